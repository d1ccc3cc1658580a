//! Both position sensors of a frame → its [`Geometry`].

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Matrix2, Vector2};

use crate::frame::bowed;
use crate::frame::column_sums::ColumnSums;
use crate::frame::departure::{Departure, Noise, Term};
use crate::frame::fit_plane::through;
use crate::frame::geometry::Geometry;
use crate::frame::glitches;
use crate::frame::image::Image;
use crate::frame::lag;
use crate::frame::lag::Lag;
use crate::frame::line_steps::{covariance, lines};
use crate::frame::plane::PlaneFit;

/// Sine of the angle between fast and slow axis, at least: a frame is no line. On the scenes of docs/constants.md half and double change no result.
const UPRIGHT: f64 = 0.2;
/// Deviations of columns beyond this many of those inside are turn-around: none of noise is so large.
const BENDS: f64 = 5.0;
/// The outer fraction of a line in which turn-around is looked for, on either side: twice a usual overscan (5 %).
const TURN_AROUND: f64 = 0.1;

/// The geometry by the sensors, and how well a plane describes them.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SensorGeometry {
    /// The affine map.
    pub geometry: Geometry,
    /// Plane of the x sensor and of the y sensor, nm.
    pub planes: [PlaneFit; 2],
    /// Columns that were used; those outside belong to the turn-around of the tip.
    pub columns: Range<usize>,
    /// Samples of the x sensor and of the y sensor that are far off and were left out.
    pub glitches: [usize; 2],
    /// How the x sensor and the y sensor lag behind the tip, where their lines show it; planes and steps are free of it.
    pub lags: [Option<Lag>; 2],
    /// Step from column to column along the fast direction, one number per line, nm.
    pub fast_steps: Vec<f64>,
    /// Step from row to row along the slow direction, one number per column, nm.
    pub slow_steps: Vec<f64>,
}

/// Fits planes to the x and y sensors (nm, same shape).
///
/// `None` where the sensors do not span an area: constant, all missing, or moving along one line.
pub fn from_sensors(x: &Image, y: &Image) -> Option<SensorGeometry> {
    fitted(x, y, None, Grid::Curved)
}

/// What describes the sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Grid {
    /// Planes, as published.
    Plane,
    /// Planes and a smooth departure where it predicts lines that were held out.
    Curved,
}

/// The same by some grid. `taken_off`: lags that the sensors are free of already.
pub(crate) fn fitted(
    x: &Image,
    y: &Image,
    taken_off: Option<[Option<Lag>; 2]>,
    grid: Grid,
) -> Option<SensorGeometry> {
    let (rows, columns) = (x.rows, x.columns);
    if (y.rows, y.columns) != (rows, columns) {
        return None;
    }
    let (sensors, glitches) = without_glitches(x, y);
    let (sensors, lags, used) = match taken_off {
        Some(lags) => {
            let used = straight_columns(&sensors)?;
            (sensors, lags, used)
        }
        None => without_lags(sensors)?,
    };
    let Bent {
        used,
        planes,
        straight: sensors,
        departure,
    } = bent(sensors, used, grid)?;
    let [x, y] = sensors.each_ref().map(|sensor| sensor.image.as_ref());
    let pixel_to_nm = Matrix2::new(
        planes[0].per_column,
        planes[0].per_row,
        planes[1].per_column,
        planes[1].per_row,
    );
    let (fast, slow) = (pixel_to_nm.column(0).norm(), pixel_to_nm.column(1).norm());
    if !(pixel_to_nm.determinant().abs() > UPRIGHT * fast * slow) {
        return None;
    }
    let (ef, es) = (pixel_to_nm.column(0) / fast, pixel_to_nm.column(1) / slow);
    let lines = [lines(x, &planes[0], &used), lines(y, &planes[1], &used)];
    let line_slopes = both(|axis| lines[axis].iter().map(|line| line.slope));
    let column_slopes = both(|axis| {
        let sums = &sensors[axis].sums;
        used.clone().map(|column| sums.slope(column))
    });
    let mut covariance = covariance(&line_slopes, &lines, &planes);
    for (axis, lag) in lags.iter().enumerate() {
        covariance[(axis, axis)] += lag.map_or(0.0, |lag| lag.slope_variance);
    }
    Some(SensorGeometry {
        geometry: Geometry {
            size: [columns, rows],
            pixel_to_nm,
            origin: Vector2::new(planes[0].origin, planes[1].origin),
            covariance,
            from_sensors: true,
            departure: departure.map(Arc::new),
        },
        planes,
        columns: used,
        glitches,
        lags,
        fast_steps: line_slopes.iter().map(|s| s.dot(&ef)).collect(),
        slow_steps: column_slopes.iter().map(|s| s.dot(&es)).collect(),
    })
}

/// What planes and a smooth departure make of two sensors.
struct Bent<'a> {
    used: Range<usize>,
    planes: [PlaneFit; 2],
    /// The sensors without the departure.
    straight: [Sensor<'a>; 2],
    /// `None` of a straight scanner.
    departure: Option<Departure>,
}

/// Columns that bend away at a side are turn-around, unless a smooth departure describes them like all others.
fn bent(sensors: [Sensor<'_>; 2], used: Range<usize>, grid: Grid) -> Option<Bent<'_>> {
    let of = |used: Range<usize>| {
        let planes = [sensors[0].plane(&used)?, sensors[1].plane(&used)?];
        let curved = (grid == Grid::Curved).then(|| departure(&sensors, &planes, &used));
        let departure = curved.flatten();
        Some((used, planes, departure))
    };
    let every = 0..sensors[0].image.columns;
    let first = of(used)?;
    if first.2.is_some()
        && first.0 != every
        && let Some((used, planes, Some(departure))) = of(every.clone())
    {
        let straight = without_departure(&sensors, &departure);
        if straight_columns(&straight)? == every {
            let departure = Some(departure);
            return Some(Bent {
                used,
                planes,
                straight,
                departure,
            });
        }
    }
    let (used, planes, departure) = first;
    Some(Bent {
        used,
        planes,
        straight: match &departure {
            Some(departure) => without_departure(&sensors, departure),
            None => sensors,
        },
        departure,
    })
}

/// The smooth departure of both sensors from their planes; `None` of a straight scanner.
fn departure(
    sensors: &[Sensor<'_>; 2],
    planes: &[PlaneFit; 2],
    used: &Range<usize>,
) -> Option<Departure> {
    let axes = [Vector2::x(), Vector2::y()];
    let (mut terms, mut noise) = (Vec::new(), Vec::new());
    for ((sensor, plane), axis) in sensors.iter().zip(planes).zip(axes) {
        let found = bowed::departure(&sensor.image, plane, used);
        for described in found {
            let along = described.along;
            let sizes = described.across.iter().zip(described.sizes.iter());
            terms.extend(sizes.map(|(across, size)| Term {
                along,
                across: *across,
                size: axis * *size,
            }));
            noise.push(Noise {
                along,
                across: described.across,
                axis,
                covariance: described.covariance,
            });
        }
    }
    let rows = sensors[0].image.rows;
    let columns = [used.start, used.end - 1];
    (!terms.is_empty()).then(|| Departure::new(terms, columns, [0, rows - 1]).with_noise(noise))
}

/// Both sensors as those of a straight scanner.
fn without_departure<'a>(sensors: &[Sensor<'a>; 2], departure: &Departure) -> [Sensor<'a>; 2] {
    let [mut x, mut y] = sensors
        .each_ref()
        .map(|sensor| sensor.image.clone().into_owned());
    let columns = x.columns;
    for row in 0..x.rows {
        let line = row * columns..(row + 1) * columns;
        let places = departure.line(row, columns);
        let both = x.values[line.clone()].iter_mut().zip(&mut y.values[line]);
        for ((x, y), off) in both.zip(places) {
            *x -= off.x;
            *y -= off.y;
        }
    }
    [x, y].map(|image| Sensor::new(Cow::Owned(image)))
}

/// Steps of the x and of the y sensor, where both are known.
fn both<I: Iterator<Item = Option<f64>>>(of: impl Fn(usize) -> I) -> Vec<Vector2<f64>> {
    let pairs = of(0).zip(of(1));
    pairs
        .filter_map(|(x, y)| Some(Vector2::new(x?, y?)))
        .collect()
}

/// A sensor, the sums over its columns, and the plane through all of it.
struct Sensor<'a> {
    image: Cow<'a, Image>,
    sums: ColumnSums,
    whole: Option<PlaneFit>,
}

impl<'a> Sensor<'a> {
    fn new(image: Cow<'a, Image>) -> Self {
        let sums = ColumnSums::of(&image);
        let whole = through(&sums, &image, 0..image.columns);
        Self { image, sums, whole }
    }

    /// The plane through the columns `used`.
    fn plane(&self, used: &Range<usize>) -> Option<PlaneFit> {
        if *used == (0..self.image.columns) {
            self.whole
        } else {
            through(&self.sums, &self.image, used.clone())
        }
    }

    /// What it is without its lag in the columns `used`.
    fn without(self, lag: Option<Lag>, used: &Range<usize>) -> Self {
        match lag {
            Some(lag) => Self::new(Cow::Owned(lag.taken_off(&self.image, used))),
            None => self,
        }
    }
}

/// Both sensors without the samples that are far off, and how many those are.
fn without_glitches<'a>(x: &'a Image, y: &'a Image) -> ([Sensor<'a>; 2], [usize; 2]) {
    let sensors = [x, y].map(|sensor| Sensor::new(Cow::Borrowed(sensor)));
    let planes = sensors.iter().filter_map(|sensor| sensor.whole);
    let pitch = planes.fold(0.0f64, |longest, plane| {
        longest.max(plane.per_column.abs()).max(plane.per_row.abs())
    });
    let mut counts = [0; 2];
    let mut each = counts.iter_mut();
    let sound = sensors.map(|sensor| {
        let found = glitches::dropped(&sensor.image, pitch);
        match (found, each.next()) {
            (Some((without, dropped)), Some(count)) => {
                *count = dropped;
                Sensor::new(Cow::Owned(without))
            }
            _ => sensor,
        }
    });
    (sound, counts)
}

/// Two sensors without their lags, and the columns in which they are straight.
type Straight<'a> = ([Sensor<'a>; 2], [Option<Lag>; 2], Range<usize>);

/// A lag that explains whole lines is taken off first; of any other bend what is not straight is left out, and a lag is
/// looked for in the rest.
fn without_lags(sensors: [Sensor<'_>; 2]) -> Option<Straight<'_>> {
    let every = 0..sensors[0].image.columns;
    let find = |sensor: &Sensor<'_>, used| {
        lag::find(&sensor.image, &sensor.sums, used, &sensor.plane(used)?)
    };
    let seen = sensors.each_ref().map(|sensor| find(sensor, &every));
    let whole = seen.map(|seen| seen.filter(lag::Found::explains_all).map(|seen| seen.lag));
    let [x, y] = sensors;
    let sensors = [x.without(whole[0], &every), y.without(whole[1], &every)];
    let used = straight_columns(&sensors)?;
    let rest = [0, 1].map(|axis| match whole[axis] {
        Some(_) => None,
        None if used == every => seen[axis].map(|seen| seen.lag),
        None => find(&sensors[axis], &used).map(|found| found.lag),
    });
    let lags = [whole[0].or(rest[0]), whole[1].or(rest[1])];
    let [x, y] = sensors;
    let sensors = [x.without(rest[0], &used), y.without(rest[1], &used)];
    Some((sensors, lags, used))
}

impl SensorGeometry {
    /// What the plane leaves of a sensor (0: x, 1: y): curvature, lag, hysteresis, noise; nm.
    pub fn residual_map(&self, sensor: usize, measured: &Image) -> Image {
        let plane = &self.planes[sensor];
        let values = measured
            .values
            .iter()
            .enumerate()
            .map(|(i, v)| {
                v - plane.at((i % measured.columns) as f64, (i / measured.columns) as f64)
            })
            .collect();
        Image::new(measured.rows, measured.columns, values)
    }
}

/// The columns in which the tip moves straight: the mean line of either sensor follows the line
/// fitted to its inner part. Turn-around shows as a run of deviating columns at an edge.
fn straight_columns(sensors: &[Sensor<'_>; 2]) -> Option<Range<usize>> {
    let columns = sensors[0].image.columns;
    let margin = (TURN_AROUND * columns as f64) as usize;
    let (mut first, mut last) = (0, columns);
    for sensor in sensors {
        let inner = sensor.plane(&(margin..columns - margin))?;
        // 0 of a column without values.
        let mean = |c: usize| sensor.sums.about(c, &inner).map_or(0.0, |[mean, _]| mean);
        let deviation: Vec<f64> = (0..columns).map(mean).collect();
        let inside = &deviation[margin..columns - margin];
        let rms = (inside.iter().map(|d| d * d).sum::<f64>() / inside.len() as f64).sqrt();
        // Half a pixel of deviation is turn-around even on a sensor without noise.
        let pitch = inner.per_column.hypot(inner.per_row);
        let limit = (BENDS * rms).max(0.5 * pitch);
        let bends = |c: &usize| deviation[*c].abs() > limit;
        first = first.max((0..margin).take_while(bends).count());
        last = last.min(columns - (columns - margin..columns).rev().take_while(bends).count());
    }
    Some(first..last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::rng::stream;
    use rand_distr::{Distribution, StandardNormal};

    const STEPS: Matrix2<f64> = Matrix2::new(0.21, 0.004, -0.003, 0.22);

    /// Sensors of a sheared frame of 64 lines of 80 samples with white noise (nm).
    fn sensors(noise: f64, seed: u64) -> [Image; 2] {
        let mut rng = stream(seed, "sensors", 0);
        [0, 1].map(|axis| {
            let values = (0..64 * 80_usize)
                .map(|i| {
                    let n = Vector2::new((i % 80) as f64, (i / 80) as f64);
                    let white: f64 = StandardNormal.sample(&mut rng);
                    (STEPS * n)[axis] + noise * white
                })
                .collect();
            Image::new(64, 80, values)
        })
    }

    /// J comes back within its stated errors: mean square pull of its four entries over 200 frames
    /// within four times its scatter, √(2/800) = 0.05, of 1.
    #[test]
    fn the_plane_fit_has_honest_errors() {
        let mut pulls = 0.0;
        for seed in 0..200 {
            let [x, y] = sensors(0.2, seed);
            let g = from_sensors(&x, &y).unwrap().geometry;
            for entry in 0..4 {
                let miss = g.pixel_to_nm[entry] - STEPS[entry];
                pulls += miss * miss / g.covariance[(entry, entry)] / 800.0;
            }
        }
        assert!((0.8..1.2).contains(&pulls), "{pulls}");
    }

    /// Columns in which the tip turns round are left out and do not bend the plane.
    #[test]
    fn turn_around_is_left_out() {
        let [mut x, y] = sensors(0.0, 0);
        for row in 0..64 {
            for c in 0..4 {
                x.values[row * 80 + c] += 0.3 * f64::from(4 - c as i32);
            }
        }
        let found = from_sensors(&x, &y).unwrap();
        assert_eq!(found.columns, 4..80);
        assert!((found.geometry.pixel_to_nm - STEPS).norm() < 1e-9);
    }

    /// What the plane leaves is what was added to it.
    #[test]
    fn the_residual_map_shows_hysteresis() {
        let [mut x, y] = sensors(0.0, 0);
        // A bow along the lines with zero mean and zero mean slope.
        let bow = |c: usize| ((c as f64 - 39.5).powi(2) - 533.25) * 1e-5;
        for (i, v) in x.values.iter_mut().enumerate() {
            *v += bow(i % 80);
        }
        let found = from_sensors(&x, &y).unwrap();
        assert_eq!(found.columns, 0..80);
        let map = found.residual_map(0, &x);
        for (i, v) in map.values.iter().enumerate() {
            assert!((v - bow(i % 80)).abs() < 1e-9, "{v} at {i}");
        }
    }

    /// Constant sensors, or sensors that move along one line only, describe no frame.
    #[test]
    fn sensors_without_area_are_refused() {
        let [x, _] = sensors(0.0, 0);
        let still = Image::new(64, 80, vec![1.0; 64 * 80]);
        assert!(from_sensors(&x, &still).is_none());
        assert!(from_sensors(&x, &x).is_none());
    }
}
