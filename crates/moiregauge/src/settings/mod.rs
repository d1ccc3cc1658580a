//! Every knob of an analysis, with its default and its range.

pub(crate) mod by_hand;
pub(crate) mod check;
pub(crate) mod knobs;
pub(crate) mod ranges;

pub use by_hand::{ByHand, Mask};
pub use check::SettingsError;
pub use knobs::{Calibration, GivenDrift, Grouping, Lines, MoireLayers, RulerLayer, Settings};
pub use ranges::{MOST_DRAWS, MOST_GRAINS, MOST_IMAGES, MOST_MOIRES, OutOfRange};
