//! Whether a lattice is the second shell of another, whose first waves noise nearly hides.
//!
//! The waves K₁ and K₂ of a second shell say where the first shell is: (K₁ + K₂)/3, (2K₂ − K₁)/3 and (K₂ − 2K₁)/3. Nothing is searched
//! there, so that far less power than a wave needs that stands out of a whole transform says that it is there. Under noise alone
//! the power of each over that of the noise is exponentially distributed; the images of a set say it together. Each of the three has to be
//! there: stripes and lumps of slow ground make one or two of them, in all images of a set alike.

use std::f64::consts::PI;

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use crate::lattice::fit::leverage::ALONG;
use crate::lattice::fit::model::Model;
use crate::lattice::fit::noise::{BESIDE, ResidualNoise};
use crate::numbers::chi2;
use crate::numbers::exact;
use crate::numbers::median::median;

/// A lattice is the second shell of another if noise alone has as much power where the first would be less often than this.
const SECOND_SHELL: f64 = 1e-6;

/// The waves of the first shell in thirds of the pair of the second.
pub(crate) const FIRST: [[f64; 2]; 3] = [[1.0, 1.0], [-1.0, 2.0], [-2.0, 1.0]];

/// By which the noise around the waves may be underestimated, as a power: some seventy bins tell it to an eighth, and slow noise is
/// steep.
const NOISE_KNOWN_TO: f64 = 1.3;

/// Noise over that of short waves up to which it is an image's own.
const OWN: f64 = 2.0;

/// Waves with fewer cycles per frame are background.
const SLOW: f64 = 2.5;

/// Ground is a function of the wavelength: what it is at a wave is read at all waves as long, to within this share ...
const AS_LONG: f64 = 0.25;

/// ... and farther than this from those that the first shell would be, cycles per frame; ...
const LOBE: f64 = 1.5;

/// ... and the fewest of them.
const FEWEST: usize = 6;

/// Ratio of the power of a place to that of each other beyond which it holds a non-lattice wave: hum, or stripes. Chosen by eye: first waves of one
/// lattice differ by less than ten times.
const ELSE: f64 = 30.0;

/// Power where the first shell would be, if a lattice is the second shell of another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Hidden {
    /// Power over noise of each wave that can be told, of all images in sum, ...
    #[serde(with = "exact")]
    power: [f64; 3],
    /// ... in this number of images, ...
    images: [u32; 3],
    /// ... and what of their noise each has for itself, as a share, in sum: ground is the same in all.
    #[serde(with = "exact")]
    own: f64,
}

impl Hidden {
    /// `seen`: power and noise at a place, in multiples of the pair; `None` where they cannot be told. `own_noise`: that no other image has.
    pub(crate) fn new(seen: impl Fn(Vector2<f64>) -> Option<[f64; 2]>, own_noise: f64) -> Self {
        let seen = FIRST.map(|[h, k]| seen(Vector2::new(h, k) / 3.0));
        // One wave may be that of stripes.
        if seen.iter().flatten().count() < 2 {
            return Self::default();
        }
        let own = seen.iter().flatten();
        Self {
            power: seen.map(|seen| seen.map_or(0.0, |[power, noise]| power / noise)),
            images: seen.map(|seen| u32::from(seen.is_some())),
            own: own
                .map(|[_, noise]| OWN * own_noise / noise)
                .fold(1.0, f64::min),
        }
    }

    /// What several images say together.
    pub(crate) fn of_all(all: impl Iterator<Item = Self>) -> Self {
        all.fold(Self::default(), |a, b| Self {
            power: [0, 1, 2].map(|i| a.power[i] + b.power[i]),
            images: [0, 1, 2].map(|i| a.images[i] + b.images[i]),
            own: a.own + b.own,
        })
    }

    /// Whether what is there is the first shell of a lattice of which that of the fit is the second.
    pub(crate) fn is_first_shell(&self) -> bool {
        self.chance() < SECOND_SHELL
    }

    /// The probability that noise alone has so much power there, at most.
    pub(crate) fn chance(&self) -> f64 {
        let most = self.images.into_iter().max().unwrap_or(0);
        // What is there in some images alone is told by these.
        let told = |i: &usize| self.images[*i] > 0 && 2 * self.images[*i] >= most;
        let mean = |i: &usize| self.power[*i] / f64::from(self.images[*i]);
        let mut places: Vec<usize> = (0..3).filter(told).collect();
        places.sort_by(|a, b| mean(a).total_cmp(&mean(b)));
        if let [.., second, first] = &*places
            && mean(first) > ELSE * mean(second)
        {
            places.pop();
        }
        let [weakest, _, ..] = &*places else {
            return 1.0;
        };
        // As many images as noise of their own makes of them.
        let (mean, images) = (mean(weakest), self.images[*weakest]);
        let others = f64::from(images) - 1.0;
        let independent = (1.0 + others * self.own / f64::from(most)).floor();
        let power = mean * independent / NOISE_KNOWN_TO;
        chi2::tail(2.0 * power, 2 * independent as usize).powi(places.len() as i32)
    }
}

impl ResidualNoise {
    /// Power where the first shell would be, if the lattice is the second shell of another; `offsets`: lines have some.
    pub(crate) fn hidden(&self, model: &Model, offsets: bool) -> Hidden {
        let cycles = model.pair / PI;
        let seen = |index: Vector2<f64>| {
            let k = cycles * index;
            let centre = k.map(|c| c.round() as i64);
            // The offsets of lines hide a wave along the slow axis, and levelling them takes it off.
            let slow = offsets && centre.x.abs() < BESIDE;
            if slow || k.norm() < SLOW {
                return None;
            }
            let ground = self.as_long(k, &cycles)?;
            let [near, around] = self.near_and_around(centre);
            Some([near, around.max(self.level_near(k)).max(ground)])
        };
        Hidden::new(seen, self.level())
    }

    /// The typical power of all waves about as long as `k` (cycles per frame), but for those that the first shell would be; `None` where these are
    /// nearly all.
    fn as_long(&self, k: Vector2<f64>, cycles: &Matrix2<f64>) -> Option<f64> {
        let ends = FIRST.map(|[h, k]| cycles * Vector2::new(h, k) / 3.0);
        let reach = (k.norm() * (1.0 + AS_LONG)).ceil() as i64;
        let mut around = Vec::new();
        for (x, y) in (0..=reach).flat_map(|x| (-reach..=reach).map(move |y| (x, y))) {
            let at = Vector2::new(x as f64, y as f64);
            let is_end = |end: &Vector2<f64>| (at - end).norm() < LOBE || (at + end).norm() < LOBE;
            // Half of the plane: the other half says the same.
            if (x > 0 || y > 0)
                && (at.norm() / k.norm() - 1.0).abs() < AS_LONG
                && !ends.iter().any(is_end)
            {
                around.push(self.power(x, y));
            }
        }
        (around.len() >= FEWEST).then(|| median(&mut around) / std::f64::consts::LN_2)
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
        let image = |power: f64| Hidden::new(|_| Some([power, 1.0]), 1.0);
        let noise = image(0.3);
        assert!(noise.chance() > 0.1);
        let images = |n: usize, power: f64| Hidden::of_all((0..n).map(|_| image(power))).chance();
        // Three waves above 4 each: e⁻ˢ with s = 12/1.3.
        let s: f64 = 12.0 / 1.3;
        assert!((images(1, 4.0) / (-s).exp() - 1.0).abs() < 1e-6);
        // Two images: (e⁻ˢ (1 + s))³ with s = 8/1.3.
        let s: f64 = 8.0 / 1.3;
        let wanted = ((-s).exp() * (1.0 + s)).powi(3);
        assert!((images(2, 4.0) / wanted - 1.0).abs() < 1e-6);
        assert!(images(8, 4.0) < 1e-7 && images(8, 1.0) > 0.05);
        assert_eq!(Hidden::default().chance(), 1.0);
        assert_eq!(Hidden::new(|_| None, 1.0).chance(), 1.0);
        // A wave of something else at one place says nothing, and with a place that cannot be told there is nothing left.
        let place = |q: Vector2<f64>| Some([if q.x > 0.0 { 1e6 } else { 4.0 }, 1.0]);
        let beside = |q: Vector2<f64>| if q.x < -0.5 { None } else { place(q) };
        let all = |one: Hidden| Hidden::of_all((0..8).map(|_| one)).chance();
        assert_eq!(all(Hidden::new(beside, 1.0)), 1.0);
        assert!(all(Hidden::new(place, 1.0)) > images(8, 4.0));
        // Ground that all images have alike is told once.
        let ground = Hidden::new(|_| Some([4.0, 1.0]), 0.0);
        let all = Hidden::of_all((0..8).map(|_| ground));
        assert!((all.chance() / ground.chance() - 1.0).abs() < 1e-6);
    }
}
