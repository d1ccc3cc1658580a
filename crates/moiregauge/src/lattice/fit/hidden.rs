//! Whether a lattice is the second shell of another, whose first waves noise nearly hides.
//!
//! The waves K₁ and K₂ of a second shell say where the first shell is: (K₁ + K₂)/3, (2K₂ − K₁)/3 and (K₂ − 2K₁)/3. Nothing is searched
//! there, so that far less power than a wave needs that stands out of a whole transform says that it is there. Under noise alone
//! the power of each over that of the noise is exponentially distributed; the images of a set say it together. The strongest of the
//! three does not count: it may be that of stripes.

use std::f64::consts::PI;

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use crate::lattice::fit::model::Model;
use crate::lattice::fit::noise::{ALONG, BESIDE, ResidualNoise};
use crate::numbers::chi2;
use crate::numbers::exact;
use crate::numbers::median::median;

/// The waves of the first shell in thirds of the pair of the second.
pub(crate) const FIRST: [[f64; 2]; 3] = [[1.0, 1.0], [-1.0, 2.0], [-2.0, 1.0]];

/// By which the noise around the waves may be underestimated, as a power: some seventy bins tell it to an eighth, and slow noise is
/// steep.
const NOISE_KNOWN_TO: f64 = 1.3;

/// Waves with fewer cycles per frame are background.
const SLOW: f64 = 2.5;

/// Power where the first shell would be, if a lattice is the second shell of another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Hidden {
    /// Power over noise, in sum.
    #[serde(with = "exact")]
    power: f64,
    /// Of so many waves.
    waves: u32,
}

impl Hidden {
    /// `power`: power over noise at a place, in multiples of the pair; `None` where it cannot be told.
    pub(crate) fn new(power: impl Fn(Vector2<f64>) -> Option<f64>) -> Self {
        let seen = FIRST.map(|[h, k]| power(Vector2::new(h, k) / 3.0));
        let strongest = seen.iter().flatten().copied().fold(0.0, f64::max);
        let seen = seen.iter().flatten();
        Self {
            waves: (seen.clone().count() as u32).saturating_sub(1),
            power: seen.sum::<f64>() - strongest,
        }
    }

    /// What several images say together.
    pub(crate) fn of_all(all: impl Iterator<Item = Self>) -> Self {
        all.fold(Self::default(), |a, b| Self {
            power: a.power + b.power,
            waves: a.waves + b.waves,
        })
    }

    /// The probability that noise alone has so much power there, at most.
    pub(crate) fn chance(&self) -> f64 {
        chi2::tail(2.0 * self.power / NOISE_KNOWN_TO, 2 * self.waves as usize)
    }
}

impl ResidualNoise {
    /// Power where the first shell would be, if the lattice is the second shell of another.
    pub(crate) fn hidden(&self, model: &Model) -> Hidden {
        let cycles = model.pair / PI;
        Hidden::new(|index| {
            let k = cycles * index;
            let centre = k.map(|c| c.round() as i64);
            let slow = k.norm() < SLOW || (self.free_lines && centre.x.abs() < BESIDE);
            (!slow).then(|| {
                let [near, around] = self.near_and_around(centre);
                let noise = around.max(self.level_near(k));
                near / noise
            })
        })
    }

    /// Power at a bin (cycles per frame), and that of the noise around it.
    fn near_and_around(&self, centre: Vector2<i64>) -> [f64; 2] {
        let mut around = Vec::new();
        for (dx, dy) in (-ALONG..=ALONG).flat_map(|x| (-ALONG..=ALONG).map(move |y| (x, y))) {
            if dx.abs().max(dy.abs()) > 1 {
                around.push(self.power(centre.x + dx, centre.y + dy));
            }
        }
        let noise = median(&mut around) / std::f64::consts::LN_2;
        [self.power(centre.x, centre.y), noise]
    }
}

/// The pair of the first shell, from that of the second.
pub(crate) fn first_shell(second: &Matrix2<f64>) -> Matrix2<f64> {
    let [a, b, _] = FIRST.map(|[h, k]| second * Vector2::new(h, k) / 3.0);
    Matrix2::from_columns(&[a, b])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The second shell of a hexagon leads back to it, and noise is no first shell.
    #[test]
    fn the_first_shell_is_that_of_the_hexagon() {
        let hexagon = Matrix2::new(0.4, 0.2, 0.0, 0.35);
        let second = hexagon * Matrix2::new(1.0, -1.0, 1.0, 2.0);
        let names = hexagon.try_inverse().unwrap() * first_shell(&second);
        assert!((names - names.map(f64::round)).amax() < 1e-12, "{names}");
        assert!((names.determinant().abs() - 1.0).abs() < 1e-12);
        let noise = Hidden::new(|_| Some(1.0));
        assert!(noise.chance() > 0.1);
        let images = |n: usize, power: f64| {
            Hidden::of_all((0..n).map(|_| Hidden::new(|_| Some(power)))).chance()
        };
        // e⁻ˢ(1 + s) with s = 8/1.3.
        let s: f64 = 8.0 / 1.3;
        let wanted = (-s).exp() * (1.0 + s);
        assert!((images(1, 4.0) / wanted - 1.0).abs() < 1e-6);
        assert!(images(8, 4.0) < 1e-7 && images(8, 1.0) > 0.1);
        assert_eq!(Hidden::default().chance(), 1.0);
        assert_eq!(Hidden::new(|_| None).chance(), 1.0);
        let stripes = Hidden::new(|q| Some(if q.x > 0.0 { 1e6 } else { 1.0 }));
        assert_eq!(stripes, noise);
    }
}
