//! Where the pixels of a channel were, and when: the only place that says so.
//!
//! Nominal size and rotation → position sensors, where there are any that can be believed, and else what trace and retrace show of
//! hysteresis → calibration of the scanner → times of the pixels → the sample at rest.

use std::sync::Arc;

use heterostrain::Estimate;
use nalgebra::{Matrix2, Vector2};
use spmfile::{Channel, LineDirection, Scan};

use crate::calibration::Calibration;
use crate::caveat::Caveat;
use crate::caveat::positions::PositionDoubt;
use crate::frame::departure::Departure;
use crate::frame::geometry::{Geometry, Timing, at_rest};
use crate::frame::hysteresis;
use crate::frame::sensors::{Grid, SensorGeometry};
use crate::scan::channel::{image_of, images_of};
use crate::scan::positions::{nominal, speeds, usable_sensors};
use crate::settings::knobs::Settings;
use crate::spectrum::method::Method;

/// Bends that stretch no place by more than this share harm nobody: a tenth of the calibration that is assumed.
const HARMLESS: f64 = 1e-3;

/// The place of one channel.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    /// Trace or retrace.
    pub(crate) line: LineDirection,
    /// As the instrument intended, if the file tells.
    pub(crate) nominal: Option<Geometry>,
    /// What the position sensors say, as they were recorded.
    pub(crate) sensors: Option<SensorGeometry>,
    /// By the sensors, or nominal where there are none: not corrected by the calibration.
    pub(crate) recorded: Geometry,
    /// The same, corrected by the calibration of the scanner if there is one.
    pub(crate) geometry: Geometry,
    /// When; `None` where the file does not tell.
    pub(crate) timing: Option<Timing>,
    /// The calibration.
    scanner: Option<Matrix2<f64>>,
}

impl Place {
    /// `None` where the file has neither sensors nor a size. Doubts about the sensors are added to `caveats`.
    pub(crate) fn of(
        file: &str,
        scan: &Scan,
        channel: &Channel,
        settings: &Settings,
        caveats: &mut Vec<Caveat>,
    ) -> Option<Self> {
        let line = channel.line_direction.unwrap_or(LineDirection::Trace);
        let nominal = nominal(scan, channel);
        let grid = match settings.method {
            Method::Paper => Grid::Plane,
            _ => Grid::Curved,
        };
        let sensors = usable_sensors(file, scan, channel, nominal.as_ref(), grid, caveats);
        // Other methods have no use for it.
        let used = settings.method == Method::Lattice;
        let recorded = match &sensors {
            Some(sensors) => sensors.geometry.clone(),
            None if used => without_hysteresis(file, scan, channel, nominal.clone()?, caveats),
            None => nominal.clone()?,
        };
        let timing = scan
            .frame_direction
            .and_then(|frame| Timing::of_scan(scan, channel.columns, frame, line));
        let place = Self::given(&recorded, timing, settings);
        Some(Self {
            line,
            nominal,
            sensors,
            ..place
        })
    }

    /// Of an image whose positions, before any calibration, and times are known.
    pub(crate) fn given(recorded: &Geometry, timing: Option<Timing>, settings: &Settings) -> Self {
        let scanner = settings.scanner.as_ref();
        let geometry = match scanner {
            Some(scanner) if settings.method != Method::Paper => scanner.unbent(recorded),
            _ => recorded.clone(),
        };
        let scanner = scanner.and_then(Calibration::map);
        Self {
            line: LineDirection::Trace,
            nominal: None,
            sensors: None,
            recorded: recorded.clone(),
            geometry: scanner.map_or_else(|| geometry.clone(), |map| geometry.mapped(&map)),
            timing,
            scanner,
        }
    }

    /// The place of a block of pixels that starts at (column, row).
    pub(crate) fn cropped(self, first: [usize; 2], size: [usize; 2]) -> Self {
        Self {
            nominal: self.nominal.map(|n| n.cropped(first, size)),
            geometry: self.geometry.cropped(first, size),
            recorded: self.recorded.cropped(first, size),
            ..self
        }
    }

    /// The pixels on the sample, a drift (nm/s) taken off; `None` where drift or times are not known.
    pub(crate) fn still(&self, drift: Option<Vector2<f64>>) -> Option<Geometry> {
        let (drift, timing) = (drift?, self.timing?);
        Some(at_rest(&self.geometry, &timing, drift))
    }

    /// Tip speeds along the fast and slow axes with their spread, nm/s, and the relative error of their means; NaN
    /// without times.
    pub(crate) fn speeds(&self) -> ([Estimate; 2], [f64; 2]) {
        let (speeds, errors) = speeds(&self.recorded, self.sensors.as_ref(), self.timing.as_ref());
        let speeds = match (&self.timing, &self.scanner) {
            (Some(timing), Some(_)) => {
                let now = self.geometry.speeds(timing);
                [0, 1].map(|i| speeds[i].scaled(now[i] / speeds[i].value))
            }
            _ => speeds,
        };
        (speeds, errors)
    }
}

/// The nominal geometry with the bends that the other line direction shows; they are told.
fn without_hysteresis(
    file: &str,
    scan: &Scan,
    channel: &Channel,
    nominal: Geometry,
    caveats: &mut Vec<Caveat>,
) -> Geometry {
    let found = || {
        let (line, back) = match channel.line_direction? {
            LineDirection::Trace => (LineDirection::Trace, LineDirection::Retrace),
            LineDirection::Retrace => (LineDirection::Retrace, LineDirection::Trace),
        };
        let images = images_of(scan, &channel.name, line);
        let number = images.iter().position(|c| std::ptr::eq(*c, channel))?;
        let back = *images_of(scan, &channel.name, back).get(number)?;
        let terms = hysteresis::bend(&image_of(channel), &image_of(back))?;
        let [columns, rows] = nominal.size;
        let bent = Departure::new(terms, [0, columns - 1], [0, rows - 1]);
        let departure = bent.mapped(&nominal.pixel_to_nm);
        let (bend, longest) = departure.largest(nominal.size);
        let stretch = longest / nominal.fast_step().norm();
        let doubt = PositionDoubt::LinesBent {
            line,
            bend,
            share: bend / nominal.extent()[0],
            stretch,
        };
        (stretch > HARMLESS).then_some((doubt, departure))
    };
    let Some((doubt, departure)) = found() else {
        return nominal;
    };
    caveats.push(Caveat::new(doubt, file));
    Geometry {
        departure: Some(Arc::new(departure)),
        ..nominal
    }
}
