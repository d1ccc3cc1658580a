//! `moiregauge config`, and the reading of such files.

use std::path::Path;
use std::process::ExitCode;

use heterostrain::material::Material;
use moiregauge::settings::{Settings, SettingsError};
use moiregauge_pipeline::{
    NotSettings, SettingsFileError, UnknownMaterial, read_layers, read_settings,
};

use crate::nearest::{nearest, nearest_key};
use crate::say::say;

/// Print a commented settings file with all defaults
///
/// Save it, change what you need, and give it to `moiregauge analyze --config FILE`. Options on the
/// command line override the file. A results.json can be used too: `--config results.json` takes its settings.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Example:
  moiregauge config > settings.toml
  moiregauge analyze scans/ --out results --config settings.toml")]
pub(crate) struct ConfigArgs {}

/// Every setting with its default. A test compares it with [`Settings::default`].
const COMMENTED: &str = r#"# Settings of `moiregauge analyze`. Every line shows its default.

# Channel that shows the moiré, by name. Without it: TR Phase, TR Amplitude, Phase, … whichever
# comes first.
# channel = "TR Phase"

# Number of the image, if a file holds several images of the channel (pages, frames), from 1. Without it: the first.
# image = 2

# Line directions to use: "trace", "retrace" or "both".
line = "both"

# Estimator of the lattice vectors:
#   "lattice"          harmonics fitted to the pixels, then one joint fit to all scans, phases included
#   "autocorrelation"  divided by the overlap, sub-pixel peaks, several shells
#   "fourier"          peaks of the Fourier transform with a Hann window, sub-pixel, exact inverse
#   "paper"            as published in arXiv 2406.08681, for comparison only: it is biased
method = "lattice"

# What is subtracted from an image first: "mean", "plane", "quadratic", "cubic", or "line-mean"
# (which damages harmonics whose crests run along the fast axis).
background = "plane"

# Choices made by hand: about two vectors of the lattice (x and y each, nm), or about its mean wavelength, and the parts
# of each frame to use (corners of polygons, nm from the lower left corner).
#   [by_hand]
#   lattice_nm = [[12.1, 0.4], [6.2, 10.5]]
#   near_nm = 12.0
#   regions_nm = [[[0.0, 0.0], [250.0, 0.0], [250.0, 400.0]]]

# The layers: a name (graphene, hBN, MoS2, …; `moiregauge moire --list` has them all) or a table
#   [material]
#   name = "mine"
#   lattice_constant_nm = 0.2461
#   lattice_constant_b_nm = 0.2461   # these two only for lattices that are not hexagonal
#   cell_angle_deg = 60.0
#   poisson_ratio = 0.17
#   lattice_constant_sigma_nm = 0.0001
#   poisson_ratio_sigma = 0.03
#   source = "where the numbers come from"
# Without it graphene is assumed, and the results say so.
# material = "graphene"

# How many moirés every image shows (a twisted trilayer, twisted graphene on aligned hBN); each is fitted
# after the others are subtracted and has its own results.
moires = 1

# The lower layer, if it differs: a name or a table [substrate]; `material` is then the upper layer.
# substrate = "hBN"

# The layers of each moiré, the largest cell first, if not all moirés have the same layers: one such table for
# each of them, instead of `material` and `substrate`.
#   [[moire_layers]]
#   material = "graphene"
#   [[moire_layers]]
#   material = "graphene"
#   substrate = "hBN"
#   ruler = "off"   # of this moiré, if it differs from that below

# The orientation of one of the layers in the frame of the scans, if it is known: of layer 1 (the lower
# one, the reference) or 2, of its atomic vector ("atomic": a row of atoms, a zigzag edge) or of its
# reciprocal vector ("reciprocal": an armchair edge). It separates isotropic strain from twist.
# lattice_angle = { angle_deg = 12.0, sigma_deg = 0.2, layer = 1, of = "atomic" }

# Of two equal layers one orientation leaves the sense of the twist open. The orientation of the other layer
# decides, or this entry: "positive" (layer 2 is turned counter-clockwise against layer 1) or "negative".
# lattice_angle_2 = { angle_deg = 13.1, sigma_deg = 0.2, layer = 2, of = "atomic" }
# twist_sense = "positive"

# Which grain to use of scans that show several, as their sets are named (grain 1, grain 2). Without this entry each is a
# set of its own.
# grain = 2

# Two wave vectors of the moiré, x and y in rad/nm, that belong to the reciprocal vectors of the atoms at 0° and 120°.
# A strained lattice has several such pairs; without this the image, an orientation or the least strain chooses.
# moire_waves = [[0.24, 0.01], [-0.11, 0.21]]

# Form of the strain equation: "real-space" (the stretch acts on atomic positions, positive is
# tension) or "k-space" (on reciprocal vectors as in arXiv 2406.08681, positive is compression).
strain_convention = "real-space"

# How files become sets: "auto" (slow axis, line rate, size, channel), "folder" (the same, and folders
# never mix) or "file" (every file by itself).
grouping = "auto"

# Standard uncertainty of the time of a frame, s: headers hold whole seconds (0.29 s) and are written
# some time after the end of the frame.
frame_time_sigma_s = 0.6

# Scans that are shown but not used: names of files, * stands for any characters.
exclude = []

# Leave out scans that do not fit the others: worst first, while the leave-one-out χ² of a scan has
# p < 0.001 divided by the number of scans; never more than a fifth of them.
exclude_outliers = false

# Use only the region that all scans of an analysis have in common.
overlap = false

# A known drift, to be used instead of measuring it.
# [drift]
# x_nm_per_min = 0.5
# y_nm_per_min = -0.15
# sigma_nm_per_min = 0.05

# Standard uncertainty of each component of the drift, nm/min, where the scans do not tell it: what an instrument at rest drifts.
drift_prior_nm_per_min = 1.0

# Standard uncertainties that the scans do not show, for the uncertainty budget. Calibration of the
# position sensors (or of the scanner, without sensors): gain common to x and y, difference of the two,
# deviation from a right angle; and by how much sensors, or a scanner without them, bend against a straight line,
# per cent of their range in the frame. Values from your own calibration are better.
calibration.gain_percent = 1.0
calibration.mismatch_percent = 0.5
calibration.orthogonality_mrad = 5.0
calibration.sensor_bend_percent = 0.1
calibration.scanner_bend_percent = 1.0

# A calibration of the scanner, written by `moiregauge calibrate`: path of the file, relative to this one.
# It corrects positions, and its errors replace those above.
# scanner = "scanner.toml"

# Isotropic heterostrain that the layers may have besides the uniaxial one, per cent. The moiré does not
# show it; up to 0.06 % changes the twist by less than 0.001°.
isotropic_strain_percent = 0.05

# Layer whose atoms the frames show beside the moiré and which measures them in place of the scanner: "1", "2", "auto" or
# "off"; the strain that it may have itself, along x and along y, per cent; and, where the atoms of other frames calibrate
# the scanner (--ruler-from), by how much its gains may differ from those at that magnification, per cent.
ruler = "auto"
ruler_strain_percent = 0.1
ruler_magnification_percent = 0.5

# Monte Carlo draws for the drift (per set) and for twist and strain (per scan).
drift_draws = 10000
strain_draws = 1000

# Seed of all random numbers: the same seed gives the same bytes.
seed = 1
"#;

/// Prints the commented file.
pub(crate) fn run(_args: &ConfigArgs) -> anyhow::Result<ExitCode> {
    say(COMMENTED)?;
    Ok(ExitCode::SUCCESS)
}

/// Reads a settings file, in which `material` may be a name, or the settings that results hold.
pub(crate) fn read(path: &Path) -> anyhow::Result<Settings> {
    read_settings(path).map_err(in_words)
}

/// The error with what may have been meant.
fn in_words(error: SettingsFileError) -> anyhow::Error {
    let SettingsFileError::Content { what, file, source } = error else {
        return error.into();
    };
    let meant = nearest_key(&source.to_string());
    let source = match *source {
        NotSettings::Material(unknown) => known_materials(&unknown),
        other => other.into(),
    };
    source.context(format!("in {what} {file}{meant}"))
}

/// What is known in place of a material that is not.
fn known_materials(unknown: &UnknownMaterial) -> anyhow::Error {
    let UnknownMaterial { name, known } = unknown;
    let nearest = nearest(name, known.iter().map(String::as_str));
    anyhow::anyhow!(
        "unknown material {name:?}{nearest}; known are {}. Describe others in a file (--materials) or in a [material] \
         table of a settings file",
        known.join(", ")
    )
}

/// `graphene`, or `graphene/hBN` for graphene on hBN: the layers (upper, lower where it is another one).
pub(crate) fn named_layers(
    text: &str,
    own: &[Material],
) -> anyhow::Result<(Material, Option<Material>)> {
    moiregauge_pipeline::named_layers(text, own).map_err(|unknown| known_materials(&unknown))
}

/// The layers that the user describes in a file: `[[layer]]` tables.
pub(crate) fn own_materials(path: Option<&Path>) -> anyhow::Result<Vec<Material>> {
    path.map_or(Ok(Vec::new()), |path| read_layers(path).map_err(in_words))
}

/// Refuses numbers with which nothing sensible can come out, with the option by which they are given.
pub(crate) fn check(settings: &Settings) -> anyhow::Result<()> {
    settings.check().map_err(with_option)
}

/// Options by the names of settings; the first that the name begins with.
const OPTIONS: [(&str, &str); 29] = [
    ("material.lattice_constant_nm", "--lattice-constant"),
    (
        "material.lattice_constant_sigma_nm",
        "--lattice-constant-sigma",
    ),
    ("material.poisson_ratio_sigma", "--poisson-ratio-sigma"),
    ("material.poisson_ratio", "--poisson-ratio"),
    ("moires", "--moires, --method lattice"),
    (
        "moire_layers",
        "--moires, --layers, --lattice-angle, --atomic",
    ),
    ("frame_time_sigma_s", "--frame-time-sigma"),
    ("calibration.gain_percent", "--calibration-gain"),
    ("calibration.mismatch_percent", "--calibration-mismatch"),
    (
        "calibration.orthogonality_mrad",
        "--calibration-orthogonality",
    ),
    ("calibration.sensor_bend_percent", "--sensor-bend"),
    ("calibration.scanner_bend_percent", "--scanner-bend"),
    ("isotropic_strain_percent", "--isotropic-strain"),
    ("ruler_strain_percent", "--ruler-strain"),
    ("ruler_magnification_percent", "--ruler-magnification"),
    ("scanner", "--calibration"),
    ("drift_draws", "--drift-draws"),
    ("drift.sigma_nm_per_min", "--drift-sigma"),
    ("drift_prior_nm_per_min", "--drift-prior"),
    ("drift", "--drift"),
    ("lattice_angle_2", "--lattice-angle-2"),
    ("lattice_angle.layer", "--lattice-angle-layer"),
    ("lattice_angle", "--lattice-angle"),
    ("strain_draws", "--strain-draws"),
    ("size_nm", "--size"),
    ("line_rate_hz", "--line-rate"),
    ("rotation_deg", "--rotation"),
    ("crop", "--crop"),
    ("x_sensor", "--x-sensor and --y-sensor"),
];

/// The error with the options that it is about.
pub(crate) fn with_option(error: SettingsError) -> anyhow::Error {
    let found = OPTIONS
        .iter()
        .find(|(setting, _)| error.setting.starts_with(setting));
    match found {
        Some((_, option)) => anyhow::anyhow!("{error} ({option})"),
        None => error.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_commented_file_holds_the_defaults() {
        assert_eq!(
            moiregauge_pipeline::parse_settings(COMMENTED, Path::new("")).unwrap(),
            Settings::default()
        );
    }
}
