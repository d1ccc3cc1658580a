//! One scan in detail, for the figures.

use nalgebra::Vector2;
use spmfile::{Channel, LineDirection, Scan};

use crate::campaign::analysis::ScanAnalysis;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::frame::plane::PlaneFit;
use crate::frame::sensors::SensorGeometry;
use crate::scan::channel::{channels, choose_channel, flat_image_of};
use crate::scan::picture::{BentSensors, Companion, Illustration, Picture};
use crate::scan::place::Place;
use crate::scan::positions::sensor_images;
use crate::settings::knobs::Settings;
use crate::spectrum::pictures::pictures;

/// Blocks along the longer side of a map of residuals, at most: as fine as a figure shows.
const RESIDUAL_BLOCKS: usize = 128;
/// Pixels along the longer side of a picture, at most: as fine as a figure shows.
const MOST_PIXELS: usize = 1024;

/// Cells of the grid that is drawn along each side, and pieces of the line along each.
const GRID_LINES: usize = 10;
const GRID_STEPS: usize = 6;

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
    let image = flat_image_of(channel, settings.background);
    let mut ignored = Vec::new();
    let place = Place::of("", scan, channel, settings, &mut ignored)?;
    let measured = place
        .sensors
        .as_ref()
        .and_then(|_| sensor_images("", scan, channel, &mut ignored));
    let sensors = place.sensors.as_ref().zip(measured.as_ref());
    // The whole frame is shown, also where only a part of it was analysed.
    let (pixel_to_nm, origin) = match sensors {
        Some(_) => (place.geometry.pixel_to_nm, place.geometry.origin),
        None => (line.pixel_to_nm, line.origin),
    };
    let [fast_velocities, slow_velocities] =
        sensors.map_or_else(Default::default, |(sensors, _)| velocities(sensors, &place));
    let sensor_line = sensors.map_or_else(Vec::new, |(sensors, measured)| {
        let axis = usize::from(pixel_to_nm.m11.abs() < pixel_to_nm.m21.abs());
        middle_line(&measured[axis], &sensors.planes[axis])
    });
    let longer = channel.columns.max(channel.rows);
    let residual_block = longer.div_ceil(RESIDUAL_BLOCKS).max(1);
    let sensor_residuals =
        sensors.map(|(sensors, measured)| residuals(sensors, measured, residual_block));
    let (autocorrelation, spectrum, spectrum_step) = pictures(&image, &line.pixels);
    // Pixels of a cropped image are others.
    let patch = line
        .patch
        .clone()
        .filter(|p| p.is_of([image.columns, image.rows]));
    Some(Illustration {
        file: analysed.file.clone(),
        line: line.line,
        unit: channel.unit.clone(),
        image,
        pixel_to_nm,
        origin,
        nominal_pixel_to_nm: place.nominal.as_ref().map(|n| n.pixel_to_nm),
        autocorrelation,
        spectrum,
        spectrum_step,
        lattice: line.pixels,
        patch,
        sensor_line,
        fast_velocities,
        slow_velocities,
        sensor_residuals,
        residual_block,
        bent: bent(scan, settings, residual_block),
        amplitude: amplitude(scan, channel, settings),
    })
}

/// What the planes leave of each sensor, in blocks.
fn residuals(sensors: &SensorGeometry, measured: &[Image; 2], block: usize) -> [Image; 2] {
    [0, 1].map(|axis| {
        let left = sensors.residual_map(axis, &measured[axis]);
        left.binned(block)
    })
}

/// The sensors of every line direction whose scanner bends.
fn bent(scan: &Scan, settings: &Settings, block: usize) -> Vec<BentSensors> {
    let of = |channel: &Channel| {
        let place = Place::of("", scan, channel, settings, &mut Vec::new())?;
        let sensors = place.sensors.as_ref()?;
        let departure = sensors.geometry.departure.as_deref()?;
        let mut measured = sensor_images("", scan, channel, &mut Vec::new())?;
        let before = residuals(sensors, &measured, block);
        for row in 0..channel.rows {
            let places = departure.line(row, channel.columns);
            for (axis, image) in measured.iter_mut().enumerate() {
                let line = &mut image.values[row * channel.columns..][..channel.columns];
                line.iter_mut()
                    .zip(&places)
                    .for_each(|(v, off)| *v -= off[axis]);
            }
        }
        Some(BentSensors {
            line: place.line,
            before,
            after: residuals(sensors, &measured, block),
            grid: grid_lines(&place.geometry),
        })
    };
    let channels = channels(scan, settings).unwrap_or_default();
    channels.into_iter().filter_map(of).collect()
}

/// Lines along the columns and along the rows of a frame: places on the straight grid and the departure there.
fn grid_lines(geometry: &Geometry) -> Vec<Vec<[Vector2<f64>; 2]>> {
    let last = geometry.size.map(|n| n as f64 - 1.0);
    let at = |column: usize, row: usize| {
        let shares = Vector2::new(column as f64 * last[0], row as f64 * last[1]);
        let pixel = shares / (GRID_LINES * GRID_STEPS) as f64;
        let off = geometry.departure.as_deref().map(|d| d.at(pixel));
        [geometry.place(pixel), off.unwrap_or_default()]
    };
    let steps = || 0..=GRID_LINES * GRID_STEPS;
    let lines = (0..=GRID_LINES).map(|line| line * GRID_STEPS);
    lines
        .flat_map(|line| {
            [
                steps().map(|step| at(line, step)).collect(),
                steps().map(|step| at(step, line)).collect(),
            ]
        })
        .collect()
}

/// The velocities of the tip along the fast and the slow axis by the sensors, nm/s.
fn velocities(sensors: &SensorGeometry, place: &Place) -> [Vec<f64>; 2] {
    let (raw, now) = (&sensors.geometry, &place.geometry);
    let of = |steps: &[f64], axis: usize, by: f64| {
        let seconds = place.timing.map_or(f64::NAN, |t| t.per_pixel[axis].abs());
        let all = steps.iter().map(|s| s * by / seconds);
        all.filter(|v| v.is_finite()).collect()
    };
    let fast = now.fast_step().norm() / raw.fast_step().norm();
    let slow = now.slow_step().norm() / raw.slow_step().norm();
    [
        of(&sensors.fast_steps, 0, fast),
        of(&sensors.slow_steps, 1, slow),
    ]
}

/// The line of a sensor in the middle of the frame: column, reading and plane.
fn middle_line(measured: &Image, plane: &PlaneFit) -> Vec<[f64; 3]> {
    let row = measured.rows / 2;
    let readings = measured.row(row).iter().enumerate();
    readings
        .map(|(c, v)| [c as f64, *v, plane.at(c as f64, row as f64)])
        .collect()
}

/// The name, in small letters, of the channel with the amplitude that belongs to a phase; `None` where `channel` is no
/// phase.
pub fn amplitude_of(channel: &str) -> Option<String> {
    let plain = channel.to_lowercase();
    plain
        .contains("phase")
        .then(|| plain.replace("phase", "amplitude"))
}

/// The amplitude of the same line as a phase.
fn amplitude(scan: &Scan, phase: &Channel, settings: &Settings) -> Option<Companion> {
    let wanted = amplitude_of(&phase.name)?;
    let found = scan.channels.iter().find(|c| {
        c.name.to_lowercase() == wanted
            && c.line_direction == phase.line_direction
            && (c.rows, c.columns) == (phase.rows, phase.columns)
    })?;
    Some(Companion {
        channel: found.name.clone(),
        unit: found.unit.clone(),
        image: flat_image_of(found, settings.background),
    })
}

/// The image of a scan in its place: the channel of the settings or the one that would be analysed, by the position
/// sensors or, without them, by the size and offset that the file states.
///
/// `None` for a scan without an image or without a size.
pub fn picture(file: &str, scan: &Scan, settings: &Settings) -> Option<Picture> {
    let names: Vec<(&str, &str)> = scan
        .channels
        .iter()
        .map(|c| (c.name.as_str(), c.internal_name.as_str()))
        .collect();
    let name = choose_channel(&names, settings.channel.as_deref())
        .or_else(|| choose_channel(&names, None))?;
    let channel = scan.channels.iter().find(|c| c.name == name)?;
    let place = Place::of(file, scan, channel, settings, &mut Vec::new())?;
    let geometry = place.geometry;
    let image = flat_image_of(channel, settings.background);
    let block = image.columns.max(image.rows).div_ceil(MOST_PIXELS).max(1);
    // Pixels that fill no block are left out, as few as they are.
    let middle = Vector2::repeat((block - 1) as f64 / 2.0);
    Some(Picture {
        file: file.to_owned(),
        channel: channel.name.clone(),
        unit: channel.unit.clone(),
        image: image.binned(block),
        pixel_to_nm: geometry.pixel_to_nm * block as f64,
        origin: geometry.origin + geometry.pixel_to_nm * middle,
        from_sensors: place.sensors.is_some(),
    })
}
