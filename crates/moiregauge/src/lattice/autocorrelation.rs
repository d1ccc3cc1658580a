//! Lattice vectors from the autocorrelation, divided by the overlap, at sub-pixel peaks.
//!
//! The autocorrelation of a periodic image is even about every lattice vector, so the parabola
//! through a patch centred on a peak has its top exactly there, whatever the shape of the peak. The
//! image is windowed first: without a window the sum over the overlap keeps the beat of the
//! harmonics with the frame and the peaks move by several thousandths of a wavelength.
//!
//! Noise: a peak at lag R compares the start of the image with its end. For local noise power
//! `S_h` at the harmonics `q_h` of amplitude `2|c_h|`,
//!   `cov(δ_R, δ_R') = κ(R, R') V`, `V = H⁻¹ N H⁻¹`, `H = Σ 2|c_h|² q qᵀ`, `N = Σ 2|c_h|² S_h q qᵀ`,
//!   `κ(R, R') = Σ_n w²(n) [w(n+R) − w(n−R)] [w(n+R') − w(n−R')] / (W(R) W(R'))`,
//! with `W(R) = Σ w(n) w(n+R)`. The lattice through the peaks is fitted by least squares with κ
//! (plus the noise-with-noise term) as covariance.

use heterostrain::lattice::{Lattice, Px, reciprocal};
use nalgebra::{DMatrix, Matrix2, Matrix2xX, Matrix4, Matrix6, Vector2, Vector6};

use crate::frame::background::Background;
use crate::frame::image::Image;
use crate::lattice::lag_noise::{GradientNoise, Overlap, noise_with_noise};
use crate::numbers::chi2::enlargement;
use crate::spectrum::harmonics::Harmonics;
use crate::spectrum::lags::Autocorrelation;
use crate::spectrum::transform::Spectrum;

/// Radius of the patch around a peak, as a share of the shortest lattice vector: less than half, where the next peak
/// begins. Chosen by eye.
const PATCH: f64 = 0.22;
/// Farthest peaks used, as a share of the frame: beyond it little is left of the overlap (30 % along a diagonal).
const FARTHEST: f64 = 0.45;
/// Most peaks used: the nearest ones to find the lattice, far ones to pin it down. Chosen by eye.
const MOST_PEAKS: usize = 30;

/// Fits the lattice to the peaks of the autocorrelation of an image without its `background`, starting from `start` (px).
///
/// `None` where fewer than three peaks lie within the frame.
pub(crate) fn measure(
    image: &Image,
    background: Background,
    harmonics: &Harmonics,
    start: &Matrix2<f64>,
) -> Option<Lattice<Px>> {
    let spectrum = Spectrum::new(image);
    let autocorrelation = spectrum.autocorrelation();
    let frame = Vector2::new(spectrum.image_size[0] as f64, spectrum.image_size[1] as f64);
    let mut basis = *start;
    // Near peaks first: an error of the start grows with the distance.
    for reach in [0.5 * FARTHEST, FARTHEST] {
        let near = peaks(&autocorrelation, &basis, &places(&basis, reach * frame));
        if near.len() >= 3 {
            basis = fit(&near, frame, None)?.0;
        }
    }
    let places = places(&basis, FARTHEST * frame);
    let measured = peaks(&autocorrelation, &basis, &places);
    let model = harmonics.model(image, background);
    let unbiased = unbiased(measured, &model, &harmonics.pair, &places)?;
    if unbiased.len() < 3 {
        return None;
    }
    let (basis, covariance) = fit(&unbiased, frame, Some(harmonics))?;
    Some(Lattice::new(basis, covariance))
}

/// Takes off what the frame does to the peaks: the same peaks are measured on the model image,
/// whose lattice is known. Thousandths of a wavelength at four periods become some 10⁻⁵.
fn unbiased(
    measured: Vec<Peak>,
    model: &Image,
    pair: &Matrix2<f64>,
    places: &[Vector2<f64>],
) -> Option<Vec<Peak>> {
    let basis = reciprocal(pair)?;
    let autocorrelation = Spectrum::new(model).autocorrelation();
    let modelled = peaks(&autocorrelation, &basis, places);
    let corrected = measured.into_iter().filter_map(|mut peak| {
        let model = modelled.iter().find(|m| m.index == peak.index)?;
        peak.position -= model.position - basis * peak.index;
        Some(peak)
    });
    Some(corrected.collect())
}

#[derive(Clone, Debug)]
struct Peak {
    /// Lattice indices in the basis at 60°.
    index: Vector2<f64>,
    /// Measured position, px.
    position: Vector2<f64>,
    /// Relative variance from the roughness of the autocorrelation at the peak, px².
    roughness: f64,
}

/// Indices of the lattice points within an ellipse, nearest first, at most [`MOST_PEAKS`].
fn places(basis: &Matrix2<f64>, reach: Vector2<f64>) -> Vec<Vector2<f64>> {
    let mut places: Vec<(f64, Vector2<f64>)> = Vec::new();
    let farthest = (reach.amax() / shortest(basis)).ceil() as i64 + 1;
    for h in -farthest..=farthest {
        for k in 0..=farthest {
            if k == 0 && h <= 0 {
                continue;
            }
            let index = Vector2::new(h as f64, k as f64);
            let r = (basis * index).component_div(&reach).norm();
            if r <= 1.0 {
                places.push((r, index));
            }
        }
    }
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all = places.into_iter().map(|(_, index)| index);
    if all.len() <= MOST_PEAKS {
        return all.collect();
    }
    // The nearest third, and of the others evenly many at every distance.
    let near = MOST_PEAKS / 3;
    let stride = (all.len() - near) as f64 / (MOST_PEAKS - near) as f64;
    let all: Vec<_> = all.collect();
    let far = (1..=MOST_PEAKS - near).map(|i| near + (i as f64 * stride) as usize - 1);
    (0..near).chain(far).map(|i| all[i]).collect()
}

/// Length of the shortest of the three vectors.
fn shortest(basis: &Matrix2<f64>) -> f64 {
    let third = basis.column(1) - basis.column(0);
    let both = basis.column(0).norm().min(basis.column(1).norm());
    both.min(third.norm())
}

/// Measures the peaks at these lattice points; points without a peak are left out.
fn peaks(
    autocorrelation: &Autocorrelation,
    basis: &Matrix2<f64>,
    places: &[Vector2<f64>],
) -> Vec<Peak> {
    let radius = (PATCH * shortest(basis)).max(1.6);
    let measured = places.iter().filter_map(|&index| {
        let (position, roughness) = peak(autocorrelation, basis * index, radius)?;
        Some(Peak {
            index,
            position,
            roughness,
        })
    });
    measured.collect()
}

/// The top of the paraboloid through a patch, re-centred until it sits on the top.
fn peak(
    autocorrelation: &Autocorrelation,
    near: Vector2<f64>,
    radius: f64,
) -> Option<(Vector2<f64>, f64)> {
    let mut centre = near;
    for round in 0..12 {
        let (step, roughness) = paraboloid(autocorrelation, centre, radius)?;
        centre += step;
        // A peak that runs away is not that of this lattice point.
        if (centre - near).norm() > 1.5 * radius {
            return None;
        }
        if step.norm() < 1e-4 || round == 11 {
            return Some((centre, roughness));
        }
    }
    None
}

/// Weighted fit of a paraboloid around `centre`; the offset of its top and its variance for unit
/// noise per lag.
fn paraboloid(
    autocorrelation: &Autocorrelation,
    centre: Vector2<f64>,
    radius: f64,
) -> Option<(Vector2<f64>, f64)> {
    // The top of a wide peak is smooth: some hundred lags describe it.
    let stride = (radius / 9.0).ceil() as i64;
    let reach = (radius / stride as f64).ceil() as i64;
    let mut normal = Matrix6::<f64>::zeros();
    let mut right = Vector6::<f64>::zeros();
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            let (x, y) = (
                centre.x.round() as i64 + stride * dx,
                centre.y.round() as i64 + stride * dy,
            );
            // Offsets common to a whole line show at row lag 0 only; so does white noise at lag 0.
            if y == 0 {
                continue;
            }
            // In units of the radius, which keeps the equations well conditioned.
            let d = (Vector2::new(x as f64, y as f64) - centre) / radius;
            let w = 1.0 - d.norm_squared();
            if w <= 0.0 {
                continue;
            }
            let terms = Vector6::new(1.0, d.x, d.y, d.x * d.x, d.x * d.y, d.y * d.y);
            right += w * autocorrelation.at(x, y)? * terms;
            normal += w * terms * terms.transpose();
        }
    }
    let inverse = normal.try_inverse()?;
    let c = inverse * right;
    let hessian = Matrix2::new(2.0 * c[3], c[4], c[4], 2.0 * c[5]);
    // A maximum curves down in every direction.
    if !(hessian.trace() < 0.0 && hessian.determinant() > 0.0) {
        return None;
    }
    let top = hessian.try_inverse()? * radius;
    let step = -top * Vector2::new(c[1], c[2]);
    let gradient = 0.5 * (inverse[(1, 1)] + inverse[(2, 2)]);
    let steepest = 0.5 * top.norm_squared() * gradient;
    Some((step * (radius / step.norm()).min(1.0), steepest))
}

/// Generalised least squares of the basis through the peaks.
///
/// Without harmonics only the basis is meaningful, not the covariance.
fn fit(
    peaks: &[Peak],
    frame: Vector2<f64>,
    harmonics: Option<&Harmonics>,
) -> Option<(Matrix2<f64>, Matrix4<f64>)> {
    let n = peaks.len();
    let overlaps: Vec<Overlap> = peaks
        .iter()
        .map(|p| Overlap::new(frame, p.position))
        .collect();
    // Beside κ each peak has an error of its own: noise correlated with noise, and what the finite
    // patch leaves.
    let noise = harmonics.map_or(Some(GradientNoise::unit()), GradientNoise::new)?;
    let along: Vec<f64> = peaks
        .iter()
        .map(|p| noise.along(p.position.component_div(&frame)))
        .collect();
    let mut covariance = DMatrix::from_fn(n, n, |i, j| {
        (along[i] * along[j]).sqrt() * overlaps[i].kappa(&overlaps[j])
    });
    let v = noise.v;
    let per_lag = harmonics.map_or(0.0, noise_with_noise);
    for (i, (peak, overlap)) in peaks.iter().zip(&overlaps).enumerate() {
        let own = 2.0 * per_lag * overlap.squares * peak.roughness / v.trace();
        covariance[(i, i)] += own + 0.02 * covariance[(i, i)];
    }
    let weights = covariance.cholesky()?.inverse();
    let index = Matrix2xX::from_iterator(n, peaks.iter().flat_map(|p| [p.index.x, p.index.y]));
    let position =
        Matrix2xX::from_iterator(n, peaks.iter().flat_map(|p| [p.position.x, p.position.y]));
    let product = |a: &Matrix2xX<f64>, b: &Matrix2xX<f64>| -> Matrix2<f64> {
        (a * &weights * b.transpose()).fixed_resize(0.0)
    };
    let inverse = product(&index, &index).try_inverse()?;
    let basis = product(&position, &index) * inverse;
    // What the peaks say themselves: residuals clearly larger than the noise explains raise the errors.
    let residual = &position - basis * &index;
    let chi2 = (v.try_inverse()? * product(&residual, &residual)).trace();
    let scale = enlargement(chi2, 2 * n.saturating_sub(2));
    // vec(basis) = (a₁; a₂): the covariance between vectors is `inverse`, between components V.
    Some((basis, inverse.kronecker(&v) * scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten peaks that scatter more and more: errors are those of the noise until chance makes such a scatter in fewer than
    /// 5 % of cases (χ²/dof = 26.296/16 for 16 degrees of freedom), and χ²/dof times larger from there on.
    #[test]
    fn only_significant_scatter_of_peaks_enlarges() {
        let basis = Matrix2::new(20.0, 10.0, 0.0, 17.32);
        let places = [
            [1, 0],
            [0, 1],
            [-1, 1],
            [2, 0],
            [0, 2],
            [-2, 2],
            [1, 1],
            [-1, 2],
            [-2, 1],
            [3, 0],
        ];
        let scattered = |size: f64| {
            let peaks: Vec<Peak> = places
                .iter()
                .enumerate()
                .map(|(i, place)| {
                    let index = Vector2::new(f64::from(place[0]), f64::from(place[1]));
                    let off = Vector2::new((7.0 * i as f64).sin(), (5.0 * i as f64).cos());
                    Peak {
                        index,
                        position: basis * index + size * off,
                        roughness: 0.0,
                    }
                })
                .collect();
            fit(&peaks, Vector2::new(256.0, 256.0), None).unwrap().1[(0, 0)]
        };
        let least = scattered(0.0);
        let ratios: Vec<f64> = (0..200)
            .map(|i| scattered(1e-4 * 1.05f64.powi(i)) / least)
            .collect();
        let threshold = 26.296 / 16.0;
        let between = |r: &&f64| **r > 1.1 && **r < threshold / 1.05;
        // Weights depend on the positions, by some per cent.
        assert_eq!(ratios.iter().find(between), None, "{ratios:?}");
        assert!(
            ratios
                .iter()
                .any(|r| *r > threshold && *r < 1.3 * threshold)
        );
    }
}
