//! A map as it was made.

use moiregauge::campaign::Analysis;
use moiregauge::caveat::Caveat;
use moiregauge::map::{Agreement, DriftChange, TwistStrainMap};
use moiregauge::scan::Picture;
use moiregauge::settings::Settings;
use moiregauge::window::UsedHarmonic;
use moiregauge_report::Provenance;
use moiregauge_report::results::{MappedImage, TwistStrainResult};
use spmfile::LineDirection;

use super::domains::Domains;

/// A map and what came with it.
pub(super) struct Made {
    pub(super) map: TwistStrainMap,
    pub(super) settings: Settings,
    pub(super) provenance: Provenance,
    pub(super) whole: Option<TwistStrainResult>,
    pub(super) images: Vec<MappedImage>,
    /// The first of them, to be shown.
    pub(super) picture: Option<Picture>,
    pub(super) agreement: Option<Agreement>,
    pub(super) drift_change: Option<DriftChange>,
    pub(super) domains: Domains,
    pub(super) caveats: Vec<Caveat>,
}

/// Twist and strain of the whole images.
pub(super) fn whole_image(analysis: &Analysis) -> Option<TwistStrainResult> {
    if let Some(combined) = &analysis.combined {
        let found = &combined.twist_strain;
        return Some(TwistStrainResult::of_mean(found, &combined.budget));
    }
    let set = analysis.sets.first()?;
    let mean = set.mean.as_ref().or(set.uncorrected.as_ref());
    let scan = set.scans.first();
    mean.map(|m| TwistStrainResult::of_mean(&m.twist_strain, &m.budget))
        .or(scan.and_then(|s| s.twist_strain_sensor.as_ref().map(Into::into)))
}

/// One image behind a map.
pub(super) fn image(
    file: &str,
    line: Option<LineDirection>,
    drift_corrected: bool,
    harmonics: &[UsedHarmonic],
) -> MappedImage {
    MappedImage {
        file: file.to_owned(),
        line: match line {
            Some(LineDirection::Retrace) => "retrace",
            Some(LineDirection::Trace) | None => "trace",
        }
        .to_owned(),
        drift_corrected,
        harmonics: harmonics.iter().map(Into::into).collect(),
    }
}
