//! Maps in the coordinates of the atoms of a layer.
//!
//! The atoms of a frame are demodulated under the windows of its moiré. Where a scanner creeps or bends slowly, the local lattices of both go
//! through the same map, so that a node's moiré in the coordinates of its own atoms is free of it
//! ([`heterostrain::strain::Ruler`], with the covariance of both). Waves of the atoms that the moiré changes, `b ± m`, do not reach
//! through a window as wide as its cell.

use heterostrain::lattice::Waves;
use heterostrain::material::{Bilayer, Material};
use heterostrain::strain::{Ruler, StrainTensor, TwistStrain};
use nalgebra::{Matrix2, Matrix4, Vector2};
use rayon::prelude::*;

use crate::frame::geometry::Geometry;
use crate::map::sample::LatticeMap;
use crate::map::scanner::straight;
use crate::window::mask::Mask;
use crate::window::types::WaveMap;

impl LatticeMap {
    /// Twist and strain of every node that has a lattice, with the orientation of the ruler, which is layer 1 or layer 2: the solution next
    /// to the `twist` (rad) of the whole.
    pub fn twist_strain_by(
        &self,
        ruler: &Ruler,
        layer: u8,
        twist: f64,
        bilayer: Bilayer<'_>,
    ) -> Vec<Option<TwistStrain>> {
        let nu = bilayer.stretched.poisson_ratio;
        let found = self.nodes.par_iter().map(|node| {
            let finite = node.waves.basis.iter().all(|x| x.is_finite());
            let lattice = finite.then(|| node.waves.lattice())??;
            let all = ruler.tensors(&lattice, bilayer, layer).ok()?;
            let off = |found: &StrainTensor| (found.twist - twist).abs();
            let nearest = all.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
            Some(nearest.uniaxial(nu))
        });
        found.collect()
    }

    /// Measures every node by its own atoms of a layer of `material`: `waves` is their map, of the frame that `placed` describes. Nodes
    /// without atoms are weak. Whether most of the good nodes have them; otherwise nothing is changed.
    pub(crate) fn rule_nodes(
        &mut self,
        waves: &WaveMap,
        placed: &Geometry,
        material: &Material,
        angle: f64,
    ) -> bool {
        let waves = &*straight(waves, placed);
        let Some(to_pixels) = placed.pixel_to_nm.try_inverse() else {
            return false;
        };
        let dual = to_pixels.transpose();
        let ruler = |node: usize| {
            let at = to_pixels * (self.grid.place(node) - placed.origin);
            let (pair, covariance) = between(waves, &at)?;
            let atoms = Waves::new(pair, covariance).in_nm(&dual).lattice()?;
            Ruler::new(&atoms, material, angle)
        };
        let rulers: Vec<Option<Ruler>> = (0..self.nodes.len()).into_par_iter().map(ruler).collect();
        let good = || {
            let nodes = self.nodes.iter().zip(&rulers);
            nodes.filter(|(node, _)| node.mask == Mask::Good)
        };
        if 2 * good().filter(|(_, ruler)| ruler.is_some()).count() <= good().count() {
            return false;
        }
        for (node, ruler) in self.nodes.iter_mut().zip(rulers) {
            let finite = node.waves.basis.iter().all(|x| x.is_finite());
            let lattice = node.waves.lattice().filter(|_| finite);
            let ruled = ruler.zip(lattice);
            match ruled.and_then(|(ruler, lattice)| ruler.measured(&lattice).waves()) {
                Some(waves) => node.waves = waves,
                None if node.mask == Mask::Good => node.mask = Mask::Weak,
                None => {}
            }
        }
        true
    }
}

/// The lattice of a map between its nodes, and its covariance; `None` where a node beside the place has none.
fn between(map: &WaveMap, at: &Vector2<f64>) -> Option<(Matrix2<f64>, Matrix4<f64>)> {
    let from = at - map.first;
    let steps = [from.x / map.step[0], from.y / map.step[1]];
    let last = map.size.map(|n| n.saturating_sub(2) as f64);
    let first = [0, 1].map(|i| steps[i].floor().clamp(0.0, last[i]));
    let (mut pair, mut covariance) = (Matrix2::zeros(), Matrix4::zeros());
    for (column, row) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let share = |i: usize, side: usize| {
            let along = steps[i] - first[i];
            if side == 1 { along } else { 1.0 - along }
        };
        let weight = share(0, column) * share(1, row);
        let node = (first[1] as usize + row) * map.size[0] + first[0] as usize + column;
        let node = map.nodes.get(node)?;
        let known = matches!(node.mask, Mask::Good | Mask::Margin);
        if !known || !node.pair.iter().all(|q| q.is_finite()) {
            return None;
        }
        pair += node.pair * weight;
        covariance += node.covariance * weight;
    }
    Some((pair, covariance))
}
