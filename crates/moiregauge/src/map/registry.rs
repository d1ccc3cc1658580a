//! The registry of the two layers on the nodes of a map: what codes for the relaxation of layers start from or are compared with.
//!
//! `d(r) = −A L⁻¹ (r − u(r) − r₀)`: the phases of the pattern, followed from node to node, in vectors of layer 1
//! ([`heterostrain::strain::Registry`]). Its errors are those of the phases. A, one for the whole map, is that of the mean lattice.

use heterostrain::Estimate;
use heterostrain::lattice::Waves;
use heterostrain::material::Bilayer;
use heterostrain::strain::{FixedBranch, Registry, StrainConvention};
use nalgebra::{Matrix2, Vector2};

use crate::map::gauge::Gauge;
use crate::map::quantities::Plane;
use crate::map::sample::LatticeMap;
use crate::window::mask::Mask;

/// The registry from place to place.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RegistryMap {
    /// What it counts from: zero at this node of the pattern, which is a convention.
    pub gauge: Gauge,
    /// Layer 1 and the mean moiré.
    pub layers: Registry,
    /// Displacement of layer 2 against layer 1 along x and y, nm; NaN where phases could not be followed.
    pub registry: [Plane; 2],
    /// The same in vectors a₁, a₂ of layer 1.
    pub shares: [Plane; 2],
    /// Covariance of its two components, nm².
    pub covariance: Vec<f32>,
}

impl LatticeMap {
    /// The registry, with labelling and branch of `reference` (wave vectors, rad/nm); `None` where no phase was followed or
    /// the lattice has no solution.
    pub fn registry<'a>(
        &self,
        reference: &Matrix2<f64>,
        bilayer: impl Into<Bilayer<'a>>,
        convention: StrainConvention,
    ) -> Option<RegistryMap> {
        let gauge = self.gauge?;
        let real = Waves::exact(*reference).lattice()?;
        let branch = FixedBranch::of(&real, bilayer, convention).ok()?;
        let layers = branch.registry(&Waves::exact(gauge.waves).lattice()?)?;
        let shares_of = layers.atoms.try_inverse()? * layers.gradient;
        let mut out = RegistryMap {
            gauge,
            layers,
            registry: Default::default(),
            shares: Default::default(),
            covariance: Vec::with_capacity(self.nodes.len()),
        };
        for (n, node) in self.nodes.iter().enumerate() {
            let known = node.mask == Mask::Good && node.displacement.x.is_finite();
            let way = self.grid.place(n) - node.displacement - gauge.node;
            let variance = &node.displacement_covariance;
            let add = |planes: &mut [Plane; 2], map: &Matrix2<f64>| {
                let value: Vector2<f64> = map * way;
                let covariance = map * variance * map.transpose();
                for (i, plane) in planes.iter_mut().enumerate() {
                    let estimate = Estimate::from_variance(value[i], covariance[(i, i)]);
                    plane.push(known.then_some(estimate));
                }
                covariance[(0, 1)]
            };
            let both = add(&mut out.registry, &layers.gradient);
            add(&mut out.shares, &shares_of);
            let both = if known { both } else { f64::NAN };
            out.covariance.push(both as f32);
        }
        Some(out)
    }
}
