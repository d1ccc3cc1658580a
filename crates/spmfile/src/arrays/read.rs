//! An array or a picture → a scan, with what the user tells of it.

use super::plane::{Plane, Told};
use super::{npy, picture, text};
use crate::archive::Archive;
use crate::detect::{Format, detect};
use crate::error::ReadError;
use crate::labels;
use crate::scan::{
    Channel, ChannelInfo, FrameDirection, LineDirection, Scan, Span, UnreadableChannel,
};
use crate::sensors::sensor_axis;
use crate::whole::{MOST_CHANNELS, some_readable};

/// What only the user knows of an array.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ArrayOptions {
    /// Width and height of the image, edge to edge, nm.
    pub size_nm: Option<[f64; 2]>,
    /// Whether the bottom or the top line was acquired first.
    pub frame_direction: Option<FrameDirection>,
    /// Whether the lines are those of the way forth or back; names such as `phase_retrace` tell
    /// it themselves.
    pub line_direction: Option<LineDirection>,
    /// Lines per second, a line being trace and retrace together.
    pub line_rate_hz: Option<f64>,
    /// See [`Scan::line_times_s`].
    pub line_times_s: Option<[f64; 2]>,
    /// Rotation of the fast axis against x, counter-clockwise, rad.
    pub rotation_rad: Option<f64>,
    /// The unit of the values.
    pub unit: Option<String>,
    /// The unit of arrays named as position sensors (`x_sensor`).
    pub sensor_unit: Option<String>,
}

/// Reads the arrays that are wanted; [`crate::read()`] does so without options.
///
/// # Errors
/// - The bytes are no array and no picture.
/// - They are damaged, or hold kinds of numbers that are not read.
pub fn read(
    bytes: &[u8],
    options: &ArrayOptions,
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    read_as(detect(bytes), bytes, options, wanted)
}

/// The same for bytes of which [`crate::detect()`] has told the format before.
///
/// # Errors
/// As [`read`].
pub fn read_as(
    format: Format,
    bytes: &[u8],
    options: &ArrayOptions,
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    let (format, told, planes) = match format {
        Format::Npy => ("NumPy array", Told::default(), npy::read(bytes).map(one)),
        Format::Npz => return archive(bytes, options, wanted),
        Format::Tiff => ("TIFF", Told::default(), picture::tiff(bytes)),
        Format::Png => ("PNG", Told::default(), picture::png(bytes).map(one)),
        Format::Jpeg => ("JPEG", Told::default(), picture::jpeg(bytes).map(one)),
        Format::TextMatrix => match text::read(bytes) {
            Ok((told, plane)) => ("text matrix", told, Ok(one(plane))),
            Err(error) => ("text matrix", Told::default(), Err(error)),
        },
        _ => {
            return Err(ReadError::Unsupported {
                format: "array",
                reason: "expected an array or a picture, found another kind of file".to_owned(),
            });
        }
    };
    let mut planes = planes.map_err(|reason| ReadError::Damaged { format, reason })?;
    let several = planes.len() > 1;
    let mut comments = Some(told);
    let told: Vec<Told> = planes
        .iter_mut()
        .map(|plane| comments.take().unwrap_or_default().or(Told::by(plane)))
        .collect();
    let mut scan = told
        .first()
        .map_or_else(Scan::default, |told| frame(format, options, told));
    for (index, (plane, told)) in planes.into_iter().zip(told).enumerate() {
        let name = match &told.name {
            Some(name) => name.clone(),
            None if several => format!("image {}", index + 1),
            None => "image".to_owned(),
        };
        let info = info(name, options, &told);
        if plane.rendering {
            scan.metadata.push(rendering(&info.name));
        }
        if wanted(&info) {
            scan.channels.push(channel(info, plane, options, &told));
        }
    }
    Ok(scan)
}

fn one(plane: Plane) -> Vec<Plane> {
    vec![plane]
}

/// Reads an archive of arrays: each one of two dimensions is a channel.
fn archive(
    bytes: &[u8],
    options: &ArrayOptions,
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    const FORMAT: &str = "NumPy archive";
    let damaged = |reason: String| ReadError::Damaged {
        format: FORMAT,
        reason,
    };
    let mut archive = Archive::open(bytes).map_err(damaged)?;
    let names: Vec<String> = archive
        .names()
        .into_iter()
        .filter(|name| name.strip_suffix(".npy").is_some())
        .collect();
    if names.len() > MOST_CHANNELS {
        return Err(ReadError::TooManyChannels {
            found: names.len(),
            limit: MOST_CHANNELS,
        });
    }
    let mut scan: Option<Scan> = None;
    let mut unreadable = Vec::new();
    let mut announced = names.len();
    for entry in &names {
        let stem = entry.trim_end_matches(".npy");
        let mut told = Told::default();
        let about = format!("{stem}.txt");
        let carried = match archive.entry(&about) {
            Some(text) => labels::lines(&String::from_utf8_lossy(&text.map_err(damaged)?)),
            None => Vec::new(),
        };
        if carried.is_empty() && !wanted(&info(stem.to_owned(), options, &told)) {
            scan.get_or_insert_with(|| frame(FORMAT, options, &told));
            continue;
        }
        let content = match archive.entry(entry) {
            Some(content) => content.map_err(damaged)?,
            None => continue,
        };
        let plane = npy::read(&content).map(|mut plane| {
            let fits = labels::fits(&carried, [plane.rows, plane.columns]);
            plane.carried = if fits { carried } else { Vec::new() };
            told = Told::by(&mut plane);
            plane
        });
        let name = told.name.clone().unwrap_or_else(|| stem.to_owned());
        let info = info(name, options, &told);
        let scan = scan.get_or_insert_with(|| frame(FORMAT, options, &told));
        match plane {
            // Positions of the pixels, written beside the images.
            Err(_) if COORDINATES.contains(&stem) => announced -= 1,
            _ if !wanted(&info) => {}
            Ok(plane) => scan.channels.push(channel(info, plane, options, &told)),
            Err(error) => unreadable.push(UnreadableChannel {
                name: info.name,
                error,
            }),
        }
    }
    let mut scan = scan.unwrap_or_else(|| frame(FORMAT, options, &Told::default()));
    scan.unreadable = unreadable;
    some_readable(scan, announced)
}

/// Arrays of one dimension beside the images: positions of columns and of lines.
const COORDINATES: [&str; 2] = ["x_nm", "y_nm"];

fn info(name: String, options: &ArrayOptions, told: &Told) -> ChannelInfo {
    let value = |key: &str| labels::value(&told.channel, key).map(str::to_owned);
    ChannelInfo {
        line_direction: labels::stated_direction(&told.channel)
            .or_else(|| labels::line_direction(&name))
            .or(options.line_direction),
        name,
        internal_name: value("internal name").unwrap_or_default(),
        scan_line: value("scan line"),
    }
}

fn rendering(name: &str) -> (String, String) {
    let note = format!(
        "{name:?} is the luminance (0.299 red + 0.587 green + 0.114 blue) of a coloured picture: a \
         rendering, not measured values"
    );
    ("rendering".to_owned(), note)
}

fn channel(info: ChannelInfo, plane: Plane, options: &ArrayOptions, told: &Told) -> Channel {
    let given = match sensor_axis(&info.name, &info.internal_name) {
        Some(_) => options.sensor_unit.as_deref(),
        None => options.unit.as_deref(),
    };
    let size_nm = options.size_nm.or(told.size_nm);
    Channel {
        name: info.name,
        internal_name: info.internal_name,
        unit: given.or(told.unit.as_deref()).unwrap_or("").to_owned(),
        line_direction: info.line_direction,
        scan_line: info.scan_line,
        rows: plane.rows,
        columns: plane.columns,
        width_nm: size_nm.map(|[width, _]| width),
        height_nm: size_nm.map(|[_, height]| height),
        span: Span::PixelEdges,
        scale: 1.0,
        offset: 0.0,
        scaling: "values as stored".to_owned(),
        plane_fit: labels::value(&told.channel, "plane fit").map(str::to_owned),
        samples: plane.samples,
    }
}

/// The frame as the user describes it, and where he does not, the file.
fn frame(format: &str, options: &ArrayOptions, told: &Told) -> Scan {
    let mut scan = Scan {
        format: format.to_owned(),
        size_nm: told.size_nm,
        metadata: told.lines.clone(),
        ..Scan::default()
    };
    labels::apply(&mut scan);
    scan.size_nm = options.size_nm.or(scan.size_nm);
    scan.frame_direction = options.frame_direction.or(scan.frame_direction);
    scan.line_rate_hz = options.line_rate_hz.or(scan.line_rate_hz);
    scan.line_times_s = options.line_times_s.or(scan.line_times_s);
    scan.rotation_rad = options.rotation_rad.unwrap_or(scan.rotation_rad);
    scan
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::archive::tests::zip;

    #[test]
    fn archives_give_a_channel_per_array() {
        let image = |shape: &str, n: u8| {
            let header = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': {shape}, }}");
            let mut bytes = b"\x93NUMPY\x01\0".to_vec();
            bytes.extend((header.len() as u16).to_le_bytes());
            bytes.extend(header.bytes());
            bytes.extend(0..n);
            bytes
        };
        let bytes = zip(&[
            ("phase_retrace.npy", &image("(2, 3)", 6)),
            ("x_sensor.npy", &image("(2, 3)", 6)),
            ("times.npy", &image("(6,)", 6)),
            ("notes.txt", b"hello"),
        ]);
        let options = ArrayOptions {
            size_nm: Some([30.0, 20.0]),
            frame_direction: Some(FrameDirection::Up),
            line_direction: Some(LineDirection::Trace),
            line_rate_hz: Some(2.0),
            unit: Some("°".to_owned()),
            sensor_unit: Some("nm".to_owned()),
            ..ArrayOptions::default()
        };
        let scan = read(&bytes, &options, &|_| true).expect("two images");
        let [phase, sensor] = &scan.channels[..] else {
            panic!("two channels");
        };
        assert_eq!(
            (phase.name.as_str(), phase.unit.as_str()),
            ("phase_retrace", "°")
        );
        assert_eq!(
            (sensor.name.as_str(), sensor.unit.as_str()),
            ("x_sensor", "nm")
        );
        assert_eq!(phase.line_direction, Some(LineDirection::Retrace));
        assert_eq!(sensor.line_direction, Some(LineDirection::Trace));
        assert_eq!(phase.values(), [3.0, 4.0, 5.0, 0.0, 1.0, 2.0]);
        assert_eq!((phase.width_nm, phase.height_nm), (Some(30.0), Some(20.0)));
        assert_eq!(scan.unreadable.len(), 1);
        assert_eq!(
            (scan.frame_direction, scan.line_rate_hz),
            (options.frame_direction, Some(2.0))
        );

        let none = read(&bytes, &options, &|info| info.name == "times");
        assert!(none.is_ok_and(|scan| scan.channels.is_empty()));
        let alone = zip(&[("times.npy", &image("(6,)", 6))]);
        assert!(matches!(
            crate::read(&alone),
            Err(ReadError::NoReadableChannel { .. })
        ));
    }

    #[test]
    fn other_files_are_refused() {
        assert!(read(b"PK", &ArrayOptions::default(), &|_| true).is_err());
    }
}
