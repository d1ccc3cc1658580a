//! Normal equations of functions that describe the phases ψ₁, ψ₂ and ψ₂ − ψ₁ + a constant.
//!
//! The three waves see the same functions, so that of each place the values of these are kept once. They are summed for the
//! functions that are not zero there, and those sums go into the matrix when others take their place.

use nalgebra::{DMatrix, DVector, Vector2};

use crate::coverage::basis::Basis;
use crate::numbers::normal_equations::NormalEquations;
use crate::numbers::widest::widest;

/// What holds coefficients that nothing sees, as a share of the mean of the diagonal.
const STIFFNESS: f64 = 1e-6;

/// The functions that are not zero at a place, ordered, each with its value.
#[derive(Default)]
pub(crate) struct Functions {
    pub(crate) names: Vec<usize>,
    pub(crate) values: Vec<f64>,
}

impl Functions {
    pub(crate) fn at(basis: &Basis, at: Vector2<f64>) -> Self {
        let (names, values) = basis.at(at).into_iter().map(|(i, [x, ..])| (i, x)).unzip();
        Self { names, values }
    }

    /// What they are here less what they are at another place.
    pub(crate) fn less(&self, other: &Self) -> Self {
        let mut both = Self::default();
        let (mut m, mut n) = (0, 0);
        while m < other.names.len() || n < self.names.len() {
            let (i, j) = (other.names.get(m), self.names.get(n));
            let first = j.is_none_or(|j| i.is_some_and(|i| i <= j));
            let second = i.is_none_or(|i| j.is_some_and(|j| j <= i));
            let value = match (first, second) {
                (true, true) => self.values[n] - other.values[m],
                (true, false) => -other.values[m],
                _ => self.values[n],
            };
            both.names.extend(if first { i } else { j });
            both.values.push(value);
            m += usize::from(first);
            n += usize::from(second);
        }
        both
    }

    /// ψ of the three waves, without the constant of the third: `count` functions describe ψ₁ and as many ψ₂.
    pub(crate) fn phases(&self, coefficients: &DVector<f64>, count: usize) -> [f64; 3] {
        let all = || self.names.iter().zip(&self.values);
        let first: f64 = all().map(|(i, x)| coefficients[*i] * x).sum();
        let second = all().map(|(i, x)| coefficients[count + i] * x);
        [
            first,
            second.clone().sum(),
            second.fold(-first, |sum, term| sum + term),
        ]
    }
}

/// Normal equations that are filled place by place, in the lower triangle.
pub(crate) struct Sums {
    normal: DMatrix<f64>,
    pub(crate) right: DVector<f64>,
    /// Functions of ψ₁, as many of ψ₂.
    count: usize,
    here: Here,
}

/// What the matrix has for the functions that are at hand.
#[derive(Default)]
struct Here {
    names: Vec<usize>,
    /// Column by column: those of ψ₁ with each other, those of ψ₂ with those of ψ₁, and with each other.
    blocks: [Vec<f64>; 3],
    /// The constant with those of ψ₁, with those of ψ₂, and with itself.
    constant: [Vec<f64>; 2],
    corner: f64,
}

impl Sums {
    /// For a number of functions of each phase.
    pub(crate) fn new(count: usize) -> Self {
        let size = 2 * count + 1;
        Self {
            normal: DMatrix::zeros(size, size),
            right: DVector::zeros(size),
            count,
            here: Here::default(),
        }
    }

    /// Adds the three waves at a place; `constant`: what that of the third is there, 0 for differences of two places.
    pub(crate) fn add(&mut self, functions: &Functions, weights: [f64; 3], constant: f64) {
        if self.here.names != functions.names {
            self.put_back();
            self.take(&functions.names);
        }
        self.here.add(&functions.values, weights, constant);
    }

    /// Adds what was measured of the three waves.
    pub(crate) fn add_right(
        &mut self,
        functions: &Functions,
        measured: [f64; 3],
        weights: [f64; 3],
        constant: f64,
    ) {
        let n = self.count;
        let [a, b, c] = weights;
        for (i, x) in functions.names.iter().zip(&functions.values) {
            let third = c * x * measured[2];
            let (first, second) = (a * x * measured[0], b * x * measured[1]);
            self.right[*i] = self.right[*i] + first - third;
            self.right[n + i] = self.right[n + i] + second + third;
        }
        self.right[2 * n] += c * constant * measured[2];
    }

    /// Places in the matrix of what is at hand: block, number within it, row and column.
    fn places(names: &[usize], count: usize, mut each: impl FnMut(usize, usize, [usize; 2])) {
        let size = names.len();
        for (j, column) in names.iter().enumerate() {
            for (i, row) in names.iter().enumerate() {
                let number = j * size + i;
                if i >= j {
                    each(0, number, [*row, *column]);
                    each(2, number, [count + row, count + column]);
                }
                each(1, number, [count + row, *column]);
            }
        }
    }

    fn take(&mut self, names: &[usize]) {
        let (n, size) = (self.count, names.len());
        let Here {
            blocks, constant, ..
        } = &mut self.here;
        for block in blocks.iter_mut() {
            block.clear();
            block.resize(size * size, 0.0);
        }
        let normal = &self.normal;
        Self::places(names, n, |block, number, [row, column]| {
            blocks[block][number] = normal[(row, column)];
        });
        for (first, constant) in [0, n].into_iter().zip(constant) {
            constant.clear();
            constant.extend(names.iter().map(|i| normal[(2 * n, first + i)]));
        }
        self.here.corner = normal[(2 * n, 2 * n)];
        self.here.names.clear();
        self.here.names.extend(names);
    }

    fn put_back(&mut self) {
        let n = self.count;
        let (here, normal) = (&self.here, &mut self.normal);
        if here.names.is_empty() {
            return;
        }
        Self::places(&here.names, n, |block, number, [row, column]| {
            normal[(row, column)] = here.blocks[block][number];
        });
        for (first, constant) in [0, n].into_iter().zip(&here.constant) {
            for (i, value) in here.names.iter().zip(constant) {
                normal[(2 * n, first + i)] = *value;
            }
        }
        normal[(2 * n, 2 * n)] = here.corner;
    }

    pub(crate) fn equations(&mut self, basis: &Basis) -> Option<NormalEquations> {
        self.put_back();
        let mut normal = self.normal.clone();
        let size = self.right.len();
        let stiffness = STIFFNESS * normal.trace() / size as f64;
        normal.fill_upper_triangle_with_lower_triangle();
        if let Basis::Splines(splines) = basis {
            for first in [0, basis.len()] {
                splines.in_lines(|places| {
                    for (a, x) in places.iter().zip([1.0, -2.0, 1.0]) {
                        for (b, y) in places.iter().zip([1.0, -2.0, 1.0]) {
                            normal[(first + a, first + b)] += stiffness * x * y;
                        }
                    }
                });
            }
        }
        // Constants are free where only differences are looked at.
        for i in 0..size {
            normal[(i, i)] += 1e-3 * stiffness;
        }
        let units = NormalEquations::units(&normal);
        NormalEquations::new(&normal, units, |_| 0.0)
    }
}

impl Here {
    fn add(&mut self, values: &[f64], weights: [f64; 3], constant: f64) {
        let size = values.len();
        let [first, mixed, second] = &mut self.blocks;
        widest(
            #[inline(always)]
            || {
                let columns = first
                    .chunks_exact_mut(size)
                    .zip(mixed.chunks_exact_mut(size))
                    .zip(second.chunks_exact_mut(size));
                for (((first, mixed), second), y) in columns.zip(values) {
                    let [a, b, c] = weights.map(|weight| weight * y);
                    let rows = first.iter_mut().zip(mixed).zip(second);
                    for (((first, mixed), second), x) in rows.zip(values) {
                        let third = x * c;
                        *first = *first + x * a + third;
                        *second = *second + x * b + third;
                        *mixed -= third;
                    }
                }
            },
        );
        let [first, second] = &mut self.constant;
        for ((first, second), y) in first.iter_mut().zip(second).zip(values) {
            let third = constant * (weights[2] * y);
            *first -= third;
            *second += third;
        }
        self.corner += constant * (weights[2] * constant);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;
    use crate::numbers::splines::Splines;

    /// Sums over the functions at hand are those of whole rows.
    #[test]
    fn sums_are_those_of_rows() {
        let corners = [Vector2::zeros(), Vector2::new(60.0, 40.0)];
        let basis = Basis::Splines(Splines::new(corners, [3, 2]));
        let n = basis.len();
        let mut sums = Sums::new(n);
        let mut normal = DMatrix::<f64>::zeros(2 * n + 1, 2 * n + 1);
        let mut right = DVector::<f64>::zeros(2 * n + 1);
        let at = |i: usize| Vector2::new((7 * i % 61) as f64, (11 * i % 41) as f64);
        for i in 0..40 {
            let functions = Functions::at(&basis, at(i)).less(&Functions::at(&basis, at(i + 1)));
            let weights = [1.0, 2.0, 3.0].map(|w| w / (1.0 + i as f64));
            let measured = [0.3, -0.2, 0.1];
            sums.add(&functions, weights, 0.5);
            sums.add_right(&functions, measured, weights, 0.5);
            let mut rows = [(); 3].map(|()| DVector::<f64>::zeros(2 * n + 1));
            for (i, x) in functions.names.iter().zip(&functions.values) {
                rows[0][*i] = *x;
                rows[1][n + i] = *x;
                rows[2][*i] = -x;
                rows[2][n + i] = *x;
            }
            rows[2][2 * n] = 0.5;
            for (wave, row) in rows.iter().enumerate() {
                normal += weights[wave] * row * row.transpose();
                right += weights[wave] * measured[wave] * row;
            }
            let coefficients = DVector::from_fn(2 * n + 1, |i, _| (i as f64).sin());
            let phases = functions.phases(&coefficients, n);
            let wanted = rows.map(|row| row.dot(&coefficients));
            assert!((phases[1] - wanted[1]).abs() < 1e-12);
            assert!((phases[2] + 0.5 * coefficients[2 * n] - wanted[2]).abs() < 1e-12);
        }
        sums.put_back();
        let found = &sums.normal;
        let lower = (0..=2 * n).flat_map(|j| (j..=2 * n).map(move |i| (i, j)));
        assert!((sums.right - right).amax() < 1e-12);
        for place in lower {
            assert!((found[place] - normal[place]).abs() < 1e-12, "{place:?}");
        }
    }
}
