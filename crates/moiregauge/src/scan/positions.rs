//! Where the pixels of an image are: by its position sensors, or as the instrument intended.

use heterostrain::Estimate;
use nalgebra::Vector2;
use spmfile::{Channel, FrameDirection, LineDirection, Scan};

use crate::caveat::Caveat;
use crate::caveat::positions::PositionDoubt;
use crate::frame::axis::Axis;
use crate::frame::geometry::{Geometry, Timing};
use crate::frame::image::Image;
use crate::frame::loops::{self, HalfLine, SlowLag};
use crate::frame::sensors::{Grid, SensorGeometry, fitted};
use crate::numbers::spread::mean_and_spread;
use crate::scan::channel::image_of;

/// A sensor whose span differs from the nominal size by more than this factor is not believed: open tubes are off by
/// 1.3.
const WILD_SPAN: f64 = 2.0;
/// Trace and retrace of different speeds, by more than headers round, are no loop.
const SAME_SPEED: f64 = 0.01;
/// More samples than this share that are off deserve a word: one in a thousand is no stray one. Half and twice as much
/// change no result of docs/constants.md.
const NOTABLE_GLITCHES: f64 = 1e-3;
/// A lag that changes the fast step by more than this share deserves a word: a hundredth of the calibration that is
/// assumed.
const NOTABLE_LAG: f64 = 1e-4;

/// The geometry that the instrument intended: nominal pitch, rotated.
pub(crate) fn nominal(scan: &Scan, channel: &Channel) -> Option<Geometry> {
    Geometry::of_pitch(
        [channel.columns, channel.rows],
        channel.pitch_nm()?,
        scan.rotation_rad,
        Vector2::from(scan.offset_nm),
    )
}

/// Relative standard errors of the nominal pitch along the fast and the slow axis, where the format does not say whether
/// its size spans N pixels or N − 1: either may be, so that it is off by none or by 1/N.
pub(crate) fn pitch_sigma(scan: &Scan, channel: &Channel) -> Option<[f64; 2]> {
    let of = |count: usize| 1.0 / (std::f64::consts::SQRT_2 * count as f64);
    (!scan.size_is_defined()).then(|| [of(channel.columns), of(channel.rows)])
}

/// The sensors of this line direction as images in nm; `None` where they are absent or levelled.
pub(crate) fn sensor_images(
    file: &str,
    scan: &Scan,
    channel: &Channel,
    caveats: &mut Vec<Caveat>,
) -> Option<[Image; 2]> {
    let line = channel.line_direction.unwrap_or(LineDirection::Trace);
    let other = match line {
        LineDirection::Trace => LineDirection::Retrace,
        LineDirection::Retrace => LineDirection::Trace,
    };
    let found = match spmfile::position_sensors(scan, line) {
        Ok(sensors) => Ok(sensors),
        Err(problem) => spmfile::position_sensors(scan, other)
            .inspect(|_| {
                caveats.push(Caveat::new(
                    PositionDoubt::SensorsOfOtherLine { line, other },
                    file,
                ));
            })
            .map_err(|_| problem),
    };
    let sensors = match found {
        Ok(sensors) => sensors,
        Err(problem) => {
            caveats.push(Caveat::new(
                PositionDoubt::NoPositionSensors {
                    reason: problem.to_string(),
                },
                file,
            ));
            return None;
        }
    };
    for sensor in [sensors.x, sensors.y] {
        if let Some(fit) = &sensor.plane_fit {
            caveats.push(Caveat::new(
                PositionDoubt::SensorPlaneFitted {
                    fit: fit.clone(),
                    sensor: sensor.name.clone(),
                },
                file,
            ));
            return None;
        }
    }
    Some([in_nm(sensors.x), in_nm(sensors.y)])
}

/// The geometry by the sensors, if there are any that can be believed; else a caveat.
pub(crate) fn usable_sensors(
    file: &str,
    scan: &Scan,
    channel: &Channel,
    nominal: Option<&Geometry>,
    grid: Grid,
    caveats: &mut Vec<Caveat>,
) -> Option<SensorGeometry> {
    let [x, y] = sensor_images(file, scan, channel, caveats)?;
    if (x.rows, x.columns) != (channel.rows, channel.columns) {
        caveats.push(Caveat::new(
            PositionDoubt::SensorShape {
                sensors: [x.columns, x.rows],
                channel: channel.name.clone(),
                image: [channel.columns, channel.rows],
            },
            file,
        ));
        return None;
    }
    let line = channel.line_direction.unwrap_or(LineDirection::Trace);
    let found = match slow_lag(scan, channel, [&x, &y]) {
        Some(lag) => {
            let [x, y] = [(&x, 0), (&y, 1)].map(|(s, axis)| lag.taken_off(s, axis, line));
            let lags = [0, 1].map(|axis| lag.of_sensor(axis, line));
            fitted(&x, &y, Some(lags), grid)
        }
        None => fitted(&x, &y, None, grid),
    };
    let Some(sensors) = found else {
        caveats.push(Caveat::new(PositionDoubt::SensorsFlat, file));
        return None;
    };
    if let Some(nominal) = nominal {
        let (measured, intended) = (sensors.geometry.extent(), nominal.extent());
        let ratios = [measured[0] / intended[0], measured[1] / intended[1]];
        if ratios
            .iter()
            .any(|r| !(1.0 / WILD_SPAN..=WILD_SPAN).contains(r))
        {
            caveats.push(Caveat::new(
                PositionDoubt::SensorSpan {
                    measured,
                    nominal: intended,
                },
                file,
            ));
            return None;
        }
    }
    if sensors.geometry.pixel_to_nm.determinant() < 0.0 {
        caveats.push(Caveat::new(PositionDoubt::SensorsMirrored, file));
    }
    about_glitches(file, channel, &sensors, caveats);
    about_lag(file, scan, channel, &sensors, caveats);
    Some(sensors)
}

/// A lag that trace and retrace show together; `None` where one of them was not recorded.
fn slow_lag(scan: &Scan, channel: &Channel, own: [&Image; 2]) -> Option<SlowLag> {
    let line = channel.line_direction?;
    let other = match line {
        LineDirection::Trace => LineDirection::Retrace,
        LineDirection::Retrace => LineDirection::Trace,
    };
    // The other direction in place of its own would be compared with itself.
    spmfile::position_sensors(scan, line).ok()?;
    let sensors = spmfile::position_sensors(scan, other).ok()?;
    let timing = Timing::of_scan(scan, channel.columns, FrameDirection::Up, line)?;
    let back = Timing::of_scan(scan, channel.columns, FrameDirection::Up, other)?;
    let pixel = timing.per_pixel.x.abs();
    if (back.per_pixel.x.abs() / pixel - 1.0).abs() > SAME_SPEED {
        return None;
    }
    let last = (channel.columns - 1) as f64;
    let whole = (0.5 * timing.per_pixel.y.abs() / pixel).max(last);
    let half = HalfLine {
        whole,
        run_up: (whole - last) / 2.0,
    };
    let other = [in_nm(sensors.x), in_nm(sensors.y)];
    let other = [&other[0], &other[1]];
    match line {
        LineDirection::Trace => loops::find(own, other, half),
        LineDirection::Retrace => loops::find(other, own, half),
    }
}

/// A sensor as an image in nm.
fn in_nm(sensor: &Channel) -> Image {
    let factor = spmfile::nm_per(&sensor.unit).unwrap_or(f64::NAN);
    let mut image = image_of(sensor);
    for v in &mut image.values {
        *v *= factor;
    }
    image
}

/// Says how many samples were left out, where it is more than a stray one.
fn about_glitches(
    file: &str,
    channel: &Channel,
    sensors: &SensorGeometry,
    caveats: &mut Vec<Caveat>,
) {
    let dropped: usize = sensors.glitches.iter().sum();
    let samples = 2 * channel.columns * channel.rows;
    if dropped as f64 > NOTABLE_GLITCHES * samples as f64 {
        let line = channel.line_direction.unwrap_or(LineDirection::Trace);
        caveats.push(Caveat::new(
            PositionDoubt::SensorGlitches {
                line,
                dropped,
                samples,
            },
            file,
        ));
    }
}

/// Says where the lines of a sensor bend as those of one that lags behind the tip.
fn about_lag(
    file: &str,
    scan: &Scan,
    channel: &Channel,
    sensors: &SensorGeometry,
    caveats: &mut Vec<Caveat>,
) {
    let line = channel.line_direction.unwrap_or(LineDirection::Trace);
    let direction = scan.frame_direction.unwrap_or(FrameDirection::Up);
    let timing = Timing::of_scan(scan, channel.columns, direction, line);
    let step = sensors.geometry.fast_step().norm();
    let each = [Axis::X, Axis::Y]
        .into_iter()
        .zip(sensors.lags)
        .zip(&sensors.planes);
    for ((sensor, lag), plane) in each {
        let Some(lag) = lag.filter(|lag| lag.slope_nm.abs() > NOTABLE_LAG * step) else {
            continue;
        };
        caveats.push(Caveat::new(
            PositionDoubt::SensorLag {
                line,
                sensor,
                bend: lag.bend_nm.abs(),
                columns: lag.columns,
                time_constant: timing.map(|timing| lag.columns * timing.per_pixel.x.abs()),
                share: (lag.slope_nm / step).abs(),
                short: lag.slope_nm * plane.per_column < 0.0,
            },
            file,
        ));
    }
}

/// Tip speeds with their spread, and the relative error of their means.
pub(crate) fn speeds(
    geometry: &Geometry,
    sensors: Option<&SensorGeometry>,
    timing: Option<&Timing>,
) -> ([Estimate; 2], [f64; 2]) {
    let unknown = Estimate::new(f64::NAN, f64::NAN);
    let Some(timing) = timing else {
        return ([unknown; 2], [0.0; 2]);
    };
    let plain = geometry.speeds(timing);
    let Some(sensors) = sensors else {
        return (plain.map(|v| Estimate::new(v, 0.0)), [0.0; 2]);
    };
    let of = |axis: usize, steps: &[f64]| {
        let spread = mean_and_spread(steps).sigma;
        let step = [geometry.fast_step(), geometry.slow_step()][axis].norm();
        let relative = if spread.is_finite() {
            spread / step
        } else {
            0.0
        };
        let speed = Estimate::new(plain[axis], plain[axis] * relative);
        (speed, relative / (steps.len().max(1) as f64).sqrt())
    };
    let (fast, fast_error) = of(0, &sensors.fast_steps);
    let (slow, slow_error) = of(1, &sensors.slow_steps);
    ([fast, slow], [fast_error, slow_error])
}
