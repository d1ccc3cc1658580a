//! Fourier transforms of matrices, line by line and column by column.

use std::cell::RefCell;
use std::sync::Arc;

use rayon::prelude::*;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::num_complex::{Complex, Complex64};
use rustfft::{Fft, FftPlanner};

use crate::numbers::interrupt;

/// Lines that a thread transforms at once, at least.
const LINES: usize = 32;

/// Blocks of columns that are in work at once: enough for many threads.
const BLOCKS: usize = 32;

/// Columns transformed together: enough to fill a cache line, few enough to stay in the cache.
const COLUMN_BLOCK: usize = 8;

thread_local! {
    /// Planners keep the plans they made: planning costs as much as a small transform.
    static PLANNERS: RefCell<(RealFftPlanner<f64>, FftPlanner<f64>)> =
        RefCell::new((RealFftPlanner::new(), FftPlanner::new()));
}

/// The plans for the way back: of a line, complex to real, and of a column.
pub(crate) fn inverses(
    rows: usize,
    columns: usize,
) -> (Arc<dyn ComplexToReal<f64>>, Arc<dyn Fft<f64>>) {
    PLANNERS.with_borrow_mut(|(real, complex)| {
        (
            real.plan_fft_inverse(columns),
            complex.plan_fft_inverse(rows),
        )
    })
}

/// The plans for the way there: of a line, real to complex, and of a column.
fn forwards(rows: usize, columns: usize) -> (Arc<dyn RealToComplex<f64>>, Arc<dyn Fft<f64>>) {
    PLANNERS.with_borrow_mut(|(real, complex)| {
        (
            real.plan_fft_forward(columns),
            complex.plan_fft_forward(rows),
        )
    })
}

/// How the values of a transform are kept; they are calculated in double precision.
pub(crate) trait Kept: Copy + Default + Send + Sync {
    fn kept(value: f64) -> Self;
    fn wide(self) -> f64;
}

impl Kept for f64 {
    fn kept(value: f64) -> Self {
        value
    }

    fn wide(self) -> f64 {
        self
    }
}

impl Kept for f32 {
    fn kept(value: f64) -> Self {
        value as Self
    }

    fn wide(self) -> f64 {
        f64::from(self)
    }
}

fn kept<T: Kept>(value: Complex64) -> Complex<T> {
    Complex::new(T::kept(value.re), T::kept(value.im))
}

pub(crate) fn wide<T: Kept>(value: Complex<T>) -> Complex64 {
    Complex64::new(value.re.wide(), value.im.wide())
}

/// The size of an image and of the grid on which it is transformed, columns and rows.
#[derive(Clone, Copy)]
pub(crate) struct Grid {
    pub(crate) image: [usize; 2],
    pub(crate) padded: [usize; 2],
}

/// Real-to-complex transform of the lines of an image, zero-padded, on all threads, and what `line` returns for each of them.
///
/// `line` fills in one line; the padding of the buffer it is given is zero already. `room` makes what it needs, once for many
/// lines.
pub(crate) fn forward<T: Kept, S, R: Send>(
    grid: Grid,
    room: impl Fn() -> S + Sync,
    line: impl Fn(&mut S, usize, &mut [f64]) -> R + Sync,
) -> (Vec<Complex<T>>, Vec<R>) {
    let [columns, rows] = grid.padded;
    let half = columns / 2 + 1;
    let (real, complex) = forwards(rows, columns);
    let mut values = vec![Complex::default(); rows * half];
    let lines = values.par_chunks_exact_mut(half).take(grid.image[1]);
    let buffers = || {
        let (input, output) = (real.make_input_vec(), real.make_output_vec());
        (input, output, real.make_scratch_vec(), room())
    };
    let said = lines.with_min_len(LINES).enumerate().map_init(
        buffers,
        |(buffer, transformed, scratch, room), (row, out)| {
            interrupt::check();
            buffer.fill(0.0);
            let said = line(room, row, &mut buffer[..grid.image[0]]);
            real.process_with_scratch(buffer, transformed, scratch)
                .unwrap_or_else(|e| unreachable!("row buffers fit their plan: {e}"));
            for (out, value) in out.iter_mut().zip(transformed) {
                *out = kept(*value);
            }
            said
        },
    );
    let said = said.collect();
    columns_in_place(&mut values, rows, half, &*complex);
    (values, said)
}

/// Transforms every column of a `rows × width` matrix in place, a few columns at a time.
pub(crate) fn columns_in_place<T: Kept>(
    values: &mut [Complex<T>],
    rows: usize,
    width: usize,
    plan: &dyn Fft<f64>,
) {
    for first in (0..width).step_by(COLUMN_BLOCK * BLOCKS) {
        let starts = (first..width).step_by(COLUMN_BLOCK).take(BLOCKS);
        let starts: Vec<usize> = starts.collect();
        let columns = |first: usize| {
            interrupt::check();
            let count = COLUMN_BLOCK.min(width - first);
            let mut block = vec![Complex64::default(); count * rows];
            for (row, line) in values.chunks_exact(width).enumerate() {
                for (c, value) in line[first..first + count].iter().enumerate() {
                    block[c * rows + row] = wide(*value);
                }
            }
            let mut scratch = vec![Complex64::default(); plan.get_inplace_scratch_len()];
            plan.process_with_scratch(&mut block, &mut scratch);
            block
        };
        let blocks: Vec<Vec<Complex64>> = starts.par_iter().map(|&first| columns(first)).collect();
        let lines = values.par_chunks_exact_mut(width).with_min_len(LINES);
        lines.enumerate().for_each(|(row, line)| {
            for (block, out) in blocks.iter().zip(line[first..].chunks_mut(COLUMN_BLOCK)) {
                for (c, value) in out.iter_mut().enumerate() {
                    *value = kept(block[c * rows + row]);
                }
            }
        });
    }
}
