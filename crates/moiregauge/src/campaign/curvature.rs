//! How position sensors bend, seen by a lattice that does not.
//!
//! A wave of a uniform lattice has the phase `q·(s − w)` where sensors show s and are w off, and the fit reads `ψ_v = −q_v·w` off both of its wave vectors:
//! with `Q = (q₁, q₂)`, `w = −Q⁻ᵀ ψ`.
//!
//! A sample that speeds up bends an image, too, by `½ a t²`, and in frames up and down alike: where only one direction is slow, curvature along it and
//! acceleration are one number. How the drift changes from frame to frame tells the acceleration.

use nalgebra::{Matrix2, Matrix3, Matrix6, Matrix6x2, SMatrix, Vector2, Vector3, Vector6};

use crate::calibration::curvature::{Seen, SeenBySet};
use crate::campaign::sightings::middle_of_frame;
use crate::drift::linear::{Observation, weighted, weights};
use crate::frame::geometry::Geometry;
use crate::lattice::fit::bend::FOLLOWED;
use crate::numbers::chi2::enlargement;
use crate::scan::measured::{MeasuredLine, MeasuredScan};

/// What the images of a set show. `observations`: one for each line; `drift`: velocity and its covariance, of which the acceleration changes no more
/// than all within a frame.
pub(crate) fn seen_by_set(
    scans: &[MeasuredScan],
    observations: &[Observation],
    drift: &(Vector2<f64>, Matrix2<f64>),
) -> SeenBySet {
    let lines = || scans.iter().flat_map(|s| &s.lines);
    let times =
        lines().filter_map(|l| Some(l.timing?.per_pixel.y.abs() * l.geometry.size[1] as f64));
    // Images without times have no lever: any time will do.
    let time = times.reduce(f64::min).unwrap_or(1.0);
    let change = (drift.0.component_mul(&drift.0) + drift.1.diagonal()) / (time * time);
    // A sample that is known to be at rest: what rounding leaves.
    let before = Matrix2::from_diagonal(&change.add_scalar(f64::EPSILON));
    let ages = scans
        .iter()
        .flat_map(|s| vec![middle_of_frame(s); s.lines.iter().len()]);
    let ages: Option<Vec<f64>> = ages.collect();
    let told = ages.and_then(|ages| acceleration(observations, &ages, &before));
    SeenBySet {
        images: lines().filter_map(seen).collect(),
        acceleration: told.unwrap_or((Vector2::zeros(), before)),
    }
}

/// The acceleration (nm/s²) that the drift of images shows at their `ages` (s), and its covariance; `before`: that without them.
fn acceleration(
    observations: &[Observation],
    ages: &[f64],
    before: &Matrix2<f64>,
) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let middle = ages.iter().sum::<f64>() / ages.len() as f64;
    let weights = weights(observations).ok()?;
    let rows = observations.iter().zip(ages).zip(weights);
    let rows = rows.map(|((o, age), weight)| {
        let design = o.design_with_acceleration(age - middle);
        (design, o.lattice.flat(), weight)
    });
    let mut known = SMatrix::<f64, 8, 8>::zeros();
    known
        .fixed_view_mut::<2, 2>(6, 6)
        .copy_from(&before.try_inverse()?);
    let (found, covariance) = weighted(rows.clone(), known)?;
    let chi2 = rows.map(|(design, values, weight)| {
        let miss = values - design * found;
        (miss.transpose() * weight * miss)[0]
    });
    let freedom = (4 * observations.len()).saturating_sub(8);
    let scale = enlargement(chi2.sum(), freedom);
    let covariance = covariance.fixed_view::<2, 2>(6, 6) * scale;
    Some((found.fixed_rows::<2>(6).into_owned(), covariance))
}

/// What an image of a uniform lattice shows; `None` where there is no fit, or one that does not follow the bend.
fn seen(line: &MeasuredLine) -> Option<Seen> {
    let fit = line.lattice.fit.as_ref()?;
    let bend = fit.inhomogeneity.filter(|_| fit.clipped < FOLLOWED)?;
    let j = line.geometry.pixel_to_nm;
    let of_phases = -j * fit.wave_vectors.basis.transpose().try_inverse()?;
    let by_nm = second_derivatives(&j.try_inverse()?);
    let of_places: Matrix6<f64> = Matrix2::identity().kronecker(&by_nm);
    let map: Matrix6<f64> = of_phases.kronecker(&by_nm);
    let (values, noise) = (bend.second.values.cast(), bend.second.covariance.cast());
    let of_sensors = noise_of_sensors(&line.geometry);
    let covariance = map * noise * map.transpose() + of_places * of_sensors * of_places.transpose();
    let gradient = line
        .timing
        .and_then(|timing| line.geometry.time_gradient(&timing));
    let u = gradient.unwrap_or_else(Vector2::zeros);
    let squares = Vector3::new(u.x * u.x, u.x * u.y, u.y * u.y);
    Some(Seen {
        values: map * values,
        covariance,
        by_acceleration: Matrix6x2::from(Matrix2::identity().kronecker(&squares)),
    })
}

/// What noise of the sensors makes of second derivatives of places by pixels, (xx, xy, yy) of x, then of y: white noise that makes a variance s² of
/// a step makes `60 s²/n²` of those along it over n pixels, and `12 s²/n²` with n across it of the mixed ones.
fn noise_of_sensors(geometry: &Geometry) -> Matrix6<f64> {
    let steps = geometry.covariance.diagonal();
    let [columns, rows] = geometry.size.map(|n| (n as f64).powi(2));
    let of_axis = |i: usize| {
        let (fast, slow) = (steps[i], steps[2 + i]);
        let mixed = 6.0 * (fast / rows + slow / columns);
        [60.0 * fast / columns, mixed, 60.0 * slow / rows]
    };
    let all = [of_axis(0), of_axis(1)];
    Matrix6::from_diagonal(&Vector6::from_row_slice(all.as_flattened()))
}

/// Takes (xx, xy, yy) by pixels to those by nm; `to_pixels`: pixels per nm.
fn second_derivatives(to_pixels: &Matrix2<f64>) -> Matrix3<f64> {
    let pair = |i: usize, j: usize| {
        let (a, b) = (to_pixels.column(i), to_pixels.column(j));
        [a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[1] * b[1]]
    };
    let rows = [pair(0, 0), pair(0, 1), pair(1, 1)];
    Matrix3::from_fn(|i, j| rows[i][j])
}
