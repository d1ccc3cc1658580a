//! Triangles of nodes in pixels → twist and strain of each on the sample.
//!
//! The edges of a triangle are lattice vectors of the moiré there. With integer steps S (2 × 2) of two edges E: the
//! primitive vectors are `E S⁻¹`, linear in the three places, so that the errors of the nodes are carried on exactly.

use heterostrain::lattice::Lattice;
use heterostrain::material::Bilayer;
use heterostrain::strain::{FixedBranch, StrainConvention, StrainError, TwistStrain};
use nalgebra::{Matrix2, Matrix4, Vector2};

use crate::domains::mesh::{Dislocation, Mesh, MeshTriangle};
use crate::domains::nodes::{Contrast, FoundNodes};
use crate::frame::geometry::Geometry;

/// A triangle on the sample.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct DomainCell {
    /// Its nodes.
    pub nodes: [usize; 3],
    /// Its middle, nm.
    pub centre: Vector2<f64>,
    /// Primitive vectors of the moiré here, 60° apart, nm.
    pub lattice: Lattice,
    /// Twist and strain; `None` if no layers explain the triangle.
    pub twist_strain: Option<TwistStrain>,
}

/// The domain structure on the sample, nm.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DomainMap {
    /// Places of the nodes.
    pub nodes: Vec<Vector2<f64>>,
    /// Their covariances, nm².
    pub covariances: Vec<Matrix2<f64>>,
    /// (h, k) of every node in the mesh.
    pub indices: Vec<Option<[i32; 2]>>,
    /// Cells.
    pub cells: Vec<DomainCell>,
    /// Where nodes are missing.
    pub missing: Vec<Vector2<f64>>,
    /// Nodes within the mesh that fit into no cell.
    pub extra: Vec<usize>,
    /// Dislocations, places in nm.
    pub dislocations: Vec<Dislocation>,
    /// Bright or dark nodes.
    pub contrast: Contrast,
    /// Whether the image tells that by itself.
    pub contrast_is_clear: bool,
    /// The mean lattice of the cells, nm.
    pub mean: Matrix2<f64>,
}

impl DomainMap {
    /// Takes nodes and mesh to the sample (`placed`: pixels → nm, drift taken off) and inverts every cell.
    /// `None` without cells or with a singular geometry.
    ///
    /// # Errors
    /// What the mean lattice lacks for the inversion.
    pub fn new<'a>(
        found: &FoundNodes,
        mesh: &Mesh,
        placed: &Geometry,
        bilayer: impl Into<Bilayer<'a>>,
        convention: StrainConvention,
    ) -> Option<Result<Self, StrainError>> {
        let j = placed.pixel_to_nm;
        let nodes: Vec<Vector2<f64>> = found.nodes.iter().map(|n| placed.at(n.place)).collect();
        let covariances: Vec<Matrix2<f64>> = found
            .nodes
            .iter()
            .map(|n| j * n.covariance * j.transpose())
            .collect();
        let mut cells = cells(mesh, &nodes, &covariances)?;
        if cells.is_empty() {
            return None;
        }
        // On the sample the pair may stand clockwise: a mirrored scan.
        if j.determinant() < 0.0 {
            let swap = Matrix2::new(0.0, 1.0, 1.0, 0.0);
            for cell in &mut cells {
                cell.lattice = cell.lattice.relabelled(&swap);
            }
        }
        let sum: Matrix2<f64> = cells.iter().map(|c| c.lattice.basis).sum();
        let mean = sum / cells.len() as f64;
        let exact = Lattice::new(mean, Matrix4::zeros());
        let branch = match FixedBranch::of(&exact, bilayer, convention) {
            Ok(branch) => branch,
            Err(why) => return Some(Err(why)),
        };
        for cell in &mut cells {
            cell.twist_strain = branch.at(&cell.lattice);
        }
        Some(Ok(Self {
            indices: mesh.indices.clone(),
            missing: mesh.missing.iter().map(|p| placed.at(*p)).collect(),
            extra: mesh.extra.clone(),
            dislocations: mesh
                .dislocations
                .iter()
                .map(|d| Dislocation {
                    place: placed.at(d.place),
                    ..*d
                })
                .collect(),
            contrast: found.contrast,
            contrast_is_clear: found.contrast_is_clear,
            nodes,
            covariances,
            cells,
            mean,
        }))
    }
}

/// The triangles of a mesh of nodes on the sample.
fn cells(
    mesh: &Mesh,
    nodes: &[Vector2<f64>],
    covariances: &[Matrix2<f64>],
) -> Option<Vec<DomainCell>> {
    let of_triangle = |triangle: &MeshTriangle| {
        let corners = triangle.nodes.map(|n| nodes[n]);
        let errors = triangle.nodes.map(|n| covariances[n]);
        Some(DomainCell {
            nodes: triangle.nodes,
            centre: corners.iter().sum::<Vector2<f64>>() / 3.0,
            lattice: cell(&corners, &errors, &triangle.steps)?,
            twist_strain: None,
        })
    };
    mesh.triangles.iter().map(of_triangle).collect()
}

/// Primitive vectors from the corners of a triangle with their covariances and the steps of its edges.
fn cell(
    corners: &[Vector2<f64>; 3],
    errors: &[Matrix2<f64>; 3],
    steps: &[[i32; 2]; 3],
) -> Option<Lattice> {
    let [s, t] = [0, 1].map(|i| Vector2::from(steps[i].map(f64::from)));
    let inverse = Matrix2::from_columns(&[s, t]).try_inverse()?;
    let edges = Matrix2::from_columns(&[corners[1] - corners[0], corners[2] - corners[1]]);
    // basis = Σ r_v w_vᵀ.
    let (m, n) = (inverse.row(0).transpose(), inverse.row(1).transpose());
    let weights = [-m, m - n, n];
    let mut covariance = Matrix4::zeros();
    for (w, error) in weights.iter().zip(errors) {
        for (a, b) in (0..4).flat_map(|a| (0..4).map(move |b| (a, b))) {
            covariance[(a, b)] += w[a / 2] * w[b / 2] * error[(a % 2, b % 2)];
        }
    }
    Some(Lattice::new(edges * inverse, covariance))
}
