//! A measured calibration of the scanner, applied to the positions of pixels.

use spmfile::Scan;

use crate::calibration::Coordinates;
use crate::caveat::calibrating::CalibrationDoubt;
use crate::caveat::positions::PositionDoubt;
use crate::caveat::{Caveat, Doubt};
use crate::scan::measured::MeasuredLine;
use crate::settings::knobs::Settings;

/// Sizes and line rates that differ by more than this factor are other conditions. Chosen by eye.
const EXTRAPOLATED: f64 = 3.0;

/// Whether the calibration was measured under the conditions of this scan.
pub(crate) fn about_calibration<'a>(
    file: &str,
    scan: &Scan,
    mut lines: impl Iterator<Item = &'a MeasuredLine>,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) {
    let Some(scanner) = &settings.scanner else {
        return;
    };
    let from_sensors = scanner.coordinates == Coordinates::Sensors;
    if lines.any(|l| l.geometry.from_sensors != from_sensors) {
        caveats.push(Caveat::new(
            CalibrationDoubt::OfOtherCoordinates {
                calibrated: scanner.coordinates,
            },
            file,
        ));
    } else if !from_sensors {
        let expected = |doubt: &Doubt| {
            matches!(
                doubt,
                Doubt::Positions(PositionDoubt::NoPositionSensors { .. })
            )
        };
        caveats.retain(|c| !expected(&c.doubt));
    }
    let apart = |value: f64, known: Vec<f64>| {
        let near = |other: &f64| (1.0 / EXTRAPOLATED..=EXTRAPOLATED).contains(&(value / other));
        !known.is_empty() && !known.iter().any(near)
    };
    let sizes = || scanner.sizes_nm.iter().map(|s| s[0]).collect();
    let rate = scan
        .line_rate_hz
        .is_some_and(|hz| apart(hz, scanner.line_rates_hz.clone()));
    let size = scan.size_nm.is_some_and(|[w, _]| apart(w, sizes()));
    if rate || size {
        caveats.push(Caveat::new(
            CalibrationDoubt::Extrapolated {
                size,
                line_rate: rate,
                factor: EXTRAPOLATED,
            },
            file,
        ));
    }
}
