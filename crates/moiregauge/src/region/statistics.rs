//! Means and spreads over an area.

use nalgebra::{Matrix2, Matrix4, Vector2};

use super::correlation::{Pairs, pairs};
use super::{Region, mean_wavelength};
use crate::map::{Mask, TwistStrainMap};
use crate::strain::TwistStrain;

/// Mean and spread of a quantity over an area.
///
/// With N nodes, errors σ_i and correlations ρ_ij of their noise: `var(mean) = ⟨σ²⟩ Σρ/N²`, and the expected
/// square scatter about the mean is `v + ⟨σ²⟩(1 − Σρ/N²)` with v that of the quantity itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionMean {
    /// Plain mean over the good nodes.
    pub mean: f64,
    /// Its standard error by noise.
    pub sigma: f64,
    /// Standard deviation over the nodes.
    pub spread: f64,
    /// The same without what noise adds, 0 where noise explains it.
    pub corrected: f64,
    /// What `corrected` does not exceed, with 95 % confidence as far as noise goes.
    pub below: f64,
    /// Root mean square of the errors of the nodes.
    pub noise: f64,
}

impl RegionMean {
    /// From sums over N nodes: count, values, their squares and variances of their noise.
    pub(super) fn of_sums(
        [count, sum, squares, variances]: [f64; 4],
        pairs: &Pairs,
    ) -> Option<Self> {
        if count < 1.0 {
            return None;
        }
        let mean = sum / count;
        let variance = (squares / count - mean * mean).max(0.0);
        let noise = variances / count;
        let own = variance - noise * (1.0 - pairs.mean).max(0.0);
        let doubt = ((2.0 * noise * noise + 4.0 * own.max(0.0) * noise) * pairs.square).sqrt();
        Some(Self {
            mean,
            sigma: (noise * pairs.mean).sqrt(),
            spread: variance.sqrt(),
            corrected: own.max(0.0).sqrt(),
            below: (own.max(0.0) + 1.645 * doubt).sqrt(),
            noise: noise.sqrt(),
        })
    }

    /// Of (value, σ) at nodes; what is not finite is left out.
    fn of(values: impl Iterator<Item = [f64; 2]>, pairs: &Pairs) -> Option<Self> {
        let known: Vec<[f64; 2]> = values.filter(|v| v.iter().all(|x| x.is_finite())).collect();
        let offset = known.first()?[0];
        let sums = known.iter().fold([0.0; 4], |s, [value, sigma]| {
            let v = value - offset;
            [s[0] + 1.0, s[1] + v, s[2] + v * v, s[3] + sigma * sigma]
        });
        let found = Self::of_sums(sums, pairs)?;
        Some(Self {
            mean: found.mean + offset,
            ..found
        })
    }

    /// The same in another unit.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        let size = factor.abs();
        Self {
            mean: self.mean * factor,
            sigma: self.sigma * size,
            spread: self.spread * size,
            corrected: self.corrected * size,
            below: self.below * size,
            noise: self.noise * size,
        }
    }
}

/// A region of a map in numbers. Errors are those of image noise alone, as in the map.
#[derive(Clone, Debug)]
pub struct RegionStatistics {
    /// The region.
    pub region: Region,
    /// Nodes within it.
    pub nodes: usize,
    /// Those to be believed.
    pub good: usize,
    /// The others by reason, in the order of [`Mask::ALL`].
    pub masked: Vec<(Mask, usize)>,
    /// Share of the region's area that the map reaches at all, 0 to 1.
    pub covered: f64,
    /// θ, rad.
    pub twist: Option<RegionMean>,
    /// Components of the strain vector.
    pub strain: Option<[RegionMean; 2]>,
    /// θ, α and the strain vector of the region as a whole, means of the nodes', with the error of the mean.
    pub mean: Option<TwistStrain>,
    /// Root mean square of the local strain |E| without noise; at least the strain of the mean.
    pub strain_rms: Option<f64>,
    /// Mean of the three wavelengths, nm.
    pub wavelength: Option<RegionMean>,
}

impl RegionStatistics {
    /// The good nodes of a map within a region.
    pub fn new(map: &TwistStrainMap, region: &Region) -> Self {
        let nodes = region.nodes(&map.grid);
        let good: Vec<usize> = nodes
            .iter()
            .copied()
            .filter(|&n| map.mask[n] == Mask::Good)
            .collect();
        let masked = Mask::ALL.into_iter().filter(|m| *m != Mask::Good);
        let masked = masked.map(|m| (m, nodes.iter().filter(|&&n| map.mask[n] == m).count()));
        let pairs = pairs(&map.grid, &good, map.window_nm);
        let of = |value: &dyn Fn(usize) -> [f64; 2]| {
            RegionMean::of(good.iter().map(|&n| value(n)), &pairs)
        };
        let plane = |plane: &crate::map::Plane| {
            of(&|n| {
                let e = plane.at(n);
                [e.value, e.sigma]
            })
        };
        let twist = plane(&map.twist);
        let angle = plane(&map.lattice_angle);
        let strain = plane(&map.strain[0]).zip(plane(&map.strain[1]));
        let strain = strain.map(|(a, b)| [a, b]);
        let covariance = good
            .iter()
            .map(|&n| f64::from(map.strain_covariance[n]))
            .sum::<f64>()
            / good.len().max(1) as f64
            * pairs.mean;
        let mean = twist.zip(angle).zip(strain).map(|((twist, angle), e)| {
            let squares = [twist, angle, e[0], e[1]].map(|q| q.sigma * q.sigma);
            let mut all = Matrix4::from_diagonal(&squares.into());
            all.fixed_view_mut::<2, 2>(2, 2).copy_from(&Matrix2::new(
                squares[2], covariance, covariance, squares[3],
            ));
            TwistStrain {
                twist: twist.mean,
                lattice_angle: angle.mean,
                strain_vector: Vector2::new(e[0].mean, e[1].mean),
                covariance: all,
            }
        });
        let strain_rms = strain.map(|e| {
            let square = |m: RegionMean| m.mean.powi(2) + m.spread.powi(2) - m.noise.powi(2);
            e.map(square).iter().sum::<f64>().max(0.0).sqrt()
        });
        Self {
            region: region.clone(),
            nodes: nodes.len(),
            good: good.len(),
            masked: masked.filter(|(_, count)| *count > 0).collect(),
            covered: (nodes.len() as f64 * map.node_area() / region.area()).min(1.0),
            twist,
            strain,
            mean,
            strain_rms,
            wavelength: of(&|n| mean_wavelength(map, n)),
        }
    }

    /// Share of the nodes in the region that are masked, 0 to 1.
    pub fn masked_share(&self) -> f64 {
        1.0 - self.good as f64 / self.nodes.max(1) as f64
    }
}
