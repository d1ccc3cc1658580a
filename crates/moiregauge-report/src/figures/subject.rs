//! What goes in: that of which a figure is drawn.

use moiregauge::campaign::{Analysis, SetAnalysis, SetMean};
use moiregauge::map::TwistStrainMap;
use moiregauge::scan::Illustration;

use crate::draw::colormap::ColorMap;
use crate::map_details::MapDetails;

/// What a figure of a set is drawn from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Subject<'a> {
    pub(super) id: &'a str,
    pub(super) analysis: &'a Analysis,
    pub(super) set: &'a SetAnalysis,
    pub(super) map: ColorMap,
}

impl<'a> Subject<'a> {
    /// The scan of the set that is shown in detail, or why there is none.
    pub(super) fn illustration(&self) -> Result<&'a Illustration, &'static str> {
        let shown = self.set.illustration.as_ref();
        shown.ok_or("no scan of this set could be shown in detail")
    }

    /// The drift-corrected mean of the set, or why there is none.
    pub(super) fn mean(&self) -> Result<&'a SetMean, &'static str> {
        let mean = self.set.with_drift();
        mean.ok_or("the drift of this set is not known")
    }
}

/// What a map figure is drawn from.
pub(super) struct MapSubject<'a> {
    pub(super) id: &'a str,
    pub(super) map: &'a TwistStrainMap,
    pub(super) details: &'a MapDetails,
    pub(super) colours: ColorMap,
}
