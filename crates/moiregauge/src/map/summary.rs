//! A map in a few numbers: means, and spreads with the noise taken off.

use nalgebra::Vector2;

use crate::map::quantities::{Plane, TwistStrainMap};
use crate::window::mask::Mask;

/// Windows beyond which noise of slopes is not correlated: by 10⁻³ at most.
const REACH: f64 = 6.0;

/// Mean and spread of a quantity over the good nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Mean over the good nodes.
    pub mean: f64,
    /// Its standard error by the noise of the image.
    pub mean_sigma: f64,
    /// Standard deviation over the nodes.
    pub spread: f64,
    /// The same without what noise adds: `√max(0, s² − ⟨σ²⟩)`.
    pub corrected: f64,
    /// Root mean square of the errors of the nodes.
    pub noise: f64,
}

impl TwistStrainMap {
    /// The area of a node, nm².
    pub fn node_area(&self) -> f64 {
        self.grid.step.determinant().abs()
    }

    /// Number of good nodes.
    pub fn good(&self) -> usize {
        self.count(Mask::Good)
    }

    /// Number of nodes with this mask.
    pub fn count(&self, mask: Mask) -> usize {
        self.mask.iter().filter(|m| **m == mask).count()
    }

    /// Mean and spread of one of the planes of this map; `None` without good nodes.
    ///
    /// Nodes under one window share their noise. Of white noise a window of width w leaves phases that are correlated by `e^{−r²/4w²}`, and slopes
    /// of phases, which twist, strain and wavelengths are made of, by the Laplacian of that: `(1 − r²/4w²) e^{−r²/4w²}` over all directions. Slopes so
    /// average to what phases say at the edges. The size of a strain and displacements take windows of `4πw²` as independent: an upper limit.
    pub fn spread(&self, plane: &Plane) -> Option<Spread> {
        self.spread_where(plane, |_| true)
    }

    /// The same over the good nodes that pass.
    pub fn spread_where(&self, plane: &Plane, wanted: impl Fn(usize) -> bool) -> Option<Spread> {
        let good: Vec<[f64; 2]> = (0..self.mask.len())
            .filter(|&n| self.mask[n] == Mask::Good && wanted(n))
            .map(|n| [f64::from(plane.value[n]), f64::from(plane.sigma[n])])
            .filter(|v| v.iter().all(|x| x.is_finite()))
            .collect();
        let count = good.len() as f64;
        if good.is_empty() {
            return None;
        }
        let mean = good.iter().map(|v| v[0]).sum::<f64>() / count;
        let variance = good.iter().map(|v| (v[0] - mean).powi(2)).sum::<f64>() / count;
        let noise = good.iter().map(|v| v[1] * v[1]).sum::<f64>() / count;
        let window = 4.0 * std::f64::consts::PI * self.window_nm * self.window_nm;
        let independent = (count * self.node_area() / window).clamp(1.0, count);
        let of_slopes = self.is_of_slopes(plane);
        let together = of_slopes.then(|| self.noise_of_mean(plane, &wanted));
        Some(Spread {
            mean,
            mean_sigma: together.unwrap_or_else(|| (noise / independent).sqrt()),
            spread: variance.sqrt(),
            corrected: (variance - noise).max(0.0).sqrt(),
            noise: noise.sqrt(),
        })
    }

    /// Whether a plane of this map holds what is linear in slopes of phases.
    fn is_of_slopes(&self, plane: &Plane) -> bool {
        let (strain, waves) = (self.strain.iter(), self.wavelengths.iter());
        let mut all = [&self.twist, &self.lattice_angle, &self.orientation]
            .into_iter()
            .chain(strain)
            .chain(waves);
        all.any(|own| std::ptr::eq(own, plane))
    }

    /// Standard error of the mean of a plane of slopes over the good nodes that pass.
    fn noise_of_mean(&self, plane: &Plane, wanted: &impl Fn(usize) -> bool) -> f64 {
        let [columns, rows] = self.grid.size;
        let sigma = |n: usize| {
            let good = self.mask[n] == Mask::Good && plane.value[n].is_finite() && wanted(n);
            if good { f64::from(plane.sigma[n]) } else { 0.0 }
        };
        let sigmas: Vec<f64> = (0..self.mask.len()).map(sigma).collect();
        let reach = [0, 1].map(|i| {
            let step = self.grid.step.column(i).norm();
            (REACH * self.window_nm / step).ceil() as isize
        });
        // Each pair of nodes once: the row above or, in the same row, to the right.
        let ways =
            (0..=reach[1]).flat_map(|up| (-reach[0]..=reach[0]).map(move |aside| (aside, up)));
        let mut sum: f64 = sigmas.iter().map(|s| s * s).sum();
        for (aside, up) in ways.filter(|(aside, up)| *up > 0 || *aside > 0) {
            let way = self.grid.step * Vector2::new(aside as f64, up as f64);
            let square = way.norm_squared() / (4.0 * self.window_nm * self.window_nm);
            let correlation = (1.0 - square) * (-square).exp();
            let first = aside.min(0).unsigned_abs();
            let across = columns.saturating_sub(aside.unsigned_abs());
            let shift = up * columns as isize + aside;
            let lines = 0..rows.saturating_sub(up.unsigned_abs());
            let products = lines.flat_map(|row| {
                let start = row * columns + first;
                start..start + across
            });
            let products = products.map(|n| sigmas[n] * sigmas[n.wrapping_add_signed(shift)]);
            sum += 2.0 * correlation * products.sum::<f64>();
        }
        let count = sigmas.iter().filter(|s| **s > 0.0).count() as f64;
        sum.max(0.0).sqrt() / count.max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use heterostrain::material::Material;
    use heterostrain::strain::StrainConvention;

    use super::*;
    use crate::frame::geometry::Geometry;
    use crate::map::sample::LatticeMap;
    use crate::map::tests::{map_of, rms};
    use crate::simulate::field::FieldScene;

    /// Means of the twist and of both components of the strain over maps of a uniform lattice with noise, forty frames, miss the truth by what they say.
    #[test]
    fn means_of_slopes_miss_by_their_errors() {
        let geometry = Geometry::of_pitch([256; 2], [1.0; 2], 0.0, Vector2::zeros()).unwrap();
        let (material, convention) = (Material::graphene(), StrainConvention::RealSpace);
        let mut pulls = Vec::new();
        for seed in 0..40 {
            let mut scene = FieldScene::rippled(256, 14.0, 0.0);
            (scene.white, scene.seed) = (0.8, seed);
            let lattices = LatticeMap::new(&map_of(&scene, Some(13.0)), &geometry).unwrap();
            let found = lattices.twist_strain(&scene.pair, &material, convention);
            let map = TwistStrainMap::new(&lattices, &found.unwrap());
            let exact = heterostrain::lattice::Waves::exact(scene.pair);
            let truth = heterostrain::strain::twist_strain(
                &exact.lattice().unwrap(),
                &material,
                convention,
            )
            .unwrap();
            let pull = |plane, truth: f64| {
                let spread = map.spread(plane).unwrap();
                (spread.mean - truth) / spread.mean_sigma
            };
            pulls.push(pull(&map.twist, truth.twist));
            pulls.extend([0, 1].map(|i| pull(&map.strain[i], truth.strain_vector[i])));
        }
        assert!((0.8..1.3).contains(&rms(&pulls)), "{}", rms(&pulls));
    }
}
