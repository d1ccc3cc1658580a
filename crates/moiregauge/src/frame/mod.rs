//! One frame: its pixels, where each of them was and when, and images resampled to be shown.

pub(crate) mod artefacts;
pub(crate) mod axis;
pub(crate) mod background;
pub(crate) mod blur;
pub(crate) mod bowed;
pub(crate) mod clip;
pub(crate) mod column_sums;
pub(crate) mod departure;
pub(crate) mod fit_plane;
pub(crate) mod geometry;
pub(crate) mod glitches;
pub(crate) mod grid_errors;
pub(crate) mod hysteresis;
pub(crate) mod image;
pub(crate) mod lag;
pub(crate) mod line_steps;
pub(crate) mod loops;
pub(crate) mod median_ground;
pub(crate) mod plane;
pub(crate) mod polygon;
pub(crate) mod resample;
pub(crate) mod sensors;
pub(crate) mod smaller;

pub use axis::Axis;
pub use background::{Background, remove_background};
pub use departure::Departure;
pub use geometry::{Geometry, Timing};
pub use grid_errors::{Bends, GridErrors};
pub use image::Image;
pub use lag::Lag;
pub use plane::PlaneFit;
pub use resample::{Resampled, resample};
pub use sensors::{SensorGeometry, from_sensors};
