//! Doubts about where the pixels are: frame and position sensors.

use spmfile::LineDirection;

use crate::caveat::explained::explain;
use crate::frame::axis::Axis;
use crate::numbers::words::line_name;

/// Where the pixels are.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PositionDoubt {
    /// A frame without sensors is turned.
    #[error(
        "the frame is turned by {:.4}°. Vectors and angles are given in laboratory axes; in the axes of the image all \
         angles are smaller by this much",
        .rotation.to_degrees()
    )]
    FrameTurned {
        /// By this angle, rad.
        rotation: f64,
    },
    /// The sensors of the other line direction were taken.
    #[error(
        "lengths may be off by some tenths of a per cent: the {} image has no position sensors of its own, and those \
         of the {} are used",
        line_name(*.line), line_name(*.other)
    )]
    SensorsOfOtherLine {
        /// That of the image.
        line: LineDirection,
        /// That of the sensors.
        other: LineDirection,
    },
    /// There are no sensors.
    #[error(
        "the calibration error of the scanner (often 1 % and more) goes fully into lengths, twist and strain, since \
         nominal coordinates are used: {reason}"
    )]
    NoPositionSensors {
        /// What is not there.
        reason: String,
    },
    /// The instrument levelled the sensors.
    #[error(
        "nominal coordinates are used, with the full calibration error of the scanner: the instrument subtracted a fit \
         ({fit}) from {sensor:?}, which no longer contains positions. Switch off levelling of the sensor channels"
    )]
    SensorPlaneFitted {
        /// What was subtracted.
        fit: String,
        /// The sensor.
        sensor: String,
    },
    /// Sensors and image have other numbers of pixels.
    #[error(
        "nominal coordinates are used, with the full calibration error of the scanner: the position sensors have {} × \
         {} pixels, but {channel:?} has {} × {}",
        .sensors[0], .sensors[1], .image[0], .image[1]
    )]
    SensorShape {
        /// Columns and rows of the sensors.
        sensors: [usize; 2],
        /// The image.
        channel: String,
        /// Its columns and rows.
        image: [usize; 2],
    },
    /// The sensors span no area.
    #[error(
        "nominal coordinates are used, with the full calibration error of the scanner: the position sensors do not \
         span an area (constant, missing, or along one line)"
    )]
    SensorsFlat,
    /// The sensors span something else than the scan size.
    #[error(
        "nominal coordinates are used: the sensors span {:.1} × {:.1} nm, but the scan size is {:.1} × {:.1} nm. \
         Correct the sensitivity of the sensors, or the scan size",
        .measured[0], .measured[1], .nominal[0], .nominal[1]
    )]
    SensorSpan {
        /// What they span, nm.
        measured: [f64; 2],
        /// The scan size, nm.
        nominal: [f64; 2],
    },
    /// The sensors make a mirror image.
    #[error(
        "the signs of the twist and of the strain axis may be wrong: they follow the sensors, which describe a \
         mirrored frame, so one of them has the wrong sign. Scan a sample with known features to find out which"
    )]
    SensorsMirrored,
    /// Samples of the sensors are far off and were left out.
    #[error(
        "results are not affected: in the {}, {} of {samples} samples of the position sensors ({:.1} %) are spikes and \
         were left out. Each is away from its neighbours by more than eleven times the noise and more than three \
         pixels",
        line_name(*.line), .dropped, 100.0 * *.dropped as f64 / *.samples as f64
    )]
    SensorGlitches {
        /// Trace or retrace.
        line: LineDirection,
        /// How many.
        dropped: usize,
        /// Samples of both sensors.
        samples: usize,
    },
    /// The lines of a sensor bend as those of one that lags behind the tip.
    #[error(
        "a lag of a sensor was removed, and a part of its effect is in the errors: in the {} the lines of the {} \
         sensor are bent by {bend:.2} nm at their beginning, and straight after about {columns:.1} columns{}. \
         Uncorrected, the pixels would be {:.2} % too {} along the fast axis. If the tip itself lags there, crop the \
         first columns",
        line_name(*.line),
        axis_name(*.sensor),
        .time_constant.map_or_else(String::new, |t| format!(", a time constant of {:.2} ms", 1000.0 * t)),
        100.0 * .share,
        if *.short { "short" } else { "long" }
    )]
    SensorLag {
        /// Trace or retrace.
        line: LineDirection,
        /// The sensor.
        sensor: Axis,
        /// How far its lines bend, nm.
        bend: f64,
        /// Over how many columns.
        columns: f64,
        /// In time, s; `None` where the file does not tell its line rate.
        time_constant: Option<f64>,
        /// By how much a plane through the whole would change the pixels.
        share: f64,
        /// Whether it would make them shorter.
        short: bool,
    },
    /// Hysteresis that trace and retrace show was taken off.
    #[error(
        "no sensor recorded it, but {} and {} are bent against each other along the lines: by up to {bend:.2} nm on either \
         side of their middle, {:.2} % of the frame, which changes the lattice by up to {:.2} % from place to place. This was \
         taken off. What bends both alike, or the slow axis, stays in the image and may be as large",
        line_name(*.line),
        line_name(match line {
            LineDirection::Trace => LineDirection::Retrace,
            LineDirection::Retrace => LineDirection::Trace,
        }),
        100.0 * .share,
        100.0 * .stretch
    )]
    LinesBent {
        /// Trace or retrace.
        line: LineDirection,
        /// How far each is off a straight line, nm.
        bend: f64,
        /// As a share of the fast side.
        share: f64,
        /// The largest stretch along the lines.
        stretch: f64,
    },
}

fn axis_name(axis: Axis) -> &'static str {
    match axis {
        Axis::X => "x",
        Axis::Y => "y",
    }
}

explain! { PositionDoubt:
    FrameTurned "frame-turned" Note
        "The frame was scanned at an angle. Vectors and angles are given in laboratory axes, not in the axes of the \
         image."
        "An angle in the image plus the angle of the frame is the angle in laboratory axes."
    SensorsOfOtherLine "sensors-of-other-line" Warning
        "The positions come from the other line direction. Where the tip lags or creeps, the two directions differ by \
         some tenths of a per cent."
        "Record the position sensors in both line directions, or analyse the direction that has them."
    NoPositionSensors "no-position-sensors" Warning
        "Positions are the nominal ones. The calibration error of the scanner, often 1 % and more, goes fully into \
         lengths, twist and strain."
        "Record the position sensors. Otherwise calibrate the scanner with a known lattice, or scan the place again \
         with the sample turned by 90°."
    SensorPlaneFitted "sensor-plane-fitted" Warning
        "The instrument levelled the signal of a position sensor. This removes the slope that holds the positions. \
         Nominal coordinates were used, with the full calibration error of the scanner."
        "Switch off levelling of the sensor channels and record again."
    SensorShape "sensor-shape" Warning
        "The position sensors and the image have different numbers of pixels. Nominal coordinates were used, with the \
         full calibration error of the scanner."
        "Record sensors and image with the same numbers of samples and lines."
    SensorsFlat "sensors-flat" Warning
        "The position sensors show no motion over an area: they are constant, missing or the same. Nominal coordinates \
         were used, with the full calibration error of the scanner."
        "Look at the sensor images: each has to rise evenly along its own axis. Record them again."
    SensorSpan "sensor-span" Warning
        "The position sensors span more than twice or less than half of the scan size. Their unit or their sensitivity \
         is wrong. Nominal coordinates were used."
        "Correct the sensitivity of the sensors in the instrument, or the scan size if that is what is wrong."
    SensorsMirrored "sensors-mirrored" Serious
        "According to the sensors the frame is a mirror image, so one sensor has the wrong sign. The signs of the \
         twist and of the strain axis are then wrong."
        "Scan a sample with known features to find out which sensor has the wrong sign. Correct it before you use \
         signs or axes."
    SensorGlitches "sensor-glitches" Note
        "Some samples of the position sensors are spikes. They were left out of the fit of the pixel positions. The \
         results are not affected."
        "Look at the cables and the converter of the sensors. Results need no repair."
    SensorLag "sensor-lag" Note
        "At the beginning of the lines a position sensor follows the tip with a delay. The effect was removed, and a \
         part of it is in the errors."
        "Scan more slowly or with more overscan. If the tip itself lags, crop the first columns."
    LinesBent "lines-bent" Warning
        "The scanner has hysteresis that no sensor recorded: trace and retrace show the same line bent in opposite ways. \
         Half of their mutual displacement was taken off each. Creep, and hysteresis of the slow axis, are the same in both \
         and stay in the image: they make a lattice that is uniform change across the frame, by about as much as is said \
         here. The mean lattice of a whole frame suffers little."
        "Do not take changes of this size across the frame, in maps or in the text, for strain. Record the position sensors."
}
