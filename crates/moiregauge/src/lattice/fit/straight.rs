//! The fit of a lattice that bends.
//!
//! What a bend leaves beside the harmonics is the same in every frame and no noise; read as noise it would make the errors of a lattice that changes
//! by a per cent ten times too large, and pass for ground that all frames share. At the edges of a frame it also leaks into the waves: it moves
//! the wave vectors by up to one part in ten thousand. Where the bend is more than chance, noise is read, and the waves are
//! fitted again, in an image from which the difference between the bent and the straight waves is taken off.

use nalgebra::Matrix2;
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::frame::image::Image;
use crate::lattice::fit::bend::{Bend, FOLLOWED, Inhomogeneity, inhomogeneity};
use crate::lattice::fit::bent_waves::BentWaves;
use crate::lattice::fit::fit_pixels::{FinalNoise, Fit};
use crate::lattice::fit::frame::{Frame, turns, wave};
use crate::lattice::fit::model::Model;

/// Steps of the bend: each is linear in it.
const STEPS: usize = 2;

/// What is known of a bend.
pub(crate) struct Followed {
    /// Without what the bend leaves.
    pub(crate) noise: FinalNoise,
    /// How the lattice changes.
    pub(crate) change: Option<Inhomogeneity>,
    /// The mean of the bend that the fit was freed of, rad per pixel, a column each.
    pub(crate) mean: Option<Matrix2<f64>>,
}

/// Frees a fit, and its noise, of what a bend leaves.
pub(crate) fn without_bend(fit: &mut Fit, noise: FinalNoise) -> Followed {
    let mut total = Bend::none();
    let mut straight: Option<(FinalNoise, Image)> = None;
    for _ in 0..STEPS {
        let seen = straight.as_ref().map_or(&noise, |(seen, _)| seen);
        let found = inhomogeneity(
            &fit.frame,
            &fit.model,
            fit.bent_gram(&noise),
            &seen.bends,
            &seen.acting(),
        );
        let Some((_, bend)) =
            found.filter(|(change, _)| change.is_significant() && fit.clipped() < FOLLOWED)
        else {
            break;
        };
        let more = total.and(&bend);
        let image = straightened(&fit.frame, &fit.model, &more);
        let next = fit.in_image(&image).noise();
        let Some(next) = next.filter(|next| next.power() < seen.power()) else {
            break;
        };
        straight = Some((next, image));
        total = more;
    }
    let Some((straight, image)) = straight else {
        return Followed {
            change: fit.inhomogeneity(&noise),
            mean: None,
            noise,
        };
    };
    let straight = FinalNoise {
        bends: noise.bends,
        bent: noise.bent,
        ..straight
    };
    let mut change = fit.inhomogeneity(&straight);
    if let Some(change) = &mut change {
        change.second.values = total.second(&fit.frame).cast();
    }
    // The mean of the bend is added to the waves only where the lattice is said to change.
    let is_told = change.as_ref().is_some_and(Inhomogeneity::is_significant);
    let refitted = is_told.then(|| fit.refit(&image)).flatten();
    Followed {
        change,
        mean: refitted.map(|()| total.mean(&fit.frame)),
        noise: straight,
    }
}

/// The image without the difference between the bent waves and the straight ones.
fn straightened(frame: &Frame, model: &Model, bend: &Bend) -> Image {
    let columns = frame.image.columns;
    let indices = &model.basis.indices;
    let waves = indices.iter().map(|&index| wave(&model.pair, index));
    let places: Vec<_> = waves.collect();
    let along: Vec<_> = places.iter().map(|p| turns(p.x, &frame.x)).collect();
    let up: Vec<_> = places.iter().map(|p| turns(p.y, &frame.y)).collect();
    let scanner = BentWaves::new(frame, &model.pair, indices);
    let middle = mean_phases(frame, bend);
    let mut image = frame.image.clone();
    let lines = image.values.par_chunks_exact_mut(columns).enumerate();
    lines.for_each(|(row, line)| {
        let mut own = Vec::new();
        if let Some(scanner) = &scanner {
            scanner.each(row, |_, turns| own.push(turns.to_vec()));
        }
        let along = if scanner.is_some() { &own } else { &along };
        for (column, value) in line.iter_mut().enumerate() {
            let phases = bend.phases([frame.x[column], frame.y[row]]);
            let bent = [0, 1].map(|i| Complex64::cis(phases[i] - middle[i]));
            for (i, [alpha, beta]) in model.waves.iter().enumerate() {
                let [h, k] = model.basis.indices[i];
                let turn = along[i][column] * up[i][row];
                let change = turn * bent[0].powi(h) * bent[1].powi(k) - turn;
                *value -= alpha * change.re + beta * change.im;
            }
        }
    });
    image
}

/// The mean of the phases over the pixels that count, which the phases of the straight waves have taken up; from a grid of pixels.
fn mean_phases(frame: &Frame, bend: &Bend) -> [f64; 2] {
    const ACROSS: usize = 64;
    let stride = |n: usize| n.div_ceil(ACROSS);
    let (mut sum, mut count) = ([0.0; 2], 0.0);
    for row in (0..frame.image.rows).step_by(stride(frame.image.rows)) {
        let pixels = frame.image.row(row).iter().enumerate();
        for (column, value) in pixels.step_by(stride(frame.image.columns)) {
            if frame.present[row] > 0 && value.is_finite() {
                let phases = bend.phases([frame.x[column], frame.y[row]]);
                sum = [sum[0] + phases[0], sum[1] + phases[1]];
                count += 1.0;
            }
        }
    }
    sum.map(|sum| sum / f64::max(count, 1.0))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;
    use crate::frame::background::Background;
    use crate::frame::departure::{Across, Departure, Term};
    use crate::lattice::fit::measure::measure;
    use crate::numbers::rng::normals;
    use crate::spectrum::harmonics::Windowed;
    use crate::spectrum::shells::shells;

    const SIZE: [usize; 2] = [150, 121];

    /// Creep along the lines of up to a per cent of the frame.
    fn creep() -> Departure {
        let log = Across::Log {
            tau: 0.02,
            from_last: false,
        };
        let term = Term {
            along: 0,
            across: log,
            size: Vector2::new(0.5, 0.0),
        };
        Departure::new(vec![term], [0, SIZE[0] - 1], [0, SIZE[1] - 1])
    }

    /// Squares of the errors of the waves of a lattice whose phases bend evenly, by `bend` radians at an edge, so that its mean is that of the middle.
    fn squares(bend: f64, scanner: Option<&Departure>) -> f64 {
        let pair = Matrix2::new(0.45, -0.02, 0.21, 0.52);
        let edge = Vector2::new(SIZE[0] as f64, SIZE[1] as f64) / 2.0;
        let mut sum = 0.0;
        for seed in 0..16u64 {
            let mut normal = normals(seed, "straight", 0);
            let (first, second) = (0.7 * seed as f64, 1.9 * seed as f64);
            let value = |i: usize| {
                let pixel = Vector2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
                let at = pixel + scanner.map_or_else(Vector2::zeros, |u| u.at(pixel));
                let place =
                    (pixel + Vector2::repeat(0.5)).component_div(&edge) - Vector2::repeat(1.0);
                let a = pair.column(0).dot(&at) + first + bend * place.x * place.x;
                let b = pair.column(1).dot(&at) + second - bend * place.x * place.y;
                a.cos() + b.cos() + (b - a).cos() + 0.1 * normal()
            };
            let values = (0..SIZE[0] * SIZE[1]).map(value);
            let image = Image::new(SIZE[1], SIZE[0], values.collect());
            let start = Windowed::new(&image).fit(&image, &pair, Background::Plane, shells(2));
            let found = measure(&image, &start.unwrap(), Background::Plane, scanner).unwrap();
            assert_eq!(found.fit.change().is_some(), bend > 0.0, "{seed}");
            sum += (found.fit.wave_vectors.basis - pair).norm_squared();
        }
        sum
    }

    /// The mean of a lattice that bends by what the fit follows is found as well as that of one that does not, wherever the pattern begins, under a straight
    /// scanner and under one that creeps: of 64 numbers with such noise the root mean square is known to a tenth.
    #[test]
    fn bends_do_not_leak_into_the_mean() {
        let creep = creep();
        for scanner in [None, Some(&creep)] {
            let [straight, bent] = [0.0, 0.25].map(|bend| squares(bend, scanner).sqrt());
            assert!(bent < 1.3 * straight, "{bent} {straight}");
        }
    }
}
