//! How position sensors bend.
//!
//! Sensors show `s = r + w(r)`, to second order `w_i = ½ Σ K_i,jk r_j r_k` about the middle of the frame. A curvature is a property of the sensor: 0.1 %
//! of a range R is `K = 0.008/R` anywhere in it.

use heterostrain::Estimate;
use nalgebra::{Matrix2, Matrix6, Matrix6x2, Vector2, Vector6};
use serde::{Deserialize, Serialize};

use crate::frame::departure::{Across, Departure, Term};
use crate::frame::geometry::Geometry;
use crate::numbers::chi2::enlargement;

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

/// What an image of a uniform lattice shows.
pub(crate) struct Seen {
    /// Second derivatives, per nm.
    pub(crate) values: Vector6<f64>,
    pub(crate) covariance: Matrix6<f64>,
    /// What an acceleration of the sample (nm/s²) adds to them: `w = ½ a t²` with `t = u·r`.
    pub(crate) by_acceleration: Matrix6x2<f64>,
}

/// What the images of one set show, with one acceleration of its drift (nm/s²) and the covariance of that.
pub(crate) struct SeenBySet {
    pub(crate) images: Vec<Seen>,
    pub(crate) acceleration: (Vector2<f64>, Matrix2<f64>),
}

/// Normal equations of curvature and acceleration.
struct Normal {
    own: Matrix6<f64>,
    mixed: Matrix6x2<f64>,
    other: Matrix2<f64>,
    right: (Vector6<f64>, Vector2<f64>),
}

impl SeenBySet {
    fn normal(&self) -> Option<Normal> {
        let (before, covariance) = self.acceleration;
        let known = covariance.try_inverse()?;
        let mut sums = Normal {
            own: Matrix6::zeros(),
            mixed: Matrix6x2::zeros(),
            other: known,
            right: (Vector6::zeros(), known * before),
        };
        for image in &self.images {
            let weight = image.covariance.try_inverse()?;
            let lever = image.by_acceleration;
            sums.own += weight;
            sums.mixed += weight * lever;
            sums.other += lever.transpose() * weight * lever;
            sums.right.0 += weight * image.values;
            sums.right.1 += lever.transpose() * weight * image.values;
        }
        Some(sums)
    }

    /// χ² for a curvature and the acceleration that fits it best.
    fn chi2(&self, curvature: &Vector6<f64>) -> Option<f64> {
        let normal = self.normal()?;
        let free = normal.right.1 - normal.mixed.transpose() * curvature;
        let acceleration = normal.other.try_inverse()? * free;
        let of_image = |image: &Seen| {
            let miss = image.values - curvature - image.by_acceleration * acceleration;
            Some((miss.transpose() * image.covariance.try_inverse()? * miss)[0])
        };
        let (before, covariance) = self.acceleration;
        let miss = acceleration - before;
        let of_acceleration = (miss.transpose() * covariance.try_inverse()? * miss)[0];
        let images: Option<f64> = self.images.iter().map(of_image).sum();
        Some(images? + of_acceleration)
    }
}

impl Curvature {
    /// The mean of what sets show, with errors that hold their scatter and what the drift may have done; `None` where it may be chance.
    pub(crate) fn of(sets: &[SeenBySet]) -> Option<Self> {
        let (mut weights, mut weighted) = (Matrix6::zeros(), Vector6::zeros());
        for set in sets {
            let sums = set.normal()?;
            let back = sums.mixed * sums.other.try_inverse()?;
            weights += sums.own - back * sums.mixed.transpose();
            weighted += sums.right.0 - back * sums.right.1;
        }
        let covariance = weights.try_inverse()?;
        let values = covariance * weighted;
        let chi2: Option<f64> = sets.iter().map(|set| set.chi2(&values)).sum();
        let images: usize = sets.iter().map(|set| set.images.len()).sum();
        let covariance = covariance * enlargement(chi2?, 6 * (images - 1));
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
