//! What a file does not tell and the user knows: the options for it.

use std::path::PathBuf;

use clap::ValueEnum;
pub(crate) use moiregauge_pipeline::Known;
use moiregauge_pipeline::KnownError;
use moiregauge_report::results::{Crop, FrameOrder, UserSpecified};
use spmfile::length_nm;

use crate::numbers;

/// The options for what files do not tell.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "What the files do not tell")]
pub(crate) struct KnownArgs {
    /// Width and height from edge to edge, as in 70nm×35nm or 70nm
    ///
    /// Also 1.5umx1.5um or 70x35nm; one length is a square. Arrays and pictures need it; in other files it replaces their
    /// own size.
    #[arg(long, value_name = "W×H", value_parser = parse_size)]
    size: Option<[f64; 2]>,
    /// Unit of the values of arrays and pictures
    #[arg(long, value_name = "UNIT")]
    unit: Option<String>,
    /// Lines per second, trace and retrace together
    #[arg(long, value_name = "HZ", value_parser = numbers::number(numbers::LINE_RATE_HZ))]
    line_rate: Option<f64>,
    /// Direction of the slow scan: up if the bottom line was first
    ///
    /// alternating-… starts with the first file by name (numbers in names are sorted as numbers). Of files that hold a
    /// frame of each direction (Omicron Matrix) this frame is read; default there: both, for convert and info up.
    #[arg(long, value_enum)]
    frame_direction: Option<FrameArg>,
    /// Angle of the fast axis against x, degrees counter-clockwise
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = numbers::number(numbers::ANGLE_DEG))]
    rotation: Option<f64>,
    /// Name of the channel of the position sensor along x
    #[arg(long, value_name = "NAME", requires = "y_sensor")]
    x_sensor: Option<String>,
    /// Name of the channel of the position sensor along y
    #[arg(long, value_name = "NAME", requires = "x_sensor")]
    y_sensor: Option<String>,
    /// Unit of the position sensors of arrays
    #[arg(long, value_name = "UNIT")]
    sensor_unit: Option<String>,
    /// File that holds the position sensors, of the same shape as the images; for all scans
    #[arg(long, value_name = "FILE")]
    sensors: Option<PathBuf>,
    /// Use only this block: first column, first row, columns and rows; rows are counted from the top
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse_crop)]
    crop: Option<Crop>,
}

/// Sense of the slow motion of one file or of a series.
#[derive(Clone, Copy, Debug, ValueEnum, PartialEq, Eq)]
enum FrameArg {
    Up,
    Down,
    AlternatingUp,
    AlternatingDown,
}

impl From<FrameArg> for FrameOrder {
    fn from(frame: FrameArg) -> Self {
        match frame {
            FrameArg::Up => Self::Up,
            FrameArg::Down => Self::Down,
            FrameArg::AlternatingUp => Self::AlternatingUp,
            FrameArg::AlternatingDown => Self::AlternatingDown,
        }
    }
}

impl KnownArgs {
    /// The file that is read beside each scan.
    pub(crate) fn second_file(&self) -> Option<&PathBuf> {
        self.sensors.as_ref()
    }

    /// What the user tells.
    pub(crate) fn user_specified(&self) -> UserSpecified {
        let sensors = self.sensors.as_ref();
        UserSpecified {
            size_nm: self.size,
            unit: self.unit.clone(),
            line_rate_hz: self.line_rate,
            frame_direction: self.frame_direction.map(Into::into),
            rotation_deg: self.rotation,
            x_sensor: self.x_sensor.clone(),
            y_sensor: self.y_sensor.clone(),
            sensor_unit: self.sensor_unit.clone(),
            sensors: sensors.map(|path| moiregauge_pipeline::names::in_words(path)),
            crop: self.crop,
        }
    }

    /// What is known of these files.
    pub(crate) fn of(&self, inputs: &[PathBuf]) -> Known {
        Known::new(&self.user_specified(), inputs)
    }
}

/// The error with the option that it is about.
pub(crate) fn with_option(error: KnownError) -> anyhow::Error {
    crate::errors::with_advice(error.into())
}

/// `70nm×35nm`, `70x35 nm`: two lengths; the first may leave its unit to the second. `70nm`: a square.
pub(crate) fn parse_size(text: &str) -> Result<[f64; 2], String> {
    let parsed = || {
        let Some((width, height)) = text.split_once(['×', 'x', 'X', '*']) else {
            return Some([length_nm(text)?; 2]);
        };
        // `um` is how the micrometre is typed.
        let height_nm = length_nm(height)?;
        let unit = height.trim_start_matches(|c: char| !c.is_alphabetic() || c == 'e');
        let width_nm = length_nm(width).or_else(|| length_nm(&format!("{width}{unit}")))?;
        Some([width_nm, height_nm])
    };
    let size = parsed().ok_or_else(|| {
        "expected width × height with a unit (pm, Å, nm, um, mm), as in 70nm×35nm, or one length for a square".to_owned()
    })?;
    numbers::sides(size)
}

fn parse_crop(text: &str) -> Result<Crop, String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[column, top, columns, rows]) if columns > 0 && rows > 0 => Ok(Crop {
            column,
            top,
            columns,
            rows,
        }),
        _ => Err(
            "expected first column, first row from the top, columns, rows, as in 0,128,256,256"
                .to_owned(),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_in_any_spelling() {
        let near = |text: &str, expected: [f64; 2]| {
            let found = parse_size(text).expect(text);
            let close = |(a, b): (f64, f64)| (a - b).abs() < 1e-9 * b;
            assert!(
                found.into_iter().zip(expected).all(close),
                "{text}: {found:?}"
            );
        };
        near("70nm×70nm", [70.0, 70.0]);
        near("70x35nm", [70.0, 35.0]);
        near("600 Å", [60.0, 60.0]);
        near("1.5 um x 2 µm", [1500.0, 2000.0]);
        near("500pm×7Å", [0.5, 0.7]);
        near("1e3nm×2e3 nm", [1000.0, 2000.0]);
        for wrong in ["70×70", "70", "-1nm×2nm", "0nm×2nm", "1V×2V", "", "nm×nm"] {
            assert!(parse_size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_is_told_becomes_options_and_is_told_again() {
        use clap::Parser as _;
        use moiregauge_serve::user_specified_as_options;
        #[derive(clap::Parser)]
        struct Typed {
            #[command(flatten)]
            known: KnownArgs,
        }
        let told = UserSpecified {
            size_nm: Some([70.0, 35.5]),
            unit: Some("a b".to_owned()),
            line_rate_hz: Some(0.1 + 0.2),
            frame_direction: Some(FrameOrder::AlternatingDown),
            rotation_deg: Some(-12.5),
            x_sensor: Some("x".to_owned()),
            y_sensor: Some("y".to_owned()),
            sensor_unit: Some("V".to_owned()),
            sensors: Some("s.npy".to_owned()),
            crop: parse_crop("1,2,3,4").ok(),
        };
        let typed = ["program".to_owned()].into_iter();
        let typed = Typed::parse_from(typed.chain(user_specified_as_options(&told)));
        assert_eq!(typed.known.user_specified(), told);
        assert!(user_specified_as_options(&UserSpecified::default()).is_empty());
    }

    #[test]
    fn blocks_are_four_numbers() {
        let crop = parse_crop("1, 2,3,4").expect("a block");
        assert_eq!(
            (crop.column, crop.top, crop.columns, crop.rows),
            (1, 2, 3, 4)
        );
        for wrong in ["1,2,3", "1,2,0,4", "-1,2,3,4", "a", ""] {
            assert!(parse_crop(wrong).is_err(), "{wrong}");
        }
    }
}
