//! Moiré vectors → twist angle and heterostrain.

mod twist_strain;

pub use twist_strain::TwistStrain;
