//! The image of a larger area, in which the frames of the scans are marked.

use std::path::Path;

use moiregauge::campaign::picture;
use moiregauge::scan::Picture;
use moiregauge::settings::Settings;
use moiregauge_report::InputFile;
use moiregauge_report::results::UserSpecified;

use super::error::{AnalyseError, Place};
use crate::known::Known;
use crate::opened::read_scan;
use crate::source::Places;

/// The image of a larger area, read before the work.
pub(super) fn survey_image(
    name: &str,
    settings: &Settings,
    places: &Places,
) -> Result<(Picture, InputFile), AnalyseError> {
    let path = Path::new(name);
    // What is known of the scans, as their size, is not known of it.
    let known = Known::new(&UserSpecified::default(), &[path.to_owned()]).at(places);
    let reading = read_scan(path, settings, &known).map_err(|source| AnalyseError::Beside {
        place: Place::Survey,
        file: name.to_owned(),
        source,
    })?;
    let shown = picture(name, &reading.scan, settings);
    let shown = shown.ok_or_else(|| AnalyseError::NoPicture {
        file: name.to_owned(),
    })?;
    Ok((shown, reading.input))
}
