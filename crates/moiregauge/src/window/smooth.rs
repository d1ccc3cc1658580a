//! Blocks → envelopes: amplitude and slope of every wave under a Gaussian window, on nodes.
//!
//! Around each node the mixed image is fitted by `c₀ + c₁·d`, d the way from the node, with the weights
//! `e^{−d²/2w²}` (local linear regression). Inside a complete frame that is the convolution with the
//! Gaussian and its derivative; at edges and beside missing pixels the moments of what is left of the
//! window correct both. The slope of the phase is `Im(c₁/c₀)`, exact for a wave of any wave vector.
//!
//! Noise: white noise of variance S per pixel gives c₀ the variance `S·amplitude_noise` and the components
//! of c₁ the covariance `S·slope_noise` (each shared by real and imaginary part). For a complete window
//! that is `1/(4πw²)` and `1/(8πw⁴)`.
//!
//! # References
//! Fan and Gijbels, Local Polynomial Modelling and Its Applications (1996), section 3.2.

use nalgebra::{Matrix2, Matrix3, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::{Complex32, Complex64};

use crate::numbers::interrupt;
use crate::window::blocks::{Blocks, Layer};

/// Distance from the middle at which windows end, widths: 4·10⁻⁵ of the height.
const REACH: f64 = 4.5;
/// Fraction of the window below which a node is not computed; masks ask for far more. Half and twice as much change no
/// result of docs/constants.md.
const LEAST_SHARE: f64 = 0.05;
/// Harmonics below this many noise units (amplitude) are left out of a node: their phases are off by some third of a
/// rad.
const FAINT: f64 = 3.0;
/// Without harmonics above this many a pattern is not seen at a node.
const WEAKEST: f64 = 4.0;
/// Products summed side by side, as processors do; it fixes the order of the sums.
const LANES: usize = 8;

/// Nodes on the middles of blocks, evenly spaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Nodes {
    /// Columns and rows of nodes.
    pub(crate) size: [usize; 2],
    /// Block of node (0, 0).
    pub(crate) first: [usize; 2],
    /// Blocks from node to node.
    pub(crate) stride: [usize; 2],
}

impl Nodes {
    /// As many nodes as fit into a number of blocks, in their middle.
    pub(crate) fn filling(blocks: [usize; 2], stride: [usize; 2]) -> Self {
        let along = |axis: usize| {
            let count = (blocks[axis].max(1) - 1) / stride[axis] + 1;
            let first = (blocks[axis].max(1) - 1 - (count - 1) * stride[axis]) / 2;
            (count, first)
        };
        let ((columns, left), (rows, bottom)) = (along(0), along(1));
        Self {
            size: [columns, rows],
            first: [left, bottom],
            stride,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Whether a row of blocks is no farther than `radius` from a row of nodes.
    pub(crate) fn see(&self, row: usize, radius: usize) -> bool {
        let nearest = (row + self.stride[1] / 2).saturating_sub(self.first[1]) / self.stride[1];
        let nearest = self.first[1] + nearest.min(self.size[1] - 1) * self.stride[1];
        nearest.abs_diff(row) <= radius
    }

    /// The block on which a node lies.
    pub(crate) fn block(&self, node: usize) -> [usize; 2] {
        let (column, row) = (node % self.size[0], node / self.size[0]);
        [
            self.first[0] + column * self.stride[0],
            self.first[1] + row * self.stride[1],
        ]
    }

    /// Pixels from node to node.
    pub(crate) fn step(&self, blocks: &Blocks) -> [f64; 2] {
        [0, 1].map(|i| (self.stride[i] * blocks.block[i]) as f64)
    }

    /// Place of a node, pixels.
    pub(crate) fn place(&self, blocks: &Blocks, node: usize) -> Vector2<f64> {
        let [column, row] = self.block(node).map(|i| i as f64);
        blocks.middle(column, row)
    }
}

/// What is left of the window around a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Support {
    /// Share of the window that holds pixels, 0 to 1.
    pub(crate) share: f64,
    /// Variance of c₀ for white noise of unit variance.
    pub(crate) amplitude_noise: f64,
    /// Covariance of the components of c₁ for such noise, per pixel².
    pub(crate) slope_noise: Matrix2<f64>,
    /// Inverse of the moments: from the plain sum and those tilted along x and y to c₀ and c₁.
    pub(crate) inverse: Matrix3<f64>,
}

/// Amplitude and slope of one wave at every node.
pub(crate) struct Envelope {
    /// c₀; zero where there is no support.
    pub(crate) amplitude: Vec<Complex32>,
    /// `Im(c₁/c₀)`, rad per pixel.
    pub(crate) slope: Vec<[f32; 2]>,
    /// `Re(c₁/c₀)`, per pixel.
    pub(crate) growth: Vec<[f32; 2]>,
    /// What may be left of other harmonics in the slope, rad per pixel; empty where nothing was looked for.
    pub(crate) unsure: Vec<f32>,
}

/// The envelopes of all waves.
pub(crate) struct Smoothed {
    pub(crate) nodes: Nodes,
    /// `None` where nothing is left of the window.
    pub(crate) support: Vec<Option<Support>>,
    pub(crate) envelopes: Vec<Envelope>,
}

/// A harmonic that stands out at a node.
pub(crate) struct Standing {
    /// Power without that of the noise.
    pub(crate) signal: f64,
    /// Over that of the noise.
    pub(crate) to_noise: f64,
    /// Whether it is enough to see a pattern by.
    pub(crate) is_strong: bool,
    /// Slope of the phase, rad per pixel, and what may be left of other harmonics in it.
    pub(crate) slope: Vector2<f64>,
    pub(crate) unsure: f64,
}

impl Envelope {
    /// c₀ and both components of c₁ at a node.
    pub(crate) fn fitted(&self, node: usize) -> [Complex64; 3] {
        let amplitude = self.amplitude[node];
        let amplitude = Complex64::new(f64::from(amplitude.re), f64::from(amplitude.im));
        let [x, y] = [0, 1].map(|i| {
            let relative = [self.growth[node][i], self.slope[node][i]].map(f64::from);
            amplitude * Complex64::new(relative[0], relative[1])
        });
        [amplitude, x, y]
    }

    /// What stands out at a node of noise of so much power; `None` where it is too faint.
    pub(crate) fn standing(&self, node: usize, noise: f64) -> Option<Standing> {
        let power = f64::from(self.amplitude[node].norm_sqr());
        if power <= FAINT * FAINT * noise || power <= 0.0 {
            return None;
        }
        // Noise adds to the power.
        let signal = power - noise;
        Some(Standing {
            signal,
            to_noise: if noise > 0.0 {
                signal / noise
            } else {
                f64::INFINITY
            },
            is_strong: power > WEAKEST * WEAKEST * noise,
            slope: Vector2::from(self.slope[node].map(f64::from)),
            unsure: self.unsure.get(node).copied().map_or(0.0, f64::from),
        })
    }
}

/// Weights along one axis, and times the distance in pixels, filled up with zeros to whole lanes.
pub(crate) struct Kernel {
    pub(crate) radius: usize,
    pub(crate) plain: Vec<f32>,
    pub(crate) tilted: Vec<f32>,
    /// Pixels of a block.
    pub(crate) step: f64,
    /// Variance of the weights, pixels².
    pub(crate) own: f64,
}

/// Blocks of `block` pixels from the middle of a window of `width` pixels to its end.
pub(crate) fn radius(width: f64, block: usize) -> usize {
    (REACH * width / block as f64).ceil() as usize
}

impl Kernel {
    /// For blocks of `block` pixels; `width` is that of the window with the block.
    pub(crate) fn new(width: f64, block: usize) -> Self {
        let step = block as f64;
        // The mean over a block widens by (b² − 1)/12 pixels².
        let own = (width * width - (step * step - 1.0) / 12.0).max(0.25 * step * step);
        let radius = radius(width, block);
        let distance = |i: usize| (i as f64 - radius as f64) * step;
        let weights: Vec<f64> = (0..=2 * radius)
            .map(|i| (-0.5 * distance(i).powi(2) / own).exp())
            .collect();
        let sum: f64 = weights.iter().sum();
        let mut plain: Vec<f32> = weights.iter().map(|w| (w / sum) as f32).collect();
        let tilted = weights.iter().enumerate();
        let mut tilted: Vec<f32> = tilted
            .map(|(i, w)| (distance(i) * w / sum) as f32)
            .collect();
        let padded = plain.len().next_multiple_of(LANES);
        plain.resize(padded, 0.0);
        tilted.resize(padded, 0.0);
        Self {
            radius,
            plain,
            tilted,
            step,
            own,
        }
    }

    fn weight(&self, offset: isize) -> [f64; 2] {
        let i = (offset + self.radius as isize) as usize;
        [f64::from(self.plain[i]), f64::from(self.tilted[i])]
    }

    /// Sums of `w dᵃ` and of `w² dᵃ`, a = 0, 1, 2, over the blocks 0 to `count` around block `at`.
    fn moments(&self, at: usize, count: usize) -> [[f64; 3]; 2] {
        let radius = self.radius as isize;
        let (low, high) = (-(at as isize), count as isize - 1 - at as isize);
        let mut sums = [[0.0; 3]; 2];
        for offset in low.max(-radius)..=high.min(radius) {
            let [w, wd] = self.weight(offset);
            let d = offset as f64 * self.step;
            for (sum, term) in sums[0].iter_mut().zip([w, wd, wd * d]) {
                *sum += term;
            }
            for (sum, term) in sums[1].iter_mut().zip([w * w, w * wd, wd * wd]) {
                *sum += term;
            }
        }
        sums
    }
}

/// Smooths every layer of `blocks` with a window of the given widths (pixels).
pub(crate) fn smooth(blocks: &Blocks, width: [f64; 2], nodes: Nodes) -> Smoothed {
    let kernels = [0, 1].map(|axis| Kernel::new(width[axis], blocks.block[axis]));
    let fits = fits(blocks, &kernels, nodes);
    let layers = blocks.layers.iter();
    let envelopes = layers.map(|layer| envelope(blocks, layer, &kernels, nodes, &fits));
    let envelopes = envelopes.collect();
    Smoothed {
        nodes,
        envelopes,
        support: fits,
    }
}

impl Support {
    /// From the moments of w and of w² over the window: 1, x, y, xx, xy, yy.
    fn new(first: [f64; 6], second: [f64; 6], pixels: f64) -> Option<Self> {
        let matrix = |[a, x, y, xx, xy, yy]: [f64; 6]| Matrix3::new(a, x, y, x, xx, xy, y, xy, yy);
        if first[0] < LEAST_SHARE {
            return None;
        }
        let inverse = matrix(first).try_inverse()?;
        let noise = inverse * matrix(second) * inverse / pixels;
        Some(Self {
            share: first[0],
            amplitude_noise: noise[(0, 0)],
            slope_noise: noise.fixed_view::<2, 2>(1, 1).into_owned(),
            inverse,
        })
    }

    /// c₀ and c₁/c₀ from the sums.
    fn amplitude_and_slope(&self, [s, x, y]: [Complex64; 3]) -> (Complex32, [Complex32; 2]) {
        let row = |i: usize| {
            let m = self.inverse.row(i);
            s * m[0] + x * m[1] + y * m[2]
        };
        let amplitude = row(0);
        let single = |c: Complex64| Complex32::new(c.re as f32, c.im as f32);
        let relative = |i: usize| {
            let relative = single(row(i) / amplitude);
            if relative.is_finite() {
                relative
            } else {
                Complex32::default()
            }
        };
        (single(amplitude), [relative(1), relative(2)])
    }
}

fn fits(blocks: &Blocks, kernels: &[Kernel; 2], nodes: Nodes) -> Vec<Option<Support>> {
    let pixels = (blocks.block[0] * blocks.block[1]) as f64;
    if let Some(share) = &blocks.share {
        return fits_with_gaps(blocks, share, kernels, nodes);
    }
    let along = [0, 1].map(|axis| {
        let at = |i: usize| nodes.first[axis] + i * nodes.stride[axis];
        let moments = |i| kernels[axis].moments(at(i), blocks.size[axis]);
        (0..nodes.size[axis]).map(moments).collect::<Vec<_>>()
    });
    let product = |x: &[f64; 3], y: &[f64; 3]| {
        [
            x[0] * y[0],
            x[1] * y[0],
            x[0] * y[1],
            x[2] * y[0],
            x[1] * y[1],
            x[0] * y[2],
        ]
    };
    let all = along[1].iter().flat_map(|y| {
        let of_row = along[0].iter();
        of_row.map(move |x| Support::new(product(&x[0], &y[0]), product(&x[1], &y[1]), pixels))
    });
    all.collect()
}

/// The same where pixels are missing: the moments are sums over what is there.
fn fits_with_gaps(
    blocks: &Blocks,
    share: &[f32],
    kernels: &[Kernel; 2],
    nodes: Nodes,
) -> Vec<Option<Support>> {
    let pixels = (blocks.block[0] * blocks.block[1]) as f64;
    let reach = |axis: usize, at: usize| {
        let radius = kernels[axis].radius;
        at.saturating_sub(radius)..(at + radius + 1).min(blocks.size[axis])
    };
    // Along the lines first: three powers of w and of w².
    let lines: Vec<Vec<[f64; 6]>> = (0..blocks.size[1])
        .into_par_iter()
        .map(|row| {
            interrupt::check();
            let line = &share[row * blocks.size[0]..(row + 1) * blocks.size[0]];
            let at = |i: usize| nodes.first[0] + i * nodes.stride[0];
            let moments = |i: usize| {
                let mut sums = [0.0; 6];
                for column in reach(0, at(i)) {
                    let offset = column as isize - at(i) as isize;
                    let [w, wd] = kernels[0].weight(offset);
                    let d = offset as f64 * kernels[0].step;
                    let terms = [w, wd, wd * d, w * w, w * wd, wd * wd];
                    for (sum, term) in sums.iter_mut().zip(terms) {
                        *sum += f64::from(line[column]) * term;
                    }
                }
                sums
            };
            (0..nodes.size[0]).map(moments).collect()
        })
        .collect();
    (0..nodes.len())
        .into_par_iter()
        .map(|node| {
            let (column, row) = (node % nodes.size[0], node / nodes.size[0]);
            let at = nodes.first[1] + row * nodes.stride[1];
            let (mut first, mut second) = ([0.0; 6], [0.0; 6]);
            for (line, x) in reach(1, at).map(|line| (line, &lines[line][column])) {
                let offset = line as isize - at as isize;
                let [w, wd] = kernels[1].weight(offset);
                let d = offset as f64 * kernels[1].step;
                let up = [w, w, wd, w, wd, wd * d];
                let squared = [w * w, w * w, w * wd, w * w, w * wd, wd * wd];
                for (i, power) in [0, 1, 0, 2, 1, 0].into_iter().enumerate() {
                    first[i] += up[i] * x[power];
                    second[i] += squared[i] * x[3 + power];
                }
            }
            Support::new(first, second, pixels)
        })
        .collect()
}

fn envelope(
    blocks: &Blocks,
    layer: &Layer,
    kernels: &[Kernel; 2],
    nodes: Nodes,
    fits: &[Option<Support>],
) -> Envelope {
    let count = nodes.size[0];
    let radius = kernels[1].radius;
    let lines: Vec<Vec<f32>> = (0..blocks.size[1])
        .into_par_iter()
        .map(|row| {
            interrupt::check();
            if nodes.see(row, radius) {
                along(blocks.size[0], layer, &kernels[0], nodes, row)
            } else {
                Vec::new()
            }
        })
        .collect();
    let rows: Vec<Vec<(Complex32, [Complex32; 2])>> = (0..nodes.size[1])
        .into_par_iter()
        .map(|node_row| {
            interrupt::check();
            let at = nodes.first[1] + node_row * nodes.stride[1];
            let first = at.saturating_sub(radius);
            let last = (at + radius + 1).min(blocks.size[1]);
            let sums = across(&lines[first..last], &kernels[1], first + radius - at, count);
            let of_node = |column: usize| {
                let Some(fit) = &fits[node_row * count + column] else {
                    return (Complex32::default(), [Complex32::default(); 2]);
                };
                let sums = sums.each_ref().map(|values| {
                    Complex64::new(f64::from(values[column]), f64::from(values[count + column]))
                });
                fit.amplitude_and_slope(sums)
            };
            (0..count).map(of_node).collect()
        })
        .collect();
    let mut envelope = Envelope {
        amplitude: Vec::with_capacity(nodes.len()),
        slope: Vec::with_capacity(nodes.len()),
        growth: Vec::with_capacity(nodes.len()),
        unsure: Vec::new(),
    };
    for (amplitude, relative) in rows.into_iter().flatten() {
        envelope.amplitude.push(amplitude);
        envelope.slope.push(relative.map(|c| c.im));
        envelope.growth.push(relative.map(|c| c.re));
    }
    envelope
}

/// Smoothed lines summed with the weights from `tap` on: plain, tilted along the line, tilted across.
fn across(lines: &[Vec<f32>], kernel: &Kernel, tap: usize, count: usize) -> [Vec<f32>; 3] {
    let mut sums = [0; 3].map(|_| vec![0.0f32; 2 * count]);
    for (i, line) in lines.iter().enumerate() {
        let (w, wd) = (kernel.plain[tap + i], kernel.tilted[tap + i]);
        let (plain, tilted) = line.split_at(2 * count);
        let [s, x, y] = &mut sums;
        for ((s, y), value) in s.iter_mut().zip(y.iter_mut()).zip(plain) {
            *s += w * value;
            *y += wd * value;
        }
        for (x, value) in x.iter_mut().zip(tilted) {
            *x += w * value;
        }
    }
    sums
}

/// A line of blocks, smoothed, at the columns of the nodes: real, imaginary, and both tilted.
fn along(columns: usize, layer: &Layer, kernel: &Kernel, nodes: Nodes, row: usize) -> Vec<f32> {
    let radius = kernel.radius;
    let length = columns + 2 * radius + LANES;
    let (mut re, mut im) = (vec![0.0f32; length], vec![0.0f32; length]);
    let line = row * columns..(row + 1) * columns;
    re[radius..radius + columns].copy_from_slice(&layer.re[line.clone()]);
    im[radius..radius + columns].copy_from_slice(&layer.im[line]);
    let count = nodes.size[0];
    let mut out = vec![0.0; 4 * count];
    for i in 0..count {
        let at = nodes.first[0] + i * nodes.stride[0];
        let window = at..at + kernel.plain.len();
        let sums = products(kernel, &re[window.clone()], &im[window]);
        for (k, sum) in sums.into_iter().enumerate() {
            out[k * count + i] = sum;
        }
    }
    out
}

/// Sums of re·w, im·w, re·wd, im·wd.
fn products(kernel: &Kernel, re: &[f32], im: &[f32]) -> [f32; 4] {
    let mut sums = [[0.0f32; LANES]; 4];
    let (plain, tilted) = (&kernel.plain, &kernel.tilted);
    let weights = plain
        .as_chunks::<LANES>()
        .0
        .iter()
        .zip(tilted.as_chunks::<LANES>().0);
    let values = re
        .as_chunks::<LANES>()
        .0
        .iter()
        .zip(im.as_chunks::<LANES>().0);
    for ((w, wd), (re, im)) in weights.zip(values) {
        for i in 0..LANES {
            sums[0][i] += w[i] * re[i];
            sums[1][i] += w[i] * im[i];
            sums[2][i] += wd[i] * re[i];
            sums[3][i] += wd[i] * im[i];
        }
    }
    sums.map(|s| s.iter().sum())
}
