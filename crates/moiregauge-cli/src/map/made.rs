//! A map as it was made.

use moiregauge::caveat::Caveat;
use moiregauge::map::{Agreement, DriftChange, TwistStrainMap};
use moiregauge::scan::Picture;
use moiregauge::settings::Settings;
use moiregauge_report::Provenance;
use moiregauge_report::results::{MappedImage, TwistStrainResult};

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
