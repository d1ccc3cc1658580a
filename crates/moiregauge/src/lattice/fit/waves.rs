//! Plane waves on the pixels of an image, straight or with the displacements of a scanner that bends.

use nalgebra::Vector2;
use rustfft::num_complex::Complex64;

use crate::frame::departure::Departure;
use crate::frame::image::Image;

/// Hands out `e^{iq·(n + U − centre)}` line by line; U: how far from its own place a pixel is on a straight grid.
fn each(
    image: &Image,
    q: Vector2<f64>,
    centre: Vector2<f64>,
    displacement: Option<&Departure>,
    mut take: impl FnMut(usize, &[Complex64]),
) {
    let along = (0..image.columns).map(|c| Complex64::cis(q.x * (c as f64 - centre.x)));
    let along: Vec<_> = along.collect();
    let mut line = along.clone();
    for row in 0..image.rows {
        let turn = Complex64::cis(q.y * (row as f64 - centre.y));
        for (value, along) in line.iter_mut().zip(&along) {
            *value = turn * along;
        }
        if let Some(displacement) = displacement {
            let off = displacement.line(row, image.columns);
            for (value, off) in line.iter_mut().zip(&off) {
                *value *= Complex64::cis(q.dot(off));
            }
        }
        take(row, &line);
    }
}

/// `Σ Re c e^{iq·(n + U − centre)}` of waves q with amplitudes c.
pub(crate) fn sum(
    image: &Image,
    waves: impl IntoIterator<Item = (Vector2<f64>, Complex64)>,
    centre: Vector2<f64>,
    displacement: Option<&Departure>,
) -> Vec<f64> {
    let mut values = vec![0.0; image.values.len()];
    for (q, amplitude) in waves {
        each(image, q, centre, displacement, |row, line| {
            let values = &mut values[row * image.columns..][..line.len()];
            for (value, wave) in values.iter_mut().zip(line) {
                *value += amplitude.re * wave.re - amplitude.im * wave.im;
            }
        });
    }
    values
}

/// `Σ v e^{−iq·(n + U − centre)}` over the pixels that are there.
pub(crate) fn projected(
    image: &Image,
    q: Vector2<f64>,
    centre: Vector2<f64>,
    displacement: Option<&Departure>,
) -> Complex64 {
    let mut sum = Complex64::ZERO;
    each(image, q, centre, displacement, |row, line| {
        let pixels = image.row(row).iter().zip(line);
        let there = pixels.filter(|(value, _)| value.is_finite());
        sum += there
            .map(|(value, wave)| wave.conj() * *value)
            .sum::<Complex64>();
    });
    sum
}
