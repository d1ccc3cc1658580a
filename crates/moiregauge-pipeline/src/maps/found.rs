//! A map as it was made.

use moiregauge::caveat::Caveat;
use moiregauge::map::{Agreement, DriftChange, RegistryMap, TwistStrainMap};
use moiregauge::scan::Picture;
use moiregauge::settings::Settings;
use moiregauge::survey::{MappedPattern, ScanStripes};
use moiregauge_report::Provenance;
use moiregauge_report::results::{MappedImage, TwistStrainResult};

use super::domains::Domains;

/// A map and what came with it.
#[derive(Clone, Debug)]
pub struct MapFound {
    /// What the scans show.
    pub shown: Shown,
    /// The settings, with the layers and channel that were chosen.
    pub settings: Settings,
    /// The files, those that failed among them; a front end adds its record of the run.
    pub provenance: Provenance,
    /// The images behind the map.
    pub images: Vec<MappedImage>,
    /// Doubts.
    pub caveats: Vec<Caveat>,
    /// Why the analysis of the same scans is refused: then the map has no twist and strain either.
    pub refused: Option<Caveat>,
}

/// What scans show.
#[derive(Clone, Debug)]
pub enum Shown {
    /// A lattice: twist and strain from place to place.
    Lattice(Box<LatticeShown>),
    /// Stripes: one wave vector in each pattern, which does not tell twist and strain.
    Stripes(Box<ScanStripes>),
}

/// The map of a lattice.
#[derive(Clone, Debug)]
pub struct LatticeShown {
    /// The map.
    pub map: TwistStrainMap,
    /// Twist and strain of the whole images.
    pub whole: Option<TwistStrainResult>,
    /// The first image, to be shown.
    pub picture: Option<Picture>,
    /// The pattern of that image: undistorted, and its averaged cell; nothing where phases are not followed.
    pub pattern: Option<MappedPattern>,
    /// The registry of the layers; nothing where phases are not followed.
    pub registry: Option<RegistryMap>,
    /// How well maps of several images agree.
    pub agreement: Option<Agreement>,
    /// How the drift changes between upward and downward frames.
    pub drift_change: Option<DriftChange>,
    /// Nodes and triangles, and which regime applies.
    pub domains: Domains,
}

impl MapFound {
    /// The map; of stripes twist and strain are NaN in it.
    pub fn map(&self) -> &TwistStrainMap {
        match &self.shown {
            Shown::Lattice(found) => &found.map,
            Shown::Stripes(found) => &found.stripes.map,
        }
    }
}
