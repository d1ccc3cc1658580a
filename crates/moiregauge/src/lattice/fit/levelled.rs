//! What is slow in an image against its lattice, and what taking it off leaves of noise.

use nalgebra::Vector2;

use crate::frame::blur::blurred;
use crate::frame::image::Image;

/// Standard deviation of the Gaussian in unit cells: one to three in a hundred parts of a first wave are left under it.
const WIDTH: f64 = 0.42;
/// Averages of what is left: three leave one in a hundred parts of a bump that is two and a half times as wide as the Gaussian.
const PASSES: i32 = 3;
/// What white noise of variance 1 leaves in the ground, times the product of both widths in pixels: ∫ (1 − (1 − B)³)² d²k / 4π², B the Gaussian.
const WHITE: f64 = 0.194;

/// How ground was taken off an image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Levelled {
    /// Standard deviation of the Gaussian along columns and rows, pixels.
    width: [f64; 2],
}

impl Levelled {
    /// Under a Gaussian that suits a unit cell of so many pixels along columns and rows.
    pub(crate) fn for_cell(cell: [usize; 2]) -> Self {
        Self {
            width: cell.map(|n| (WIDTH * n as f64).max(1.0)),
        }
    }

    /// The ground of an image, of which some pixels are missing.
    pub(crate) fn ground(&self, image: &Image) -> Image {
        let (mut left, mut ground) = (image.clone(), vec![0.0; image.values.len()]);
        for _ in 0..PASSES {
            let mean = blurred(&left, self.width);
            for ((left, ground), mean) in left.values.iter_mut().zip(&mut ground).zip(&mean) {
                *left -= mean;
                *ground += mean;
            }
        }
        Image::new(image.rows, image.columns, ground)
    }

    /// Mean square of the ground of white noise of variance 1.
    pub(crate) fn of_white_noise(&self) -> f64 {
        WHITE / (self.width[0] * self.width[1])
    }

    /// What contrast that changes from place to place leaves of a lattice in `left`: the lattice times a slow factor.
    pub(crate) fn contrast(&self, left: &Image, lattice: &Image) -> Vec<f64> {
        let shape = |values| Image::new(left.rows, left.columns, values);
        let times = |a: &Image, b: &Image| {
            let both = a.values.iter().zip(&b.values);
            shape(both.map(|(a, b)| a * b).collect())
        };
        let (mut left, mut sum) = (left.clone(), vec![0.0; left.values.len()]);
        let power = blurred(&times(lattice, lattice), self.width);
        for _ in 0..PASSES {
            let with = blurred(&times(&left, lattice), self.width);
            let each = lattice.values.iter().zip(with.iter().zip(&power));
            let parts: Vec<f64> = each
                .map(|(m, (with, power))| m * with / power.max(f64::MIN_POSITIVE))
                .collect();
            for ((left, sum), part) in left.values.iter_mut().zip(&mut sum).zip(parts) {
                *left -= part;
                *sum += part;
            }
        }
        sum
    }

    /// The share of the noise power at a frequency (rad per pixel) that is left without the ground.
    pub(crate) fn left(&self, q: Vector2<f64>) -> f64 {
        let turn = Vector2::new(q.x * self.width[0], q.y * self.width[1]);
        let under = (-0.5 * turn.norm_squared()).exp();
        (1.0 - under).powi(2 * PASSES)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::numbers::rng::normals;
    use rustfft::num_complex::Complex64;

    const SIZE: usize = 128;
    const MANY: u64 = 200;

    /// White noise of variance 1.
    pub(crate) fn white(seed: u64) -> Image {
        let mut normal = normals(seed, "ground", 0);
        Image::new(SIZE, SIZE, (0..SIZE * SIZE).map(|_| normal()).collect())
    }

    /// Of white noise the ground takes the power that it is said to take, in sum and frequency by frequency.
    #[test]
    fn noise_in_the_ground_is_known() {
        let levelled = Levelled::for_cell([14, 18]);
        let ks = [[1, 0], [3, 2], [0, 5], [6, 3], [4, 9]];
        let (mut power, mut left) = (0.0, [0.0; 5]);
        for seed in 0..MANY {
            let noise = white(seed);
            let ground = levelled.ground(&noise);
            let squares = ground.values.iter().map(|value| value * value);
            power += squares.sum::<f64>() / (SIZE * SIZE) as f64 / MANY as f64;
            for (left, k) in left.iter_mut().zip(ks) {
                let terms = noise.values.iter().zip(&ground.values).enumerate();
                let sum: Complex64 = terms
                    .map(|(i, (value, ground))| {
                        let turns = (k[0] * (i % SIZE) + k[1] * (i / SIZE)) as f64 / SIZE as f64;
                        Complex64::cis(-std::f64::consts::TAU * turns) * (value - ground)
                    })
                    .sum();
                *left += sum.norm_sqr() / (SIZE * SIZE) as f64 / MANY as f64;
            }
        }
        // At the ends of the frame the averages have fewer pixels.
        let all = levelled.of_white_noise();
        assert!((1.0..1.5).contains(&(power / all)), "{}", power / all);
        for (left, k) in left.into_iter().zip(ks) {
            let q = Vector2::new(k[0] as f64, k[1] as f64) * std::f64::consts::TAU / SIZE as f64;
            let expected = levelled.left(q);
            assert!(
                (left - expected).abs() < 0.25 * expected.max(0.1),
                "{k:?}: {left}, {expected}"
            );
        }
    }
}
