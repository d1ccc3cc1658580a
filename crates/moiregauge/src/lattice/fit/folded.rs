//! A line of an image folded about its centre, and its correlation with harmonics. Folding halves the work: cosines are even in X, sines odd.

use rustfft::num_complex::Complex64;

use crate::lattice::fit::frame::{BENT, Frame, ORDERS};
use crate::lattice::fit::tables::{Block, LANES, Tables, sum};
use crate::numbers::widest::widest;

/// A line folded about its centre: sums (even part) and differences (odd part) of the values at X and −X, also multiplied by powers of X.
pub(crate) struct Folded {
    x: Vec<Block>,
    even: Vec<Block>,
    odd: Vec<Block>,
    tilted_even: Vec<Block>,
    tilted_odd: Vec<Block>,
    /// Multiplied by X² and X³; filled by [`Self::raise`].
    squared_even: Vec<Block>,
    squared_odd: Vec<Block>,
    cubed_even: Vec<Block>,
    cubed_odd: Vec<Block>,
    /// The unfolded line, for a frame whose pixels have displacements, where symmetry does not hold.
    whole: Option<Vec<f64>>,
}

impl Folded {
    pub(crate) fn new(frame: &Frame) -> Self {
        let mut x = vec![[0.0; LANES]; frame.right().len().div_ceil(LANES)];
        for (value, x) in x.as_flattened_mut().iter_mut().zip(frame.right()) {
            *value = *x;
        }
        let zeros = vec![[0.0; LANES]; x.len()];
        Self {
            x,
            even: zeros.clone(),
            odd: zeros.clone(),
            tilted_even: zeros.clone(),
            tilted_odd: zeros.clone(),
            squared_even: zeros.clone(),
            squared_odd: zeros.clone(),
            cubed_even: zeros.clone(),
            cubed_odd: zeros,
            whole: (frame.displacement.as_ref()).map(|_| vec![0.0; frame.image.columns]),
        }
    }

    /// Folds a line.
    pub(crate) fn take(&mut self, line: &[f64]) {
        if let Some(whole) = &mut self.whole {
            whole.copy_from_slice(line);
        }
        let half = line.len().div_ceil(2);
        let (even, odd) = (self.even.as_flattened_mut(), self.odd.as_flattened_mut());
        widest(
            #[inline(always)]
            || {
                let pairs = line[line.len() / 2..].iter().zip(line[..half].iter().rev());
                for ((right, left), (even, odd)) in pairs.zip(even.iter_mut().zip(odd)) {
                    *even = right + left;
                    *odd = right - left;
                }
            },
        );
        if line.len() % 2 == 1 {
            // The central pixel was added to itself.
            even[0] *= 0.5;
        }
        let tilted = self.tilted_even.iter_mut().zip(&mut self.tilted_odd);
        let plain = self.x.iter().zip(self.even.iter().zip(&self.odd));
        for ((te, to), (x, (e, o))) in tilted.zip(plain) {
            for i in 0..LANES {
                te[i] = x[i] * e[i];
                to[i] = x[i] * o[i];
            }
        }
    }

    /// Multiplies the folded line by X² and X³.
    fn raise(&mut self) {
        let squared = self.squared_even.iter_mut().zip(&mut self.squared_odd);
        let cubed = self.cubed_even.iter_mut().zip(&mut self.cubed_odd);
        let tilted = self.tilted_even.iter().zip(&self.tilted_odd);
        let tilted = self.x.iter().zip(tilted);
        for (((se, so), (ce, co)), (x, (te, to))) in squared.zip(cubed).zip(tilted) {
            for i in 0..LANES {
                se[i] = x[i] * te[i];
                so[i] = x[i] * to[i];
                ce[i] = x[i] * se[i];
                co[i] = x[i] * so[i];
            }
        }
    }

    /// Sums of the line times `X² cos`, `X² sin`, `X³ cos` and `X³ sin`.
    fn raised_products(&self, waves: &[[Block; 2]]) -> [f64; 4] {
        widest(
            #[inline(always)]
            || {
                let mut sums = [[0.0; LANES]; 4];
                let squared = self.squared_even.iter().zip(&self.squared_odd);
                let cubed = self.cubed_even.iter().zip(&self.cubed_odd);
                for (((se, so), (ce, co)), [cos, sin]) in squared.zip(cubed).zip(waves) {
                    // Cosines take what is even in X: the even part times X², the odd part times X³.
                    for (sum, (a, b)) in
                        (sums.iter_mut()).zip([(se, cos), (so, sin), (co, cos), (ce, sin)])
                    {
                        for i in 0..LANES {
                            sum[i] += a[i] * b[i];
                        }
                    }
                }
                sums.map(|s| s.iter().sum())
            },
        )
    }

    /// Sums of the line times 1, X, X², X³.
    pub(crate) fn moments(&self, degree: usize) -> [f64; 4] {
        let mut moments = [sum(self.even.as_flattened()), 0.0, 0.0, 0.0];
        moments[1] = sum(self.tilted_odd.as_flattened());
        if degree > 1 {
            let tilted = self.tilted_even.iter().zip(&self.tilted_odd);
            for ((te, to), x) in tilted.zip(&self.x) {
                for i in 0..LANES {
                    moments[2] += te[i] * x[i];
                    moments[3] += to[i] * x[i] * x[i];
                }
            }
        }
        moments
    }

    /// Sums of the line times `cos`, `sin`, `X cos`, `X sin` of N harmonics, as partial sums that the compiler
    /// keeps in registers.
    fn products<const N: usize>(&self, waves: [&[[Block; 2]]; N]) -> [[f64; 4]; N] {
        /// Half of the values that are handled together.
        const HALF: usize = LANES / 2;
        widest(
            #[inline(always)]
            || {
                let n = self.even.len();
                let (even, odd) = (&self.even[..n], &self.odd[..n]);
                let (tilted_even, tilted_odd) = (&self.tilted_even[..n], &self.tilted_odd[..n]);
                let waves = waves.map(|blocks| &blocks[..n]);
                let mut sums = [[[0.0; HALF]; 4]; N];
                for block in 0..n {
                    for half in [0, HALF] {
                        let part = |values: &[Block]| -> [f64; HALF] {
                            std::array::from_fn(|i| values[block][half + i])
                        };
                        let (e, o) = (part(even), part(odd));
                        let (te, to) = (part(tilted_even), part(tilted_odd));
                        for (sums, wave) in sums.iter_mut().zip(waves) {
                            let [cos, sin] = &wave[block];
                            for i in 0..HALF {
                                sums[0][i] += e[i] * cos[half + i];
                                sums[1][i] += o[i] * sin[half + i];
                                sums[2][i] += to[i] * cos[half + i];
                                sums[3][i] += te[i] * sin[half + i];
                            }
                        }
                    }
                }
                sums.map(|sums| sums.map(|s| s.iter().sum()))
            },
        )
    }

    /// Calls `each` with the index of each harmonic and the sums of the line times `cos`, `sin`, `X cos`, `X sin`.
    pub(crate) fn all_products(
        &self,
        tables: &Tables,
        row: usize,
        mut each: impl FnMut(usize, [f64; 4]),
    ) {
        if let (Some(bent), Some(line)) = (&tables.bent, &self.whole) {
            for (i, [plain, tilted, ..]) in bent.products(row, line).into_iter().enumerate() {
                each(i, [plain.re, plain.im, tilted.re, tilted.im]);
            }
            return;
        }
        let harmonics = tables.up.len();
        for i in (0..harmonics - harmonics % 2).step_by(2) {
            let [first, second] = self.products([tables.of(i), tables.of(i + 1)]);
            each(i, first);
            each(i + 1, second);
        }
        if harmonics % 2 == 1 {
            let [last] = self.products([tables.of(harmonics - 1)]);
            each(harmonics - 1, last);
        }
    }
}

/// Correlations of lines with `XᵃYᵇ e^{iθ}` of each harmonic for the powers (a, b) of [`BENT`]. Real parts belong to cosines,
/// imaginary parts to sines.
pub(crate) struct Bends(pub(crate) Vec<[Complex64; ORDERS]>);

impl Bends {
    pub(crate) fn new(harmonics: usize) -> Self {
        Self(vec![[Complex64::default(); ORDERS]; harmonics])
    }

    /// Correlations of one line.
    pub(crate) fn of_line(frame: &Frame, tables: &Tables, row: usize, line: &mut Folded) -> Self {
        let mut bends = Self::new(tables.up.len());
        let y = frame.y[row];
        let mut put = |i: usize, along: [Complex64; 4]| {
            let along = along.map(|sum| sum * tables.up[i][row]);
            for (sum, [a, b]) in bends.0[i].iter_mut().zip(BENT) {
                *sum = along[*a] * y.powi(*b as i32);
            }
        };
        if let (Some(bent), Some(whole)) = (&tables.bent, &line.whole) {
            for (i, along) in bent.products(row, whole).into_iter().enumerate() {
                put(i, along);
            }
            return bends;
        }
        line.raise();
        line.all_products(tables, row, |i, [c, s, xc, xs]| {
            let [xxc, xxs, xxxc, xxxs] = line.raised_products(tables.of(i));
            let along = [[c, s], [xc, xs], [xxc, xxs], [xxxc, xxxs]];
            put(i, along.map(|[re, im]| Complex64::new(re, im)));
        });
        bends
    }

    /// Adds the correlations of other lines.
    pub(crate) fn add(&mut self, other: &Self) {
        for (sums, others) in self.0.iter_mut().zip(&other.0) {
            for (sum, other) in sums.iter_mut().zip(others) {
                *sum += other;
            }
        }
    }
}
