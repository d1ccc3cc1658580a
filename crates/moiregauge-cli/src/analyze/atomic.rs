//! The orientation of a layer, measured in images of its atoms.

use std::path::PathBuf;

use anyhow::{Context as _, ensure};
use moiregauge::campaign::{AtomicOrientation, atomic_orientation};
use moiregauge::settings::Settings;
use moiregauge::spectrum::Method;
use moiregauge_report::InputFile;
use moiregauge_report::results::AtomicImages;

use super::measure::{given_again, measure_file};
use super::task::Task;

/// The orientation measured in the atomic images, and these; `None` without any.
pub(super) fn orientation(
    task: &Task,
) -> anyhow::Result<Option<(AtomicOrientation, Vec<InputFile>)>> {
    let Some(AtomicImages {
        files,
        channel,
        layer,
    }) = &task.run.atomic
    else {
        return Ok(None);
    };
    let paths: Vec<PathBuf> = files.iter().map(PathBuf::from).collect();
    let settings = &task.run.settings;
    let settings = Settings {
        channel: channel.clone().or_else(|| settings.channel.clone()),
        method: match settings.method {
            Method::Paper => Method::Lattice,
            other => other,
        },
        moires: 1,
        ..settings.clone()
    };
    let (paths, repeated) = moiregauge_pipeline::distinct(&paths);
    let known = task.known_of(&paths);
    let (mut scans, mut files) = (Vec::new(), Vec::new());
    for path in &paths {
        let (mut moires, file) = measure_file(path, &[], (&settings, &known), None)
            .with_context(|| format!("--atomic {}", path.display()))?;
        scans.push(moires.swap_remove(0));
        files.push(file);
    }
    let layers = settings.bilayer();
    let material = match layer {
        1 => layers.reference,
        _ => layers.stretched,
    };
    let mut found =
        atomic_orientation(&scans, material, *layer, &settings.calibration).context("--atomic")?;
    found.caveats.extend(given_again(&repeated));
    ensure!(
        found.angle.sigma.is_finite(),
        "--atomic: the images do not tell the orientation"
    );
    Ok(Some((found, files)))
}
