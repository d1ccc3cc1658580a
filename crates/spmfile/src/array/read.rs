//! An array or a picture → its outline, with what the user tells of it.

#[cfg(feature = "pictures")]
use super::picture;
use super::plane::{Plane, Told, Trouble};
use super::{npy, text};
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::labels;
use crate::options::ArrayOptions;
use crate::outline::{Input, Outline};
use crate::scan::{ChannelInfo, Scan};
use crate::sensors::sensor_axis;

/// Opens a `NumPy` array.
pub(crate) fn open_npy<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    const FORMAT: &str = "NumPy array";
    let plane = npy::open(input).map_err(|trouble| trouble.of(FORMAT))?;
    Ok(outline(
        FORMAT,
        &input.options,
        Told::default(),
        vec![plane],
    ))
}

/// Opens a matrix as text.
pub(crate) fn open_text<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let (told, plane) = text::open(input.bytes)?;
    Ok(outline(text::FORMAT, &input.options, told, vec![plane]))
}

/// Opens a picture.
#[cfg(feature = "pictures")]
pub(crate) fn open_png<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    pictures(
        "PNG",
        input,
        picture::png(input.bytes)
            .map(|plane| vec![plane])
            .map_err(Trouble::from),
    )
}

/// Opens a picture.
#[cfg(feature = "pictures")]
pub(crate) fn open_jpeg<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    pictures(
        "JPEG",
        input,
        picture::jpeg(input.bytes)
            .map(|plane| vec![plane])
            .map_err(Trouble::from),
    )
}

/// Opens every picture of a TIFF file.
#[cfg(feature = "pictures")]
pub(crate) fn open_tiff<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    pictures("TIFF", input, picture::tiff(input.bytes))
}

#[cfg(feature = "pictures")]
fn pictures<'a>(
    format: &'static str,
    input: &Input<'a>,
    planes: Result<Vec<Plane<'a>>, Trouble>,
) -> Result<Outline<'a>, ReadError> {
    let planes = planes.map_err(|trouble| trouble.of(format))?;
    Ok(outline(format, &input.options, Told::default(), planes))
}

/// The images of a file; what its comments tell is of the first one.
fn outline<'a>(
    format: &str,
    options: &ArrayOptions,
    comments: Told,
    mut planes: Vec<Plane<'a>>,
) -> Outline<'a> {
    let several = planes.len() > 1;
    let mut comments = Some(comments);
    let told: Vec<Told> = planes
        .iter_mut()
        .map(|plane| comments.take().unwrap_or_default().or(Told::by(plane)))
        .collect();
    let scan = told
        .first()
        .map_or_else(Scan::default, |told| frame(format, options, told));
    let mut outline = Outline::of(scan);
    for (index, (plane, told)) in planes.into_iter().zip(told).enumerate() {
        let name = match &told.name {
            Some(name) => name.clone(),
            None if several => format!("image {}", index + 1),
            None => "image".to_owned(),
        };
        let info = info(name, options, &told);
        let header = header(info, [plane.rows, plane.columns], options, &told);
        outline.add(header, plane.samples);
    }
    outline
}

pub(super) fn info(name: String, options: &ArrayOptions, told: &Told) -> ChannelInfo {
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

/// The header of an image of a number of rows and columns.
pub(super) fn header(
    info: ChannelInfo,
    [rows, columns]: [usize; 2],
    options: &ArrayOptions,
    told: &Told,
) -> ChannelHeader {
    let given = match sensor_axis(&info.name, &info.internal_name) {
        Some(_) => options.sensor_unit.as_deref(),
        None => options.unit.as_deref(),
    };
    let unit = given.or(told.unit.as_deref()).unwrap_or("");
    ChannelHeader {
        unit: unit.to_owned(),
        unit_as_written: unit.to_owned(),
        plane_fit: labels::value(&told.channel, "plane fit").map(str::to_owned),
        ..ChannelHeader::new(info, rows, columns).of_size(options.size_nm.or(told.size_nm))
    }
}

/// The frame as the user describes it, and where he does not, the file.
pub(super) fn frame(format: &str, options: &ArrayOptions, told: &Told) -> Scan {
    let mut scan = Scan {
        format: format.to_owned(),
        size_nm: told.size_nm,
        metadata: told.lines.clone(),
        ..Scan::default()
    };
    labels::apply(&mut scan);
    scan.notes.extend(told.notes.iter().cloned());
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
    use crate::arrays::read;
    use crate::scan::{FrameDirection, LineDirection};

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
