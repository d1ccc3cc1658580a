//! The motion of the sample: `d(t) = D t + ½ A t²`.

use nalgebra::Vector2;

use crate::simulate::settings::Drift;

/// The motion of the sample in nm and s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    pub(crate) velocity: Vector2<f64>,
    pub(crate) acceleration: Vector2<f64>,
}

impl Motion {
    pub(crate) fn new(drift: &Drift) -> Self {
        Self {
            velocity: Vector2::from(drift.velocity_nm_per_min) / 60.0,
            acceleration: Vector2::from(drift.acceleration_nm_per_min2) / 3600.0,
        }
    }

    /// Where the sample has moved to, nm.
    pub(crate) fn at(&self, time: f64) -> Vector2<f64> {
        (self.velocity + self.acceleration * (time / 2.0)) * time
    }
}
