//! How far a scanner departs from a straight one: a smooth function `w(n)` of the pixel.
//!
//! A pixel n lies at `r₀ + J n + w(n)`. Along the lines w is a sum of Legendre polynomials; the coefficient of each is a sum of
//! such polynomials across the lines and, for creep, of logarithms of the time since the frame began. Measured in pixels,
//! `U = J⁻¹ w` says where on a straight grid a pixel lies: a wave of q per pixel of that grid has the phase `q·(n + U(n))`.

use nalgebra::{DMatrix, Matrix2, Matrix2xX, Matrix4, Vector2};

/// A departure is drawn by this number of places along each side of a frame.
const PLACES: usize = 9;

/// A function across the lines, of v from −1 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Across {
    /// The Legendre polynomial of this degree.
    Power(usize),
    /// `ln(1 + s/τ)`, s from 0 at the first line in time to 1 at the last.
    Log {
        /// As a share of the frame.
        tau: f64,
        /// Whether the frame begins at the last row.
        from_last: bool,
    },
}

impl Across {
    /// Value and slope at v.
    pub(crate) fn at(self, v: f64) -> [f64; 2] {
        match self {
            Self::Power(degree) => legendre(v, degree)[degree],
            Self::Log { tau, from_last } => {
                let sign = if from_last { -1.0 } else { 1.0 };
                let since = (0.5 * (1.0 + sign * v)).max(0.0);
                [(since / tau).ln_1p(), 0.5 * sign / (tau + since)]
            }
        }
    }
}

/// Values and slopes of the Legendre polynomials up to a degree.
pub(crate) fn legendre(u: f64, degree: usize) -> Vec<[f64; 2]> {
    let mut all = vec![[1.0, 0.0], [u, 1.0]];
    for n in 1..degree {
        let (k, [p, _], [before, slope]) = (n as f64, all[n], all[n - 1]);
        // (n + 1) P′ₙ₊₁ follows from P′ₙ₊₁ = P′ₙ₋₁ + (2n + 1) Pₙ.
        all.push([
            ((2.0 * k + 1.0) * u * p - k * before) / (k + 1.0),
            slope + (2.0 * k + 1.0) * p,
        ]);
    }
    all.truncate(degree + 1);
    all
}

/// One term: a Legendre polynomial along the lines times a function across them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Term {
    pub(crate) along: usize,
    pub(crate) across: Across,
    /// x and y.
    pub(crate) size: Vector2<f64>,
}

/// What is not known of one degree along the lines: the covariance of the sizes of functions across them, along an axis.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Noise {
    pub(crate) along: usize,
    pub(crate) across: Vec<Across>,
    pub(crate) axis: Vector2<f64>,
    pub(crate) covariance: DMatrix<f64>,
}

/// The departure of the lines of one direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Departure {
    terms: Vec<Term>,
    noise: Vec<Noise>,
    /// u and v of pixel (0, 0), and their steps from pixel to pixel.
    first: [f64; 2],
    step: [f64; 2],
}

impl Departure {
    /// `first`, `last`: the columns, and the rows, at which u, and v, are −1 and 1. Beyond them it goes on straight.
    pub(crate) fn new(terms: Vec<Term>, columns: [usize; 2], rows: [usize; 2]) -> Self {
        let step = [columns, rows].map(|[first, last]| 2.0 / (last.max(first + 1) - first) as f64);
        Self {
            terms,
            noise: Vec::new(),
            first: [0, 1].map(|i| -1.0 - step[i] * [columns, rows][i][0] as f64),
            step,
        }
    }

    /// With errors of its terms.
    #[must_use]
    pub(crate) fn with_noise(self, noise: Vec<Noise>) -> Self {
        Self { noise, ..self }
    }

    /// What is not known of its slopes at a place: for each axis the covariance of the slopes from column to column and from row to row.
    pub(crate) fn noise_at(&self, place: Vector2<f64>) -> Vec<(Vector2<f64>, Matrix2<f64>)> {
        let [u, v] = [0, 1].map(|i| (self.first[i] + self.step[i] * place[i]).clamp(-1.0, 1.0));
        let of = |noise: &Noise| {
            let [p, dp] = legendre(u, noise.along)[noise.along];
            let sides = noise.across.iter().map(|across| {
                let [q, dq] = across.at(v);
                Vector2::new(dp * q * self.step[0], p * dq * self.step[1])
            });
            let sides = Matrix2xX::from_columns(&sides.collect::<Vec<_>>());
            (noise.axis, &sides * &noise.covariance * sides.transpose())
        };
        self.noise.iter().map(of).collect()
    }

    /// What is not known of straight lines through it at such places: covariance of the steps from column to column and from row to row, as that
    /// of a [`Geometry`](crate::frame::geometry::Geometry).
    pub(crate) fn noise_of_steps(&self, places: &[Vector2<f64>]) -> Matrix4<f64> {
        let middle = places.iter().sum::<Vector2<f64>>() / places.len() as f64;
        let spread: Matrix2<f64> = places
            .iter()
            .map(|at| (at - middle) * (at - middle).transpose())
            .sum();
        let Some(inverse) = spread.try_inverse() else {
            return Matrix4::zeros();
        };
        let of = |noise: &Noise| {
            let mut sides = Matrix2xX::zeros(noise.across.len());
            for at in places {
                let [u, v] = [0, 1].map(|i| self.first[i] + self.step[i] * at[i]);
                let along = legendre(u.clamp(-1.0, 1.0), noise.along)[noise.along][0];
                for (i, across) in noise.across.iter().enumerate() {
                    let value = along * across.at(v.clamp(-1.0, 1.0))[0];
                    let mut side = sides.column_mut(i);
                    side += inverse * (at - middle) * value;
                }
            }
            let slopes: Matrix2<f64> = &sides * &noise.covariance * sides.transpose();
            slopes.kronecker(&(noise.axis * noise.axis.transpose()))
        };
        self.noise.iter().map(of).sum()
    }

    /// In coordinates that are `map` times these.
    #[must_use]
    pub(crate) fn mapped(&self, map: &Matrix2<f64>) -> Self {
        let mut mapped = self.clone();
        for term in &mut mapped.terms {
            term.size = map * term.size;
        }
        for noise in &mut mapped.noise {
            noise.axis = map * noise.axis;
        }
        mapped
    }

    /// The same for a block of pixels that starts at (column, row).
    #[must_use]
    pub(crate) fn cropped(&self, first: [usize; 2]) -> Self {
        Self {
            first: [0, 1].map(|i| self.first[i] + self.step[i] * first[i] as f64),
            ..self.clone()
        }
    }

    /// The same in bins of a number of pixels along each axis; its values stay those of pixels.
    #[must_use]
    pub(crate) fn in_bins(&self, bin: usize) -> Self {
        let pixels = bin as f64;
        Self {
            first: [0, 1].map(|i| self.first[i] + self.step[i] * 0.5 * (pixels - 1.0)),
            step: self.step.map(|step| step * pixels),
            ..self.clone()
        }
    }

    /// With more terms.
    #[must_use]
    pub(crate) fn with_terms(mut self, terms: impl IntoIterator<Item = Term>) -> Self {
        self.terms.extend(terms);
        self
    }

    /// The steps of u and v from pixel to pixel, and both at (column, row).
    pub(crate) fn units(&self, place: Vector2<f64>) -> (Vector2<f64>, Vector2<f64>) {
        let (first, step) = (Vector2::from(self.first), Vector2::from(self.step));
        (step, first + step.component_mul(&place))
    }

    fn degree(&self) -> usize {
        self.terms.iter().map(|t| t.along).max().unwrap_or(0)
    }

    /// The polynomial along a row: a coefficient for each degree.
    fn row(&self, row: f64) -> Vec<Vector2<f64>> {
        let v = self.first[1] + self.step[1] * row;
        let mut sizes = vec![Vector2::zeros(); self.degree() + 1];
        for term in &self.terms {
            let edge = v.clamp(-1.0, 1.0);
            let [value, slope] = term.across.at(edge);
            sizes[term.along] += term.size * (value + slope * (v - edge));
        }
        sizes
    }

    fn along(&self, sizes: &[Vector2<f64>], column: f64) -> Vector2<f64> {
        let u = self.first[0] + self.step[0] * column;
        let edge = u.clamp(-1.0, 1.0);
        // Value and slope by the recurrence.
        let (mut before, mut here) = ([0.0, 0.0], [1.0, 0.0]);
        let mut sum = Vector2::zeros();
        for (n, size) in sizes.iter().enumerate() {
            sum += size * (here[0] + here[1] * (u - edge));
            let k = n as f64;
            let next = [
                ((2.0 * k + 1.0) * edge * here[0] - k * before[0]) / (k + 1.0),
                before[1] + (2.0 * k + 1.0) * here[0],
            ];
            (before, here) = (here, next);
        }
        sum
    }

    /// Its values at the columns of a row.
    pub(crate) fn line(&self, row: usize, columns: usize) -> Vec<Vector2<f64>> {
        let sizes = self.row(row as f64);
        let at = |column: usize| self.along(&sizes, column as f64);
        (0..columns).map(at).collect()
    }

    /// Its value at (column, row).
    pub fn at(&self, place: Vector2<f64>) -> Vector2<f64> {
        self.along(&self.row(place.y), place.x)
    }

    /// Its change from column to column and from row to row, a column each.
    pub fn slopes(&self, place: Vector2<f64>) -> Matrix2<f64> {
        let [u, v] = [0, 1].map(|i| (self.first[i] + self.step[i] * place[i]).clamp(-1.0, 1.0));
        let along = legendre(u, self.degree());
        let mut slopes = Matrix2::zeros();
        for term in &self.terms {
            let ([p, dp], [q, dq]) = (along[term.along], term.across.at(v));
            let sides = Vector2::new(dp * q * self.step[0], p * dq * self.step[1]);
            slopes += term.size * sides.transpose();
        }
        slopes
    }

    /// How far it goes, and its largest change from column to column, over some hundred places of a frame of such a size.
    pub(crate) fn largest(&self, size: [usize; 2]) -> (f64, f64) {
        const STEPS: usize = 10;
        let (mut far, mut stretch) = (0.0f64, 0.0f64);
        for i in 0..=STEPS * (STEPS + 2) {
            let share = [i % (STEPS + 1), i / (STEPS + 1)];
            let at = [0, 1].map(|k| (size[k] - 1) as f64 * share[k] as f64 / STEPS as f64);
            far = far.max(self.at(Vector2::from(at)).norm());
            stretch = stretch.max(self.slopes(Vector2::from(at)).column(0).norm());
        }
        (far, stretch)
    }

    /// Its values at [`PLACES`] × [`PLACES`] places of a frame of such a size, from edge to edge, row by row.
    pub(crate) fn drawn(&self, size: [usize; 2]) -> Vec<[f64; 2]> {
        let side = |n: usize, i: usize| (n as f64 - 1.0) * i as f64 / (PLACES - 1) as f64;
        let at = |i: usize| Vector2::new(side(size[0], i % PLACES), side(size[1], i / PLACES));
        (0..PLACES * PLACES)
            .map(|i| self.at(at(i)).into())
            .collect()
    }

    /// The mean of its slopes under a Gaussian window of such widths (standard deviations) about a place, over the pixels of a frame
    /// of such a size.
    pub(crate) fn mean_slopes(
        &self,
        place: Vector2<f64>,
        widths: Vector2<f64>,
        size: [usize; 2],
    ) -> Matrix2<f64> {
        /// Places along each axis, in widths, and their weights: exact for slopes up to the fifth degree (Gauss–Hermite).
        const NODES: [[f64; 2]; 3] = [
            [-1.732_050_807_568_877_2, 1.0],
            [0.0, 4.0],
            [1.732_050_807_568_877_2, 1.0],
        ];
        let (mut sum, mut weights) = (Matrix2::zeros(), 0.0);
        for [x, along] in NODES {
            for [y, across] in NODES {
                let at = place + Vector2::new(x, y).component_mul(&widths);
                let inside = |axis: usize| at[axis] >= 0.0 && at[axis] <= size[axis] as f64 - 1.0;
                if inside(0) && inside(1) {
                    let weight = along * across;
                    sum += self.slopes(at) * weight;
                    weights += weight;
                }
            }
        }
        if weights > 0.0 {
            sum / weights
        } else {
            self.slopes(place)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some() -> Departure {
        let term = |along, across, x, y| Term {
            along,
            across,
            size: Vector2::new(x, y),
        };
        let log = Across::Log {
            tau: 0.05,
            from_last: true,
        };
        let terms = vec![
            term(2, Across::Power(0), 0.7, -0.2),
            term(1, Across::Power(3), -0.3, 0.4),
            term(5, Across::Power(1), 0.1, 0.2),
            term(0, log, 0.3, -0.6),
        ];
        Departure::new(terms, [3, 77], [0, 59])
    }

    /// Slopes are the differences of the values, and a line holds the values at its pixels.
    #[test]
    fn slopes_and_lines_belong_to_the_values() {
        let bent = some();
        for place in [Vector2::new(20.0, 31.0), Vector2::new(61.5, 7.25)] {
            let h = 1e-4;
            for (axis, way) in [Vector2::new(h, 0.0), Vector2::new(0.0, h)]
                .iter()
                .enumerate()
            {
                let difference = (bent.at(place + way) - bent.at(place - way)) / (2.0 * h);
                assert!((bent.slopes(place).column(axis) - difference).norm() < 1e-8);
            }
        }
        let line = bent.line(12, 80);
        for (column, value) in line.iter().enumerate() {
            assert!((value - bent.at(Vector2::new(column as f64, 12.0))).norm() < 1e-12);
        }
        // P₂ = (3u² − 1)/2 in the middle of the columns is −1/2, and P₅ and P₁ are nothing there.
        let creep = (1.0 + (1.0 - 12.0 / 59.0) / 0.05f64).ln();
        let middle = Vector2::new(0.7, -0.2) * -0.5 + Vector2::new(0.3, -0.6) * creep;
        assert!((line[40] - middle).norm() < 1e-12);
    }

    /// A block and bins of pixels are the same function; beyond the columns that were used it goes on straight.
    #[test]
    fn other_pixels_are_the_same_places() {
        let bent = some();
        let at = |x: f64, y: f64| Vector2::new(x, y);
        assert!((bent.cropped([7, 5]).at(at(4.0, 9.0)) - bent.at(at(11.0, 14.0))).norm() < 1e-12);
        assert!((bent.in_bins(3).at(at(4.0, 9.0)) - bent.at(at(13.0, 28.0))).norm() < 1e-12);
        let off = bent.at(at(79.0, 20.0)) - bent.at(at(78.0, 20.0)) * 2.0 + bent.at(at(77.0, 20.0));
        assert!(off.norm() < 1e-12);
        let turn = Matrix2::new(0.0, -2.0, 1.0, 0.5);
        let place = at(33.0, 21.0);
        assert!((bent.mapped(&turn).at(place) - turn * bent.at(place)).norm() < 1e-12);
    }

    /// Under a window in the middle of a frame the mean slope of a cubic is that in the middle and half its second derivative times
    /// the variance of the window.
    #[test]
    fn windows_average_slopes() {
        let term = Term {
            along: 3,
            across: Across::Power(0),
            size: Vector2::new(1.0, 0.0),
        };
        let bent = Departure::new(vec![term], [0, 200], [0, 200]);
        let (place, width) = (Vector2::new(100.0, 100.0), 10.0);
        // P₃ = (5u³ − 3u)/2: slope −3/2 + 15u²/2 per u, u = (x − 100)/100.
        let expected = (-1.5 + 7.5 * (width / 100.0f64).powi(2)) / 100.0;
        let found = bent.mean_slopes(place, Vector2::repeat(width), [201, 201]);
        assert!((found[(0, 0)] / expected - 1.0).abs() < 1e-12, "{found}");
    }
}
