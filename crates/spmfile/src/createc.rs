//! Createc scans, `.dat`.
//!
//! A text header of lines `Key=value` (`Internal name / Displayed name=value`), padding with a small picture of
//! the image, the letters `DATA` (up to byte 16384 where nobody shortened the header), one sample that is no
//! pixel, and the images one after the other, little endian, followed by buffers of some lines.
//!
//! - The first line tells how samples are stored: `[Parameter]` as 16-bit integers, `[Paramet32]` as single
//!   precision, `[Paramco32]` as the same in a zlib stream.
//! - `Channelselectval` has a bit for each recorded signal, 1 for the topography and 2 for the current; all of
//!   them forward, then all of them backward. In older files `Chan(1,2,4)` is their number.
//! - The first stored line is the top one; backward lines are stored by position.
//! - Samples are counts of converters that reach from −10 V to 10 V in the bits of `DAC-Type`. Height is that
//!   voltage × `GainZ` × `ZPiezoconst` (Å/V), current that voltage / 10^`Gainpreamp` (V/A).
//! - `Length x[A]` is `Num.X` times the step, so it reaches from edge to edge. It is also
//!   `Num.X` × `Delta X` counts × `GainX` × `Xpiezoconst`, which tells the volts of a count where `DAC-Type` does not.
//! - `Sec/Image:` is the time of all lines there and back, shared between these as `Delay X+` and `Delay X-`.
//! - `ScanYDirec` 1 begins with the top line: of stopped scans the last stored lines are missing (zeros).

mod images;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use memchr::memmem;

use images::Images;

use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::limits::unpacked_limit;
use crate::outline::{Input, Outline};
use crate::raster::{self, Encoding};
use crate::scan::{ChannelInfo, FrameDirection, LineDirection, Scan};
use crate::signature::head;
use crate::stored::{Stored, Unpacked};
use crate::whole::{Extent, MOST_CHANNELS};
use crate::words::{self, Unread};

const FORMAT: &str = "Createc";
/// The header with the letters `DATA` at its end.
const HEADER: usize = 1 << 14;
const DATA: &[u8] = b"DATA";
/// Converters reach from −10 V to 10 V.
const RANGE_V: f64 = 20.0;
const NM_PER_ANGSTROM: f64 = 0.1;

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// One of the three first lines; `[Parameter]` begins other files, too.
pub(crate) fn detect(bytes: &[u8]) -> bool {
    let of_scan = || memmem::find(head(bytes), b"Num.X").is_some();
    bytes.starts_with(b"[Paramco32]")
        || bytes.starts_with(b"[Paramet32]")
        || bytes.starts_with(b"[Parameter]") && of_scan()
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let start = data_start(bytes)?;
    let text = text(bytes);
    let header = Header::of(&text);
    let compressed = bytes.starts_with(b"[Paramco32]");
    if compressed && cfg!(not(feature = "archives")) {
        return Err(ReadError::NotBuilt {
            format: "compressed Createc",
            feature: "archives",
        });
    }
    let encoding = if bytes.starts_with(b"[Parameter]") {
        Encoding::I16
    } else {
        Encoding::F32
    };
    let rows = header.count("Num.Y")?;
    let columns = header.count("Num.X")?;
    let channels = header.count("Channels")?;
    if channels > MOST_CHANNELS {
        return Err(ReadError::TooManyChannels {
            found: channels,
            limit: MOST_CHANNELS,
        });
    }
    let all = |length: &usize| length.checked_mul(channels)?.checked_add(encoding.width());
    let length = raster::byte_length(rows, columns, encoding)
        .filter(|length| {
            all(length).is_some_and(|all| !compressed || all as u64 <= unpacked_limit(bytes.len()))
        })
        .ok_or_else(|| {
            damaged(format!(
                "its size is {channels} channels of {rows} lines of {columns} samples"
            ))
        })?;

    let mut outline = Outline::of(header.frame(rows));
    if !compressed {
        let kind = text.lines().next().unwrap_or("").trim();
        outline.scan.notes.push(format!(
            "the reader of Createc files of the kind {kind} is untested on files of an instrument"
        ));
    }
    let mut extent = Extent::default();
    let stored = Arc::new(Images {
        bytes: &bytes[start..],
        compressed,
        encoding,
        channels,
        rows,
        columns,
        length,
        unpacked: OnceLock::new(),
    });
    for index in 0..channels {
        let (info, unit, scaling) = header.channel(index, channels);
        let from = (index * length).saturating_add(start + encoding.width());
        if !compressed && !extent.take(input.length, from, length, &info.name) {
            continue;
        }
        let mut of_channel = ChannelHeader::new(info, rows, columns)
            .in_unit(unit)
            .of_size(outline.scan.size_nm);
        if let Some((scale, words)) = scaling {
            of_channel = of_channel.scaled(scale, 0.0, words);
        }
        let stored = Arc::clone(&stored);
        let samples = move || stored.channel(index).map(Unpacked::measured);
        outline.add(of_channel, Stored::Packed(Box::new(samples)));
    }
    outline.scan.notes.extend(header.unread.notes());
    extent.judge(outline, input.length)
}

/// The byte behind the letters `DATA`.
fn data_start(bytes: &[u8]) -> Result<usize, ReadError> {
    if bytes.get(HEADER - DATA.len()..HEADER) == Some(DATA) {
        return Ok(HEADER);
    }
    // Programs that take names out of the header leave it shorter.
    let place = memmem::find(&bytes[..bytes.len().min(2 * HEADER)], b"\nDATA");
    place.map(|place| place + 1 + DATA.len()).ok_or_else(|| {
        damaged(format!(
            "expected the letters DATA behind the header, found none in {} bytes: the file was cut off inside it",
            bytes.len()
        ))
    })
}

/// The lines of the header, without the padding behind them.
fn text(bytes: &[u8]) -> Cow<'_, str> {
    let binary = |b: &u8| *b < b' ' && !matches!(b, b'\t' | b'\r' | b'\n');
    let head = &bytes[..bytes.len().min(HEADER)];
    words::decode(&head[..head.iter().position(binary).unwrap_or(head.len())])
}

/// Name and unit of a channel; factor and words where its samples become values by them.
type Described = (ChannelInfo, &'static str, Option<(f64, String)>);

/// Keys and values, in the order of the file.
struct Header<'a> {
    lines: Vec<(&'a str, &'a str)>,
    unread: Unread,
}

impl<'a> Header<'a> {
    fn of(text: &'a str) -> Self {
        let lines = text.lines().filter_map(|line| line.split_once('='));
        let lines = lines.map(|(key, value)| (key.trim(), value.trim()));
        Self {
            lines: lines.filter(|(key, _)| !matches!(*key, "" | "/")).collect(),
            unread: Unread::default(),
        }
    }

    /// The value of a key by its internal name.
    fn get(&self, key: &str) -> Option<&'a str> {
        let name = |full: &'a str| full.split(" / ").next().unwrap_or("").trim();
        let found = self.lines.iter().find(|(full, _)| name(full) == key);
        found.map(|(_, value)| *value).filter(|v| !v.is_empty())
    }

    fn number(&self, key: &str) -> Option<f64> {
        let number = |text: &str| words::number(&text.replace(',', "."));
        self.unread.entry(key, self.get(key), number)
    }

    fn count(&self, key: &str) -> Result<usize, ReadError> {
        let text = self.get(key).unwrap_or("");
        match text.parse() {
            Ok(n) if n > 0 => Ok(n),
            _ => Err(damaged(format!("expected {key:?} above 0, found {text:?}"))),
        }
    }

    /// The recorded signals, 0 for the topography and 1 for the current, where their number is that of the
    /// channels or half of it.
    fn signals(&self, channels: usize) -> Option<Vec<u32>> {
        let bits = |word: u32| (0..32).filter(|bit| word >> bit & 1 == 1).collect();
        let first = |n: u32| (0..n.min(32)).collect();
        let word = |text: &str| text.parse::<u32>().ok();
        let told = |key: &str| self.unread.entry(key, self.get(key), word);
        let selected: [Option<Vec<u32>>; 2] = [
            told("Channelselectval").map(bits),
            told("Chan(1,2,4)").map(first),
        ];
        let fits = |signals: &Vec<u32>| [signals.len(), 2 * signals.len()].contains(&channels);
        selected.into_iter().flatten().find(fits)
    }

    /// A channel by its place in the file. What is not known keeps its counts, without a unit.
    fn channel(&self, index: usize, channels: usize) -> Described {
        let signals = self.signals(channels).unwrap_or_default();
        let signal = signals.get(index % signals.len().max(1)).copied();
        let info = ChannelInfo {
            name: match signal {
                Some(0) => "Topography".to_owned(),
                Some(1) => "Current".to_owned(),
                Some(bit) => format!("Signal {}", bit + 1),
                None => format!("Channel {}", index + 1),
            },
            internal_name: String::new(),
            line_direction: signal.map(|_| {
                if index < signals.len() {
                    LineDirection::Trace
                } else {
                    LineDirection::Retrace
                }
            }),
            scan_line: None,
        };
        let scaling = match signal {
            Some(0) => self.height().map(|scaling| ("nm", scaling)),
            Some(1) => self.current().map(|scaling| ("A", scaling)),
            _ => None,
        };
        match scaling {
            Some((unit, scaling)) => (info, unit, Some(scaling)),
            None => (info, "", None),
        }
    }

    fn height(&self) -> Option<(f64, String)> {
        let (volts, words) = self.volts_per_count()?;
        let [gain, piezo] = [self.number("GainZ")?, self.number("ZPiezoconst")?];
        let words = format!("count × {words} × GainZ {gain} × ZPiezoconst {piezo} Å/V");
        Some((volts * gain * piezo * NM_PER_ANGSTROM, words))
    }

    fn current(&self) -> Option<(f64, String)> {
        let (volts, words) = self.volts_per_count()?;
        let gain = self.number("Gainpreamp")?;
        let words = format!("count × {words} / 10^{gain} V/A (Gainpreamp)");
        Some((volts / 10f64.powf(gain), words))
    }

    /// The voltage of a count.
    fn volts_per_count(&self) -> Option<(f64, String)> {
        if let Some(kind) = self.get("DAC-Type") {
            let bits = kind.trim_end_matches(|c: char| !c.is_ascii_digit());
            let told = |_: &str| bits.parse().ok().filter(|bits| (8..=32).contains(bits));
            let bits: i32 = self.unread.entry("DAC-Type", Some(kind), told)?;
            return Some((RANGE_V / 2f64.powi(bits), format!("{RANGE_V} V / 2^{bits}")));
        }
        let [length, columns] = [self.number("Length x[A]")?, self.number("Num.X")?];
        let [step, gain] = [self.number("Delta X")?, self.number("GainX")?];
        let volts = length / (columns * step * gain * self.number("Xpiezoconst")?).abs();
        let told = volts > 0.0 && volts.is_finite();
        told.then(|| (volts, format!("{volts:.6e} V (step in x)")))
    }

    /// Everything about the frame but its channels.
    fn frame(&self, rows: usize) -> Scan {
        let positive = |key: &str| self.number(key).filter(|&n| n > 0.0);
        let length = |key: &str| positive(key).map(|angstrom| angstrom * NM_PER_ANGSTROM);
        let line_s = positive("Sec/Image:").map(|image| image / rows as f64);
        let delays = positive("Delay X+").zip(positive("Delay X-"));
        let sine = self.number("ScanmodeSine").is_some_and(|mode| mode != 0.0);
        Scan {
            format: FORMAT.to_owned(),
            // For 0 public readers differ.
            frame_direction: (self.get("ScanYDirec") == Some("1")).then_some(FrameDirection::Down),
            line_rate_hz: line_s.map(|line| 1.0 / line),
            line_times_s: line_s.zip(delays).map(|(line, (forward, backward))| {
                [forward, backward].map(|delay| line * delay / (forward + backward))
            }),
            rotation_rad: self.number("Rotation").unwrap_or(0.0).to_radians(),
            size_nm: length("Length x[A]").zip(length("Length y[A]")).map(Into::into),
            notes: sine
                .then(|| "the lines followed a sine (ScanmodeSine): whether their samples are evenly spaced is not known".to_owned())
                .into_iter()
                .collect(),
            metadata: self.lines.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect(),
            ..Scan::default()
        }
    }
}
