//! A plane over an image, `v = v₀ + a·column + b·row`, and sums over lines of what it leaves.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use crate::frame::image::Image;
use crate::numbers::interrupt;

/// A fitted plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneFit {
    /// Value at pixel (0, 0).
    pub origin: f64,
    /// Slope from column to column.
    pub per_column: f64,
    /// Slope from row to row.
    pub per_row: f64,
    /// Standard deviation of the residuals of the pixels that were used.
    pub residual: f64,
}

impl PlaneFit {
    /// The plane at a pixel.
    pub fn at(&self, column: f64, row: f64) -> f64 {
        self.origin + self.per_column * column + self.per_row * row
    }
}

/// Pixels that are summed side by side. Their number is fixed, so that every vector width gives the same bits.
const LANES: usize = 8;

/// Sums over pixels of one line within the limit: their number, x, x², v, x v, v², where x is the place along the line from
/// the middle and v the residual.
type Sums = [[f64; LANES]; 6];

/// Least squares over every `step`-th line.
pub(crate) fn roughly(image: &Image, step: usize) -> Option<PlaneFit> {
    let columns = 0..image.columns;
    let mut sums = PlaneSums::new(&FLAT, columns.clone(), image.rows);
    line_sums(
        image,
        columns,
        &FLAT,
        f64::INFINITY,
        step,
        |row, of_line| {
            sums.add_line(row, of_line);
        },
    );
    sums.plane()
}

/// No plane at all.
pub(crate) const FLAT: PlaneFit = PlaneFit {
    origin: 0.0,
    per_column: 0.0,
    per_row: 0.0,
    residual: f64::INFINITY,
};

/// Normal equations of a plane through what another one leaves. Centred coordinates and residuals from that keep the sums
/// well conditioned.
pub(crate) struct PlaneSums {
    guess: PlaneFit,
    middle: [f64; 2],
    normal: Matrix3<f64>,
    right: Vector3<f64>,
    squares: f64,
    count: f64,
}

/// Sums over some pixels: their number, and with v the residual of each, Σv and Σv².
#[derive(Clone, Copy, Default)]
pub(crate) struct Plain {
    pub(crate) count: f64,
    pub(crate) v: f64,
    pub(crate) vv: f64,
}

impl PlaneSums {
    pub(crate) fn new(guess: &PlaneFit, columns: Range<usize>, rows: usize) -> Self {
        Self {
            guess: *guess,
            middle: [
                (columns.start + columns.end) as f64 / 2.0,
                rows as f64 / 2.0,
            ],
            normal: Matrix3::zeros(),
            right: Vector3::zeros(),
            squares: 0.0,
            count: 0.0,
        }
    }

    /// Adds the pixels of a line, with Σx, Σx² and Σxv, x from the middle of the columns.
    pub(crate) fn add_line(&mut self, row: usize, [n, sx, sxx, sv, sxv, svv]: [f64; 6]) {
        let y = row as f64 - self.middle[1];
        self.normal += Matrix3::new(n, sx, n * y, sx, sxx, sx * y, n * y, sx * y, n * y * y);
        self.right += Vector3::new(sv, sxv, sv * y);
        self.squares += svv;
        self.count += n;
    }

    /// Adds the pixels of a column, with Σy, Σy² and Σyv, y from the middle of the lines.
    pub(crate) fn add_column(&mut self, column: usize, plain: Plain, [y, yy, yv]: [f64; 3]) {
        let x = column as f64 - self.middle[0];
        let Plain { count: n, v, vv } = plain;
        self.normal += Matrix3::new(n, n * x, y, n * x, n * x * x, x * y, y, x * y, yy);
        self.right += Vector3::new(v, x * v, yv);
        self.squares += vv;
        self.count += n;
    }

    pub(crate) fn plane(&self) -> Option<PlaneFit> {
        let inverse = self.normal.try_inverse()?;
        let step = inverse * self.right;
        if !(self.count >= 3.0 && step.iter().all(|s| s.is_finite())) {
            return None;
        }
        let explained = step.dot(&self.right);
        let [cx, cy] = self.middle;
        Some(PlaneFit {
            origin: self.guess.origin + step[0] - step[1] * cx - step[2] * cy,
            per_column: self.guess.per_column + step[1],
            per_row: self.guess.per_row + step[2],
            residual: ((self.squares - explained).max(0.0) / self.count).sqrt(),
        })
    }
}

/// The sums of every `step`-th line over the pixels of some columns whose residual from a plane is within `limit`: their number,
/// Σx, Σx², Σv, Σxv and Σv², where x is the place along the line from the middle of the columns and v the residual.
pub(crate) fn line_sums(
    image: &Image,
    columns: Range<usize>,
    plane: &PlaneFit,
    limit: f64,
    step: usize,
    mut each: impl FnMut(usize, [f64; 6]),
) {
    let middle = (columns.start + columns.end) as f64 / 2.0;
    let from_middle: Vec<f64> = columns.clone().map(|c| c as f64 - middle).collect();
    let slope = columns.clone().map(|c| plane.per_column * c as f64);
    let slope: Vec<f64> = slope.collect();
    for row in (0..image.rows).step_by(step) {
        interrupt::check();
        let line = Line {
            values: &image.row(row)[columns.clone()],
            from_middle: &from_middle,
            slope: &slope,
            start: plane.origin + plane.per_row * row as f64,
        };
        each(row, line.sums(limit));
    }
}

/// One line of an image and of the plane that is guessed.
struct Line<'a> {
    values: &'a [f64],
    /// Columns from the middle of those that are used.
    from_middle: &'a [f64],
    /// The guessed plane along the line, from its start.
    slope: &'a [f64],
    start: f64,
}

impl Line<'_> {
    fn sums(&self, limit: f64) -> [f64; 6] {
        let mut sums: Sums = [[0.0; LANES]; 6];
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || {
                let (values, ends) = self.values.as_chunks::<LANES>();
                let (xs, last_xs) = self.from_middle.as_chunks::<LANES>();
                let (slopes, last_slopes) = self.slope.as_chunks::<LANES>();
                for ((values, xs), slopes) in values.iter().zip(xs).zip(slopes) {
                    for lane in 0..LANES {
                        let v = values[lane] - slopes[lane] - self.start;
                        add(&mut sums, lane, xs[lane], v, limit);
                    }
                }
                for (lane, value) in ends.iter().enumerate() {
                    let v = value - last_slopes[lane] - self.start;
                    add(&mut sums, lane, last_xs[lane], v, limit);
                }
            },
        );
        sums.map(|lanes| lanes.iter().sum())
    }
}

#[expect(
    clippy::inline_always,
    reason = "only inlined code is compiled for the wide vectors"
)]
#[inline(always)]
fn add(sums: &mut Sums, lane: usize, x: f64, v: f64, limit: f64) {
    // False for NaN as well.
    let inside = v.abs() < limit;
    let (one, x, v) = if inside { (1.0, x, v) } else { (0.0, 0.0, 0.0) };
    for (sum, term) in sums.iter_mut().zip([one, x, x * x, v, x * v, v * v]) {
        sum[lane] += term;
    }
}
