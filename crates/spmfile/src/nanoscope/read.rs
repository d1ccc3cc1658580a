//! The file → a scan: which bytes belong to which image.

use std::ops::Range;

use super::channel::Layout;
use super::header::{HeaderText, Section, lookup};
use super::{channel, frame, header, scaling};
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::outline::{Input, Outline};
use crate::scan::{ChannelInfo, FrameDirection, Scan, Span, UnreadableChannel};
use crate::signature::head;
use crate::stored::Stored;
use crate::words::Unread;

/// More images than any instrument records at once.
const MOST_CHANNELS: usize = 256;

/// Whether a file begins with `\*File list`, or with `\*EC File list` and the like.
pub(crate) fn detect(bytes: &[u8]) -> bool {
    first_line(bytes).is_some()
}

/// Whether it begins with `\*Force file list`.
pub(crate) fn detect_force(bytes: &[u8]) -> bool {
    first_line(bytes).is_some_and(|line| line.starts_with(b"\\*force"))
}

/// The first line in lower case, if it is that of such files.
fn first_line(bytes: &[u8]) -> Option<Vec<u8>> {
    let head = head(bytes);
    let end = head.iter().position(|&b| b == b'\n' || b == b'\r');
    let first = head[..end.unwrap_or(head.len())].to_ascii_lowercase();
    (first.starts_with(b"\\*") && first.ends_with(b"file list")).then_some(first)
}

/// Reads the header of a file that begins with `\*File list` and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let header =
        header::header_text(bytes).ok_or(ReadError::HeaderCutOff { found: bytes.len() })?;
    let sections = header::sections(&header.text);
    let images: Vec<&Section<'_>> = sections
        .iter()
        .filter(|s| s.is("Ciao image list"))
        .collect();
    if images.len() > MOST_CHANNELS {
        return Err(ReadError::TooManyChannels {
            found: images.len(),
            limit: MOST_CHANNELS,
        });
    }
    if images.is_empty() {
        let force = sections.iter().any(|s| s.is("Ciao force image list"));
        return Err(if force {
            ReadError::ForceCurve
        } else {
            ReadError::NoImage
        });
    }
    let mut places = Places {
        header: header.length as u64,
        available: input.length,
        taken: Vec::new(),
        damage: orphans(&sections),
    };
    let mut outline = Outline::of(frame(&sections, &images));
    outline.announced = Some(images.len());
    outline.scan.metadata = header::all_lines(&header.text);
    outline.scan.unreadable.clone_from(&places.damage);
    for (index, image) in images.iter().enumerate() {
        let info = channel::info(image, index + 1);
        match places.of(image, &info.name) {
            Ok(place) => add(&mut outline, image, &sections, info, &place),
            Err(error) => outline.scan.unreadable.push(UnreadableChannel {
                name: info.name,
                error,
            }),
        }
    }
    judge(input, &header, &images, &places.damage, outline)
}

/// Adds a channel that lies within the file.
fn add(
    outline: &mut Outline<'_>,
    image: &Section<'_>,
    sections: &[Section<'_>],
    info: ChannelInfo,
    place: &Layout,
) {
    let size = frame::full_size(Some(image), sections, &Unread::default());
    let mut header = ChannelHeader {
        width_nm: size.map(|[width, _]| width),
        height_nm: size.map(|[_, full]| frame::recorded_height(full, place.rows, sections)),
        span: Span::Frame,
        plane_fit: channel::plane_fit(image),
        ..ChannelHeader::new(info, place.rows, place.columns)
    };
    let samples = match scaling::scaling(image, sections, place.label) {
        Ok(scaling) => {
            header = header
                .in_unit(&scaling.unit)
                .scaled(scaling.scale, 0.0, scaling.words);
            header.unit_as_written = scaling.written;
            Stored::Flat(channel::samples(image, place))
        }
        Err(error) => Stored::Refused(error),
    };
    outline.add(header, samples);
}

/// Which error a file with a force header deserves.
pub(crate) fn refuse_force<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    Err(force(input.bytes))
}

fn force(bytes: &[u8]) -> ReadError {
    let Some(header) = header::header_text(bytes) else {
        return ReadError::HeaderCutOff { found: bytes.len() };
    };
    let sections = header::sections(&header.text);
    let volume = sections.iter().any(|s| s.is("Ciao image list"))
        || frame::scan_value(&sections, "Operating mode")
            .is_some_and(|mode| mode.to_ascii_lowercase().contains("volume"));
    if volume {
        ReadError::ForceVolume
    } else {
        ReadError::ForceCurve
    }
}

/// Channels that have lost their section line.
fn orphans(sections: &[Section<'_>]) -> Vec<UnreadableChannel> {
    sections
        .iter()
        .filter_map(orphan)
        .map(|value| UnreadableChannel {
            name: match channel::names(value) {
                ("", "") => "a channel without name".to_owned(),
                (internal, "") => internal.to_owned(),
                (_, name) => name.to_owned(),
            },
            error: "expected the section line `\\*Ciao image list` before its keys, found none"
                .to_owned(),
        })
        .collect()
}

/// The image data line of a channel whose keys stand in a foreign section, or behind those of the
/// channel before it.
fn orphan<'a>(section: &Section<'a>) -> Option<&'a str> {
    let mut named = section.grouped("Image Data");
    if section.is("Ciao image list") {
        (section.count("Data offset") > 1).then(|| named.nth(1).unwrap_or(""))
    } else if section.name.to_ascii_lowercase().contains("force") {
        None
    } else {
        let of_an_image = ["Number of lines", "Valid data len X"];
        let misplaced = of_an_image.iter().any(|key| section.get(key).is_some());
        named.next().filter(|_| misplaced)
    }
}

/// Keeps account of which bytes belong to whom.
struct Places {
    /// Length of the header.
    header: u64,
    /// Length of the file.
    available: u64,
    taken: Vec<(Range<u64>, String)>,
    /// Channels that the file does not hold as its header promises.
    damage: Vec<UnreadableChannel>,
}

impl Places {
    /// Where a channel lies, if it lies where it may.
    fn of(&mut self, image: &Section<'_>, name: &str) -> Result<Layout, String> {
        let layout = channel::layout(image)?;
        let data = layout.data.clone();
        if data.start < self.header {
            return Err(format!(
                "its data begin at byte {}, inside the header",
                data.start
            ));
        }
        // Data that overlap belong to nobody; this also bounds the memory by the file's length.
        let other = self
            .taken
            .iter()
            .find(|(range, _)| range.start < data.end && data.start < range.end);
        if let Some((_, other)) = other {
            return Err(format!("its data overlap with those of {other:?}"));
        }
        if data.end > self.available {
            let found = self.available.saturating_sub(data.start);
            let error = format!(
                "it is {found} bytes long, but its header promises {}",
                data.end - data.start
            );
            self.damage.push(UnreadableChannel {
                name: name.to_owned(),
                error: error.clone(),
            });
            return Err(error);
        }
        self.taken.push((data, name.to_owned()));
        Ok(layout)
    }
}

/// Everything about the frame but its channels.
fn frame(sections: &[Section<'_>], images: &[&Section<'_>]) -> Scan {
    let version = lookup(sections, "File list", "Version")
        .or_else(|| sections.first().and_then(|s| s.get("Version")))
        .and_then(frame::version);
    let unread = Unread::default();
    let number = |key: &str| frame::scan_number(sections, key, &unread);
    let named = |section, key| lookup(sections, section, key).filter(|v| !v.is_empty());
    let on_off = |value: &str| match value.to_ascii_lowercase().as_str() {
        "on" => Some(true),
        "off" => Some(false),
        _ => None,
    };
    Scan {
        format: match version {
            Some(version) => format!("NanoScope {version}"),
            None => "NanoScope".to_owned(),
        },
        instrument: named("Equipment list", "Description")
            .or_else(|| named("Equipment list", "Microscope"))
            .or_else(|| named("File list", "Instrument"))
            .map(str::to_owned),
        acquired: unread.entry(
            "Date",
            sections.first().and_then(|s| s.get("Date")),
            frame::date_time,
        ),
        frame_direction: frame_direction(sections, images, &unread),
        line_rate_hz: number("Scan rate").filter(|&rate| rate > 0.0),
        rounding: number("X round").or_else(|| {
            // Version 5 keeps it with the scanner.
            header::leading_number(lookup(sections, "Scanner list", "X round")?).map(|(n, _)| n)
        }),
        rotation_rad: number("Rotate Ang.").unwrap_or(0.0),
        offset_nm: ["X Offset", "Y Offset"]
            .map(|key| frame::scan_length(sections, key, &unread).unwrap_or(0.0)),
        size_nm: frame::full_size(images.first().copied(), sections, &unread),
        closed_loop: frame::scan_value(sections, "XY Closed Loop").and_then(on_off),
        line_times_s: None,
        notes: unread.notes(),
        metadata: Vec::new(),
        channels: Vec::new(),
        unreadable: Vec::new(),
    }
}

/// Each image tells its direction, the scan list the last one set. Images that contradict each
/// other leave it unknown: the wrong sense would turn the sign of the drift.
fn frame_direction(
    sections: &[Section<'_>],
    images: &[&Section<'_>],
    unread: &Unread,
) -> Option<FrameDirection> {
    let named = |key, text| unread.entry(key, text, FrameDirection::named);
    let mut told = images
        .iter()
        .filter_map(|image| named("Frame direction", image.get("Frame direction")));
    match told.next() {
        Some(first) => told.all(|other| other == first).then_some(first),
        None => named(
            "Capture direction",
            frame::scan_value(sections, "Capture direction"),
        ),
    }
}

/// Read, partly read or refused: see [`ReadError`].
fn judge<'a>(
    input: &Input<'a>,
    header: &HeaderText<'_>,
    images: &[&Section<'_>],
    damage: &[UnreadableChannel],
    mut outline: Outline<'a>,
) -> Result<Outline<'a>, ReadError> {
    let layouts = || images.iter().filter_map(|i| channel::layout(i).ok());
    let expected = layouts().map(|l| l.data.end).max().unwrap_or(0);
    let found = input.length;
    if expected > found {
        if layouts().all(|l| l.data.start >= found) {
            return Err(ReadError::HeaderOnly {
                announced: images.len(),
                expected,
                found: found as usize,
            });
        }
        // Bytes were removed everywhere: the channels that seem whole are shifted.
        if !header.crlf {
            let found = found as usize;
            return Err(ReadError::LineEndsChanged { expected, found });
        }
    }
    if !damage.is_empty() {
        let reasons: Vec<String> = damage
            .iter()
            .map(|d| format!("channel {:?}: {}", d.name, d.error))
            .chain(moved_data(input.bytes, header))
            .collect();
        outline.damage = Some(reasons.join("; "));
    }
    Ok(outline)
}

/// Words for a header that has lost bytes, so that all data lie before the place it gives for them.
///
/// Between the header's end and its promised length there are only zeros in a whole file.
fn moved_data(bytes: &[u8], header: &HeaderText<'_>) -> Option<String> {
    let sections = header::sections(&header.text);
    let (start, _) = header::leading_number(sections.first()?.get("Data length")?)?;
    let padding = bytes.get(header.length..start as usize)?;
    let filling = |b: &u8| matches!(b, 0 | 0x1a | b'\r' | b'\n');
    let first = padding.iter().position(|b| !filling(b))?;
    Some(format!(
        "the data begin {} bytes or more before the place the header gives: bytes of the header are lost, and the \
         values of the other channels cannot be trusted",
        padding.len() - first
    ))
}
