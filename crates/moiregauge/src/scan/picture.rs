//! Images to be shown beside the numbers.

use heterostrain::lattice::{Lattice, Px};
use nalgebra::{Matrix2, Vector2};
use spmfile::LineDirection;

use crate::coverage::LatticeRegion;
use crate::frame::image::Image;

/// One scan in detail, for the figures.
#[derive(Clone, Debug)]
pub struct Illustration {
    /// The file shown.
    pub file: String,
    /// The line direction shown.
    pub line: LineDirection,
    /// The channel's unit.
    pub unit: String,
    /// The image, background removed.
    pub image: Image,
    /// Affine map pixel → nm by the sensors.
    pub pixel_to_nm: Matrix2<f64>,
    /// Position of pixel (0, 0), nm.
    pub origin: Vector2<f64>,
    /// The same by the nominal size and rotation, if the file gives them.
    pub nominal_pixel_to_nm: Option<Matrix2<f64>>,
    /// Autocorrelation, lag zero at (rows/2, columns/2), one lag step per pixel.
    pub autocorrelation: Image,
    /// Logarithm of the power spectrum, frequency zero at (rows/2, columns/2).
    pub spectrum: Image,
    /// Step of `spectrum` along columns and rows, cycles per pixel.
    pub spectrum_step: [f64; 2],
    /// The measured lattice in pixels.
    pub lattice: Lattice<Px>,
    /// The part of the image that carries it; `None` for all of it, or where only a part was looked at.
    pub patch: Option<LatticeRegion>,
    /// The sensor of the fast axis along the middle line: column, measured nm, fitted nm.
    pub sensor_line: Vec<[f64; 3]>,
    /// Fast tip velocity of every line, nm/s.
    pub fast_velocities: Vec<f64>,
    /// Slow tip velocity of every column, nm/s.
    pub slow_velocities: Vec<f64>,
    /// Reading of the x and of the y sensor less the affine fit that places the pixels, nm, means over blocks;
    /// `None` without sensors.
    pub sensor_residuals: Option<[Image; 2]>,
    /// Pixels along the side of such a block.
    pub residual_block: usize,
    /// What the sensors of each line direction say beside a plane; empty of a straight scanner.
    pub bent: Vec<BentSensors>,
    /// The amplitude of the same line, where the phase is shown and both were recorded.
    pub amplitude: Option<Companion>,
}

/// The sensors of one line direction of a scanner that bends.
#[derive(Clone, Debug)]
pub struct BentSensors {
    /// Trace or retrace.
    pub line: LineDirection,
    /// Readings of the x and of the y sensor less the planes, nm, means over blocks as those of [`Illustration::sensor_residuals`].
    pub before: [Image; 2],
    /// The same less the smooth departure.
    pub after: [Image; 2],
    /// Lines of the grid: places on the straight one and how far the scanner is from there, nm.
    pub grid: Vec<Vec<[Vector2<f64>; 2]>>,
}

/// Another channel of a scan, pixel by pixel beside the one that is analysed.
#[derive(Clone, Debug)]
pub struct Companion {
    /// Its name.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Its values, background removed.
    pub image: Image,
}

/// An image and where its pixels are, to be shown.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The file as the user named it.
    pub file: String,
    /// Name of the channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Its values, background removed.
    pub image: Image,
    /// Affine map pixel (column, row) → nm, the linear part.
    pub pixel_to_nm: Matrix2<f64>,
    /// Position of pixel (0, 0), nm.
    pub origin: Vector2<f64>,
    /// Whether position sensors tell so; otherwise the size and offset that the file states.
    pub from_sensors: bool,
}
