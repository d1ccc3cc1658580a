//! One frame: its pixels, where each of them was and when, and images resampled to be shown.

pub(crate) mod axis;
pub(crate) mod background;
pub(crate) mod clip;
pub(crate) mod geometry;
pub(crate) mod glitches;
pub(crate) mod image;
pub(crate) mod lag;
pub(crate) mod loops;
pub(crate) mod plane;
pub(crate) mod polygon;
pub(crate) mod resample;
pub(crate) mod sensors;

pub use axis::Axis;
pub use background::{Background, remove_background};
pub use geometry::at_rest;
pub use geometry::{Geometry, Timing};
pub use image::Image;
pub use lag::Lag;
pub use plane::{PlaneFit, fit_plane};
pub use resample::{Resampled, resample};
pub use sensors::{SensorGeometry, from_sensors};
