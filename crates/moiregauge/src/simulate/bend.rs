//! Displacement fields of layer 2, from which twist and strain that change from place to place follow exactly.
//!
//! u(R) in nm at the place R (nm, in the frame of the sample), zero at the middle of the frame or with zero mean, and its
//! gradient `∂u_a/∂R_b`. A lattice of waves b₂ that is displaced by u shows the phases `b₂·(R − u)`.

use nalgebra::{Matrix2, Vector2};

use crate::simulate::feature::SampleFeature;
use crate::simulate::reference::Reference;

/// A displacement field.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Bend {
    /// `u = amplitude · sin(wave·(R − middle) + phase)`.
    Wave {
        wave: Vector2<f64>,
        phase: f64,
        amplitude: Vector2<f64>,
        middle: Vector2<f64>,
    },
    /// Bent in the plane like a beam with the curvature κ as rate: `u = κ (−s t, (s² + ν t²)/2)`; the twist is κ s, the
    /// strain −κ t along e and νκ t across.
    Beam(Growth),
    /// Stretched along e more and more: `u = g ((s² + ν t²)/2, −ν s t)` with the rate g; the strain is g s along e and
    /// −νg s across, the twist −νg t.
    Pull(Growth),
}

/// What grows evenly from the middle on, with `s` along the direction e and `t` across.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Growth {
    direction: Vector2<f64>,
    /// 1/nm.
    rate: f64,
    poisson_ratio: f64,
    middle: Vector2<f64>,
}

impl Growth {
    /// `(s, t)` and ν.
    fn place(&self, at: Vector2<f64>) -> (f64, f64, f64) {
        let (s, t) = components(at - self.middle, self.direction);
        (s, t, self.poisson_ratio)
    }

    /// A displacement along and across, both over the rate.
    fn displacement(&self, along: f64, over: f64) -> Vector2<f64> {
        (self.direction * along + across(self.direction) * over) * self.rate
    }

    /// The matrix of the axes (direction, across), over the rate, in those of the laboratory.
    fn gradient(&self, own: Matrix2<f64>) -> Matrix2<f64> {
        turned(own * self.rate, self.direction)
    }
}

impl Bend {
    /// The field of a class, if it is one.
    pub(crate) fn of(
        feature: &SampleFeature,
        reference: &Reference,
        poisson_ratio: f64,
    ) -> Option<Self> {
        let angle = || feature.value("angle").to_radians();
        let direction = || Vector2::new(angle().cos(), angle().sin());
        let middle = reference.centre;
        let wave = || std::f64::consts::TAU / feature.value("wavelength");
        let growth = |change: f64| Growth {
            direction: direction(),
            rate: change / reference.side(),
            poisson_ratio,
            middle,
        };
        Some(match feature.class.as_str() {
            // The twist is half the curl: ½ u k cos, with a shear of the same size.
            "twist-wave" => Self::Wave {
                wave: direction() * wave(),
                phase: feature.value("phase").to_radians(),
                amplitude: across(direction()) * 2.0 * feature.value("amplitude").to_radians()
                    / wave(),
                middle,
            },
            "strain-wave" => Self::Wave {
                wave: direction() * wave(),
                phase: feature.value("phase").to_radians(),
                amplitude: direction() * feature.value("amplitude") / 100.0 / wave(),
                middle,
            },
            "twist-gradient" => Self::Beam(growth(feature.value("change").to_radians())),
            "strain-gradient" => Self::Pull(growth(feature.value("change") / 100.0)),
            _ => return None,
        })
    }

    /// u, nm.
    pub(crate) fn displacement(&self, at: Vector2<f64>) -> Vector2<f64> {
        match *self {
            Self::Wave {
                wave,
                phase,
                amplitude,
                middle,
            } => amplitude * (wave.dot(&(at - middle)) + phase).sin(),
            Self::Beam(growth) => {
                let (s, t, nu) = growth.place(at);
                growth.displacement(-s * t, 0.5 * (s * s + nu * t * t))
            }
            Self::Pull(growth) => {
                let (s, t, nu) = growth.place(at);
                growth.displacement(0.5 * (s * s + nu * t * t), -nu * s * t)
            }
        }
    }

    /// `∂u_a/∂R_b`.
    pub(crate) fn gradient(&self, at: Vector2<f64>) -> Matrix2<f64> {
        match *self {
            Self::Wave {
                wave,
                phase,
                amplitude,
                middle,
            } => amplitude * wave.transpose() * (wave.dot(&(at - middle)) + phase).cos(),
            Self::Beam(growth) => {
                let (s, t, nu) = growth.place(at);
                growth.gradient(Matrix2::new(-t, -s, s, nu * t))
            }
            Self::Pull(growth) => {
                let (s, t, nu) = growth.place(at);
                growth.gradient(Matrix2::new(s, nu * t, -nu * t, -nu * s))
            }
        }
    }
}

fn across(direction: Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-direction.y, direction.x)
}

fn components(at: Vector2<f64>, direction: Vector2<f64>) -> (f64, f64) {
    (at.dot(&direction), at.dot(&across(direction)))
}

/// A matrix of the axes (direction, across) in those of the laboratory.
fn turned(own: Matrix2<f64>, direction: Vector2<f64>) -> Matrix2<f64> {
    let axes = Matrix2::from_columns(&[direction, across(direction)]);
    axes * own * axes.transpose()
}
