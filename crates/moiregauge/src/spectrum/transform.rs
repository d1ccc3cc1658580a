//! The windowed, zero-padded Fourier transform of an image, and its autocorrelation.
//!
//! One transform serves both: its squared modulus is the periodogram in which the lattice is
//! found, and the inverse transform of that is the autocorrelation. The image is weighted with a
//! Hann window `w`; missing pixels weigh nothing. Pixel coordinates `n = (column, row)`,
//! frequencies in rad per pixel.

use nalgebra::Vector2;
use rustfft::num_complex::{Complex, Complex64};

use crate::frame::image::Image;
use crate::spectrum::fourier::{Grid, Kept, columns_in_place, forward, inverses, wide};
use crate::spectrum::hann::hann;
use crate::spectrum::lags::{Autocorrelation, Overlap, lag_sums};

/// Spectrum `F(k) = Σ w(n) I(n) e^{−ik·n}` on the padded grid, for non-negative column frequencies.
pub(crate) struct Spectrum<T = f64> {
    /// Padded height.
    pub(crate) rows: usize,
    /// Padded width.
    pub(crate) columns: usize,
    /// Size of the image, (columns, rows).
    pub(crate) image_size: [usize; 2],
    /// `rows × (columns/2 + 1)` values, row by row.
    pub(crate) values: Vec<Complex<T>>,
    /// The window along columns and along rows.
    pub(crate) window: [Vec<f64>; 2],
    /// Weights including missing pixels; `None` where none are missing.
    weights: Option<Image>,
}

impl Spectrum {
    /// Transforms `image` (background already removed), padded for lags up to half the image.
    pub(crate) fn new(image: &Image) -> Self {
        let size = |n: usize| padded(n + n / 2);
        Self::on_grid(image, size(image.rows), size(image.columns), hann)
    }

    /// The same without a window: every pixel weighs the same.
    pub(crate) fn unwindowed(image: &Image) -> Self {
        Self::on_grid(
            image,
            padded(2 * image.rows),
            padded(2 * image.columns),
            |n| vec![1.0; n],
        )
    }

    /// The same without padding: frequencies are whole cycles per frame.
    pub(crate) fn unpadded(image: &Image) -> Self {
        Self::on_grid(image, image.rows, image.columns, hann)
    }

    /// A spectrum with the mean power of several images of one size; its phases mean nothing.
    pub(crate) fn mean_of(images: impl Iterator<Item = Image>) -> Option<Self> {
        let (mut mean, mut count) = (None::<Self>, 0.0);
        for image in images {
            let mut other = Self::new(&image);
            for value in &mut other.values {
                *value = Complex64::new(value.norm_sqr(), 0.0);
            }
            match &mut mean {
                None => mean = Some(other),
                Some(mean) => {
                    for (sum, value) in mean.values.iter_mut().zip(&other.values) {
                        *sum += value;
                    }
                }
            }
            count += 1.0;
        }
        let mut mean = mean?;
        for value in &mut mean.values {
            *value = Complex64::new((value.re / count).sqrt(), 0.0);
        }
        Some(mean)
    }

    fn on_grid(
        image: &Image,
        rows: usize,
        columns: usize,
        window: impl Fn(usize) -> Vec<f64>,
    ) -> Self {
        let window = [window(image.columns), window(image.rows)];
        let missing = image.values.iter().any(|v| !v.is_finite());
        let weights = missing.then(|| {
            let values = (0..image.values.len())
                .map(|i| {
                    let w = window[0][i % image.columns] * window[1][i / image.columns];
                    if image.values[i].is_finite() { w } else { 0.0 }
                })
                .collect();
            Image::new(image.rows, image.columns, values)
        });
        let image_size = [image.columns, image.rows];
        let line = |(): &mut (), row: usize, out: &mut [f64]| {
            let wr = window[1][row];
            for ((o, &v), w) in out.iter_mut().zip(image.row(row)).zip(&window[0]) {
                *o = if v.is_finite() { v * w * wr } else { 0.0 };
            }
        };
        let grid = Grid {
            image: image_size,
            padded: [columns, rows],
        };
        let (values, _) = forward(grid, || (), line);
        Self {
            rows,
            columns,
            image_size,
            values,
            window,
            weights,
        }
    }

    /// Grid step, rad per pixel, along columns and rows.
    pub(crate) fn step(&self) -> Vector2<f64> {
        std::f64::consts::TAU * Vector2::new(1.0 / self.columns as f64, 1.0 / self.rows as f64)
    }

    /// Autocorrelation as a plain sum over the overlap, for lags of up to 0.6 of the frame.
    pub(crate) fn summed_autocorrelation(&self) -> Autocorrelation {
        let max_lag = self.max_lag();
        Autocorrelation {
            max_lag,
            values: self.summed(&self.values, max_lag),
        }
    }

    /// 0.6 of the frame. On a grid of 1.5 frames a lag of 0.6 is mixed with one of 0.9, where the
    /// window leaves 10⁻⁴ of the overlap.
    fn max_lag(&self) -> [usize; 2] {
        self.image_size.map(|n| 3 * n / 5)
    }

    /// Autocorrelation divided by the weight of the overlap, for lags of up to 0.6 of the frame.
    pub(crate) fn autocorrelation(&self) -> Autocorrelation {
        let max_lag = self.max_lag();
        let summed = self.summed(&self.values, max_lag);
        let overlap = match &self.weights {
            None => {
                let [x, y] = [
                    lag_sums(&self.window[0], max_lag[0]),
                    lag_sums(&self.window[1], max_lag[1]),
                ];
                Overlap::Separable(x, y)
            }
            Some(weights) => {
                let grid = Grid {
                    image: self.image_size,
                    padded: [self.columns, self.rows],
                };
                let line = |(): &mut (), row: usize, out: &mut [f64]| {
                    out.copy_from_slice(weights.row(row));
                };
                let (spectrum, _) = forward(grid, || (), line);
                Overlap::Full(self.summed(&spectrum, max_lag))
            }
        };
        let width = 2 * max_lag[0] + 1;
        let floor = 1e-6 * overlap.at(max_lag[0], 0, width, max_lag[0]);
        let values = (0..summed.len())
            .map(|i| {
                let weight = overlap.at(i % width, i / width, width, max_lag[0]);
                if weight > floor {
                    summed[i] / weight
                } else {
                    f64::NAN
                }
            })
            .collect();
        Autocorrelation { max_lag, values }
    }

    /// `Σ_n f(n) f(n + lag)` from the transform of f, rows of lags ≥ 0, both signs along columns.
    fn summed(&self, spectrum: &[Complex64], max_lag: [usize; 2]) -> Vec<f64> {
        let half = self.half();
        let mut power: Vec<Complex64> = spectrum
            .iter()
            .map(|v| Complex64::new(v.norm_sqr(), 0.0))
            .collect();
        let (plan, inverse) = inverses(self.rows, self.columns);
        columns_in_place(&mut power, self.rows, half, &*inverse);
        let mut scratch = plan.make_scratch_vec();
        let mut line = plan.make_output_vec();
        let scale = 1.0 / (self.rows * self.columns) as f64;
        let mut out = Vec::with_capacity((max_lag[1] + 1) * (2 * max_lag[0] + 1));
        for row in power.chunks_exact_mut(half).take(max_lag[1] + 1) {
            // The transform of a real row is real at both ends of the spectrum; rounding is not.
            row[0].im = 0.0;
            row[half - 1].im = 0.0;
            plan.process_with_scratch(row, &mut line, &mut scratch)
                .unwrap_or_else(|e| unreachable!("row buffers fit their plan: {e}"));
            let (positive, negative) = (&line[..=max_lag[0]], &line[self.columns - max_lag[0]..]);
            out.extend(negative.iter().chain(positive).map(|v| v * scale));
        }
        out
    }
}

impl<T: Kept> Spectrum<T> {
    /// The transform of values that `line` writes line by line, none of them missing, under the window and without padding,
    /// and what it returns for each line. `room` makes what it needs, once for many lines.
    pub(crate) fn of_lines<S, R: Send>(
        image_size: [usize; 2],
        room: impl Fn() -> S + Sync,
        line: impl Fn(&mut S, usize, &mut [f64]) -> R + Sync,
    ) -> (Self, Vec<R>) {
        let [columns, rows] = image_size;
        let window = image_size.map(hann);
        let grid = Grid {
            image: image_size,
            padded: image_size,
        };
        let (values, said) = forward(grid, room, |room, row, out: &mut [f64]| {
            let said = line(room, row, out);
            for (value, w) in out.iter_mut().zip(&window[0]) {
                *value *= w * window[1][row];
            }
            said
        });
        let spectrum = Self {
            rows,
            columns,
            image_size,
            values,
            window,
            weights: None,
        };
        (spectrum, said)
    }

    /// Number of stored column frequencies.
    pub(crate) fn half(&self) -> usize {
        self.columns / 2 + 1
    }

    /// Value at any frequency of the grid, of either sign.
    pub(crate) fn at(&self, x: i64, y: i64) -> Complex64 {
        let (rows, columns) = (self.rows as i64, self.columns as i64);
        let x = x.rem_euclid(columns);
        if x > columns / 2 {
            let (x, y) = ((columns - x) as usize, (-y).rem_euclid(rows) as usize);
            self.value(x, y).conj()
        } else {
            self.value(x as usize, y.rem_euclid(rows) as usize)
        }
    }

    /// Squared modulus at the grid point (column frequency `kx ≥ 0`, row frequency `ky` mod rows).
    pub(crate) fn power(&self, kx: usize, ky: usize) -> f64 {
        self.value(kx, ky).norm_sqr()
    }

    /// Value at the grid point (column frequency `kx ≥ 0`, row frequency `ky` mod rows).
    pub(crate) fn value(&self, kx: usize, ky: usize) -> Complex64 {
        wide(self.values[ky * self.half() + kx])
    }
}

/// The smallest even 2·3·5-smooth size of at least `n`.
fn padded(n: usize) -> usize {
    let smooth = |mut m: usize| {
        for p in [2, 3, 5] {
            while m.is_multiple_of(p) {
                m /= p;
            }
        }
        m == 1
    };
    let mut m = n.max(8);
    while !m.is_multiple_of(2) || !smooth(m) {
        m += 1;
    }
    m
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    fn speckle(rows: usize, columns: usize, missing: bool) -> Image {
        let mut rng = crate::numbers::rng::stream(7, "speckle", 0);
        let values = (0..rows * columns)
            .map(|i| {
                let v: f64 = rng.random();
                if missing && i % 5 == 2 {
                    f64::NAN
                } else {
                    v - 0.5
                }
            })
            .collect();
        Image::new(rows, columns, values)
    }

    /// `Σ w(n) w(n+d) I(n) I(n+d) / Σ w(n) w(n+d)` over pixels that are there, by its definition;
    /// without the division where `summed`.
    fn by_definition(
        image: &Image,
        window: fn(usize) -> Vec<f64>,
        d: [i64; 2],
        summed: bool,
    ) -> f64 {
        let (wx, wy) = (window(image.columns), window(image.rows));
        let at = |x: i64, y: i64| {
            let inside =
                (0..image.columns as i64).contains(&x) && (0..image.rows as i64).contains(&y);
            let value = inside.then(|| image.row(y as usize)[x as usize])?;
            value
                .is_finite()
                .then(|| (value, wx[x as usize] * wy[y as usize]))
        };
        let (mut sum, mut weight) = (0.0, 0.0);
        for y in 0..image.rows as i64 {
            for x in 0..image.columns as i64 {
                if let (Some((a, wa)), Some((b, wb))) = (at(x, y), at(x + d[0], y + d[1])) {
                    sum += wa * wb * a * b;
                    weight += wa * wb;
                }
            }
        }
        if summed { sum } else { sum / weight }
    }

    /// The transform route equals the O(n⁴) definition: windowed, with missing pixels, and summed;
    /// on a frame that is not square. Lags up to half the frame are exact to rounding.
    #[test]
    fn autocorrelation_matches_its_definition() {
        for missing in [false, true] {
            let image = speckle(18, 22, missing);
            let normalised = Spectrum::new(&image).autocorrelation();
            let summed = Spectrum::unwindowed(&image).summed_autocorrelation();
            for d in [[0, 0], [3, 2], [-7, 5], [11, 9], [-11, -9], [4, 0]] {
                let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-11, "{d:?}: {a} {b}");
                let at = |ac: &Autocorrelation| ac.at(d[0], d[1]).unwrap();
                close(at(&normalised), by_definition(&image, hann, d, false));
                close(
                    at(&summed),
                    by_definition(&image, |n| vec![1.0; n], d, true),
                );
            }
        }
    }

    /// The stored half of the transform equals the definition `Σ w I e^{−ik·n}`.
    #[test]
    fn transform_matches_its_definition() {
        let image = speckle(16, 17, false);
        let spectrum = Spectrum::unpadded(&image);
        for (kx, ky) in [(0, 0), (3, 5), (8, 15), (1, 9)] {
            let mut sum = Complex64::default();
            for row in 0..image.rows {
                for column in 0..image.columns {
                    let phase = spectrum.step().x * (kx * column) as f64
                        + spectrum.step().y * (ky * row) as f64;
                    let w = spectrum.window[0][column] * spectrum.window[1][row];
                    sum += w * image.row(row)[column] * Complex64::from_polar(1.0, -phase);
                }
            }
            assert!((sum.norm_sqr() - spectrum.power(kx, ky)).abs() < 1e-12);
        }
    }
}
