//! Uneven ground below a lattice: bumps and slopes that no polynomial follows.
//!
//! What a fit leaves is averaged under a Gaussian so wide that hardly anything of the lattice's waves is left under it, what that leaves is
//! averaged again, and the sum is the ground. It is taken off the image, of which all is left that the lattice's waves are made of. Noise as
//! slow as the ground goes with it, so what is read off the spectrum of the rest is divided by the share that is left.

use crate::frame::image::Image;
use crate::lattice::fit::fit_pixels::Fit;
use crate::lattice::fit::levelled::Levelled;

/// Power of the ground over that of white noise under the same averages, from which on it is worth its while. Chosen by eye.
const WORTH: f64 = 10.0;
/// Share of the power of the ground that three quarters of the pixels have at most, if it is bumps: of one with a standard deviation of a sixth of the frame
/// they have a twentieth, of rough ground, which all frames of a set show alike, a quarter.
const ELSEWHERE: f64 = 0.15;
/// Ground that was taken off an image.
pub(crate) struct Ground {
    pub(crate) levelled: Levelled,
    image: Image,
}

impl Ground {
    /// An image without it.
    pub(crate) fn off(&self, image: &Image) -> Image {
        self.combined(image, |value, ground| value - ground)
    }

    /// An image of which it was taken off, with it.
    pub(crate) fn put_back(&self, image: &Image) -> Image {
        self.combined(image, |value, ground| value + ground)
    }

    /// Whether hardly any of its power is in most of the pixels: bumps, and not rough ground.
    pub(crate) fn is_in_places(&self) -> bool {
        let mut powers: Vec<f64> = self
            .image
            .values
            .iter()
            .map(|value| value * value)
            .collect();
        powers.sort_unstable_by(f64::total_cmp);
        let all: f64 = powers.iter().sum();
        let most = &powers[..powers.len() * 3 / 4];
        most.iter().sum::<f64>() < ELSEWHERE * all
    }

    fn combined(&self, image: &Image, each: impl Fn(f64, f64) -> f64) -> Image {
        let both = image.values.iter().zip(&self.image.values);
        let values = both.map(|(value, ground)| each(*value, *ground));
        Image::new(image.rows, image.columns, values.collect())
    }
}

impl Fit<'_> {
    /// The ground below the lattice, by the pixels that are there in `image`, of which the fit's has more; `None` where there is hardly more than noise.
    /// `before`: what was taken off the fit's image, but is there in `image`.
    pub(crate) fn ground(
        &self,
        levelled: Levelled,
        image: &Image,
        before: Option<&Ground>,
    ) -> Option<Ground> {
        let mut left = self.left_of(image);
        let white = levelled.of_white_noise() * mean_square(&left.values);
        if let Some(before) = before {
            left = before.put_back(&left);
        }
        let image = levelled.ground(&left);
        let power = mean_square(&image.values);
        (power > WORTH * white).then_some(Ground { levelled, image })
    }
}

impl Fit<'_> {
    /// What is left of the pixels that count and are there in `image`, of which the fit's has more.
    fn left_of(&self, image: &Image) -> Image {
        let mut left = Image::new(image.rows, image.columns, self.left());
        for (pixel, (left, value)) in left.values.iter_mut().zip(&image.values).enumerate() {
            if !value.is_finite() || self.frame.present[pixel / image.columns] == 0 {
                *left = f64::NAN;
            }
        }
        left
    }

    /// What contrast that changes from place to place leaves, where ground was taken off: no noise, and of no weight for the wave vectors, to which it is in
    /// quadrature.
    pub(crate) fn uneven_contrast(&self) -> Option<Vec<f64>> {
        let levelled = self.frame.levelled?;
        let image = self.frame.image;
        let nothing = Image::new(image.rows, image.columns, vec![0.0; image.values.len()]);
        let mut lattice = self.in_image(&nothing);
        lattice.model.background.fill(0.0);
        let negative = lattice.left_of(image);
        Some(levelled.contrast(&self.left_of(image), &negative))
    }
}

/// Mean square of the numbers that are there.
fn mean_square(values: &[f64]) -> f64 {
    let there = || values.iter().filter(|value| value.is_finite());
    there().map(|value| value * value).sum::<f64>() / there().count().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::background::Background;
    use crate::lattice::fit::levelled::tests::white;
    use crate::lattice::fit::measure::{Found, measure};
    use crate::numbers::rng::normals;
    use crate::spectrum::harmonics::Windowed;
    use crate::spectrum::shells::shells;
    use nalgebra::{Matrix2, Vector2};

    const SIZE: usize = 128;
    const NOISE: f64 = 0.3;
    /// Images of a kind.
    const SEEDS: u64 = 12;

    fn pair() -> Matrix2<f64> {
        Matrix2::new(0.45, -0.02, 0.21, 0.52)
    }

    /// Three waves of amplitude 1, with ground below them, a contrast of their own and white noise.
    fn image(
        seed: u64,
        ground: impl Fn(Vector2<f64>) -> f64,
        contrast: impl Fn(Vector2<f64>) -> f64,
    ) -> Image {
        let mut normal = normals(seed, "uneven", 0);
        let value = |i: usize| {
            let at = Vector2::new((i % SIZE) as f64, (i / SIZE) as f64);
            let [a, b] = [0, 1].map(|j| pair().column(j).dot(&at));
            ground(at) + contrast(at) * (a.cos() + b.cos() + (b - a).cos()) + NOISE * normal()
        };
        Image::new(SIZE, SIZE, (0..SIZE * SIZE).map(value).collect())
    }

    fn bump(at: Vector2<f64>) -> f64 {
        (-0.5 * (at - Vector2::new(70.0, 55.0)).norm_squared() / 15.0f64.powi(2)).exp()
    }

    fn fitted(image: &Image) -> Found {
        let start = Windowed::new(image).fit(image, &pair(), Background::Plane, shells(3));
        measure(image, &start.unwrap(), Background::Plane).unwrap()
    }

    /// Bumps lie in places, and waves and rough ground do not.
    #[test]
    fn bumps_are_told_from_rough_ground() {
        let levelled = Levelled::for_cell([30, 30]);
        let ground = |image| Ground { levelled, image };
        let of = |value: &dyn Fn(Vector2<f64>) -> f64| {
            let at = |i: usize| Vector2::new((i % SIZE) as f64, (i / SIZE) as f64);
            ground(Image::new(
                SIZE,
                SIZE,
                (0..SIZE * SIZE).map(|i| value(at(i))).collect(),
            ))
        };
        assert!(of(&bump).is_in_places());
        assert!(!of(&|at| (0.05 * at.x).sin()).is_in_places());
        let rough = |seed| ground(levelled.ground(&white(seed)));
        assert!((0..20).all(|seed| !rough(seed).is_in_places()));
    }

    /// A lattice goes on across a bump: nothing is left out, and its waves are as certain as without, by what they are off.
    #[test]
    fn bumps_cost_nothing() {
        let mut sum = 0.0;
        for seed in 0..SEEDS {
            let found = fitted(&image(seed, |at| 6.0 * bump(at), |_| 1.0));
            let plain = fitted(&image(seed, |_| 0.0, |_| 1.0));
            let gone = found
                .rest
                .map_or(0, |rest| rest.values.len() - rest.finite().len());
            assert!(50 * gone < SIZE * SIZE, "{seed}: {gone} pixels left out");
            let variance =
                |fit: &crate::lattice::fit::fitted::LatticeFit| fit.wave_vectors.covariance.trace();
            let ratio = variance(&found.fit) / variance(&plain.fit);
            assert!((0.7..1.8).contains(&ratio), "{seed}: {ratio}");
            let off = found.fit.wave_vectors.basis - pair();
            sum += off.norm_squared() / variance(&found.fit);
        }
        let pull = (sum / SEEDS as f64).sqrt();
        assert!((0.7..1.4).contains(&pull), "{pull}");
    }

    /// Where contrast is lost on a bump the rest of the lattice is as certain as its noise lets it be.
    #[test]
    fn lost_contrast_is_no_noise() {
        let mut sum = 0.0;
        for seed in 0..SEEDS {
            let found = fitted(&image(seed, |at| 4.0 * bump(at), |at| 1.0 - 0.5 * bump(at)));
            let plain = fitted(&image(seed, |_| 0.0, |_| 1.0));
            let [found, plain] = [&found.fit, &plain.fit].map(|fit| fit.wave_vectors);
            let ratio = found.covariance.trace() / plain.covariance.trace();
            assert!((0.7..3.0).contains(&ratio), "{seed}: {ratio}");
            sum += (found.basis - pair()).norm_squared() / found.covariance.trace();
        }
        let pull = (sum / SEEDS as f64).sqrt();
        assert!((0.7..1.4).contains(&pull), "{pull}");
    }
}
