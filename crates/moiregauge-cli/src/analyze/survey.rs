//! The image of a larger area, in which the frames of the scans are marked.

use std::path::Path;

use anyhow::Context as _;
use moiregauge::campaign::picture;
use moiregauge::scan::Picture;
use moiregauge_report::InputFile;

use super::task::Task;
use crate::reading::read;

/// The image of a larger area, read before the work.
pub(super) fn survey_image(task: &Task) -> anyhow::Result<Option<(Picture, InputFile)>> {
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
