//! How position sensors bend, seen by a lattice that does not.
//!
//! A wave of a uniform lattice has the phase `q·(s − w)` where sensors show s and are w off, and the fit reads `ψ_v = −q_v·w` off both of its wave vectors:
//! with `Q = (q₁, q₂)`, `w = −Q⁻ᵀ ψ`.

use nalgebra::{Matrix2, Matrix3, Matrix6, Vector6};

use crate::calibration::curvature::Seen;
use crate::frame::geometry::Geometry;
use crate::lattice::fit::bend::FOLLOWED;
use crate::scan::measured::MeasuredLine;

/// What an image of a uniform lattice shows; `None` where there is no fit, or one that does not follow the bend.
pub(crate) fn seen(line: &MeasuredLine) -> Option<Seen> {
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
    Some((map * values, covariance))
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
