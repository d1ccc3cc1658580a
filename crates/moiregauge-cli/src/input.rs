//! What a file does not tell and the user knows: options, and scans read with them.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use clap::ValueEnum;
use moiregauge::series::natural_order;
use spmfile::arrays::ArrayOptions;
use spmfile::{
    Block, ChannelInfo, Format, FrameDirection, ReadError, Scan, Span, crop, detect, length_nm,
    read_selected, sensor_axis,
};

use crate::session;

/// The options for what files do not tell.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "What the files do not tell")]
pub(crate) struct KnownArgs {
    /// Width and height of the image from edge to edge, as in 70nm×70nm, 1.5umx1.5um or 70x35nm;
    /// arrays and pictures need it, other files obey it in place of their own
    #[arg(long, value_name = "W×H", value_parser = parse_size)]
    size: Option<[f64; 2]>,
    /// Unit of the values of arrays and pictures
    #[arg(long, value_name = "UNIT")]
    unit: Option<String>,
    /// Lines per second, trace and retrace together
    #[arg(long, value_name = "HZ", value_parser = parse_line_rate)]
    line_rate: Option<f64>,
    /// Which line was first: up is the bottom one. The alternating ones begin with the first file by
    /// name, numbers in names counting as numbers. Of files that hold a frame of each (Omicron Matrix)
    /// that one is read, otherwise up
    #[arg(long, value_enum)]
    frame_direction: Option<FrameArg>,
    /// Angle by which the fast axis is turned against x, degrees, counter-clockwise
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = parse_number)]
    rotation: Option<f64>,
    /// Channel that is the position sensor along x, by name
    #[arg(long, value_name = "NAME", requires = "y_sensor")]
    x_sensor: Option<String>,
    /// Channel that is the position sensor along y, by name
    #[arg(long, value_name = "NAME", requires = "x_sensor")]
    y_sensor: Option<String>,
    /// Unit of the position sensors of arrays
    #[arg(long, value_name = "UNIT")]
    sensor_unit: Option<String>,
    /// File that holds the position sensors, of the same shape as the images; for all scans
    #[arg(long, value_name = "FILE")]
    sensors: Option<PathBuf>,
    /// Use this block only: first column, first row, columns and rows, as the screen shows them:
    /// rows are counted from the top
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

/// A block as the screen shows it, row 0 on top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Crop {
    column: usize,
    top: usize,
    columns: usize,
    rows: usize,
}

/// The options, and the order of the files for those that alternate.
#[derive(Clone, Debug, Default)]
pub(crate) struct Known {
    args: KnownArgs,
    order: Vec<PathBuf>,
}

impl KnownArgs {
    /// The file that is read beside each scan.
    pub(crate) fn second_file(&self) -> Option<&PathBuf> {
        self.sensors.as_ref()
    }

    /// What is known of these files.
    pub(crate) fn of(&self, inputs: &[PathBuf]) -> Known {
        let (mut order, _) = moiregauge_pipeline::distinct(inputs);
        order.sort_by(|a, b| natural_order(&a.to_string_lossy(), &b.to_string_lossy()));
        Known {
            args: self.clone(),
            order,
        }
    }
}

impl Known {
    /// Reads the wanted channels of a file and its position sensors, completed by what is known.
    ///
    /// The second part says in words what the user's options replaced.
    pub(crate) fn read(
        &self,
        path: &Path,
        bytes: &[u8],
        wanted: &dyn Fn(&ChannelInfo) -> bool,
    ) -> anyhow::Result<(Scan, Vec<String>)> {
        let mut scan = self.decode(path, bytes, wanted)?;
        let replaced = self.complete(path, &mut scan)?;
        Ok((scan, replaced))
    }

    /// Reads the wanted channels and those named as sensors.
    pub(crate) fn decode(
        &self,
        path: &Path,
        bytes: &[u8],
        wanted: &dyn Fn(&ChannelInfo) -> bool,
    ) -> Result<Scan, ReadError> {
        let wanted =
            |info: &ChannelInfo| wanted(info) || self.names_sensor(&info.name, &info.internal_name);
        if is_array(bytes) {
            spmfile::arrays::read(bytes, &self.array_options(path), &wanted)
        } else if detect(bytes) == Format::OmicronMatrix {
            session::read(path, bytes, self.frame_direction(path), &wanted)
        } else {
            read_selected(bytes, &wanted)
        }
    }

    /// Whether the user calls the channel of these names a position sensor.
    pub(crate) fn names_sensor(&self, name: &str, internal_name: &str) -> bool {
        let both = [&self.args.x_sensor, &self.args.y_sensor];
        both.into_iter()
            .flatten()
            .any(|wanted| is_named(name, wanted) || is_named(internal_name, wanted))
    }

    fn array_options(&self, path: &Path) -> ArrayOptions {
        ArrayOptions {
            size_nm: self.args.size,
            frame_direction: self.frame_direction(path),
            line_rate_hz: self.args.line_rate,
            rotation_rad: self.args.rotation.map(f64::to_radians),
            unit: self.args.unit.clone(),
            sensor_unit: self.args.sensor_unit.clone(),
            ..ArrayOptions::default()
        }
    }

    fn frame_direction(&self, path: &Path) -> Option<FrameDirection> {
        let number = self.order.iter().position(|p| p == path).unwrap_or(0);
        let up = match self.args.frame_direction? {
            FrameArg::Up => true,
            FrameArg::Down => false,
            FrameArg::AlternatingUp => number % 2 == 0,
            FrameArg::AlternatingDown => number % 2 == 1,
        };
        Some(if up {
            FrameDirection::Up
        } else {
            FrameDirection::Down
        })
    }

    /// Puts what is known into a scan, then takes the block that is wanted of it. Returns what was
    /// replaced.
    pub(crate) fn complete(&self, path: &Path, scan: &mut Scan) -> anyhow::Result<Vec<String>> {
        let mut replaced = Vec::new();
        let mut note = |what: &str, old: Option<String>, new: String| {
            if let Some(old) = old.filter(|old| *old != new) {
                replaced.push(format!("{what} {new} in place of the file's {old}"));
            }
        };
        if let Some(size @ [width, height]) = self.args.size {
            let words = |[w, h]: [f64; 2]| format!("{w} nm × {h} nm");
            note("size", scan.size_nm.map(words), words(size));
            scan.size_nm = Some(size);
            for channel in &mut scan.channels {
                (channel.width_nm, channel.height_nm) = (Some(width), Some(height));
                channel.span = Span::PixelEdges;
            }
        }
        if let Some(rate) = self.args.line_rate {
            let old = scan
                .line_rate_hz
                .or(scan.line_times_s.map(|[a, b]| 1.0 / (a + b)));
            if old != Some(rate) {
                let words = |hz: f64| format!("{hz} Hz");
                note("line rate", old.map(words), words(rate));
                scan.line_rate_hz = Some(rate);
                scan.line_times_s = None;
            }
        }
        if let Some(direction) = self.frame_direction(path) {
            let words = |d: FrameDirection| match d {
                FrameDirection::Up => "up".to_owned(),
                FrameDirection::Down => "down".to_owned(),
            };
            let old = scan.frame_direction.map(words);
            note("frame direction", old, words(direction));
            scan.frame_direction = Some(direction);
        }
        if let Some(degrees) = self.args.rotation {
            // Files that tell no rotation have none.
            let old = Some(scan.rotation_rad.to_degrees()).filter(|old| *old != 0.0);
            let words = |deg: f64| format!("{deg}°");
            note("rotation", old.map(words), words(degrees));
            scan.rotation_rad = degrees.to_radians();
        }
        self.sensors(scan)?;
        if let Some(wanted) = self.args.crop {
            let rows = scan.channels.first().map_or(0, |c| c.rows);
            let below = wanted.top.checked_add(wanted.rows);
            let row = below
                .and_then(|end| rows.checked_sub(end))
                .with_context(|| {
                    format!(
                        "--crop: rows {} to {} from the top of an image of {rows}",
                        wanted.top,
                        wanted.top.saturating_add(wanted.rows).saturating_sub(1)
                    )
                })?;
            let block = Block {
                column: wanted.column,
                row,
                columns: wanted.columns,
                rows: wanted.rows,
            };
            crop(scan, block).context("--crop")?;
        }
        Ok(replaced)
    }

    /// Makes the channels that the user names position sensors, or those of the second file.
    fn sensors(&self, scan: &mut Scan) -> anyhow::Result<()> {
        let names = self
            .args
            .x_sensor
            .as_deref()
            .zip(self.args.y_sensor.as_deref());
        let Some(path) = &self.args.sensors else {
            if let Some(names) = names {
                adopt(scan, names)?;
            }
            return Ok(());
        };
        let about = || format!("--sensors {}", path.display());
        let bytes = std::fs::read(path).with_context(about)?;
        let mut second = self.decode(path, &bytes, &|_| true).with_context(about)?;
        if let Some(names) = names {
            adopt(&mut second, names).with_context(about)?;
        }
        let sensors: Vec<_> = second
            .channels
            .into_iter()
            .filter(|c| sensor_axis(&c.name, &c.internal_name).is_some())
            .collect();
        for axis in ['X', 'Y'] {
            ensure!(
                sensors
                    .iter()
                    .any(|c| sensor_axis(&c.name, &c.internal_name) == Some(axis)),
                "{}: expected a channel like \"{axis} Sensor\", found none; name both with --x-sensor \
                 and --y-sensor",
                about()
            );
        }
        scan.channels
            .retain(|c| sensor_axis(&c.name, &c.internal_name).is_none());
        for (image, sensor) in scan
            .channels
            .iter()
            .flat_map(|image| sensors.iter().map(move |sensor| (image, sensor)))
        {
            ensure!(
                (image.rows, image.columns) == (sensor.rows, sensor.columns),
                "{}: channel {:?} has {} lines of {} samples, {:?} of the scan {} of {}",
                about(),
                sensor.name,
                sensor.rows,
                sensor.columns,
                image.name,
                image.rows,
                image.columns
            );
        }
        scan.channels.extend(sensors);
        Ok(())
    }
}

/// Whether the bytes are those of an array or a picture, which tell nothing of a frame.
fn is_array(bytes: &[u8]) -> bool {
    matches!(
        detect(bytes),
        Format::Npy | Format::Npz | Format::Tiff | Format::Png | Format::Jpeg | Format::TextMatrix
    )
}

/// Names the channels that the user calls position sensors so; others of these names are left out.
fn adopt(scan: &mut Scan, (x, y): (&str, &str)) -> anyhow::Result<()> {
    let found = |scan: &Scan, wanted: &str| -> Vec<usize> {
        let named =
            |c: &spmfile::Channel| is_named(&c.name, wanted) || is_named(&c.internal_name, wanted);
        (0..scan.channels.len())
            .filter(|&i| named(&scan.channels[i]))
            .collect()
    };
    let both = [
        ("X Sensor", found(scan, x), x),
        ("Y Sensor", found(scan, y), y),
    ];
    for (role, places, wanted) in &both {
        if places.is_empty() {
            let mut present: Vec<&str> = scan.channels.iter().map(|c| c.name.as_str()).collect();
            present.dedup();
            bail!(
                "no channel {wanted:?} for the {role}; there are {}",
                present.join(", ")
            );
        }
    }
    let mut index = 0;
    scan.channels.retain_mut(|channel| {
        let role = both.iter().find(|(_, places, _)| places.contains(&index));
        index += 1;
        match role {
            Some((role, _, _)) => {
                channel.internal_name = std::mem::replace(&mut channel.name, (*role).to_owned());
                true
            }
            None => sensor_axis(&channel.name, &channel.internal_name).is_none(),
        }
    });
    Ok(())
}

/// Whether a name is the wanted one: case, blanks and signs do not count, and a name without line
/// direction stands for both.
pub(crate) fn is_named(name: &str, wanted: &str) -> bool {
    let plain = |text: &str| -> String {
        text.chars()
            .filter(|c| c.is_alphanumeric())
            .flat_map(char::to_lowercase)
            .collect()
    };
    let (name, wanted) = (plain(name), plain(wanted));
    let rest = name.strip_prefix(&wanted);
    let directions = ["", "trace", "retrace", "forward", "backward"];
    !wanted.is_empty() && rest.is_some_and(|rest| directions.contains(&rest))
}

/// `70nm×70nm`, `70x70 nm`: two lengths; the first may leave its unit to the second.
pub(crate) fn parse_size(text: &str) -> Result<[f64; 2], String> {
    let parsed = || {
        let (width, height) = text.split_once(['×', 'x', 'X', '*'])?;
        // `um` is how the micrometre is typed.
        let height_nm = length_nm(height)?;
        let unit = height.trim_start_matches(|c: char| !c.is_alphabetic() || c == 'e');
        let width_nm = length_nm(width).or_else(|| length_nm(&format!("{width}{unit}")))?;
        let good = |n: f64| n > 0.0 && n.is_finite();
        (good(width_nm) && good(height_nm)).then_some([width_nm, height_nm])
    };
    parsed().ok_or_else(|| {
        "expected width × height with a unit (pm, Å, nm, um, mm), as in 70nm×70nm".to_owned()
    })
}

fn parse_number(text: &str) -> Result<f64, String> {
    let number: Option<f64> = text.trim().parse().ok();
    number
        .filter(|n| n.is_finite())
        .ok_or_else(|| "expected a number".to_owned())
}

/// From an hour a line to the fastest video microscopes.
fn parse_line_rate(text: &str) -> Result<f64, String> {
    parse_number(text)
        .ok()
        .filter(|rate| (1e-4..=1e5).contains(rate))
        .ok_or_else(|| "expected a line rate between 0.0001 and 100000 Hz".to_owned())
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
        near("1.5 um x 2 µm", [1500.0, 2000.0]);
        near("500pm×7Å", [0.5, 0.7]);
        near("1e3nm×2e3 nm", [1000.0, 2000.0]);
        for wrong in ["70×70", "70nm", "-1nm×2nm", "0nm×2nm", "1V×2V", "", "nm×nm"] {
            assert!(parse_size(wrong).is_err(), "{wrong}");
        }
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

    #[test]
    fn names_without_direction_stand_for_both() {
        assert!(is_named("Phase_Retrace", "phase") && is_named("TR Phase", "tr_phase"));
        assert!(!is_named("Phase 2", "phase") && !is_named("TR Phase", "phase"));
        assert!(!is_named("", ""));
    }

    #[test]
    fn files_alternate_by_number() {
        let args = KnownArgs {
            frame_direction: Some(FrameArg::AlternatingDown),
            ..KnownArgs::default()
        };
        let known = args.of(&["s.10.npy", "s.9.npy"].map(PathBuf::from));
        let of = |name: &str| known.frame_direction(Path::new(name));
        assert_eq!(of("s.9.npy"), Some(FrameDirection::Down));
        assert_eq!(of("s.10.npy"), Some(FrameDirection::Up));
    }
}
