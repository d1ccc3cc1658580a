//! One scan in detail, for the figures.

use spmfile::{LineDirection, Scan};

use super::measure::{channels, image_of};
use super::positions::{nominal, sensor_images, usable_sensors};
use super::scanner::calibrated;
use crate::analysis::{Illustration, ScanAnalysis};
use crate::background::remove_background;
use crate::geometry::Timing;
use crate::lattice::pictures;
use crate::settings::Settings;

/// The pictures behind the numbers of `analysed`, from the pixels of the same scan.
///
/// `None` where the scan no longer has what was measured.
pub fn illustrate(
    scan: &Scan,
    analysed: &ScanAnalysis,
    settings: &Settings,
) -> Option<Illustration> {
    let line = analysed.lines.first()?;
    let channel = channels(scan, settings)
        .ok()?
        .into_iter()
        .find(|c| c.line_direction.unwrap_or(LineDirection::Trace) == line.line)?;
    let image = remove_background(&image_of(channel), settings.background);
    let nominal = nominal(scan, channel);
    let mut ignored = Vec::new();
    let sensors = usable_sensors("", scan, channel, nominal.as_ref(), &mut ignored);
    let measured = sensors
        .as_ref()
        .and_then(|_| sensor_images("", scan, channel, &mut ignored));
    let timing = analysed
        .frame_direction
        .and_then(|frame| Timing::of_scan(scan, channel.columns, frame, line.line));
    let velocities = |steps: &[f64], axis: usize| -> Vec<f64> {
        let seconds = timing.map_or(f64::NAN, |t| t.per_pixel[axis].abs());
        steps
            .iter()
            .map(|s| s / seconds)
            .filter(|v| v.is_finite())
            .collect()
    };
    let (mut fast, mut slow) = (Vec::new(), Vec::new());
    let mut sensor_line = Vec::new();
    let mut pixel_to_nm = line.pixel_to_nm;
    let mut origin = line.origin;
    if let (Some(sensors), Some(measured)) = (&sensors, &measured) {
        let scaled = |steps: &[f64], by: f64| steps.iter().map(|s| s * by).collect::<Vec<f64>>();
        let (raw, now) = (&sensors.geometry, calibrated(&sensors.geometry, settings));
        let by = [
            now.fast_step().norm() / raw.fast_step().norm(),
            now.slow_step().norm() / raw.slow_step().norm(),
        ];
        fast = velocities(&scaled(&sensors.fast_steps, by[0]), 0);
        slow = velocities(&scaled(&sensors.slow_steps, by[1]), 1);
        // The whole frame is shown, also where only a part of it was analysed.
        pixel_to_nm = now.pixel_to_nm;
        origin = now.origin;
        let axis = usize::from(pixel_to_nm.m11.abs() < pixel_to_nm.m21.abs());
        let row = channel.rows / 2;
        let plane = &sensors.planes[axis];
        sensor_line = measured[axis]
            .row(row)
            .iter()
            .enumerate()
            .map(|(c, v)| [c as f64, *v, plane.at(c as f64, row as f64)])
            .collect();
    }
    let (autocorrelation, spectrum, spectrum_step) = pictures(&image, &line.pixels);
    Some(Illustration {
        file: analysed.file.clone(),
        line: line.line,
        unit: channel.unit.clone(),
        image,
        pixel_to_nm,
        origin,
        nominal_pixel_to_nm: nominal.map(|n| n.pixel_to_nm),
        autocorrelation,
        spectrum,
        spectrum_step,
        lattice: line.pixels,
        sensor_line,
        fast_velocities: fast,
        slow_velocities: slow,
    })
}
