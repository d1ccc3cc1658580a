//! The pattern of a map: its mean lattice, the undistorted image, the averaged cell, the registry of the layers.

use moiregauge::map::RegistryMap;
use moiregauge::survey::MappedPattern;
use nalgebra::Matrix2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The pattern of one image as its map shows it.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct PatternResult {
    /// The file as the user named it.
    pub file: String,
    /// `trace` or `retrace`.
    pub line: String,
    /// The channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Whether the drift is taken off.
    pub drift_corrected: bool,
    /// L₁ and L₂ of the mean lattice, nm.
    pub lattice_vectors_nm: [[f64; 2]; 2],
    /// A node of the mean lattice, nm: corners of the averaged cell are such nodes.
    pub node_nm: [f64; 2],
    /// `bright` or `dark`: what the nodes are.
    pub nodes_are: String,
    /// The image with the displacement of its pattern taken off. Resampled to be shown: nothing is measured from it.
    pub undistorted: UndistortedResult,
    /// The averaged cell; nothing where fewer than two cells of the image are known.
    pub cell: Option<MeanCellResult>,
}

/// The undistorted image.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct UndistortedResult {
    /// Columns and rows.
    pub pixels: [usize; 2],
    /// Distance of its pixels, nm.
    pub pitch_nm: f64,
    /// Its bottom left pixel, nm.
    pub origin_nm: [f64; 2],
    /// Share of its pixels that are not missing.
    pub known_percent: f64,
}

/// The averaged cell.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct MeanCellResult {
    /// Bins along each vector.
    pub bins: usize,
    /// Moiré cells of the image with pixels in it.
    pub cells: usize,
    /// Pixels that were averaged.
    pub pixels: u64,
    /// Root mean square of the standard errors of the bins, unit of the channel.
    pub sigma: Option<f64>,
}

impl From<&MappedPattern> for PatternResult {
    fn from(found: &MappedPattern) -> Self {
        let shown = &found.undistorted;
        Self {
            file: found.file.clone(),
            line: match found.line {
                spmfile::LineDirection::Trace => "trace",
                spmfile::LineDirection::Retrace => "retrace",
            }
            .to_owned(),
            channel: found.channel.clone(),
            unit: found.unit.clone(),
            drift_corrected: found.drift_corrected,
            lattice_vectors_nm: columns(&found.gauge.vectors),
            node_nm: found.gauge.node.into(),
            nodes_are: brightness(found.gauge.bright),
            undistorted: UndistortedResult {
                pixels: [shown.image.columns, shown.image.rows],
                pitch_nm: shown.pitch,
                origin_nm: shown.origin.into(),
                known_percent: 100.0 * shown.known,
            },
            cell: found.cell.as_ref().map(|cell| MeanCellResult {
                bins: cell.bins,
                cells: cell.all_cells,
                pixels: cell.pixels.iter().map(|n| u64::from(*n)).sum(),
                sigma: rms(cell.sigma.iter().copied()),
            }),
        }
    }
}

/// The registry of the layers: what its numbers in `displacement.csv` and `map.zarr` count from.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct RegistryResult {
    /// What it is, and how signs and zero are chosen.
    pub convention: String,
    /// Atomic vectors a₁ and a₂ of layer 1 (A as columns), nm.
    pub layer_1_vectors_nm: [[f64; 2]; 2],
    /// Moiré vectors of the same names (L as columns), nm: along each the registry changes by minus one vector of layer 1.
    pub moire_vectors_nm: [[f64; 2]; 2],
    /// r₀, the node of the pattern where the registry is zero, nm.
    pub zero_nm: [f64; 2],
    /// `bright` or `dark`: what that node is.
    pub zero_is: String,
    /// Nodes of the map where it is known.
    pub nodes: usize,
    /// Root mean square error of a component, nm.
    pub sigma_nm: Option<f64>,
}

const CONVENTION: &str = "registry of layer 2 against layer 1, d(r) = −A L⁻¹ (r − u(r) − r₀) with the displacement u of the \
                          pattern: atoms of layer 2 less those of layer 1 at r, up to a lattice vector of layer 1; continuous where \
                          phases are followed; nm, x right, y up. Layer 1 is taken as perfect, at the orientation of the mean \
                          lattice. Zero at a node of the pattern and the sign (that of a positive twist) are conventions: an \
                          image of the moiré tells neither which stacking a node has nor which layer is above";

impl From<&RegistryMap> for RegistryResult {
    fn from(found: &RegistryMap) -> Self {
        let known = found.registry[0].value.iter().filter(|v| v.is_finite());
        let sigmas = found.registry.iter().flat_map(|plane| &plane.sigma);
        Self {
            convention: CONVENTION.to_owned(),
            layer_1_vectors_nm: columns(&found.layers.atoms),
            moire_vectors_nm: columns(&found.layers.moire),
            zero_nm: found.gauge.node.into(),
            zero_is: brightness(found.gauge.bright),
            nodes: known.count(),
            sigma_nm: rms(sigmas.map(|s| f64::from(*s))),
        }
    }
}

fn columns(vectors: &Matrix2<f64>) -> [[f64; 2]; 2] {
    [0, 1].map(|i| vectors.column(i).into_owned().into())
}

fn brightness(bright: bool) -> String {
    if bright { "bright" } else { "dark" }.to_owned()
}

fn rms(values: impl Iterator<Item = f64>) -> Option<f64> {
    let finite = values.filter(|v| v.is_finite());
    let (sum, count) = finite.fold((0.0, 0.0f64), |(s, n), v| (s + v * v, n + 1.0));
    (count > 0.0).then(|| (sum / count).sqrt())
}
