//! How lattices on one frame enlarge the errors of each other.

use nalgebra::{DMatrix, Matrix3, Matrix4, SMatrix, Vector2};

use crate::frame::departure::Departure;
use crate::frame::image::Image;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::measured::MeasuredLattice;
use crate::spectrum::error::LatticeError;

/// Samples per shortest period at which the correlation of lattices is worked out: more than two for the second
/// order.
const SAMPLES: f64 = 5.0;

/// One lattice and what it makes of the image.
pub(crate) struct Part {
    pub(crate) lattice: MeasuredLattice,
    pub(crate) fit: LatticeFit,
    pub(crate) model: Vec<f64>,
}

/// Enlarges the errors of each part by what the others take of it.
pub(crate) fn beside_each_other(
    parts: &mut [Part],
    image: &Image,
    displacement: Option<&Departure>,
) -> Result<(), LatticeError> {
    let columns: Vec<usize> = parts.iter().map(|p| derivatives(&p.fit)).collect();
    let total: usize = 1 + columns.iter().sum::<usize>();
    let shortest = parts
        .iter()
        .flat_map(|p| {
            p.fit
                .harmonics
                .iter()
                .map(|h| p.fit.wave_vectors.basis * Vector2::from(h.index.map(f64::from)))
        })
        .map(|q| std::f64::consts::TAU / q.norm())
        .fold(f64::INFINITY, f64::min);
    let stride = ((shortest / SAMPLES) as usize).max(1);
    let mut fisher = DMatrix::<f64>::zeros(total, total);
    let mut design = nalgebra::DVector::<f64>::zeros(total);
    for row in (0..image.rows).step_by(stride) {
        for column in (0..image.columns).step_by(stride) {
            if !image.row(row)[column].is_finite() {
                continue;
            }
            design[0] = 1.0;
            let mut at = 1;
            let pixel = Vector2::new(column as f64, row as f64);
            let pixel = pixel + displacement.map_or_else(Vector2::zeros, |u| u.at(pixel));
            for part in parts.iter() {
                at += differentiate(&part.fit, image, pixel, &mut design.as_mut_slice()[at..]);
            }
            fisher.ger(1.0, &design, &design, 1.0);
        }
    }
    let whole = fisher.clone().cholesky().ok_or(LatticeError::Entangled)?;
    let whole = whole.inverse();
    let mut at = 1;
    for (part, n) in parts.iter_mut().zip(columns) {
        let own: Vec<usize> = std::iter::once(0).chain(at..at + n).collect();
        let alone = fisher.select_rows(&own).select_columns(&own);
        let alone = alone.cholesky().ok_or(LatticeError::Entangled)?.inverse();
        // The seven derivatives come first.
        let beside: SMatrix<f64, 7, 7> = whole.fixed_view::<7, 7>(at, at).into_owned();
        let alone: SMatrix<f64, 7, 7> = alone.fixed_view::<7, 7>(1, 1).into_owned();
        part.enlarge(&beside, &alone)
            .ok_or(LatticeError::Entangled)?;
        at += n;
    }
    Ok(())
}

/// Number of parameters of a lattice: three phases, four components of wave vectors, amplitudes.
fn derivatives(fit: &LatticeFit) -> usize {
    4 + 2 * fit.harmonics.len()
}

/// Derivatives of the model at a place: by the phases of the first three harmonics, by `(q₁, q₂)` in units of
/// one over the frame, by the amplitudes of the first three, and by both amplitudes of the others. Returns their number.
fn differentiate(fit: &LatticeFit, image: &Image, pixel: Vector2<f64>, out: &mut [f64]) -> usize {
    let from_centre = pixel - fit.centre;
    let place = from_centre.component_div(&Vector2::new(image.columns as f64, image.rows as f64));
    out[3..7].fill(0.0);
    let mut next = 10;
    for (i, harmonic) in fit.harmonics.iter().enumerate() {
        let index = harmonic.index.map(f64::from);
        let q = fit.wave_vectors.basis * Vector2::from(index);
        let (sin, cos) = (q.dot(&from_centre) + harmonic.phase).sin_cos();
        let by_phase = -harmonic.amplitude * sin;
        for (vector, n) in index.into_iter().enumerate() {
            out[3 + 2 * vector] += n * by_phase * place.x;
            out[4 + 2 * vector] += n * by_phase * place.y;
        }
        if i < 3 {
            out[i] = by_phase;
            out[7 + i] = cos;
        } else {
            out[next] = sin;
            out[next + 1] = cos;
            next += 2;
        }
    }
    next
}

/// `L_b L_a⁻¹` of the Cholesky factors: takes the covariance a to b.
fn map<const N: usize>(
    beside: &SMatrix<f64, N, N>,
    alone: &SMatrix<f64, N, N>,
) -> Option<SMatrix<f64, N, N>> {
    let [b, a] = [beside, alone].map(|m| DMatrix::from_column_slice(N, N, m.as_slice()));
    let (b, a) = (b.cholesky()?.l(), a.cholesky()?.l());
    let inverse = a.solve_lower_triangular(&DMatrix::identity(N, N))?;
    Some(SMatrix::from_column_slice((b * inverse).as_slice()))
}

impl Part {
    /// Takes the covariances through the map that takes `alone` to `beside`.
    fn enlarge(&mut self, beside: &SMatrix<f64, 7, 7>, alone: &SMatrix<f64, 7, 7>) -> Option<()> {
        // The scale of the derivatives by wave vectors cancels but for its ratio along x and y, which is kept by
        // mapping each block by itself.
        let phases = map::<3>(
            &beside.fixed_view::<3, 3>(0, 0).into_owned(),
            &alone.fixed_view::<3, 3>(0, 0).into_owned(),
        )?;
        let pair = map::<4>(
            &beside.fixed_view::<4, 4>(3, 3).into_owned(),
            &alone.fixed_view::<4, 4>(3, 3).into_owned(),
        )?;
        let size = self.fit.centre.map(|m| 2.0 * m + 1.0);
        let scale = Matrix4::from_diagonal(&nalgebra::Vector4::new(size.x, size.y, size.x, size.y));
        let back = scale.map(|s| if s == 0.0 { 0.0 } else { 1.0 / s });
        let pair: Matrix4<f64> = back * pair * scale;
        let waves = &mut self.fit.wave_vectors;
        waves.covariance = pair * waves.covariance * pair.transpose();
        let covariance: Matrix3<f64> = phases * self.fit.phase_covariance * phases.transpose();
        self.fit.phase_covariance = covariance;
        self.lattice.phases.covariance = covariance;
        // Same pair, same labelling: only the errors change.
        let real = waves.lattice()?;
        self.lattice.pixels.covariance = real.covariance;
        self.lattice.fit = Some(self.fit.clone());
        Some(())
    }
}
