//! Means and spreads over an area.

use heterostrain::strain::TwistStrain;
use nalgebra::{Matrix2, Matrix4, Vector2};

use crate::map::quantities::{Plane, TwistStrainMap};
use crate::region::correlation::{Pairs, pairs};
use crate::region::polygon::Region;
use crate::region::smoothing::{Bends, Bent};
use crate::window::mask::Mask;

/// Mean and spread of a quantity over an area.
///
/// With weights `w_i` that add up to one, errors `σ_i` and correlations `ρ_ij` of the noise of nodes:
/// `var(mean) = ⟨σ²⟩ Σ w_i w_j ρ_ij`, and the expected square scatter about the mean is
/// `v + ⟨σ²⟩(1 − Σ w_i w_j ρ_ij)` with v that of the quantity itself.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RegionMean {
    /// Mean over the area of the good nodes.
    pub mean: f64,
    /// Its standard error: noise and `blur`.
    pub sigma: f64,
    /// How far the window's smoothing has moved the mean, as the curvature of the map tells; 0 where that may be noise.
    pub blur: f64,
    /// Standard deviation over the nodes.
    pub spread: f64,
    /// The same without what noise adds, 0 where noise explains it.
    pub corrected: f64,
    /// What the spread of the lattice does not exceed, with 95 % confidence as far as noise goes, for changes over no
    /// less than some eight windows: noise and `widening` are in it.
    pub below: f64,
    /// Factor by which smoothing with the window may have reduced the spread, from the curvature of the map.
    pub widening: f64,
    /// Root mean square of the errors of the nodes.
    pub noise: f64,
}

impl RegionMean {
    /// From sums of weights, values, their squares and variances of their noise, and those of
    /// [`Bends::widening`].
    pub(crate) fn of_sums(
        [weight, sum, squares, variances]: [f64; 4],
        bends: &Bends,
        bent: &Bent,
        pairs: &Pairs,
    ) -> Option<Self> {
        if !(weight > 0.0) {
            return None;
        }
        let mean = sum / weight;
        let variance = (squares / weight - mean * mean).max(0.0);
        let noise = variances / weight;
        let own = variance - noise * (1.0 - pairs.mean).max(0.0);
        let doubt = ((2.0 * noise * noise + 4.0 * own.max(0.0) * noise) * pairs.square).sqrt();
        let widening = bends.widening([own.max(0.0), doubt], mean, bent);
        Some(Self {
            mean,
            sigma: (noise * pairs.mean).sqrt(),
            blur: 0.0,
            spread: variance.sqrt(),
            corrected: own.max(0.0).sqrt(),
            below: (own.max(0.0) + 1.645 * doubt).sqrt() * widening,
            widening,
            noise: noise.sqrt(),
        })
    }

    /// The same in another unit.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        let size = factor.abs();
        Self {
            mean: self.mean * factor,
            sigma: self.sigma * size,
            blur: self.blur * size,
            spread: self.spread * size,
            corrected: self.corrected * size,
            below: self.below * size,
            widening: self.widening,
            noise: self.noise * size,
        }
    }
}

/// The nodes of an area and what their noise does together.
struct Area<'a> {
    map: &'a TwistStrainMap,
    /// Good nodes with weights that add up to one.
    nodes: Vec<(usize, f64)>,
    pairs: Pairs,
    /// Nodes with weights that make `½ w² ∇²` of a quantity, mean over the area, out of its values.
    curvature: Vec<(usize, f64)>,
    curvature_pairs: Pairs,
    bends: Bends,
}

impl<'a> Area<'a> {
    fn new(map: &'a TwistStrainMap, mut nodes: Vec<(usize, f64)>) -> Self {
        let all: f64 = nodes.iter().map(|n| n.1).sum();
        for node in &mut nodes {
            node.1 /= all;
        }
        let curvature = curvature(map, &nodes);
        Self {
            pairs: pairs(&map.grid, &nodes, map.window_nm),
            curvature_pairs: pairs(&map.grid, &curvature, map.window_nm),
            bends: Bends::new(map),
            map,
            nodes,
            curvature,
        }
    }

    /// Mean and spread of (value, σ) at nodes; what is not finite is left out.
    fn mean(&self, value: &dyn Fn(usize) -> [f64; 2]) -> Option<RegionMean> {
        let known = self.nodes.iter().map(|&(n, w)| (value(n), w));
        let known: Vec<([f64; 2], f64)> = known
            .filter(|(v, _)| v.iter().all(|x| x.is_finite()))
            .collect();
        // Against one of them, so that squares keep their digits.
        let offset = known.first()?.0[0];
        let sums = known.iter().fold([0.0; 4], |s, ([value, sigma], w)| {
            let v = value - offset;
            [
                s[0] + w,
                s[1] + w * v,
                s[2] + w * v * v,
                s[3] + w * sigma * sigma,
            ]
        });
        let all = self.nodes.iter();
        let bent = all.fold(Bent::default(), |sums, &(n, w)| {
            match self.bends.at(self.map, n, value) {
                Some(bend) => sums.and(w, value(n)[0] - offset, bend),
                None => sums,
            }
        });
        let found = RegionMean::of_sums(sums, &self.bends, &bent, &self.pairs)?;
        let bend: f64 = self.curvature.iter().map(|&(n, w)| w * value(n)[0]).sum();
        let by_noise = found.noise * found.noise * self.curvature_pairs.mean;
        let blur = (bend * bend - by_noise).max(0.0);
        Some(RegionMean {
            mean: found.mean + offset,
            blur: blur.sqrt(),
            sigma: (found.sigma * found.sigma + blur).sqrt(),
            ..found
        })
    }

    fn plane(&self, plane: &Plane) -> Option<RegionMean> {
        self.mean(&|n| {
            let e = plane.at(n);
            [e.value, e.sigma]
        })
    }

    /// Mean of the covariances of the two components of strain, as far as their noise goes.
    fn strain_covariance(&self) -> f64 {
        let all = self.nodes.iter();
        let mean: f64 = all
            .map(|&(n, w)| w * f64::from(self.map.strain_covariance[n]))
            .sum();
        mean * self.pairs.mean
    }
}

/// Weights for the mean of `½ w² ∇²` by differences over about a window along both axes of the grid, which stand nearly
/// upright on each other; nodes without good neighbours at that distance are left out.
fn curvature(map: &TwistStrainMap, nodes: &[(usize, f64)]) -> Vec<(usize, f64)> {
    let [columns, rows] = map.grid.size;
    let lengths = [0, 1].map(|i| map.grid.step.column(i).norm());
    let apart = lengths.map(|l| (map.window_nm / l).round().max(1.0));
    let factor = [0, 1].map(|i| 0.5 * (map.window_nm / (apart[i] * lengths[i])).powi(2));
    let [across, up] = apart.map(|a| a as usize);
    let good = |n: usize| map.mask[n] == Mask::Good && map.twist.value[n].is_finite();
    let beside = |node: usize| {
        let (column, row) = (node % columns, node / columns);
        let inside = column >= across && column + across < columns && row >= up && row + up < rows;
        let four = inside.then(|| {
            [
                node - across,
                node + across,
                node - up * columns,
                node + up * columns,
            ]
        });
        four.filter(|four| four.iter().all(|n| good(*n)))
    };
    let used: Vec<(usize, f64, [usize; 4])> = nodes
        .iter()
        .filter_map(|&(n, w)| Some((n, w, beside(n)?)))
        .collect();
    let all: f64 = used.iter().map(|u| u.1).sum();
    let mut weights = std::collections::BTreeMap::<usize, f64>::new();
    for (node, weight, four) in used {
        for (n, other) in four.into_iter().enumerate() {
            *weights.entry(other).or_default() += factor[n / 2] * weight / all;
        }
        *weights.entry(node).or_default() -= 2.0 * (factor[0] + factor[1]) * weight / all;
    }
    weights.into_iter().collect()
}

/// A region of a map in numbers. Errors are those of image noise and of what the window smooths; what all nodes have in
/// common (drift, calibration, lattice constant, model) is not in them.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RegionStatistics {
    /// The region.
    pub region: Region,
    /// Its area, nm²; of a grain that of its nodes.
    pub area_nm2: f64,
    /// Nodes whose cells the area covers at least in part.
    pub nodes: usize,
    /// Good nodes.
    pub good: usize,
    /// The others by reason, in the order of [`Mask::ALL`].
    pub masked: Vec<(Mask, usize)>,
    /// Share of the area within the map that is masked, 0 to 1.
    pub masked_share: f64,
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
        Self::of_nodes(map, region, region.area(), &region.shares(&map.grid))
    }

    /// The good nodes of a grain of a map, which has no corners; `None` where no node is of it.
    pub fn of_grain(map: &TwistStrainMap, number: u8) -> Option<Self> {
        let all = map.grain.iter().enumerate();
        let own = all.filter(|(_, grain)| **grain == number);
        let nodes: Vec<(usize, f64)> = own.map(|(node, _)| (node, 1.0)).collect();
        let region = Region {
            name: format!("grain {number}"),
            corners: Vec::new(),
        };
        let area = nodes.len() as f64 * map.node_area();
        (!nodes.is_empty()).then(|| Self::of_nodes(map, &region, area, &nodes))
    }

    fn of_nodes(
        map: &TwistStrainMap,
        region: &Region,
        area_nm2: f64,
        shares: &[(usize, f64)],
    ) -> Self {
        let (good, masked): (Vec<_>, Vec<_>) = shares
            .iter()
            .copied()
            .partition(|(n, _)| map.mask[*n] == Mask::Good);
        let of_mask = |m: Mask| masked.iter().filter(|(n, _)| map.mask[*n] == m).count();
        let sum = |nodes: &[(usize, f64)]| nodes.iter().map(|n| n.1).sum::<f64>();
        let (all, believed) = (sum(shares), sum(&good));
        let counts = (shares.len(), good.len());
        let area = Area::new(map, good);
        let twist = area.plane(&map.twist);
        let angle = area.plane(&map.lattice_angle);
        let strain = area.plane(&map.strain[0]).zip(area.plane(&map.strain[1]));
        let strain = strain.map(|(a, b)| [a, b]);
        let covariance = area.strain_covariance();
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
            area_nm2,
            nodes: counts.0,
            good: counts.1,
            masked: Mask::ALL
                .into_iter()
                .map(|m| (m, of_mask(m)))
                .filter(|(_, count)| *count > 0)
                .collect(),
            masked_share: 1.0 - if all > 0.0 { believed / all } else { 0.0 },
            covered: (all * map.node_area() / area_nm2).min(1.0),
            twist,
            strain,
            mean,
            strain_rms,
            wavelength: area.mean(&|n| mean_wavelength(map, n)),
        }
    }
}

/// The mean of the three wavelengths at a node with an upper limit of its error, nm.
pub(crate) fn mean_wavelength(map: &TwistStrainMap, node: usize) -> [f64; 2] {
    let three = map.wavelengths.each_ref().map(|w| w.at(node));
    let value = three.iter().map(|w| w.value).sum::<f64>() / 3.0;
    let sigma = three.iter().map(|w| w.sigma).sum::<f64>() / 3.0;
    [value, sigma]
}
