//! The noise of a fit whose lattice bends.
//!
//! What a bend leaves beside the harmonics is the same in every frame and no noise; read as noise it would make the errors of a lattice that changes
//! by a per cent ten times too large, and pass for ground that all frames share. Where the bend is more than chance, noise is read in an
//! image from which the difference between the bent and the straight waves is taken off.

use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::frame::image::Image;
use crate::lattice::fit::bend::{Bend, FOLLOWED, inhomogeneity};
use crate::lattice::fit::bent_waves::BentWaves;
use crate::lattice::fit::fit_pixels::{FinalNoise, Fit};
use crate::lattice::fit::frame::{Frame, turns, wave};
use crate::lattice::fit::model::Model;

/// Steps of the bend: each is linear in it.
const STEPS: usize = 2;

/// The same noise without what a bend leaves.
pub(crate) fn without_bend(fit: &Fit, noise: FinalNoise) -> FinalNoise {
    let mut total = Bend::none();
    let mut straight: Option<FinalNoise> = None;
    for _ in 0..STEPS {
        let seen = straight.as_ref().unwrap_or(&noise);
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
        total.add(&bend);
        let image = straightened(&fit.frame, &fit.model, &total);
        let next = fit.in_image(&image).noise();
        let Some(next) = next.filter(|next| next.power() < seen.power()) else {
            break;
        };
        straight = Some(next);
    }
    match straight {
        Some(straight) => FinalNoise {
            bends: noise.bends,
            bent: noise.bent,
            ..straight
        },
        None => noise,
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
