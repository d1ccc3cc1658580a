//! A position sensor that lags behind the tip: lines that bend where they begin.
//!
//! A sensor of the first order with the time constant T shows a tip of the speed V late by `V T`, and after each
//! turn-around it takes some T until it does: `x(t) = V (t − T) + 2 V T e^{−t/T}`. A straight line through the whole
//! is flatter than V: by `12 (T/T_line)²` of it where the bend lies within the line.
//!
//! In: the image of one sensor. Out: the exponential that its mean line has beside a polynomial of the third degree,
//! which takes the place of creep and hysteresis; nothing where noise or another shape explains the line as well.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Vector2};

use crate::frame::column_sums::ColumnSums;
use crate::frame::image::Image;
use crate::frame::plane::PlaneFit;
use crate::numbers::least_squares::{lowest_below, solve};
use crate::numbers::median::median;

/// Fewer columns show nothing: the decay takes a tenth of a line, which would be three of them.
pub(crate) const FEWEST: usize = 32;
/// The bend decays within this part of a line; a slower one is not told from creep and hysteresis.
pub(crate) const SLOWEST: f64 = 0.1;
/// Of what the polynomial leaves of the mean line, the exponential explains at least this share: more than half is
/// its own, ...
pub(crate) const SHARE: f64 = 0.5;
/// ... and improves χ² by this much, in units of what it leaves: e⁻²⁵ by chance, the search for the decay included.
pub(crate) const IMPROVEMENT: f64 = 50.0;
/// A lag that explains whole lines leaves less than this many times the noise. Half and twice as much change no result
/// of docs/constants.md.
const EXCESS: f64 = 3.0;
/// The same as a share of the bend, where there is no noise. On the scenes of docs/constants.md half and double change no result.
const NOTHING: f64 = 1e-3;
/// Steps of the search for the decay, ...
const STEPS: usize = 40;
/// ... and its shortest one, columns: a shorter one bends a single pixel.
const SHORTEST: f64 = 0.5;
/// A sensor is of the first order no better than to this share of what the bend does to the slope. On the scenes of docs/constants.md half and double
/// change results by at most 0.01 σ.
pub(crate) const FIRST_ORDER_TO: f64 = 0.03;
/// Lines that are looked at, at most about this many: their mean is then known to a 64th of the noise.
const MOST_ROWS: usize = 4096;
/// The median of a column is looked for this many of its standard deviations, times 1/√n, about the mean: four of its own for
/// Gaussian noise. Where it lies elsewhere all values are looked at.
const MEDIAN_WITHIN: f64 = 5.0;
/// Where the best decay of the grid leaves more than this share there is no lag: one between two steps of the grid, which
/// are 6 % off at most, explains hardly more.
const HOPELESS: f64 = 0.6;
/// Columns that are read together: the values of a line lie side by side.
const PIECE: usize = 8;
/// The degree of the polynomial, plus one: a cubic, for creep and hysteresis.
const SMOOTH: usize = 4;

/// The bend at the beginning of the lines of one sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// Columns in which the bend falls to 1/e: the time constant in units of the time of a pixel.
    pub columns: f64,
    /// Whether lines begin at the last column.
    pub from_last: bool,
    /// The bend at the first column that was used, nm.
    pub bend_nm: f64,
    /// What the bend adds to the step from column to column of a straight line, nm, if it is not taken off.
    pub slope_nm: f64,
    /// Variance of that, nm².
    pub slope_variance: f64,
}

impl Lag {
    /// The bend at a column, nm; `used` are the columns that were used.
    fn at(&self, column: usize, used: &Range<usize>) -> f64 {
        self.bend_nm * (-from_begin(column, used, self.from_last) / self.columns).exp()
    }

    /// The image without it; columns outside of `used` are left as they are.
    pub(crate) fn taken_off(&self, image: &Image, used: &Range<usize>) -> Image {
        let mut straight = image.clone();
        let bend: Vec<f64> = used.clone().map(|c| self.at(c, used)).collect();
        for line in straight.values.chunks_exact_mut(image.columns) {
            for (value, bend) in line[used.clone()].iter_mut().zip(&bend) {
                *value -= bend;
            }
        }
        straight
    }
}

/// A lag that was found in some columns, and how well it describes them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    pub(crate) lag: Lag,
    /// The variance that it leaves in the mean line, nm².
    left: f64,
    /// That of the noise of the mean line, nm².
    noise: f64,
}

impl Found {
    /// Whether it leaves no more than noise: in whole lines it explains the turn-around and all.
    pub(crate) fn explains_all(&self) -> bool {
        let exact = NOTHING * self.lag.bend_nm;
        self.left < EXCESS * self.noise + exact * exact
    }
}

/// Looks for the lag of a sensor in the columns `used`, whose plane is known.
pub(crate) fn find(
    image: &Image,
    sums: &ColumnSums,
    used: &Range<usize>,
    plane: &PlaneFit,
) -> Option<Found> {
    if used.len() < FEWEST {
        return None;
    }
    let line = mean_line(image, sums, used, plane)?;
    let smooth = orthonormal(polynomials(used.len()))?;
    let rest = &line - &smooth * smooth.tr_mul(&line);
    let plain = rest.norm_squared();
    let mut best: Option<(f64, f64, bool)> = None;
    for from_last in [false, true] {
        let left = |columns: f64| beside(&smooth, &rest, columns, from_last);
        let among = [SHORTEST, SLOWEST * used.len() as f64];
        let Some(columns) = lowest_below(left, among, STEPS, HOPELESS * plain) else {
            continue;
        };
        let chi2 = left(columns);
        if best.is_none_or(|(least, ..)| chi2 < least) {
            best = Some((chi2, columns, from_last));
        }
    }
    let (left, columns, from_last) = best?;
    // Two parameters more than the polynomial has; rounding is all that a sensor without noise leaves.
    let left_variance = (left / (used.len() - SMOOTH - 2) as f64).max(f64::MIN_POSITIVE);
    let explained = plain - left;
    if !(explained > SHARE * plain && explained > IMPROVEMENT * left_variance) {
        return None;
    }
    let lag = bend(&line, &smooth, columns, from_last, left_variance)?;
    Some(Found {
        lag,
        left: left_variance,
        noise: noise(image, used, plane),
    })
}

/// The same columns, upright on each other and of length one; `None` where they cannot be told apart.
fn orthonormal(columns: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let width = columns.ncols();
    let found = columns.qr();
    (found.r().rank(f64::EPSILON) == width).then(|| found.q())
}

/// Sum of squares that a bend leaves of a line from which the smooth part was taken.
fn beside(smooth: &DMatrix<f64>, rest: &DVector<f64>, columns: f64, from_last: bool) -> f64 {
    let decay = decay(rest.len(), columns, from_last);
    let own = &decay - smooth * smooth.tr_mul(&decay);
    let height = own.dot(rest) / own.norm_squared();
    if height.is_finite() {
        (rest - own * height).norm_squared()
    } else {
        f64::INFINITY
    }
}

/// The bend of the decay that was found, and what it does to the slope.
fn bend(
    line: &DVector<f64>,
    smooth: &DMatrix<f64>,
    columns: f64,
    from_last: bool,
    variance: f64,
) -> Option<Lag> {
    let design = with_bend(smooth, columns, from_last);
    let bend_nm = solve(&design, line)?[SMOOTH];
    let decay = |columns: f64| decay(line.len(), columns, from_last);
    let step = 1e-3 * columns;
    let change = (decay(columns + step) - decay(columns - step)) * (bend_nm / (2.0 * step));
    let both = design.insert_column(SMOOTH + 1, 0.0);
    let both = with_column(both, SMOOTH + 1, &change);
    let covariance = (both.transpose() * both).try_inverse()? * variance;
    let of_bend = covariance.fixed_view::<2, 2>(SMOOTH, SMOOTH).into_owned();
    let slopes = Vector2::new(slope(&decay(columns)), slope(&change));
    let slope_nm = slopes.x * bend_nm;
    let model = FIRST_ORDER_TO * slope_nm;
    Some(Lag {
        columns,
        from_last,
        bend_nm,
        slope_nm,
        slope_variance: slopes.dot(&(of_bend * slopes)) + model * model,
    })
}

/// Median of each column about the plane of the sensor, nm; `None` where a column has no values.
fn mean_line(
    image: &Image,
    sums: &ColumnSums,
    used: &Range<usize>,
    plane: &PlaneFit,
) -> Option<DVector<f64>> {
    let mut line = DVector::zeros(used.len());
    let rows = image.rows.div_ceil(step(image)) as f64;
    let mut kept: Vec<Near> = vec![Near::default(); PIECE];
    // Lines are read in pieces, and a piece of them is turned into columns.
    for first in used.clone().step_by(PIECE) {
        let last = (first + PIECE).min(used.end);
        for (near, column) in kept.iter_mut().zip(first..last) {
            let [mean, sigma] = sums.about(column, plane)?;
            let reach = MEDIAN_WITHIN * sigma / rows.sqrt();
            near.start([mean - reach, mean + reach], image.rows);
        }
        each_left(image, plane, first..last, |lane, rest| kept[lane].add(rest));
        for (near, column) in kept.iter_mut().zip(first..last) {
            line[column - used.start] = match near.median() {
                Some(median) => median,
                None => median(&mut column_left(image, plane, column)),
            };
        }
    }
    Some(line)
}

/// Values of a column near where their median is expected, and how many there are below them: the rest need not be
/// sorted.
#[derive(Clone, Default)]
struct Near {
    within: [f64; 2],
    values: Vec<f64>,
    kept: usize,
    below: usize,
    count: usize,
}

impl Near {
    fn start(&mut self, within: [f64; 2], most: usize) {
        self.values.resize(most + 1, 0.0);
        (self.within, self.kept, self.below, self.count) = (within, 0, 0, 0);
    }

    /// Without branches: whether a value is near is a matter of chance.
    fn add(&mut self, value: f64) {
        let [low, high] = self.within;
        self.count += usize::from(value.is_finite());
        self.below += usize::from(value < low && value > f64::NEG_INFINITY);
        self.values[self.kept] = value;
        self.kept += usize::from(value >= low && value <= high);
    }

    /// The median of all values, as [`median`] has it; `None` where it is not among those kept.
    fn median(&mut self) -> Option<f64> {
        let rank = (self.count / 2).checked_sub(self.below)?;
        let kept = &mut self.values[..self.kept];
        (rank < kept.len()).then(|| *kept.select_nth_unstable_by(rank, f64::total_cmp).1)
    }
}

/// From line to line that is looked at.
fn step(image: &Image) -> usize {
    1 + image.rows / MOST_ROWS
}

/// Shows what a plane leaves of the pixels of some columns, line by line, each with the number of its column.
fn each_left(
    image: &Image,
    plane: &PlaneFit,
    columns: Range<usize>,
    mut each: impl FnMut(usize, f64),
) {
    for row in (0..image.rows).step_by(step(image)) {
        let values = &image.row(row)[columns.clone()];
        for (lane, (column, value)) in columns.clone().zip(values).enumerate() {
            each(lane, value - plane.at(column as f64, row as f64));
        }
    }
}

/// What a plane leaves of a column, without missing values.
fn column_left(image: &Image, plane: &PlaneFit, column: usize) -> Vec<f64> {
    let mut left = Vec::with_capacity(image.rows);
    each_left(image, plane, column..column + 1, |_, rest| {
        if rest.is_finite() {
            left.push(rest);
        }
    });
    left
}

/// The variance that noise gives to the medians of columns, nm²: one column of each piece tells it.
fn noise(image: &Image, used: &Range<usize>, plane: &PlaneFit) -> f64 {
    let of_piece = |first: usize| {
        let columns = PIECE.min(used.end - first) as f64;
        variance_of_median(&mut column_left(image, plane, first)) * columns / used.len() as f64
    };
    used.clone().step_by(PIECE).map(of_piece).sum()
}

/// The variance of the median of some values, from their scatter.
fn variance_of_median(values: &mut [f64]) -> f64 {
    let middle = median(values);
    for value in values.iter_mut() {
        *value = (*value - middle).abs();
    }
    // Of Gaussian noise: σ is 1.4826 of the median size, and the median has π/2 of the variance of the mean.
    let sigma = 1.4826 * median(values);
    std::f64::consts::FRAC_PI_2 * sigma * sigma / values.len() as f64
}

/// Columns from where lines begin.
fn from_begin(column: usize, used: &Range<usize>, from_last: bool) -> f64 {
    if from_last {
        (used.end - 1 - column) as f64
    } else {
        (column - used.start) as f64
    }
}

fn decay(count: usize, columns: f64, from_last: bool) -> DVector<f64> {
    let ratio = (-1.0 / columns).exp();
    let mut decay = DVector::zeros(count);
    let mut left = 1.0;
    for c in 0..count {
        decay[if from_last { count - 1 - c } else { c }] = left;
        left *= ratio;
    }
    decay
}

/// Legendre polynomials of the degrees 0 to 3 over the columns.
fn polynomials(count: usize) -> DMatrix<f64> {
    DMatrix::from_fn(count, SMOOTH, |c, degree| {
        let u = (2.0 * c as f64 + 1.0 - count as f64) / count as f64;
        match degree {
            0 => 1.0,
            1 => u,
            2 => 1.5 * u * u - 0.5,
            _ => (2.5 * u * u - 1.5) * u,
        }
    })
}

fn with_bend(smooth: &DMatrix<f64>, columns: f64, from_last: bool) -> DMatrix<f64> {
    let wider = smooth.clone().insert_column(SMOOTH, 0.0);
    with_column(wider, SMOOTH, &decay(smooth.nrows(), columns, from_last))
}

fn with_column(mut matrix: DMatrix<f64>, place: usize, column: &DVector<f64>) -> DMatrix<f64> {
    matrix.set_column(place, column);
    matrix
}

/// Slope of the straight line through the values.
pub(crate) fn slope(values: &DVector<f64>) -> f64 {
    let n = values.len() as f64;
    let from_middle = |c: usize| c as f64 - (n - 1.0) / 2.0;
    let sum: f64 = values
        .iter()
        .enumerate()
        .map(|(c, v)| from_middle(c) * v)
        .sum();
    sum / (n * (n * n - 1.0) / 12.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::fit_plane::fit_plane;
    use crate::numbers::rng::stream;
    use rand_distr::{Distribution, StandardNormal};

    fn found(image: &Image, used: &Range<usize>) -> Option<Lag> {
        let plane = fit_plane(image, used.clone())?;
        find(image, &ColumnSums::of(image), used, &plane).map(|found| found.lag)
    }

    const COLUMNS: usize = 128;
    const PITCH: f64 = 0.8;

    /// A sensor of 96 lines along the fast axis: `bend` at each column, and white noise, nm.
    fn sensor(bend: impl Fn(f64) -> f64, noise: f64, seed: u64) -> Image {
        let mut rng = stream(seed, "lag", 0);
        let values = (0..96 * COLUMNS)
            .map(|i| {
                let column = (i % COLUMNS) as f64;
                let white: f64 = StandardNormal.sample(&mut rng);
                PITCH * column + bend(column) + noise * white
            })
            .collect();
        Image::new(96, COLUMNS, values)
    }

    /// What a sensor of the first order shows of a tip at constant speed that has turned at column 0.
    fn lagging(columns: f64) -> impl Fn(f64) -> f64 {
        move |c| -PITCH * columns * (1.0 - 2.0 * (-c / columns).exp())
    }

    /// Slope of the mean of all lines, nm per column.
    fn mean_slope(image: &Image) -> f64 {
        let column = |c: usize| (0..image.rows).map(|r| image.row(r)[c]).sum::<f64>();
        let mean = DVector::from_fn(image.columns, |c, _| column(c) / image.rows as f64);
        slope(&mean)
    }

    /// The time constant and what it does to the slope, −12 (`T/T_line`)² of it where lines are long, in trace and in
    /// retrace; the straight rest has the pitch of the tip.
    #[test]
    fn a_lag_is_measured() {
        for columns in [0.8, 2.0, 5.0, 9.0] {
            for mirrored in [false, true] {
                let bend = |c: f64| {
                    let bend = lagging(columns);
                    if mirrored {
                        -bend(COLUMNS as f64 - 1.0 - c)
                    } else {
                        bend(c)
                    }
                };
                let image = sensor(bend, 0.2, 7);
                let used = 0..COLUMNS;
                let lag = found(&image, &used).unwrap();
                assert_eq!(lag.from_last, mirrored);
                assert!((lag.columns / columns - 1.0).abs() < 0.1, "{lag:?}");
                // What is taken off changes the slope of plain least squares by exactly that.
                let straight = lag.taken_off(&image, &used);
                let change = mean_slope(&image) - mean_slope(&straight);
                assert!((change - lag.slope_nm).abs() < 1e-9);
                let rest = fit_plane(&straight, used).unwrap();
                let sigma = lag.slope_variance.sqrt().hypot(5e-5);
                let miss = rest.per_column - PITCH;
                assert!(miss.abs() < 4.0 * sigma, "{columns}: {miss} ± {sigma}");
                if (2.0..6.0).contains(&columns) {
                    let share = -12.0 * (columns / COLUMNS as f64).powi(2);
                    assert!((lag.slope_nm / PITCH / share - 1.0).abs() < 0.3, "{lag:?}");
                }
            }
        }
    }

    /// A line by column, nm.
    type Shape = Box<dyn Fn(f64) -> f64>;

    /// Noise, bows and creep of scanners, ripples and steps are no lag.
    #[test]
    fn what_is_no_lag_is_not_taken_for_one() {
        let place = |c: f64| 2.0 * c / COLUMNS as f64 - 1.0;
        let shapes: [(&str, Shape); 6] = [
            ("noise", Box::new(|_| 0.0)),
            ("bow", Box::new(move |c| 1.5 * place(c).powi(2))),
            (
                "bend of hysteresis",
                Box::new(move |c| 0.8 * (1.3 * place(c)).sin()),
            ),
            ("creep", Box::new(move |c| 0.8 * (1.6 + place(c)).ln())),
            ("ripple", Box::new(move |c| 0.05 * (40.0 * place(c)).sin())),
            (
                "step",
                Box::new(move |c| if place(c) > 0.1 { 0.1 } else { 0.0 }),
            ),
        ];
        for (name, shape) in &shapes {
            for seed in 0..20 {
                let image = sensor(shape, 0.2, seed);
                assert_eq!(found(&image, &(0..COLUMNS)), None, "{name} {seed}");
            }
        }
    }
}
