//! JPK images (`NanoWizard` and the like), `.jpk` and `.jpk-qi-image`.
//!
//! A TIFF file with private tags. The first directory describes the frame and shows a coloured
//! thumbnail; each further one holds a channel with a list of scaling slots (`raw`, `volts`,
//! `calibrated` …), one of which is the default.
//!
//! - The first stored line is that with the smallest grid coordinate, `v` = 0: the bottom one, or
//!   the top one where the grid is reflected. Retrace lines are stored in order of position.
//! - The origin of the grid is its corner `u` = `v` = 0: in a real file the frame before this one
//!   ended half a line short of `v` = 1 from there. [`Scan::offset_nm`] is the centre.
//! - The grid is turned by `theta` against the axes of the scanner, counter-clockwise, in rad.
//! - The scan rate counts trace and retrace together (start and end of a real file fit it within
//!   0.1 %); the duty cycle is the share of the time within the frame.
//!
//! Names of the tags: Gwyddion's `jpk.h`, by the maker of the instrument.

#[cfg(all(feature = "hdf5", not(target_family = "wasm")))]
pub(crate) mod hdf5;

#[cfg(feature = "archives")]
use crate::archive::Archive;
use crate::clock;
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::outline::{Input, Outline};
use crate::raster::{self, Order};
use crate::scan::{ChannelInfo, DateTime, FrameDirection, LineDirection, Scan, UnreadableChannel};
use crate::signature::{first_entry, tiff_has};
use crate::stored::Flat;
use crate::tiff_tags::{Directory, directories};
use crate::whole::{Extent, some_readable};
use crate::words::Unread;

const FORMAT: &str = "JPK";
/// The entry of an archive of curves that holds the image of the map begins like this, and ends
/// with `jpk-qi-image` or `force`.
const IMAGE_ENTRY: &str = "data-image.";

const PHOTOMETRIC: u16 = 262;
const START_DATE: u16 = 0x8003;
const END_DATE: u16 = 0x8006;
const PROPERTIES: u16 = 0x8017;
const X0: u16 = 0x8040;
const Y0: u16 = 0x8041;
const U_LENGTH: u16 = 0x8042;
const V_LENGTH: u16 = 0x8043;
const THETA: u16 = 0x8044;
const REFLECT: u16 = 0x8045;
const RATE: u16 = 0x8049;
const DUTY_CYCLE: u16 = 0x804a;
const MOTION: u16 = 0x804b;
const CHANNEL: u16 = 0x8050;
const RETRACE: u16 = 0x8051;
const FANCY_NAME: u16 = 0x8052;
/// Lines of `key : value` about the channel; files of some programs and of maps have its name only there.
const PARAMETERS: u16 = 0x8053;
const SLOTS: u16 = 0x8080;
const DEFAULT_SLOT: u16 = 0x8081;
/// Tags of the first slot; those of the next lie [`SLOT_STRIDE`] higher.
const SLOT_NAME: u16 = 0x8090;
const SLOT_UNIT: u16 = 0x80a2;
const SLOT_SCALING: u16 = 0x80a3;
const SLOT_FACTOR: u16 = 0x80a4;
const SLOT_OFFSET: u16 = 0x80a5;
const SLOT_STRIDE: u16 = 0x30;
/// Slots that fit between the first one and the end of the range of tags.
const MOST_SLOTS: u16 = 128;

/// Tags of the first directory that tell about the frame, with their names.
const TOLD: [(u16, &str); 16] = [
    (0x8000, "Program version"),
    (START_DATE, "Start"),
    (END_DATE, "End"),
    (0x8004, "Name"),
    (0x8005, "Comment"),
    (0x8007, "Sample"),
    (0x8009, "Account"),
    (0x8010, "Cantilever"),
    (0x8011, "Spring constant"),
    (0x8030, "Feedback mode"),
    (0x8033, "Setpoint"),
    (REFLECT, "Grid reflected"),
    (0x8048, "Line end"),
    (RATE, "Scan rate"),
    (DUTY_CYCLE, "Duty cycle"),
    (MOTION, "Motion"),
];

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// A TIFF file with tags of the maker.
pub(crate) fn detect(bytes: &[u8]) -> bool {
    tiff_has(bytes, 0x8000, 0x80ff)
}

/// An archive of the maker.
pub(crate) fn detect_zip(bytes: &[u8]) -> bool {
    let name = first_entry(bytes);
    let folders = [&b"index/"[..], b"segments/", b"shared-data/", b"data-image"];
    name == b"header.properties"
        || name.ends_with(b".jpk-qi-image")
        || folders.iter().any(|folder| name.starts_with(folder))
}

/// An HDF5 file of the maker.
#[cfg(all(feature = "hdf5", not(target_family = "wasm")))]
pub(crate) fn detect_hdf5(bytes: &[u8]) -> bool {
    let head = crate::detect::head_of_hdf5(bytes);
    head.is_some_and(|head| memchr::memmem::find(head, b"Measurement_0").is_some())
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    outline(input.bytes)
}

fn outline(bytes: &[u8]) -> Result<Outline<'_>, ReadError> {
    let pages = directories(bytes).map_err(damaged)?;
    let first = pages.first().ok_or_else(|| damaged("it holds no image"))?;
    let mut outline = Outline::of(frame(first));
    let mut extent = Extent::default();
    let mut announced = 0;
    let mut bytes_left = bytes.len();
    for page in pages.iter().filter(|page| is_channel(page)) {
        announced += 1;
        let info = info(page);
        match channel(page, first, &info, &mut bytes_left) {
            Ok((header, samples)) => {
                outline.add_flat(header.of_size(outline.scan.size_nm), samples);
            }
            Err(Trouble::Scaling(error)) => outline.scan.unreadable.push(UnreadableChannel {
                name: info.name,
                error,
            }),
            Err(Trouble::Missing(error)) => extent.lose(info.name, error),
        }
    }
    if announced == 0 {
        return Err(ReadError::Unsupported {
            format: FORMAT,
            reason: "it holds no channel but a picture at most".to_owned(),
        });
    }
    extent.judge(some_readable(outline, announced)?, bytes.len() as u64)
}

/// Reads the headers of the image of a map in its archive; curves alone are refused.
#[cfg(feature = "archives")]
pub(crate) fn open_zip<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let mut archive = Archive::open(input.bytes).map_err(damaged)?;
    let names = archive.names();
    let name = names.iter().find(|name| name.starts_with(IMAGE_ENTRY));
    let Some(image) = name.and_then(|name| archive.entry(name)) else {
        return Err(ReadError::ForceCurve);
    };
    let image = image.map_err(damaged)?;
    let outline = outline(&image)?.owned();
    outline.ok_or_else(|| damaged("expected images in its directory, found none"))
}

/// Everything but the thumbnail: grey, and named.
fn is_channel(page: &Directory<'_>) -> bool {
    let grey = page.count(PHOTOMETRIC).is_none_or(|kind| kind <= 1);
    grey && !matches!(&*info(page).name, "" | "thumbnail")
}

/// The value of the parameter whose key ends so.
fn parameter(page: &Directory<'_>, key: &str) -> Option<String> {
    let parameters = page.text(PARAMETERS)?;
    let mut pairs = parameters.lines().filter_map(|line| line.split_once(':'));
    let (_, value) = pairs.find(|(name, _)| name.trim().ends_with(key))?;
    Some(value.trim().to_owned())
}

fn info(page: &Directory<'_>) -> ChannelInfo {
    let internal_name = page
        .text(CHANNEL)
        .or_else(|| parameter(page, "channel.name"))
        .unwrap_or_default();
    let shown = page.text(FANCY_NAME).filter(|name| !name.is_empty());
    let retrace = match page.number(RETRACE) {
        Some(retrace) => Some(retrace != 0.0),
        None => parameter(page, "retrace").and_then(|retrace| retrace.parse().ok()),
    };
    ChannelInfo {
        name: shown
            .or_else(|| parameter(page, "fancy-name"))
            .unwrap_or_else(|| internal_name.clone()),
        internal_name,
        line_direction: retrace.map(|retrace| {
            if retrace {
                LineDirection::Retrace
            } else {
                LineDirection::Trace
            }
        }),
        scan_line: None,
    }
}

/// Why a channel is not read.
enum Trouble {
    /// Its bytes are not in the file.
    Missing(String),
    /// Its values are scaled or stored in an unknown way.
    Scaling(String),
}

/// A channel and where its samples are.
fn channel<'a>(
    page: &Directory<'a>,
    first: &Directory<'_>,
    info: &ChannelInfo,
    bytes_left: &mut usize,
) -> Result<(ChannelHeader, Flat<'a>), Trouble> {
    let shape = page.shape().map_err(Trouble::Scaling)?;
    let slot = default_slot(page).map_err(Trouble::Scaling)?;
    let length = raster::byte_length(shape.rows, shape.columns, shape.encoding)
        .ok_or_else(|| Trouble::Missing("its image is empty or too large".to_owned()))?;
    let block = page.image(length).map_err(Trouble::Missing)?;
    *bytes_left = bytes_left
        .checked_sub(length)
        .ok_or_else(|| Trouble::Missing("its data overlap with those of others".to_owned()))?;
    let order = Order {
        top_first: reflected(page) || reflected(first),
        mirrored: false,
    };
    let words = format!(
        "slot {:?}: counts × {} + {}",
        slot.name, slot.factor, slot.offset
    );
    let header = ChannelHeader::new(info.clone(), shape.rows, shape.columns)
        .in_unit(&slot.unit)
        .scaled(slot.factor, slot.offset, words);
    let samples = Flat::block(block, shape.encoding, page.endian).in_order(order);
    Ok((header, samples))
}

fn reflected(page: &Directory<'_>) -> bool {
    page.number(REFLECT).is_some_and(|reflect| reflect != 0.0)
}

struct Slot {
    name: String,
    unit: String,
    factor: f64,
    offset: f64,
}

/// The slot the instrument shows.
fn default_slot(page: &Directory<'_>) -> Result<Slot, String> {
    let wanted = page
        .text(DEFAULT_SLOT)
        .ok_or("expected the name of the default slot, found none")?;
    let slots = page.count(SLOTS).unwrap_or(0).min(usize::from(MOST_SLOTS)) as u16;
    let shift = (0..slots)
        .map(|slot| slot * SLOT_STRIDE)
        .find(|shift| page.text(SLOT_NAME + shift).as_deref() == Some(&*wanted))
        .ok_or_else(|| format!("expected a slot {wanted:?}, found none among {slots}"))?;
    let scaling = page.text(SLOT_SCALING + shift).unwrap_or_default();
    let number = |tag: u16, name: &str| {
        page.number(tag + shift)
            .filter(|number| number.is_finite())
            .ok_or_else(|| format!("expected the {name} of slot {wanted:?}, found none"))
    };
    let (factor, offset) = match scaling.as_str() {
        "LinearScaling" => (
            number(SLOT_FACTOR, "factor")?,
            number(SLOT_OFFSET, "offset")?,
        ),
        "NullScaling" => (1.0, 0.0),
        other => {
            return Err(format!(
                "expected a linear scaling of slot {wanted:?}, found {other:?}"
            ));
        }
    };
    Ok(Slot {
        unit: page.text(SLOT_UNIT + shift).unwrap_or_default(),
        name: wanted,
        factor,
        offset,
    })
}

/// Everything about the frame but its channels.
fn frame(first: &Directory<'_>) -> Scan {
    let unread = Unread::default();
    let nm = |tag: u16| first.number(tag).map(|metres| metres * 1e9);
    let size = nm(U_LENGTH)
        .zip(nm(V_LENGTH))
        .map(|(u, v)| [u.abs(), v.abs()]);
    let size = size.filter(|&[u, v]| u > 0.0 && v > 0.0 && u.is_finite() && v.is_finite());
    let rotation = first
        .number(THETA)
        .filter(|theta| theta.is_finite())
        .unwrap_or(0.0);
    let reflected = reflected(first);
    let rate = first.number(RATE).filter(|&rate| rate > 0.0);
    let duty = first.number(DUTY_CYCLE).filter(|&d| d > 0.0 && d <= 1.0);
    Scan {
        format: FORMAT.to_owned(),
        acquired: [END_DATE, START_DATE]
            .iter()
            .find_map(|&tag| unread.entry("its date", first.text(tag).as_deref(), date_time)),
        frame_direction: match first.text(MOTION).as_deref() {
            // Whether a reflected grid reverses the words as well is not known.
            Some("bottomUp") if !reflected => Some(FrameDirection::Up),
            Some("topDown") if !reflected => Some(FrameDirection::Down),
            _ => None,
        },
        line_rate_hz: rate,
        line_times_s: rate.zip(duty).map(|(rate, duty)| [duty / rate / 2.0; 2]),
        rotation_rad: rotation,
        offset_nm: centre(nm(X0), nm(Y0), size, rotation, reflected),
        size_nm: size,
        metadata: metadata(first),
        notes: unread.notes(),
        ..Scan::default()
    }
}

/// The centre of a grid whose corner is given.
fn centre(
    x0: Option<f64>,
    y0: Option<f64>,
    size: Option<[f64; 2]>,
    rotation: f64,
    reflected: bool,
) -> [f64; 2] {
    let (Some(x), Some(y), Some([u, v])) = (x0, y0, size) else {
        return [0.0, 0.0];
    };
    let v = if reflected { -v } else { v };
    let (sin, cos) = rotation.sin_cos();
    let (u, v) = (u / 2.0, v / 2.0);
    [x + u * cos - v * sin, y + u * sin + v * cos]
}

/// `2017-01-16 16:01:36.264 GMT`.
fn date_time(text: &str) -> Option<DateTime> {
    let mut words = text.split_whitespace();
    let mut ymd = words.next()?.split('-').map(str::parse::<i64>);
    let mut number = || ymd.next()?.ok();
    let date = [number()?, number()?, number()?];
    clock::date(date, clock::clock(words.next()?)?)
}

/// The frame's tags by name, then the properties of the program.
fn metadata(first: &Directory<'_>) -> Vec<(String, String)> {
    let tags = TOLD
        .iter()
        .filter_map(|&(tag, name)| Some((name.to_owned(), first.words(tag)?)));
    let properties = first.text(PROPERTIES).unwrap_or_default();
    let properties = properties.lines().filter_map(|line| {
        let (key, value) = line.split_once(" : ")?;
        Some((key.trim().to_owned(), value.trim().to_owned()))
    });
    tags.chain(properties).collect()
}

#[cfg(test)]
mod tests;
