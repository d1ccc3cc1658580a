//! The pixels of a fit: where they are, which of them count, and the basis functions on them.
//!
//! Coordinates run from −1 to 1 across the frame, `X = (column − centre)·2/columns` and the same for
//! rows, so that a wave vector is the phase (rad) at the edge and every parameter is of order one.

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::frame::departure::Departure;
use crate::frame::image::Image;
use crate::numbers::interrupt;

/// Lines that a thread counts together, at least.
const AT_ONCE: usize = 64;

/// A line counts if it has this share of the pixels of the fullest one: of fewer an offset leaves nothing. Chosen by eye.
const FEWEST: f64 = 0.25;

/// An image with the list of what is missing.
#[derive(Clone)]
pub(crate) struct Frame<'a> {
    pub(crate) image: &'a Image,
    /// X of the columns and Y of the rows.
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
    /// Pixels of each line that count; 0 leaves the line out.
    pub(crate) present: Vec<usize>,
    /// (row, column) of missing pixels in lines that count.
    pub(crate) missing: Vec<[usize; 2]>,
    /// How far from its own place each pixel is on a straight grid, pixels; `None` of a straight scanner.
    pub(crate) displacement: Option<Departure>,
}

impl<'a> Frame<'a> {
    pub(crate) fn new(image: &'a Image) -> Self {
        let mut frame = Self {
            image,
            x: positions(image.columns),
            y: positions(image.rows),
            present: vec![0; image.rows],
            missing: Vec::new(),
            displacement: None,
        };
        frame.leave_out(|_| false);
        frame
    }

    /// Counts anew, without the lines for which `bad` holds and those of which hardly anything is there.
    pub(crate) fn leave_out(&mut self, bad: impl Fn(usize) -> bool) {
        let image = self.image;
        let there = |row: usize| {
            interrupt::check();
            image.row(row).iter().filter(|v| v.is_finite()).count()
        };
        let rows = (0..image.rows).into_par_iter().with_min_len(AT_ONCE);
        self.present = rows.map(there).collect();
        self.missing.clear();
        let fewest = self.present.iter().copied().max().unwrap_or(0) as f64 * FEWEST;
        for (row, count) in self.present.iter_mut().enumerate() {
            let line = image.row(row);
            if bad(row) || (*count as f64) < fewest {
                *count = 0;
            } else if *count < line.len() {
                let gone = line.iter().enumerate().filter(|(_, v)| !v.is_finite());
                self.missing.extend(gone.map(|(column, _)| [row, column]));
            }
        }
    }

    /// The same of another image of which the same pixels count.
    pub(crate) fn with<'b>(&self, image: &'b Image) -> Frame<'b> {
        Frame {
            image,
            x: self.x.clone(),
            y: self.y.clone(),
            present: self.present.clone(),
            missing: self.missing.clone(),
            displacement: self.displacement.clone(),
        }
    }

    /// Number of pixels that count.
    pub(crate) fn pixels(&self) -> usize {
        self.present.iter().sum()
    }

    /// Number of lines that count.
    pub(crate) fn lines(&self) -> usize {
        self.present.iter().filter(|&&n| n > 0).count()
    }

    /// Mean (X, Y) of the pixels that count.
    pub(crate) fn middle(&self) -> Vector2<f64> {
        // Without what is missing, of which there may be nothing.
        let whole: f64 = self.x.len() as f64;
        let mut sum = Vector2::zeros();
        let gone = self.present.iter().zip(&self.y);
        for (_, y) in gone.filter(|(n, _)| **n == 0) {
            sum.y -= whole * y;
        }
        for [row, column] in &self.missing {
            sum -= Vector2::new(self.x[*column], self.y[*row]);
        }
        sum / self.pixels().max(1) as f64
    }

    /// X of the columns to the right of the middle, and of the middle where there is one.
    pub(crate) fn right(&self) -> &[f64] {
        &self.x[self.image.columns / 2..]
    }

    /// Wave vector in rad per pixel → phase at the edges.
    pub(crate) fn edge(&self) -> Vector2<f64> {
        Vector2::new(self.image.columns as f64, self.image.rows as f64) / 2.0
    }
}

fn positions(n: usize) -> Vec<f64> {
    let centre = (n as f64 - 1.0) / 2.0;
    (0..n)
        .map(|i| (i as f64 - centre) * 2.0 / n as f64)
        .collect()
}

/// Harmonic (h, k) of the pair: h K₁ + k K₂.
pub(crate) fn wave(pair: &Matrix2<f64>, [h, k]: [i32; 2]) -> Vector2<f64> {
    pair * Vector2::new(f64::from(h), f64::from(k))
}

/// `e^{i p X}` at the given positions, which are evenly spaced: sixteen at a time are turned by the
/// same angles, so that most of them cost a multiplication.
pub(crate) fn turns(p: f64, positions: &[f64]) -> Vec<Complex64> {
    /// Pixels whose phases are made from one sine and cosine: rounding grows with their number.
    const BLOCK: usize = 16;
    let step = match positions {
        [first, second, ..] => second - first,
        _ => 0.0,
    };
    let within: [Complex64; BLOCK] = std::array::from_fn(|i| Complex64::cis(p * step * i as f64));
    let mut turns = Vec::with_capacity(positions.len());
    for block in positions.chunks(BLOCK) {
        let first = Complex64::cis(p * block[0]);
        turns.extend(within[..block.len()].iter().map(|turn| first * turn));
    }
    turns
}

/// What the model is made of: the powers of X and Y in the background, and the harmonics.
///
/// The order of the basis functions is: background terms; then for each harmonic of phase θ
/// `cos θ, sin θ, X cos θ, X sin θ, Y cos θ, Y sin θ`, and so on with the powers in `orders`.
#[derive(Clone, Debug)]
pub(crate) struct Basis {
    /// Powers (a, b) of `XᵃYᵇ`.
    pub(crate) terms: Vec<[usize; 2]>,
    /// Indices (h, k).
    pub(crate) indices: Vec<[i32; 2]>,
    /// Powers (a, b) by which the waves of each harmonic are multiplied.
    pub(crate) orders: &'static [[usize; 2]],
}

/// What a change of the wave vectors needs.
pub(crate) const STRAIGHT: &[[usize; 2]] = &powers::<3>();
/// What a bent lattice needs.
pub(crate) const BENT: &[[usize; 2]; ORDERS] = &powers();
/// How many these are.
pub(crate) const ORDERS: usize = 10;
/// Those of them that bend it, the last ones.
pub(crate) const BENDS: usize = 7;

/// The first powers (a, b) of `XᵃYᵇ`: by degree, then by that of Y.
pub(crate) const fn powers<const N: usize>() -> [[usize; 2]; N] {
    let mut all = [[0; 2]; N];
    let (mut i, mut degree, mut b) = (1, 1, 0);
    while i < N {
        all[i] = [degree - b, b];
        (i, b) = (i + 1, b + 1);
        if b > degree {
            (degree, b) = (degree + 1, 0);
        }
    }
    all
}

impl Basis {
    /// A background of total degree `degree`. Where every line has an offset of its own
    /// (`free_lines`), terms that are constant along lines do not belong to the background.
    pub(crate) fn new(degree: usize, free_lines: bool, indices: &[[i32; 2]]) -> Self {
        let terms = (0..=degree)
            .flat_map(|total| (0..=total).map(move |b| [total - b, b]))
            .filter(|[a, _]| *a > 0 || !free_lines)
            .collect();
        Self {
            terms,
            indices: indices.to_vec(),
            orders: STRAIGHT,
        }
    }

    /// Highest power in the background.
    pub(crate) fn degree(&self) -> usize {
        self.terms.last().map_or(0, |t| t[0] + t[1])
    }

    /// Highest power of all.
    pub(crate) fn highest(&self) -> usize {
        self.degree()
            .max(self.orders.last().map_or(0, |t| t[0] + t[1]))
    }

    /// Number of basis functions.
    pub(crate) fn len(&self) -> usize {
        self.terms.len() + 2 * self.orders.len() * self.indices.len()
    }

    /// Position of `cos θ` of the harmonic `i`.
    pub(crate) fn cosine(&self, i: usize) -> usize {
        self.terms.len() + 2 * self.orders.len() * i
    }
}
