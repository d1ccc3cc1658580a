//! What is read beside the scans, before them: an image of a larger area, and images of the atoms of a layer.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use moiregauge::analysis::Picture;
use moiregauge::series::{AtomicOrientation, atomic_orientation, picture};
use moiregauge::settings::{Method, Settings};
use moiregauge_report::InputFile;
use moiregauge_report::results::AtomicImages;

use super::chain::Outcome;
use super::measure::{given_again, measure_file};
use super::task::Task;
use crate::reading::read;

/// What the files beside the scans tell.
pub(super) struct Beside {
    survey: Option<(Picture, InputFile)>,
    atomic: Option<(AtomicOrientation, Vec<InputFile>)>,
}

impl Beside {
    /// Reads them.
    pub(super) fn read(task: &Task) -> anyhow::Result<Self> {
        Ok(Self {
            survey: survey_image(task)?,
            atomic: atomic(task)?,
        })
    }

    /// The settings with what they tell.
    pub(super) fn settings(&self, mut settings: Settings) -> anyhow::Result<Settings> {
        if let Some((found, _)) = &self.atomic {
            settings.lattice_angle = Some(found.known());
            crate::config::check(&settings)?;
        }
        Ok(settings)
    }

    /// Puts them into the outcome.
    pub(super) fn join(&self, outcome: &mut Outcome) {
        let Outcome {
            analysis,
            provenance,
        } = outcome;
        if let Some((found, files)) = &self.atomic {
            analysis.caveats.extend(found.caveats.iter().cloned());
            analysis.atomic = Some(found.clone());
            provenance.inputs.extend(files.iter().cloned());
        }
        if let Some((picture, file)) = &self.survey {
            analysis.survey = Some(picture.clone());
            provenance.inputs.push(file.clone());
        }
    }
}

/// The image of a larger area, read before the work.
fn survey_image(task: &Task) -> anyhow::Result<Option<(Picture, InputFile)>> {
    let Some(name) = &task.run.survey_image else {
        return Ok(None);
    };
    let (path, settings) = (Path::new(name), &task.run.settings);
    // What is known of the scans, as their size, is not known of it.
    let reading = read(path, settings, &task.nothing_known(path))
        .with_context(|| format!("--survey-image {name}"))?;
    let shown = picture(name, &reading.scan, settings).with_context(|| {
        format!("--survey-image {name}: it has no image with a size and a place")
    })?;
    Ok(Some((shown, reading.input)))
}

/// The orientation measured in the atomic images, and these; `None` without any.
fn atomic(task: &Task) -> anyhow::Result<Option<(AtomicOrientation, Vec<InputFile>)>> {
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
