//! What was asked of a map beside the map itself.

use moiregauge::domains::{DomainMap, Regime};
use moiregauge::map::RegistryMap;
use moiregauge::region::{Device, Profile, RegionStatistics, WantedArea, WantedTwist};
use moiregauge::scan::Picture;
use moiregauge::survey::MappedPattern;

/// Answers to what was asked of a map.
#[derive(Clone, Debug, Default)]
pub struct MapDetails {
    /// The grains, in the order of their numbers; none in the map of one lattice.
    pub grains: Vec<RegionStatistics>,
    /// Boxes and polygons.
    pub regions: Vec<RegionStatistics>,
    /// Lines.
    pub profiles: Vec<Profile>,
    /// The most uniform areas of the wanted size, best first.
    pub devices: Vec<Device>,
    /// The twist that is wanted, and how much of the map has it.
    pub wanted: Option<(WantedTwist, Option<WantedArea>)>,
    /// Nodes and triangles.
    pub domains: Option<DomainMap>,
    /// Whether phases or domains are to be used.
    pub regime: Option<Regime>,
    /// The first image behind the map, to be shown.
    pub picture: Option<Picture>,
    /// The pattern of that image: undistorted, and its averaged cell.
    pub pattern: Option<MappedPattern>,
    /// The registry of the layers on the nodes.
    pub registry: Option<RegistryMap>,
}
