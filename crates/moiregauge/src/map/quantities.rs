//! What a map shows: every quantity with its error, as planes of single-precision numbers.

use heterostrain::Estimate;
use heterostrain::strain::TwistStrain;
use nalgebra::Vector2;

use crate::frame::grid_errors::Bends;
use crate::map::nodes::Grid;
use crate::map::sample::LatticeMap;
use crate::window::mask::Mask;

/// One quantity on all nodes, row by row; NaN where there is none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plane {
    /// Values.
    pub value: Vec<f32>,
    /// Standard errors.
    pub sigma: Vec<f32>,
}

impl Plane {
    pub(crate) fn push(&mut self, estimate: Option<Estimate>) {
        let Estimate { value, sigma } = estimate.unwrap_or(Estimate::new(f64::NAN, f64::NAN));
        // What is no number has no sign, lest files differ in bits that say nothing and that compilers choose.
        let plain = |x: f64| if x.is_nan() { f32::NAN } else { x as f32 };
        self.value.push(plain(value));
        self.sigma.push(plain(sigma));
    }

    /// A node's value and error.
    pub fn at(&self, node: usize) -> Estimate {
        Estimate::new(f64::from(self.value[node]), f64::from(self.sigma[node]))
    }
}

/// Maps of twist, strain and lattice. Values are there wherever a lattice was found, also where `mask`
/// says that they are not to be believed; rad, nm, strain without dimension.
///
/// The errors are those of the noise in the image alone: what is common to all nodes (drift, calibration, lattice
/// constant) is not in them.
#[derive(Clone, Debug)]
pub struct TwistStrainMap {
    /// Where the nodes are.
    pub grid: Grid,
    /// Width of the window (standard deviation of the Gaussian), nm.
    pub window_nm: f64,
    /// Row by row.
    pub mask: Vec<Mask>,
    /// θ, rad.
    pub twist: Plane,
    /// α, rad, near that of the mean lattice (not reduced to [0, 60°)).
    pub lattice_angle: Plane,
    /// Components of `E = ε e^{2iφ_lab}`.
    pub strain: [Plane; 2],
    /// Covariance of the two components.
    pub strain_covariance: Vec<f32>,
    /// |E|, the bias of noise removed.
    pub magnitude: Plane,
    /// Axis `φ_lab` of the strain, rad in [0, π); NaN where the strain is not significant (p < 0.01).
    pub axis: Plane,
    /// Lengths of the lattice vectors L₁, L₂ and L₃ = L₂ − L₁, named as in the analysis of the whole image, nm.
    pub wavelengths: [Plane; 3],
    /// Direction of L₁, rad.
    pub orientation: Plane,
    /// Displacement of the pattern against the mean lattice, nm; NaN where the phase could not be followed.
    pub displacement: [Plane; 2],
    /// χ² per degree of freedom of the closure.
    pub closure: Vec<f32>,
    /// `∂_x q_y − ∂_y q_x` of the worse of q₁ and q₂, rad/nm²; 0 for a lattice without tears.
    pub curl: Vec<f32>,
    /// Signal over noise (amplitude) under the window.
    pub signal_to_noise: Vec<f32>,
    /// Standard errors of twist (rad) and both components of the strain by bends of the grid that no sensor told; NaN where they were not asked for.
    /// They are in no other number.
    pub of_bends: [Vec<f32>; 3],
    /// The grain that each node belongs to, counted from 1, and 0 of none; empty where the map shows one lattice.
    pub grain: Vec<u8>,
}

impl TwistStrainMap {
    /// Collects a lattice map and its twists and strains ([`LatticeMap::twist_strain`]).
    pub fn new(map: &LatticeMap, found: &[Option<TwistStrain>]) -> Self {
        let mut out = Self {
            grid: map.grid,
            window_nm: map.window_nm,
            mask: Vec::new(),
            twist: Plane::default(),
            lattice_angle: Plane::default(),
            strain: Default::default(),
            strain_covariance: Vec::new(),
            magnitude: Plane::default(),
            axis: Plane::default(),
            wavelengths: Default::default(),
            orientation: Plane::default(),
            displacement: Default::default(),
            closure: Vec::new(),
            curl: curl(map),
            signal_to_noise: Vec::new(),
            of_bends: [(); 3].map(|()| vec![f32::NAN; map.nodes.len()]),
            grain: Vec::new(),
        };
        for (node, found) in map.nodes.iter().zip(found) {
            let mask = match node.mask {
                Mask::Good if found.is_none() => Mask::NoSolution,
                other => other,
            };
            out.mask.push(mask);
            out.twist.push(found.map(|f| f.twist()));
            out.lattice_angle.push(found.map(|f| f.lattice_angle()));
            for (i, plane) in out.strain.iter_mut().enumerate() {
                let component = |f: TwistStrain| {
                    Estimate::from_variance(f.strain_vector[i], f.strain().covariance[(i, i)])
                };
                plane.push(found.map(component));
            }
            let covariance = found.map_or(f64::NAN, |f| f.strain().covariance[(0, 1)]);
            out.strain_covariance.push(covariance as f32);
            out.magnitude.push(found.map(|f| f.heterostrain()));
            out.axis.push(found.and_then(|f| f.axis_lab()));
            let known = node.waves.basis.iter().all(|x| x.is_finite());
            let real = known.then(|| node.waves.lattice_named_alike()).flatten();
            for (i, plane) in out.wavelengths.iter_mut().enumerate() {
                plane.push(real.map(|l| l.wavelength(i)));
            }
            out.orientation.push(real.map(|l| l.polar_angle(0)));
            for (i, plane) in out.displacement.iter_mut().enumerate() {
                let variance = node.displacement_covariance[(i, i)];
                plane.push(Some(Estimate::from_variance(
                    node.displacement[i],
                    variance,
                )));
            }
            let closure = node.chi2 / node.freedom as f64;
            out.closure.push(if node.freedom > 0 {
                closure as f32
            } else {
                f32::NAN
            });
            out.signal_to_noise.push(node.signal_to_noise.sqrt() as f32);
        }
        out
    }

    /// With what [`LatticeMap::of_bends`] says.
    #[must_use]
    pub fn with_bends(mut self, of_bends: &[[f32; 3]]) -> Self {
        for (i, plane) in self.of_bends.iter_mut().enumerate() {
            *plane = of_bends.iter().map(|of| of[i]).collect();
        }
        self
    }

    /// The root mean square of one of `of_bends` over the good nodes; `None` where it is not known.
    pub fn rms_of_bends(&self, index: usize) -> Option<f64> {
        let all = self.of_bends[index].iter().zip(&self.mask);
        let good = all.filter(|(of, mask)| **mask == Mask::Good && of.is_finite());
        let (sum, count) = good.fold((0.0, 0.0), |(sum, count), (of, _)| {
            (sum + f64::from(*of).powi(2), count + 1.0)
        });
        (count > 0.0).then(|| f64::sqrt(sum / count))
    }
}

impl TwistStrainMap {
    /// All numbers but the mask, in a fixed order: for keeping parts of a map on disk.
    pub fn planes_mut(&mut self) -> Vec<&mut Vec<f32>> {
        let [e1, e2] = &mut self.strain;
        let [l1, l2, l3] = &mut self.wavelengths;
        let [ux, uy] = &mut self.displacement;
        let both = [
            &mut self.twist,
            &mut self.lattice_angle,
            e1,
            e2,
            &mut self.magnitude,
            &mut self.axis,
            l1,
            l2,
            l3,
            &mut self.orientation,
            ux,
            uy,
        ];
        let mut all: Vec<&mut Vec<f32>> = both
            .into_iter()
            .flat_map(|plane| [&mut plane.value, &mut plane.sigma])
            .collect();
        all.extend([
            &mut self.strain_covariance,
            &mut self.closure,
            &mut self.curl,
            &mut self.signal_to_noise,
        ]);
        all.extend(&mut self.of_bends);
        all
    }

    /// Puts the rows of `other`, which follow on those of this map, behind them.
    pub fn append(&mut self, mut other: Self) {
        self.grid.size[1] += other.grid.size[1];
        self.mask.append(&mut other.mask);
        for (mine, more) in self.planes_mut().into_iter().zip(other.planes_mut()) {
            mine.append(more);
        }
    }

    /// A map without nodes, to append to.
    pub fn empty(grid: Grid, window_nm: f64) -> Self {
        let none = LatticeMap {
            grid: Grid {
                size: [grid.size[0], 0],
                ..grid
            },
            window_nm,
            gauge: None,
            bends: Bends {
                centre: Vector2::zeros(),
                range: Vector2::zeros(),
                from_sensors: false,
            },
            nodes: Vec::new(),
        };
        Self::new(&none, &[])
    }
}

/// The curl of the wave vectors by differences of neighbours; NaN at edges and beside gaps.
fn curl(map: &LatticeMap) -> Vec<f32> {
    let [columns, rows] = map.grid.size;
    let Some(inverse) = map.grid.step.try_inverse() else {
        return vec![f32::NAN; map.nodes.len()];
    };
    let of_node = |node: usize| {
        let (column, row) = (node % columns, node / columns);
        if column == 0 || row == 0 || column + 1 >= columns || row + 1 >= rows {
            return f64::NAN;
        }
        let waves = |n: usize| map.nodes[n].waves.basis;
        let along = (waves(node + 1) - waves(node - 1)) / 2.0;
        let across = (waves(node + columns) - waves(node - columns)) / 2.0;
        // Per node → per nm: ∂/∂x = Σ inverse(i, x) ∂/∂i.
        let slope = |axis: usize| along * inverse[(0, axis)] + across * inverse[(1, axis)];
        let (x, y) = (slope(0), slope(1));
        let curl = Vector2::new(x[(1, 0)] - y[(0, 0)], x[(1, 1)] - y[(0, 1)]);
        if curl.x.abs() > curl.y.abs() {
            curl.x
        } else {
            curl.y
        }
    };
    (0..map.nodes.len()).map(|n| of_node(n) as f32).collect()
}
