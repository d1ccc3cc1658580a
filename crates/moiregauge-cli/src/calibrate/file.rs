//! The calibration file: TOML that says what was measured, how, and of which files.

use std::path::Path;

use anyhow::{Context as _, ensure};
use moiregauge::calibration::{Calibration, KnownLattice};
use moiregauge::series::Calibrated;
use moiregauge_report::InputFile;
use moiregauge_report::results::ResultCaveat;
use serde::{Deserialize, Serialize};

/// Name and version of the layout.
const SCHEMA: &str = "moiregauge/calibration/1";

const HEAD: &str = "\
# Calibration of a scanner, for `moiregauge analyze --calibration FILE`.
#
# What is shown is F times what is true, F = [[1 + s + g/2, c/2], [c/2, 1 + s - g/2]], x to the right, y up:
#   s  gain_percent        lengths are shown too long by this much, mean of x and y
#   g  mismatch_percent    along x by this much more than along y
#   c  orthogonality_mrad  the axes shown enclose a right angle less this
# F is symmetric by definition: a known lattice of unknown orientation does not show a turn.
# covariance is that of (s, g, c) in these units. It holds for scans under the same conditions.

";

/// What stands in the file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationFile {
    schema: String,
    version: String,
    #[serde(default)]
    drift_separated: bool,
    #[serde(default)]
    drift_sigma_nm_per_min: f64,
    calibration: Calibration,
    known_lattice: KnownLattice,
    #[serde(default)]
    sets: Vec<Set>,
    #[serde(default)]
    files: Vec<Input>,
    #[serde(default)]
    caveats: Vec<ResultCaveat>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Set {
    name: String,
    channel: String,
    used: bool,
    gain_percent: [f64; 2],
    mismatch_percent: [f64; 2],
    orthogonality_mrad: [f64; 2],
    /// Of the known cell's first vector.
    orientation_deg: [f64; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    drift_nm_per_min: Option<[[f64; 2]; 2]>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Input {
    file: String,
    sha256: String,
    bytes: u64,
}

/// The file as text.
pub(super) fn text(
    found: &Calibrated,
    lattice: &KnownLattice,
    drift_sigma: f64,
    files: &[InputFile],
) -> anyhow::Result<String> {
    let with_sigma = |e: &moiregauge::estimate::Estimate| [e.value, e.sigma];
    let sets = found.sets.iter().map(|set| Set {
        name: set.name.clone(),
        channel: set.channel.clone(),
        used: set.used,
        gain_percent: with_sigma(&set.estimates[0]),
        mismatch_percent: with_sigma(&set.estimates[1]),
        orthogonality_mrad: with_sigma(&set.estimates[2]),
        orientation_deg: with_sigma(&set.orientation.scaled(1f64.to_degrees())),
        drift_nm_per_min: set.drift.map(|d| d.map(|v| with_sigma(&v.scaled(60.0)))),
    });
    let file = CalibrationFile {
        schema: SCHEMA.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        drift_separated: found.sets.iter().any(|s| s.drift.is_some()),
        drift_sigma_nm_per_min: drift_sigma,
        calibration: found.calibration.clone(),
        known_lattice: lattice.clone(),
        sets: sets.collect(),
        files: files
            .iter()
            .map(|f| Input {
                file: f.file.clone(),
                sha256: f.sha256.clone(),
                bytes: f.bytes,
            })
            .collect(),
        caveats: found.caveats.iter().map(Into::into).collect(),
    };
    Ok(format!("{HEAD}{}", toml::to_string(&file)?))
}

/// The calibration in a file.
pub(crate) fn read(path: &Path) -> anyhow::Result<Calibration> {
    let of = || format!("in the calibration file {}", path.display());
    let text = moiregauge_pipeline::read_text(path)
        .with_context(|| format!("cannot read the calibration file {}", path.display()))?;
    let file: CalibrationFile = toml::from_str(&text).with_context(of)?;
    ensure!(
        file.schema == SCHEMA,
        "{}: expected the schema {SCHEMA:?}, found {:?}",
        of(),
        file.schema
    );
    let lattice = file.known_lattice.problem();
    if let Some(problem) = file.calibration.problem().or(lattice) {
        anyhow::bail!("{}: {problem}", of());
    }
    Ok(file.calibration)
}
