//! Images of some waves.

use nalgebra::Vector2;
use rustfft::num_complex::Complex64;

use crate::frame::background::{Background, take_background_off};
use crate::frame::image::Image;
use crate::numbers::interrupt;
use crate::numbers::widest::widest;

/// Waves in sum.
pub(crate) struct Sum {
    pub(super) constant: f64,
    /// Wave vectors (rad per pixel) and amplitudes, phases at the centre.
    pub(crate) waves: Vec<(Vector2<f64>, Complex64)>,
}

impl Sum {
    /// As [`Harmonics::model`].
    pub(crate) fn model(&self, image: &Image, background: Background) -> Image {
        let mut model = summed(image, self.constant, self.waves.iter().copied());
        take_background_off(&mut model, background);
        model
    }
}

/// The sum of waves, phases at the centre, with the shape and the missing pixels of `image`.
pub(crate) fn summed(
    image: &Image,
    constant: f64,
    waves: impl Iterator<Item = (Vector2<f64>, Complex64)>,
) -> Image {
    let centre = centre(image.columns, image.rows);
    let mut values = vec![constant; image.values.len()];
    for (q, amplitude) in waves {
        let (im, re): (Vec<f64>, Vec<f64>) = (0..image.columns)
            .map(|c| (q.x * (c as f64 - centre.x)).sin_cos())
            .unzip();
        for (row, line) in values.chunks_exact_mut(image.columns).enumerate() {
            interrupt::check();
            let c = 2.0 * amplitude * Complex64::from_polar(1.0, q.y * (row as f64 - centre.y));
            add_wave(line, c, [&re, &im]);
        }
    }
    for (v, measured) in values.iter_mut().zip(&image.values) {
        if !measured.is_finite() {
            *v = f64::NAN;
        }
    }
    Image::new(image.rows, image.columns, values)
}

/// Adds a wave to a line: `Re(c (re + i im))`.
fn add_wave(line: &mut [f64], c: Complex64, [re, im]: [&[f64]; 2]) {
    widest(
        #[inline(always)]
        || {
            for ((v, re), im) in line.iter_mut().zip(re).zip(im) {
                *v += c.re * re - c.im * im;
            }
        },
    );
}

/// The middle of the pixels of a frame.
pub(crate) fn centre(columns: usize, rows: usize) -> Vector2<f64> {
    Vector2::new((columns as f64 - 1.0) / 2.0, (rows as f64 - 1.0) / 2.0)
}
