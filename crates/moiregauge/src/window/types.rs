//! What goes into a map of one image and what comes out, in pixels.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector3};

use crate::numbers::three::three;
use crate::window::mask::Mask;

/// How maps are made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Resolution {
    /// Width of the Gaussian window (standard deviation), nm; `None`: as wide as the lattice is straight.
    pub window_nm: Option<f64>,
    /// Distance of the nodes, nm; `None`: a third of the window, two pixels at least.
    pub step_nm: Option<f64>,
    /// Margin at the edges of the frame, in window widths; `None`: two, or a quarter of the frame where that is less.
    pub margin: Option<f64>,
}

/// Margin in windows where nobody asks for another: 2 % of the window lies beyond the frame there, ...
const MARGIN: f64 = 2.0;
/// ... and as a share of the shorter side of small frames: a quarter of the area is left.
const OF_SIDE: f64 = 0.25;

/// What no image can give.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ResolutionError {
    /// The window is wider than the image.
    #[error(
        "a window of {window_nm} nm does not fit into this image. Its width must be positive, and {widths} times the \
         width must fit into the shorter side, {side_nm:.1} nm"
    )]
    Window {
        /// What was asked for.
        window_nm: f64,
        /// How many widths have to fit.
        widths: f64,
        /// Shorter side of the image.
        side_nm: f64,
    },
    /// The nodes are farther from each other than the image is wide.
    #[error(
        "nodes {step_nm} nm apart do not fit into this image. Their distance must be positive and at most the shorter \
         side, {side_nm:.1} nm"
    )]
    Step {
        /// What was asked for.
        step_nm: f64,
        /// Shorter side of the image.
        side_nm: f64,
    },
}

/// Full width of a Gaussian window at half maximum, in standard deviations.
pub(crate) const FULL_WIDTH: f64 = 2.35;

impl Resolution {
    /// Whether a map with this resolution can be made of an image with sides in nm, of which `widths` windows
    /// have to fit into the shorter.
    ///
    /// # Errors
    /// [`ResolutionError`], where not.
    pub(crate) fn fits(&self, sides: [f64; 2], widths: f64) -> Result<(), ResolutionError> {
        let side_nm = sides[0].min(sides[1]);
        if let Some(window_nm) = self.window_nm
            && !(window_nm > 0.0 && widths * window_nm <= side_nm)
        {
            return Err(ResolutionError::Window {
                window_nm,
                widths,
                side_nm,
            });
        }
        match self.step_nm {
            Some(step_nm) if !(step_nm > 0.0 && step_nm <= side_nm) => {
                Err(ResolutionError::Step { step_nm, side_nm })
            }
            _ => Ok(()),
        }
    }

    /// The margin, in window widths, of a frame with sides in nm.
    pub fn margin_of(&self, window_nm: f64, sides: [f64; 2]) -> f64 {
        let most = OF_SIDE * sides[0].min(sides[1]) / window_nm;
        self.margin.unwrap_or(MARGIN.min(most))
    }
}

/// The lattice of an image as a start, and the size of its pixels.
#[derive(Clone, Copy, Debug)]
pub struct Reference {
    /// q₁, q₂ as columns, 60° apart, rad per pixel.
    pub pair: Matrix2<f64>,
    /// Pixels from column to column and from row to row, nm.
    pub pitch: [f64; 2],
}

impl Reference {
    /// Distance of neighbouring spots, `4π/(√3|q|)` of the mean |q|, nm.
    pub fn period(&self) -> f64 {
        let metric = Matrix2::new(1.0 / self.pitch[0], 0.0, 0.0, 1.0 / self.pitch[1]);
        let lengths = three(&(metric * self.pair)).map(|wave| wave.norm());
        let mean = lengths.iter().sum::<f64>() / 3.0;
        2.0 * std::f64::consts::TAU / (3.0f64.sqrt() * mean)
    }

    pub(crate) fn in_pixels(&self, nm: f64) -> [f64; 2] {
        self.pitch.map(|p| nm / p)
    }

    pub(crate) fn wave(&self, [h, k]: [i32; 2]) -> Vector2<f64> {
        self.pair * Vector2::new(f64::from(h), f64::from(k))
    }
}

/// The local lattice at a node, or why there is none.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct WaveNode {
    /// Whether it is to be believed.
    pub mask: Mask,
    /// q₁, q₂ as columns, rad per pixel; NaN where there is none.
    pub pair: Matrix2<f64>,
    /// Covariance of (q₁x, q₁y, q₂x, q₂y), rad² per pixel².
    pub covariance: Matrix4<f64>,
    /// Weights of the three `phases`, 1/rad²: one over their variances, 0 for a wave that does not stand out.
    pub phase_weights: [f64; 3],
    /// χ² of the closure of all harmonics.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub freedom: usize,
    /// Signal power over noise power under the window, all harmonics.
    pub signal_to_noise: f64,
    /// Phases of the first three harmonics against the reference lattice, rad, modulo 2π.
    pub phases: [f64; 3],
}

/// A harmonic that the map used.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct UsedHarmonic {
    /// (h, k).
    pub index: [i32; 2],
    /// Root mean square amplitude over the frame, units of the image.
    pub amplitude: f64,
    /// Noise level at it: variance per pixel of white noise of the same power.
    pub noise: f64,
}

/// The local lattices of an image.
#[derive(Clone, Debug)]
pub struct WaveMap {
    /// Columns and rows of nodes.
    pub size: [usize; 2],
    /// Place of node (0, 0) and the way to the next ones, pixels.
    pub first: Vector2<f64>,
    /// Pixels from node to node along columns and rows.
    pub step: [f64; 2],
    /// Width of the window, nm.
    pub window_nm: f64,
    /// Margin at the edges, in windows.
    pub margin: f64,
    /// What the phases count against.
    pub reference: Reference,
    /// Where the phases of the reference are zero, pixels.
    pub centre: Vector2<f64>,
    /// Row by row.
    pub nodes: Vec<WaveNode>,
    /// The harmonics that were used, first shell first.
    pub harmonics: Vec<UsedHarmonic>,
    /// Whether noise was seen beside the harmonics; else it is guessed from the variance of the image.
    pub noise_measured: bool,
}

impl WaveMap {
    /// Place of a node, pixels.
    pub fn place(&self, node: usize) -> Vector2<f64> {
        let (column, row) = (node % self.size[0], node / self.size[0]);
        self.first + Vector2::new(column as f64 * self.step[0], row as f64 * self.step[1])
    }

    /// Phases of q₁ and q₂ of the pattern at a node, rad, modulo 2π, and the phase of the third harmonic less their
    /// difference: a constant of the pattern that no shift changes, but that is off by π where the contrast is the other
    /// way round.
    pub(crate) fn phases(&self, node: usize) -> Vector3<f64> {
        let [a, b, c] = self.nodes[node].phases;
        let from_centre = self.place(node) - self.centre;
        let way = self.reference.pair.tr_mul(&from_centre);
        Vector3::new(a + way.x, b + way.y, c - b + a)
    }
}
