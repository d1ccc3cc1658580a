//! The position sensors among the channels of a scan.

use crate::scan::{Channel, LineDirection, Scan};
use crate::units::nm_per;

/// Where the tip really was, pixel by pixel: two channels of the same shape in units of length.
#[derive(Clone, Copy, Debug)]
pub struct PositionSensors<'a> {
    /// Position along the laboratory's x axis.
    pub x: &'a Channel,
    /// Position along the laboratory's y axis.
    pub y: &'a Channel,
}

/// Why a scan has no usable position sensors for a line direction.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SensorProblem {
    /// None recorded.
    #[error("no X and Y sensor channels")]
    Absent,
    /// Only one of two recorded.
    #[error("no {axis} sensor channel, only the other one")]
    OneAbsent {
        /// `X` or `Y`.
        axis: char,
    },
    /// Recorded, but not as a length.
    #[error(
        "channel {name:?} is in {unit:?}, not in a unit of length: the file holds no sensitivity for it"
    )]
    NotALength {
        /// The channel.
        name: String,
        /// Its unit.
        unit: String,
    },
    /// The two do not belong together.
    #[error("the X sensor has {x:?} lines and samples, the Y sensor {y:?}")]
    Shapes {
        /// Lines and samples of the X sensor.
        x: [usize; 2],
        /// Lines and samples of the Y sensor.
        y: [usize; 2],
    },
}

/// The position sensors recorded along with `line`.
///
/// They are told by name in any spelling (`Xsensor`, `X Sensor`, `x_sensor`, `X Position Sensor` …).
/// Whether the instrument plane-fitted them is for the caller to see in [`Channel::plane_fit`].
///
/// # Errors
/// [`SensorProblem`] says what is absent or unusable.
pub fn position_sensors(
    scan: &Scan,
    line: LineDirection,
) -> Result<PositionSensors<'_>, SensorProblem> {
    match (sensor(scan, 'X', line), sensor(scan, 'Y', line)) {
        (None, None) => Err(SensorProblem::Absent),
        (None, Some(_)) => Err(SensorProblem::OneAbsent { axis: 'X' }),
        (Some(_), None) => Err(SensorProblem::OneAbsent { axis: 'Y' }),
        (Some(x), Some(y)) => {
            if let Some(odd) = [x, y].into_iter().find(|c| nm_per(&c.unit).is_none()) {
                return Err(SensorProblem::NotALength {
                    name: odd.name.clone(),
                    unit: odd.unit.clone(),
                });
            }
            let shape = |c: &Channel| [c.rows, c.columns];
            if shape(x) != shape(y) {
                return Err(SensorProblem::Shapes {
                    x: shape(x),
                    y: shape(y),
                });
            }
            Ok(PositionSensors { x, y })
        }
    }
}

/// `X` or `Y` if a channel with these names is a position sensor.
///
/// Takes names, so that it can choose channels before they are decoded.
pub fn sensor_axis(name: &str, internal_name: &str) -> Option<char> {
    axis(name).or_else(|| axis(internal_name))
}

fn axis(name: &str) -> Option<char> {
    let plain: String = name
        .chars()
        .filter(char::is_ascii_alphanumeric)
        .map(|c| c.to_ascii_lowercase())
        .collect();
    ['X', 'Y'].into_iter().find(|axis| {
        let letter = axis.to_ascii_lowercase();
        let middle = ["", "axis", "position", "pos", "scanner", "scan"];
        let end = ["sensor", "sens"];
        middle.iter().any(|m| {
            end.iter().any(|e| {
                plain == format!("{letter}{m}{e}")
                    || plain == format!("{m}{e}{letter}")
                    || plain == format!("{m}{letter}{e}")
            })
        })
    })
}

fn sensor(scan: &Scan, axis: char, line: LineDirection) -> Option<&Channel> {
    let all = || {
        scan.channels
            .iter()
            .filter(move |c| sensor_axis(&c.name, &c.internal_name) == Some(axis))
    };
    let of_line = || all().filter(move |c| c.line_direction == Some(line));
    // An interleaved line was scanned at another time: the main one first.
    of_line()
        .find(|c| {
            c.scan_line
                .as_deref()
                .is_none_or(|s| s.eq_ignore_ascii_case("Main"))
        })
        .or_else(|| of_line().next())
        .or_else(|| all().find(|c| c.line_direction.is_none()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_any_spelling() {
        for x in [
            "Xsensor",
            "X Sensor",
            "XSensor",
            "x_sensor",
            "X Position Sensor",
            "Sensor X",
            "X-Sensor",
        ] {
            assert_eq!(sensor_axis(x, ""), Some('X'), "{x}");
        }
        assert_eq!(sensor_axis("Y Sensor", ""), Some('Y'));
        assert_eq!(sensor_axis("Input 1", "Ysensor"), Some('Y'));
        for other in ["Height Sensor", "ZSensor", "TR Phase", "", "Max", "Sensor"] {
            assert_eq!(sensor_axis(other, ""), None, "{other}");
        }
    }
}
