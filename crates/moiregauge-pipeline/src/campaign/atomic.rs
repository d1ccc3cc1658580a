//! The orientation of a layer, measured in images of its atoms.

use std::path::PathBuf;

use moiregauge::campaign::{AtomicOrientation, atomic_orientation};
use moiregauge::settings::Settings;
use moiregauge::spectrum::Method;
use moiregauge_report::InputFile;
use moiregauge_report::results::AtomicImages;

use super::error::{AnalyseError, Place};
use super::measure::{given_again, measure_file};
use crate::job::Job;
use crate::known::Known;
use crate::names::in_words;
use crate::source::Places;
use crate::twice::distinct;

/// The orientation measured in the atomic images, and these.
pub(super) fn orientation(
    images: &AtomicImages,
    settings: &Settings,
    told: &Known,
    places: &Places,
    job: &Job,
) -> Result<(AtomicOrientation, Vec<InputFile>), AnalyseError> {
    let paths: Vec<PathBuf> = images.files.iter().map(PathBuf::from).collect();
    let settings = Settings {
        channel: images.channel.clone().or_else(|| settings.channel.clone()),
        method: match settings.method {
            Method::Paper => Method::Lattice,
            other => other,
        },
        moires: 1,
        ..settings.clone()
    };
    let (paths, repeated) = distinct(&paths);
    let known = Known::new(told.user_specified(), &paths).at(places);
    let stage = job.stage("measuring", "images of atoms", paths.len());
    let (mut scans, mut files) = (Vec::new(), Vec::new());
    for path in &paths {
        let measured = job.run(|| measure_file(path, &settings, &known))?;
        let (mut moires, file) = measured.map_err(|source| AnalyseError::Beside {
            place: Place::Atomic,
            file: in_words(path),
            source,
        })?;
        scans.push(moires.swap_remove(0));
        files.push(file);
        stage.step();
    }
    let layers = settings.bilayer();
    let material = match images.layer {
        1 => layers.reference,
        _ => layers.stretched,
    };
    let mut found = atomic_orientation(&scans, material, images.layer, &settings.calibration)?;
    found.caveats.extend(given_again(&repeated));
    if !found.angle.sigma.is_finite() {
        return Err(AnalyseError::NoOrientation);
    }
    Ok((found, files))
}
