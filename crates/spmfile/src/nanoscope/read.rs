//! The file → a scan: which bytes belong to which image.

use std::ops::Range;

use super::channel::Layout;
use super::header::{HeaderText, Section, lookup};
use super::{channel, frame, header, scaling};
use crate::error::ReadError;
use crate::scan::{Channel, ChannelInfo, FrameDirection, Scan, Span, UnreadableChannel};

/// More images than any instrument records at once.
const MOST_CHANNELS: usize = 256;

/// Reads a file that begins with `\*File list`, decoding the channels that are wanted.
pub(crate) fn read(bytes: &[u8], wanted: &dyn Fn(&ChannelInfo) -> bool) -> Result<Scan, ReadError> {
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
    let mut reader = Reader {
        bytes,
        header: &header,
        sections: &sections,
        taken: Vec::new(),
        damage: orphans(&sections),
    };
    let mut scan = frame(&sections, &images);
    scan.metadata = header::all_lines(&header.text);
    let mut skipped = 0;
    for orphan in &reader.damage {
        scan.unreadable.push(orphan.clone());
    }
    for (index, image) in images.iter().enumerate() {
        let info = channel::info(image, index + 1);
        let place = match reader.place(image, &info.name) {
            Ok(place) => place,
            Err(error) => {
                scan.unreadable.push(UnreadableChannel {
                    name: info.name,
                    error,
                });
                continue;
            }
        };
        if !wanted(&info) {
            skipped += 1;
            continue;
        }
        let name = info.name.clone();
        match reader.channel(image, info, &place) {
            Ok(channel) => scan.channels.push(channel),
            Err(error) => scan.unreadable.push(UnreadableChannel { name, error }),
        }
    }
    let damage = reader.damage;
    judge(bytes, &header, &images, &damage, scan, skipped)
}

/// Which error a file with a force header deserves.
pub(crate) fn refuse_force(bytes: &[u8]) -> ReadError {
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

/// Walks the images, keeping account of which bytes belong to whom.
struct Reader<'a> {
    bytes: &'a [u8],
    header: &'a HeaderText<'a>,
    sections: &'a [Section<'a>],
    taken: Vec<(Range<u64>, String)>,
    /// Channels that the file does not hold as its header promises.
    damage: Vec<UnreadableChannel>,
}

impl Reader<'_> {
    /// Where a channel lies, if it lies where it may.
    fn place(&mut self, image: &Section<'_>, name: &str) -> Result<Layout, String> {
        let layout = channel::layout(image)?;
        let data = layout.data.clone();
        if data.start < self.header.length as u64 {
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
        if data.end > self.bytes.len() as u64 {
            let found = (self.bytes.len() as u64).saturating_sub(data.start);
            let error = format!(
                "it is {found} bytes long but its header promises {}",
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

    fn channel(
        &self,
        image: &Section<'_>,
        info: ChannelInfo,
        layout: &Layout,
    ) -> Result<Channel, String> {
        let scaling = scaling::scaling(image, self.sections, layout.label)?;
        let bytes = self
            .bytes
            .get(layout.data.start as usize..layout.data.end as usize)
            .ok_or("its data lie outside the file")?;
        let samples = channel::samples(layout, bytes)?;
        let samples = channel::without_invalid(image, layout, samples);
        let size = frame::full_size(Some(image), self.sections);
        Ok(Channel {
            name: info.name,
            internal_name: info.internal_name,
            unit: scaling.unit,
            line_direction: info.line_direction,
            scan_line: info.scan_line,
            rows: layout.rows,
            columns: layout.columns,
            width_nm: size.map(|[width, _]| width),
            height_nm: size
                .map(|[_, full]| frame::recorded_height(full, layout.rows, self.sections)),
            span: Span::Frame,
            scale: scaling.scale,
            offset: 0.0,
            scaling: scaling.words,
            plane_fit: channel::plane_fit(image),
            samples,
        })
    }
}

/// Everything about the frame but its channels.
fn frame(sections: &[Section<'_>], images: &[&Section<'_>]) -> Scan {
    let version = lookup(sections, "File list", "Version")
        .or_else(|| sections.first().and_then(|s| s.get("Version")))
        .and_then(frame::version);
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
        acquired: sections
            .first()
            .and_then(|s| s.get("Date"))
            .and_then(frame::date_time),
        frame_direction: frame_direction(sections, images),
        line_rate_hz: frame::scan_number(sections, "Scan rate").filter(|&rate| rate > 0.0),
        rounding: frame::scan_number(sections, "X round").or_else(|| {
            // Version 5 keeps it with the scanner.
            header::leading_number(lookup(sections, "Scanner list", "X round")?).map(|(n, _)| n)
        }),
        rotation_rad: frame::scan_number(sections, "Rotate Ang.").unwrap_or(0.0),
        offset_nm: ["X Offset", "Y Offset"]
            .map(|key| frame::scan_length(sections, key).unwrap_or(0.0)),
        size_nm: frame::full_size(images.first().copied(), sections),
        closed_loop: frame::scan_value(sections, "XY Closed Loop").and_then(on_off),
        line_times_s: None,
        notes: Vec::new(),
        metadata: Vec::new(),
        channels: Vec::new(),
        unreadable: Vec::new(),
    }
}

/// Each image tells its direction, the scan list the last one set. Images that contradict each
/// other leave it unknown: the wrong sense would turn the sign of the drift.
fn frame_direction(sections: &[Section<'_>], images: &[&Section<'_>]) -> Option<FrameDirection> {
    let mut told = images
        .iter()
        .filter_map(|image| channel::frame_direction(image.get("Frame direction")?));
    match told.next() {
        Some(first) => told.all(|other| other == first).then_some(first),
        None => channel::frame_direction(frame::scan_value(sections, "Capture direction")?),
    }
}

/// Read, partly read or refused: see [`ReadError`].
fn judge(
    bytes: &[u8],
    header: &HeaderText<'_>,
    images: &[&Section<'_>],
    damage: &[UnreadableChannel],
    scan: Scan,
    skipped: usize,
) -> Result<Scan, ReadError> {
    let layouts = || images.iter().filter_map(|i| channel::layout(i).ok());
    let expected = layouts().map(|l| l.data.end).max().unwrap_or(0);
    let found = bytes.len();
    if expected > found as u64 {
        if layouts().all(|l| l.data.start >= found as u64) {
            return Err(ReadError::HeaderOnly {
                announced: images.len(),
                expected,
                found,
            });
        }
        // Bytes were removed everywhere: the channels that seem whole are shifted.
        if !header.crlf {
            return Err(ReadError::LineEndsChanged { expected, found });
        }
    }
    if !damage.is_empty() {
        let reason = damage
            .iter()
            .map(|d| format!("channel {:?}: {}", d.name, d.error))
            .chain(moved_data(bytes, header))
            .collect::<Vec<_>>()
            .join("; ");
        return Err(ReadError::Incomplete {
            reason,
            readable: Box::new(scan),
        });
    }
    match scan.unreadable.first() {
        Some(first) if scan.channels.is_empty() && skipped == 0 => {
            Err(ReadError::NoReadableChannel {
                announced: images.len(),
                name: first.name.clone(),
                reason: first.error.clone(),
            })
        }
        _ => Ok(scan),
    }
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
        "the data begin {} bytes or more before the place the header gives: bytes of the header are \
         lost, and the values of the other channels must not be trusted",
        padding.len() - first
    ))
}
