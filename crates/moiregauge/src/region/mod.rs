//! Regions of a map in numbers: boxes and polygons, line profiles, uniform areas, areas of a wanted twist.
//!
//! In: a [`TwistStrainMap`](crate::map::TwistStrainMap). Out: means with errors that know how noise of neighbouring nodes goes together,
//! spreads without what noise adds. nm, rad, strain without dimension; places are those of the map, x right, y up.

pub(crate) mod correlation;
pub(crate) mod device;
pub(crate) mod polygon;
pub(crate) mod profile;
pub(crate) mod smoothing;
pub(crate) mod statistics;
#[cfg(test)]
pub(crate) mod tests;
pub(crate) mod trend;
pub(crate) mod wanted;

pub use device::{Device, DeviceSearch, uniform_areas};
pub use polygon::Region;
pub use profile::{Profile, ProfilePoint, ProfileValues};
pub use statistics::{RegionMean, RegionStatistics};
pub use trend::{Trend, Trends};
pub use wanted::{WantedArea, WantedTwist};
