//! Where the sample is while it drifts, by the terms of a joint fit.

use nalgebra::Vector2;

/// The way of a drifting sample: `d(t) = v t + ½ A t² − C e^{−(t − s)/τ}`, up to a constant.
///
/// Beyond the frames that it was fitted to it goes straight on: a settling or an acceleration says nothing there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriftPath {
    /// Origin of `t`, s.
    origin: f64,
    /// v, nm/s.
    velocity: Vector2<f64>,
    /// A, nm/s².
    acceleration: Vector2<f64>,
    settling: Option<Settling>,
    /// Times of the first and the last frame, s.
    frames: [f64; 2],
}

/// `−C e^{−(t − s)/τ}`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Settling {
    /// C, nm.
    pub(crate) amount: Vector2<f64>,
    /// s, s.
    pub(crate) start: f64,
    /// τ, s.
    pub(crate) time: f64,
}

impl DriftPath {
    /// A drift of constant velocity, nm/s. Times are best given near `time`, s.
    pub fn steady(velocity: Vector2<f64>, time: f64) -> Self {
        Self {
            origin: time,
            velocity,
            acceleration: Vector2::zeros(),
            settling: None,
            frames: [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// The same with what a fit has beside it, between its first and its last frame.
    pub(crate) fn with_terms(
        self,
        acceleration: Vector2<f64>,
        settling: Option<Settling>,
        frames: [f64; 2],
    ) -> Self {
        Self {
            acceleration,
            settling,
            frames,
            ..self
        }
    }

    /// How far the sample moves from one time (s) to another, nm.
    pub fn between(&self, from: f64, to: f64) -> Vector2<f64> {
        self.at(to) - self.at(from)
    }

    fn at(&self, time: f64) -> Vector2<f64> {
        let [first, last] = self.frames;
        let seen = time.max(first).min(last);
        let t = seen - self.origin;
        let mut place = (self.velocity + 0.5 * self.acceleration * t) * t;
        let mut speed = self.velocity + self.acceleration * t;
        if let Some(settling) = &self.settling {
            let left = settling.amount * (-(seen - settling.start) / settling.time).exp();
            place -= left;
            speed += left / settling.time;
        }
        place + speed * (time - seen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The way is the integral of the velocity, and straight beyond the frames.
    #[test]
    fn the_way_is_the_integral_of_the_velocity() {
        let (v, a, c) = (
            Vector2::new(0.01, -0.02),
            Vector2::new(2e-6, 5e-6),
            Vector2::new(-1.5, 0.7),
        );
        let settling = Settling {
            amount: c,
            start: 1000.0,
            time: 400.0,
        };
        let path = DriftPath::steady(v, 2000.0).with_terms(a, Some(settling), [1000.0, 3000.0]);
        let velocity = |time: f64| {
            let seen = time.clamp(1000.0, 3000.0);
            v + a * (seen - 2000.0) + c / 400.0 * (-(seen - 1000.0) / 400.0).exp()
        };
        for (from, to) in [
            (1000.0, 1600.0),
            (2900.0, 1100.0),
            (400.0, 1500.0),
            (2500.0, 9000.0),
        ] {
            let step = (to - from) / 20_000.0;
            let sum: Vector2<f64> = (0..20_000)
                .map(|i| velocity(from + (f64::from(i) + 0.5) * step) * step)
                .sum();
            let found = path.between(from, to);
            assert!((found - sum).norm() < 1e-6, "{from} {to}: {found} {sum}");
        }
        assert_eq!(
            DriftPath::steady(v, 7e10).between(7e10, 7e10 + 100.0),
            v * 100.0
        );
    }
}
