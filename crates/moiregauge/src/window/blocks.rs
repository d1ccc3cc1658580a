//! Pixels → blocks: the image mixed with waves of given wave vectors and averaged over small blocks.
//!
//! `z(B) = ⟨I(n) e^{−ig·(n − centre)}⟩` over the pixels n of block B; rad per pixel. This is all that is
//! ever done to pixels; everything later works on blocks. Single precision: the phases are made in
//! double precision, and a sum over a window loses 10⁻⁶ of itself at most.

use nalgebra::Vector2;
use rayon::prelude::*;

use crate::frame::image::Image;
use crate::numbers::interrupt;
use crate::window::lines::Levelled;
use crate::window::types::{Reference, Resolution};

/// Columns handled together, so that sums stay in the fastest memory: two kilobytes a sum.
const CHUNK: usize = 256;
/// Rows of blocks made together: enough to keep all threads busy.
const TOGETHER: usize = 64;

/// Which part of a larger image the rows in hand are, and where its phases count from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// First row of the part.
    pub(crate) row: usize,
    /// Rows of the whole image, if this is only a part of it.
    pub(crate) rows: Option<usize>,
    /// Where all phases are zero, pixels of the whole image.
    pub(crate) centre: Vector2<f64>,
}

impl Place {
    /// A whole image, phases from its middle.
    pub(crate) fn whole(image: &Image) -> Self {
        Self {
            row: 0,
            rows: None,
            centre: Vector2::new(image.columns as f64 - 1.0, image.rows as f64 - 1.0) / 2.0,
        }
    }
}

/// An image mixed down and averaged over blocks of pixels.
pub(crate) struct Blocks {
    /// Columns and rows of blocks.
    pub(crate) size: [usize; 2],
    /// Pixels of a block along columns and rows.
    pub(crate) block: [usize; 2],
    /// Middle of block (0, 0), pixels of the whole image.
    pub(crate) first: Vector2<f64>,
    /// One for each wave vector.
    pub(crate) layers: Vec<Layer>,
    /// Share of the pixels that are there, where some are missing.
    pub(crate) share: Option<Vec<f32>>,
}

/// Real and imaginary parts, row by row.
pub(crate) struct Layer {
    pub(crate) re: Vec<f32>,
    pub(crate) im: Vec<f32>,
}

impl Layer {
    /// Room for a number of blocks, empty.
    fn with_room(blocks: usize) -> Self {
        let room = || Vec::with_capacity(blocks);
        Self {
            re: room(),
            im: room(),
        }
    }
}

impl Blocks {
    /// Middle of a block, pixels.
    pub(crate) fn middle(&self, column: f64, row: f64) -> Vector2<f64> {
        self.first + Vector2::new(column * self.block[0] as f64, row * self.block[1] as f64)
    }
}

/// `e^{−ig(i − centre)}` of pixels `from`, `from + 1`, ….
fn turns(g: f64, from: usize, count: usize, centre: f64) -> [Vec<f32>; 2] {
    let mut out = [Vec::with_capacity(count), Vec::with_capacity(count)];
    for i in from..from + count {
        let (sine, cosine) = (-g * (i as f64 - centre)).sin_cos();
        out[0].push(cosine as f32);
        out[1].push(sine as f32);
    }
    out
}

/// Mixes the levelled image with every wave (rad per pixel) and averages over blocks (pixels). What does not fill
/// a block at the right and the top is left out; missing pixels count as zero.
pub(crate) fn mix(
    levelled: &Levelled,
    place: Place,
    waves: &[Vector2<f64>],
    block: [usize; 2],
) -> Blocks {
    mix_some(levelled, place, waves, block, |_| true)
}

/// The same for the rows of blocks that are `wanted`; the others are zero.
pub(crate) fn mix_some(
    levelled: &Levelled,
    place: Place,
    waves: &[Vector2<f64>],
    block: [usize; 2],
    wanted: impl Fn(usize) -> bool + Sync,
) -> Blocks {
    let [width, height] = block;
    let image = levelled.image;
    let size = [image.columns / width, image.rows / height];
    let used = size[0] * width;
    let along = waves.iter().map(|g| turns(g.x, 0, used, place.centre.x));
    let along: Vec<[Vec<f32>; 2]> = along.collect();
    let up = |g: &Vector2<f64>| turns(g.y, place.row, size[1] * height, place.centre.y);
    let up: Vec<[Vec<f32>; 2]> = waves.iter().map(up).collect();
    let layer = |_| Layer::with_room(size[0] * size[1]);
    let mut layers: Vec<Layer> = waves.iter().map(layer).collect();
    let mut shares = Vec::new();
    // A few rows at a time, so that they need no memory to speak of.
    let mut first = 0;
    while first < size[1] {
        let last = (first + TOGETHER).min(size[1]);
        let mixed: Vec<(Vec<f32>, Option<Vec<f32>>)> = (first..last)
            .into_par_iter()
            .map(|row| {
                interrupt::check();
                mix_row(levelled, row, block, &along, &up, wanted(row))
            })
            .collect();
        for (row, (sums, of_line)) in mixed.into_iter().enumerate() {
            for (layer, sums) in layers.iter_mut().zip(sums.chunks_exact(2 * size[0].max(1))) {
                layer.re.extend_from_slice(&sums[..size[0]]);
                layer.im.extend_from_slice(&sums[size[0]..]);
            }
            if let Some(of_line) = of_line {
                // Everything was there so far.
                shares.resize((first + row) * size[0], 1.0);
                shares.extend(of_line);
            }
        }
        first = last;
    }
    let share = (!shares.is_empty()).then(|| {
        shares.resize(size[0] * size[1], 1.0);
        shares
    });
    Blocks {
        size,
        block,
        first: Vector2::new(
            0.5 * (width as f64 - 1.0),
            place.row as f64 + 0.5 * (height as f64 - 1.0),
        ),
        layers,
        share,
    }
}

/// A row of blocks of every wave, real and imaginary parts after each other (zero if not `wanted`), and the share of
/// its pixels. `along` and `up`: cosine and sine of each wave at each column and line.
fn mix_row(
    levelled: &Levelled,
    row: usize,
    block: [usize; 2],
    along: &[[Vec<f32>; 2]],
    up: &[[Vec<f32>; 2]],
    wanted: bool,
) -> (Vec<f32>, Option<Vec<f32>>) {
    let [width, height] = block;
    let columns = levelled.image.columns / width;
    let used = [columns * width, height];
    let (pixels, share) = lines(levelled, row * height, used, width);
    let mut out = vec![0.0; 2 * along.len() * columns];
    if wanted {
        let sums = out.chunks_exact_mut(2 * columns.max(1));
        for ((sums, [c, s]), up) in sums.zip(along).zip(up) {
            let rows = row * height..(row + 1) * height;
            let up = [&up[0][rows.clone()], &up[1][rows]];
            mix_line(&pixels, [c, s], up, block, sums);
        }
    }
    (out, share)
}

/// Mixes the lines of a row of blocks with one wave; the blocks' real parts, then their imaginary ones, go to `sums`.
fn mix_line(
    pixels: &[f32],
    along: [&[f32]; 2],
    up: [&[f32]; 2],
    [width, height]: [usize; 2],
    sums: &mut [f32],
) {
    let used = along[0].len();
    let scale = 1.0 / (width * height) as f32;
    let chunk = (CHUNK / width).max(1) * width;
    let (mut all_re, mut all_im) = (vec![0.0f32; chunk], vec![0.0f32; chunk]);
    let (re, im) = sums.split_at_mut(sums.len() / 2);
    let mut start = 0;
    while start < used {
        let end = (start + chunk).min(used);
        let part = start..end;
        let (sum_re, sum_im) = (&mut all_re[..end - start], &mut all_im[..end - start]);
        sum_re.fill(0.0);
        sum_im.fill(0.0);
        for (row, values) in pixels.chunks_exact(used).enumerate() {
            let [c, s] = [up[0][row], up[1][row]];
            let sums = sum_re.iter_mut().zip(sum_im.iter_mut());
            for ((re, im), value) in sums.zip(&values[part.clone()]) {
                *re += c * value;
                *im += s * value;
            }
        }
        let turn = along[0][part.clone()].iter().zip(&along[1][part]);
        for ((re, im), (c, s)) in sum_re.iter_mut().zip(sum_im.iter_mut()).zip(turn) {
            (*re, *im) = (*re * c - *im * s, *re * s + *im * c);
        }
        let first = start / width;
        average(sum_re, &mut re[first..], width, scale);
        average(sum_im, &mut im[first..], width, scale);
        start = end;
    }
}

/// Sums of `width` columns, times `scale`.
fn average(columns: &[f32], out: &mut [f32], width: usize, scale: f32) {
    let out = out.iter_mut();
    match width {
        1 => out.zip(columns).for_each(|(v, a)| *v = scale * a),
        2 => {
            let pairs = columns.as_chunks::<2>().0;
            out.zip(pairs).for_each(|(v, [a, b])| *v = scale * (a + b));
        }
        _ => out
            .zip(columns.chunks(width))
            .for_each(|(v, all)| *v = scale * all.iter().sum::<f32>()),
    }
}

/// The lines of a row of blocks in single precision, missing pixels zero; and which share of each block is
/// there, unless all is.
fn lines(
    levelled: &Levelled,
    first: usize,
    [used, height]: [usize; 2],
    width: usize,
) -> (Vec<f32>, Option<Vec<f32>>) {
    let mut pixels = Vec::with_capacity(used * height);
    let mut missing = vec![0usize; used / width];
    let mut any = false;
    for row in first..first + height {
        let offset = levelled.offset(row);
        for (column, value) in levelled.image.row(row)[..used].iter().enumerate() {
            if value.is_finite() {
                pixels.push((*value - offset) as f32);
            } else {
                pixels.push(0.0);
                missing[column / width] += 1;
                any = true;
            }
        }
    }
    let all = (width * height) as f32;
    let share = any.then(|| missing.iter().map(|&n| 1.0 - n as f32 / all).collect());
    (pixels, share)
}

/// Pixels of a block along columns and rows, for a lattice.
pub(crate) fn block_of(reference: &Reference) -> [usize; 2] {
    block_within(reference.period() / BLOCKS, reference.pitch)
}

/// Pixels of a block up to a size in nm.
pub(crate) fn block_within(nm: f64, pitch: [f64; 2]) -> [usize; 2] {
    // Periods of whole pixels come out a hair too short.
    pitch.map(|p| ((nm / p + 1e-9) as usize).max(1))
}

/// Blocks from node to node, `distance_nm` apart.
pub(crate) fn stride_of(reference: &Reference, block: [usize; 2], distance_nm: f64) -> [usize; 2] {
    let pixels = reference.in_pixels(distance_nm);
    [0, 1].map(|i| ((pixels[i] / block[i] as f64).round() as usize).max(1))
}

/// Distance of the nodes, nm, with a window of `window_nm`.
pub(crate) fn step_of(resolution: &Resolution, reference: &Reference, window_nm: f64) -> f64 {
    let least = APART * reference.pitch[0].max(reference.pitch[1]);
    let usual = (window_nm / NODES).max(least);
    resolution.step_nm.unwrap_or(usual)
}

/// Smallest distance of nodes, pixels: nearer ones add nothing.
const APART: f64 = 2.0;

/// Blocks per period: finer ones cost memory by the square, coarser ones fold the first shells; see `ALIASED` of the
/// waves.
const BLOCKS: f64 = 5.0;

/// Nodes per width of the window: as for lattices.
pub(crate) const NODES: f64 = 3.0;

#[cfg(test)]
mod tests {
    use super::*;
    use rustfft::num_complex::Complex64;

    /// Against the definition, with a missing pixel, at an offset, on a frame that blocks do not fill.
    #[test]
    fn blocks_follow_their_definition() {
        let (rows, columns) = (11, 300);
        let values = (0..rows * columns).map(|i| {
            if i == 305 {
                f64::NAN
            } else {
                ((i * i) % 97) as f64 / 97.0
            }
        });
        let image = Image::new(rows, columns, values.collect());
        let place = Place {
            row: 40,
            rows: None,
            centre: Vector2::new(12.5, 50.0),
        };
        let waves = [Vector2::new(0.3, -0.7), Vector2::new(-1.1, 0.2)];
        let blocks = mix(&Levelled::as_is(&image), place, &waves, [7, 3]);
        assert_eq!(blocks.size, [42, 3]);
        assert!((blocks.middle(2.0, 1.0) - Vector2::new(17.0, 44.0)).norm() < 1e-12);
        for (layer, g) in blocks.layers.iter().zip(&waves) {
            for (column, row) in [(0, 0), (41, 2), (36, 1)] {
                let mut sum = Complex64::default();
                for (y, x) in
                    (0..3).flat_map(|y| (0..7).map(move |x| (3 * row + y, 7 * column + x)))
                {
                    let value = image.row(y)[x];
                    let at = Vector2::new(x as f64, y as f64 + 40.0) - place.centre;
                    if value.is_finite() {
                        sum += value * Complex64::cis(-g.dot(&at)) / 21.0;
                    }
                }
                let i = row * 42 + column;
                let miss = sum - Complex64::new(f64::from(layer.re[i]), f64::from(layer.im[i]));
                assert!(miss.norm() < 1e-6, "{miss}");
            }
        }
        // Pixel (5, 1) is missing.
        let share = blocks.share.unwrap();
        assert!((share[0] - 20.0 / 21.0).abs() < 1e-6 && share[1] == 1.0);
    }
}
