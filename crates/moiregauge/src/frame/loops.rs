//! A lag of the position sensors that is too slow to show as a bend: trace against retrace.
//!
//! Sensors of the first order are late by `V T (1 − 2 e^{−t/T} / (1 + e^{−H/T}))` the time t after a turn-around, H the
//! time of half a line. A bend that takes a good part of the line is not told from creep and hysteresis in one line direction.
//! Trace minus retrace at the same pixels is
//!
//! `−2 V T (1 − (e^{−t/T} + e^{−(H−t)/T}) / (1 + e^{−H/T}))`,
//!
//! a lens as hysteresis makes one, but its height and its shape belong to one T. Both are asked for: the shape has to explain
//! what a parabola does not, and the height that comes out has to be that of the shape.
//!
//! In: the sensors of both line directions. Out: the lag, or nothing.

use nalgebra::{DMatrix, DVector, Vector2};
use spmfile::LineDirection;

use crate::frame::fit_plane::fit_plane;
use crate::frame::image::Image;
use crate::frame::lag::{FEWEST, FIRST_ORDER_TO, IMPROVEMENT, Lag, SHARE, SLOWEST, slope};
use crate::numbers::least_squares::{lowest, residual, solve};
use crate::numbers::median::median;

/// A bend that is faster than this share of what single lines show is left to them.
const FASTEST: f64 = 0.8;
/// A lag longer than this share of the line makes nearly a parabola, and its height and its T are not told apart.
const LONGEST: f64 = 0.3;
/// Height over that of the shape, at most this far from 1: hysteresis that adds a tenth to a lag is usual. Half and
/// twice as much change no result of docs/constants.md.
const HEIGHT: f64 = 0.2;
/// Steps of the search for the time constant: 5 % each, refined by golden sections.
const STEPS: usize = 60;
/// Lines that are looked at, at most about this many: their median is then known to a 20th of the noise.
const MOST_ROWS: usize = 512;

/// Half a line in units of the time of a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HalfLine {
    /// From turn-around to turn-around.
    pub(crate) whole: f64,
    /// From the turn-around to the first pixel.
    pub(crate) run_up: f64,
}

/// A lag that both line directions show.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SlowLag {
    /// The time constant in units of the time of a pixel, ...
    columns: f64,
    /// ... and its standard error.
    sigma: f64,
    /// Step of the tip from column to column, nm.
    step: Vector2<f64>,
    half: HalfLine,
    count: usize,
}

/// Looks for a slow lag in the x and y sensors of trace and retrace, of the same shape.
pub(crate) fn find(trace: [&Image; 2], retrace: [&Image; 2], half: HalfLine) -> Option<SlowLag> {
    let count = trace[0].columns;
    let same = |image: &Image| image.rows == trace[0].rows && image.columns == count;
    if count < FEWEST || !trace.into_iter().chain(retrace).all(same) || !has_loop(trace, retrace)? {
        return None;
    }
    let mean_step = |axis: usize| {
        let step = |image: &Image| Some(fit_plane(image, 0..count)?.per_column);
        Some(f64::midpoint(step(trace[axis])?, step(retrace[axis])?))
    };
    let shown = Vector2::new(mean_step(0)?, mean_step(1)?);
    let along = shown.normalize();
    let lens = lens(trace, retrace, along)?;
    let fit = Fit {
        lens,
        smooth: parabola(count),
        half,
        shown: shown.norm(),
    };
    let plain = fit.left(None)?;
    let columns = fit.best(|fit, columns| fit.left(Some(columns)));
    let left = fit.left(Some(columns))?;
    let variance = (left / (count as f64 - 5.0)).max(f64::MIN_POSITIVE);
    let explained = plain - left;
    let height = fit.height(columns)?;
    let slow = columns > FASTEST * SLOWEST * count as f64 && columns < LONGEST * count as f64;
    let fits = explained > SHARE * plain && explained > IMPROVEMENT * variance;
    if !(slow && fits && (height - 1.0).abs() < HEIGHT) {
        return None;
    }
    let columns = fit.best(Fit::left_at_height);
    let change =
        (fit.template(1.001 * columns) - fit.template(0.999 * columns)) / (0.002 * columns);
    let free = residual(&fit.smooth, &change)?;
    Some(SlowLag {
        columns,
        sigma: (variance / free).sqrt(),
        step: shown / (1.0 - flattening(columns, count, half)),
        half,
        count,
    })
}

impl SlowLag {
    /// A sensor (0: x, 1: y) without the lag.
    pub(crate) fn taken_off(&self, sensor: &Image, axis: usize, line: LineDirection) -> Image {
        let mut straight = sensor.clone();
        let late: Vec<f64> = (0..self.count)
            .map(|column| self.step[axis] * self.late(column, line))
            .collect();
        for values in straight.values.chunks_exact_mut(self.count) {
            for (value, late) in values.iter_mut().zip(&late) {
                *value += late;
            }
        }
        straight
    }

    /// In steps of the tip; < 0 where lines run towards the first column.
    fn late(&self, column: usize, line: LineDirection) -> f64 {
        match line {
            LineDirection::Trace => late(column as f64, self.columns, self.half),
            LineDirection::Retrace => {
                -late((self.count - 1 - column) as f64, self.columns, self.half)
            }
        }
    }

    /// What it does to one sensor, as the lag of single lines; `None` for a sensor that hardly moves along the lines.
    pub(crate) fn of_sensor(&self, axis: usize, line: LineDirection) -> Option<Lag> {
        let share = (self.step[axis] / self.step.norm()).abs();
        let flat = |columns: f64| flattening(columns, self.count, self.half);
        let slope_nm = -self.step[axis] * flat(self.columns);
        let steepness =
            (flat(1.001 * self.columns) - flat(0.999 * self.columns)) / (0.002 * self.columns);
        let statistical = self.step[axis] * steepness * self.sigma;
        let model = FIRST_ORDER_TO * slope_nm;
        let start = 2.0 * (-self.half.run_up / self.columns).exp()
            / (1.0 + (-self.half.whole / self.columns).exp());
        (share > 0.1).then_some(Lag {
            columns: self.columns,
            from_last: line == LineDirection::Retrace,
            bend_nm: self.step[axis] * self.columns * start,
            slope_nm,
            slope_variance: statistical * statistical + model * model,
        })
    }
}

/// The lens between trace and retrace, and what explains it.
struct Fit {
    lens: DVector<f64>,
    smooth: DMatrix<f64>,
    half: HalfLine,
    /// Step from column to column that the sensors show, nm.
    shown: f64,
}

impl Fit {
    /// The lens of a lag with this time constant.
    fn template(&self, columns: f64) -> DVector<f64> {
        let count = self.lens.len();
        let step = self.shown / (1.0 - flattening(columns, count, self.half));
        DVector::from_fn(count, |c, _| {
            let there = late(c as f64, columns, self.half);
            let back = late((count - 1 - c) as f64, columns, self.half);
            -step * (there + back)
        })
    }

    /// Sum of squares that a parabola and the lens of a lag, of any height, leave.
    fn left(&self, columns: Option<f64>) -> Option<f64> {
        match columns {
            Some(columns) => residual(&self.with(columns), &self.lens),
            None => residual(&self.smooth, &self.lens),
        }
    }

    /// The same with the height that belongs to the lag.
    fn left_at_height(&self, columns: f64) -> Option<f64> {
        residual(&self.smooth, &(&self.lens - self.template(columns)))
    }

    fn height(&self, columns: f64) -> Option<f64> {
        Some(solve(&self.with(columns), &self.lens)?[self.smooth.ncols()])
    }

    fn with(&self, columns: f64) -> DMatrix<f64> {
        let place = self.smooth.ncols();
        let mut wider = self.smooth.clone().insert_column(place, 0.0);
        wider.set_column(place, &self.template(columns));
        wider
    }

    /// The time constant that leaves least: a logarithmic grid, then golden sections about the best of it.
    fn best(&self, left: impl Fn(&Self, f64) -> Option<f64>) -> f64 {
        let left = |columns: f64| left(self, columns).unwrap_or(f64::INFINITY);
        let (low, high) = (0.02 * self.lens.len() as f64, 1.2 * self.lens.len() as f64);
        lowest(left, [low, high], STEPS)
    }
}

/// How late a sensor is, in steps of the tip, the given number of columns after the first of its line.
fn late(after: f64, columns: f64, half: HalfLine) -> f64 {
    let passed = (-(after + half.run_up) / columns).exp();
    columns * (1.0 - 2.0 * passed / (1.0 + (-half.whole / columns).exp()))
}

/// By what share of itself the step of a straight line through all columns is too short.
fn flattening(columns: f64, count: usize, half: HalfLine) -> f64 {
    slope(&DVector::from_fn(count, |c, _| {
        late(c as f64, columns, half)
    }))
}

/// Whether trace and retrace lie apart in the middle of the line, more than at its ends, as far as the fastest lag makes
/// them: three columns tell it of nearly all sensors.
fn has_loop(trace: [&Image; 2], retrace: [&Image; 2]) -> Option<bool> {
    let last = trace[0].columns.checked_sub(1)?;
    let travel = |axis: usize| {
        let image = trace[axis];
        let across = |row: usize| image.row(row)[last] - image.row(row)[0];
        let mut values: Vec<f64> = (0..image.rows)
            .map(across)
            .filter(|v| v.is_finite())
            .collect();
        median(&mut values)
    };
    let travel = Vector2::new(travel(0), travel(1));
    let along = travel.normalize();
    let apart = |column: usize| apart(trace, retrace, along, column);
    let height = apart(last / 2)? - f64::midpoint(apart(0)?, apart(last)?);
    Some(height.abs() > FASTEST * SLOWEST * travel.norm() / 2.0)
}

/// Trace minus retrace along a direction, the median of a column, nm.
fn apart(
    trace: [&Image; 2],
    retrace: [&Image; 2],
    along: Vector2<f64>,
    column: usize,
) -> Option<f64> {
    let rows = trace[0].rows.min(retrace[0].rows);
    let difference = |row: usize| {
        let of = |axis: usize| trace[axis].row(row)[column] - retrace[axis].row(row)[column];
        along.x * of(0) + along.y * of(1)
    };
    let lines = (0..rows).step_by(1 + rows / MOST_ROWS);
    let mut values: Vec<f64> = lines.map(difference).filter(|v| v.is_finite()).collect();
    (!values.is_empty()).then(|| median(&mut values))
}

/// Trace minus retrace along the fast direction, the median of each column, nm.
fn lens(trace: [&Image; 2], retrace: [&Image; 2], along: Vector2<f64>) -> Option<DVector<f64>> {
    let count = trace[0].columns;
    let mut lens = DVector::zeros(count);
    for column in 0..count {
        lens[column] = apart(trace, retrace, along, column)?;
    }
    Some(lens)
}

fn parabola(count: usize) -> DMatrix<f64> {
    DMatrix::from_fn(count, 3, |c, degree| {
        let u = (2.0 * c as f64 + 1.0 - count as f64) / count as f64;
        u.powi(degree as i32)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::rng::stream;
    use rand_distr::{Distribution, StandardNormal};

    const COLUMNS: usize = 128;
    const HALF: HalfLine = HalfLine {
        whole: 134.0,
        run_up: 3.5,
    };

    /// Both sensors of both directions: a tip that moves by `STEP` per column, each line as `shape` has it, nm.
    const STEP: Vector2<f64> = Vector2::new(0.5, 0.02);

    fn sensors(shape: impl Fn(f64, bool) -> f64, noise: f64, seed: u64) -> [[Image; 2]; 2] {
        [false, true].map(|back| {
            [0, 1].map(|axis| {
                let mut rng = stream(seed, "loops", axis + 2 * u64::from(back));
                let values = (0..96 * COLUMNS).map(|i| {
                    let column = (i % COLUMNS) as f64;
                    let white: f64 = StandardNormal.sample(&mut rng);
                    let slow = [0.0, 0.4][axis as usize] * (i / COLUMNS) as f64;
                    STEP[axis as usize] * (column + shape(column, back)) + slow + noise * white
                });
                Image::new(96, COLUMNS, values.collect())
            })
        })
    }

    fn found(sensors: &[[Image; 2]; 2]) -> Option<SlowLag> {
        let [trace, retrace] = sensors;
        find([&trace[0], &trace[1]], [&retrace[0], &retrace[1]], HALF)
    }

    /// The time constant of slow lags, and the step of the tip under them; faster ones are left to single lines.
    #[test]
    fn slow_lags_are_measured() {
        for (columns, seed) in [(12.0, 1), (20.0, 2), (30.0, 3), (36.0, 4)] {
            let shape = |c: f64, back: bool| {
                let last = COLUMNS as f64 - 1.0;
                if back {
                    late(last - c, columns, HALF)
                } else {
                    -late(c, columns, HALF)
                }
            };
            let lag = found(&sensors(shape, 0.2, seed)).expect("a lag");
            assert!(
                (lag.columns - columns).abs() < 4.0 * lag.sigma,
                "{columns}: {lag:?}"
            );
            let of_x = lag.of_sensor(0, LineDirection::Trace).expect("along x");
            assert!(lag.of_sensor(1, LineDirection::Trace).is_none());
            let miss = lag.step.x - STEP.x;
            assert!(
                miss.abs() < 3.0 * of_x.slope_variance.sqrt(),
                "{columns}: {miss}"
            );
            // Without it trace and retrace are one straight line.
            let all = sensors(shape, 0.0, seed);
            for (line, images) in [LineDirection::Trace, LineDirection::Retrace]
                .iter()
                .zip(&all)
            {
                let straight = lag.taken_off(&images[0], 0, *line);
                let rest = fit_plane(&straight, 0..COLUMNS).unwrap();
                assert!(
                    rest.residual < 0.03 * columns * STEP.x,
                    "{columns}: {rest:?}"
                );
            }
        }
        let quick = |c: f64, _: bool| -late(c, 3.0, HALF);
        assert!(found(&sensors(quick, 0.2, 5)).is_none());
    }

    /// Noise, creep and hysteresis are no lag: loops of a parabola, and of other shapes.
    #[test]
    fn loops_of_hysteresis_are_no_lag() {
        let place = |c: f64| 2.0 * c / COLUMNS as f64 - 1.0;
        for seed in 0..10 {
            for height in [0.0, 3.0, 12.0] {
                let lens = |c: f64, back: bool| {
                    let size = height * (1.0 - place(c).powi(2));
                    if back { size } else { -size }
                };
                assert!(found(&sensors(lens, 0.2, seed)).is_none());
                let skew = |c: f64, back: bool| {
                    let u = place(c);
                    let size = height * (1.0 - u * u) * (1.0 + 0.3 * u);
                    if back { size } else { -size }
                };
                assert!(found(&sensors(skew, 0.2, seed)).is_none());
                let creep = |c: f64, back: bool| {
                    let after = if back { COLUMNS as f64 - c } else { c + 1.0 };
                    let size = 0.3 * height * (1.0 + 0.1 * after).ln();
                    if back { size } else { -size }
                };
                assert!(
                    found(&sensors(creep, 0.2, seed)).is_none(),
                    "{height} {seed}"
                );
            }
        }
    }
}
