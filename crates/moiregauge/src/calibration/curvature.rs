//! How position sensors bend, seen by a lattice that does not.
//!
//! Sensors show `s = r + w(r)`, to second order `w_i = ½ Σ K_i,jk r_j r_k` about the middle of the frame. A wave of a uniform lattice has the phase
//! `q·(s − w)` there, and the fit reads `ψ_v = −q_v·w` off both of its wave vectors: with `Q = (q₁, q₂)`, `w = −Q⁻ᵀ ψ`. A curvature is a property of the
//! sensor: 0.1 % of a range R is `K = 0.008/R` anywhere in it.

use heterostrain::Estimate;
use nalgebra::{Matrix2, Matrix3, Matrix6, Vector2, Vector6};
use serde::{Deserialize, Serialize};

use crate::frame::departure::{Across, Departure, Term};
use crate::frame::geometry::Geometry;
use crate::lattice::fit::bend::FOLLOWED;
use crate::numbers::chi2::enlargement;
use crate::scan::measured::MeasuredLine;

/// χ² of six numbers exceeds 22.5 once in a thousand.
const CHANCE: f64 = 22.5;
/// µm over nm.
const PER_UM: f64 = 1000.0;

/// How position sensors bend: second derivatives of what they show against where the scanner is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Curvature {
    /// Of x by (xx, xy, yy), then of y, per µm.
    pub per_um: [f64; 6],
    /// Their covariance.
    pub covariance: [[f64; 6]; 6],
}

/// What one image shows: per nm, and the covariance.
pub(crate) type Seen = (Vector6<f64>, Matrix6<f64>);

/// What an image of a uniform lattice shows; `None` where there is no fit, or one that does not follow the bend.
pub(crate) fn seen(line: &MeasuredLine) -> Option<Seen> {
    let fit = line.lattice.fit.as_ref()?;
    let bend = fit.inhomogeneity.filter(|_| fit.clipped < FOLLOWED)?;
    let j = line.geometry.pixel_to_nm;
    let of_phases = -j * fit.wave_vectors.basis.transpose().try_inverse()?;
    let by_nm = second_derivatives(&j.try_inverse()?);
    let of_places: Matrix6<f64> = Matrix2::identity().kronecker(&by_nm);
    let map: Matrix6<f64> = of_phases.kronecker(&by_nm);
    let (values, noise) = (bend.second.values, bend.second.covariance);
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

impl Curvature {
    /// The mean of what images show, with errors that hold their scatter; `None` where it may be chance.
    pub(crate) fn of(all: &[Seen]) -> Option<Self> {
        let (mut weights, mut weighted) = (Matrix6::zeros(), Vector6::zeros());
        for (values, covariance) in all {
            let weight = covariance.try_inverse()?;
            weights += weight;
            weighted += weight * values;
        }
        let covariance = weights.try_inverse()?;
        let values = covariance * weighted;
        let chi2 = all.iter().filter_map(|(one, covariance)| {
            let miss = one - values;
            Some((miss.transpose() * covariance.try_inverse()? * miss)[0])
        });
        let covariance = covariance * enlargement(chi2.sum(), 6 * (all.len() - 1));
        let against_none = (values.transpose() * covariance.try_inverse()? * values)[0];
        (against_none > CHANCE).then(|| Self {
            per_um: (values * PER_UM).into(),
            covariance: (covariance * PER_UM * PER_UM).into(),
        })
    }

    /// By how much x and y bend in a range (nm), as a share of it.
    pub fn bends(&self, range: f64) -> [Estimate; 2] {
        [0, 5].map(|i| {
            let curvature = Estimate::from_variance(self.per_um[i], self.covariance[i][i]);
            curvature.scaled(range / PER_UM / 8.0)
        })
    }

    /// What is wrong with the numbers; `None` where they can be used.
    pub(crate) fn problem(&self) -> Option<String> {
        let mut numbers = self.per_um.iter().chain(self.covariance.iter().flatten());
        let wrong = numbers.find(|v| !v.is_finite()).copied();
        let negative = (0..6).map(|i| self.covariance[i][i]).find(|v| *v < 0.0);
        let found = wrong.or(negative)?;
        Some(format!(
            "curvature: expected finite numbers and variances of 0 or more, found {found}"
        ))
    }

    /// By how much x and y may still be bent in such ranges (nm): the standard error, as a share of the range.
    pub(crate) fn shares(&self, range: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.bends(range.x)[0].sigma, self.bends(range.y)[1].sigma)
    }

    /// Positions by the sensors, freed of what they bend.
    pub(crate) fn without(&self, geometry: &Geometry) -> Geometry {
        let middle = Vector2::from(geometry.size.map(|n| (n as f64 - 1.0) / 2.0));
        let departure = geometry.departure.as_deref().cloned();
        let departure = departure.unwrap_or_else(|| {
            let [columns, rows] = geometry.size.map(|n| [0, n.max(1) - 1]);
            Departure::new(Vec::new(), columns, rows)
        });
        let (steps, centre) = departure.units(middle);
        let to_nm = geometry.pixel_to_nm * Matrix2::from_diagonal(&steps.map(|s| 1.0 / s));
        // ½ rᵀ K r with r = B (u − u₀), u and v being the units of the departure.
        let of_axis = |i: usize| {
            let [xx, xy, yy] = [0, 1, 2].map(|k| self.per_um[3 * i + k] / PER_UM);
            to_nm.transpose() * Matrix2::new(xx, xy, xy, yy) * to_nm
        };
        let both = [of_axis(0), of_axis(1)];
        let term = |along, across, size: &dyn Fn(&Matrix2<f64>) -> f64| Term {
            along,
            across: Across::Power(across),
            size: -Vector2::from(both.map(|k| size(&k))),
        };
        // u² = (2 P₂(u) + 1)/3; what is constant moves the whole frame and is left.
        let terms = [
            term(2, 0, &|k| k.m11 / 3.0),
            term(1, 1, &|k| k.m12),
            term(0, 2, &|k| k.m22 / 3.0),
            term(1, 0, &|k| -(k * centre).x),
            term(0, 1, &|k| -(k * centre).y),
        ];
        Geometry {
            departure: Some(departure.with_terms(terms).into()),
            ..geometry.clone()
        }
    }
}
