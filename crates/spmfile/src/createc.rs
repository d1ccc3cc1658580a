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

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use memchr::memmem;

use crate::cursor::Endian;
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::limits::unpacked_limit;
use crate::outline::{Input, Outline};
use crate::raster::{self, Encoding, Order};
use crate::scan::{ChannelInfo, FrameDirection, LineDirection, Samples, Scan};
use crate::signature::head;
use crate::stored::{Failure, Stored, Unpacked};
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

/// The images of a file, of which the compressed ones are unpacked once.
struct Images<'a> {
    /// All bytes behind the header.
    bytes: &'a [u8],
    compressed: bool,
    encoding: Encoding,
    channels: usize,
    rows: usize,
    columns: usize,
    /// Bytes of a channel.
    length: usize,
    unpacked: OnceLock<Result<Found<'a>, String>>,
}

/// The images and how many lines were recorded before the scan was stopped.
struct Found<'a> {
    images: Cow<'a, [u8]>,
    lines: usize,
}

impl<'a> Images<'a> {
    fn found(&self) -> Result<Found<'a>, String> {
        let images = if self.compressed {
            let images = self.channels * self.length;
            Cow::Owned(unpack(
                self.bytes,
                self.encoding.width(),
                images,
                self.columns,
            )?)
        } else {
            Cow::Borrowed(self.bytes.get(self.encoding.width()..).unwrap_or(&[]))
        };
        // Lines that were not recorded are zero in all channels.
        let line = self.length / self.rows;
        let whole = images.chunks_exact(self.length).take(self.channels);
        let last = whole.filter_map(|image| image.iter().rposition(|&byte| byte != 0));
        let lines = last.max().map_or(0, |last| last / line + 1);
        Ok(Found { images, lines })
    }

    /// The samples of a channel, missing ones as NaN.
    fn channel(&self, index: usize) -> Result<Samples, Failure> {
        let found = self.unpacked.get_or_init(|| self.found()).as_ref();
        let found = found.map_err(|error| Failure::File(damaged(error)))?;
        let start = index * self.length;
        let image = found
            .images
            .get(start..start + self.length)
            .ok_or_else(|| {
                let whole = found.images.len().saturating_sub(start) / (self.length / self.rows);
                Failure::Lost(format!("{whole} of its {} lines are there", self.rows))
            })?;
        let order = Order {
            top_first: true,
            mirrored: false,
        };
        let samples = raster::decode(image, self.columns, self.encoding, Endian::Little, order);
        let missing = (self.rows - found.lines) * self.columns;
        Ok(match samples {
            samples if missing == 0 => samples,
            Samples::F32(mut samples) => {
                leave_out(&mut samples, missing, self.columns, f32::NAN);
                Samples::F32(samples)
            }
            samples => {
                let mut samples = samples.into_doubles();
                leave_out(&mut samples, missing, self.columns, f64::NAN);
                Samples::F64(samples)
            }
        })
    }
}

/// Marks the first samples as missing, and of the line behind them, in which the scan was stopped, zeros at its ends.
fn leave_out<T: Copy + Default + PartialEq>(
    samples: &mut [T],
    missing: usize,
    columns: usize,
    nan: T,
) {
    let (blank, recorded) = samples.split_at_mut(missing);
    blank.fill(nan);
    let zero = |sample: &&mut T| **sample == T::default();
    let stopped = recorded.iter_mut().take(columns);
    stopped.take_while(zero).for_each(|sample| *sample = nan);
    let stopped = recorded.iter_mut().take(columns).rev();
    stopped.take_while(zero).for_each(|sample| *sample = nan);
}

/// The images of a zlib stream, as far as they are there, without the `skipped` bytes before them.
#[cfg(feature = "archives")]
fn unpack(bytes: &[u8], skipped: usize, images: usize, columns: usize) -> Result<Vec<u8>, String> {
    use std::io::{ErrorKind, Read};

    let mut stream = flate2::read::ZlibDecoder::new(bytes);
    let mut first = vec![0; skipped];
    let mut unpacked = Vec::new();
    let mut read = stream.read_exact(&mut first);
    read = read.and_then(|()| {
        stream
            .by_ref()
            .take(images as u64)
            .read_to_end(&mut unpacked)
            .map(drop)
    });
    // The sum of all bytes comes behind the buffers of some lines.
    let buffers = 8 * skipped as u64 * columns as u64 + 4096;
    read = read
        .and_then(|()| std::io::copy(&mut stream.take(buffers), &mut std::io::sink()).map(drop));
    match read {
        // Cut off: what is there is true.
        Err(error) if error.kind() != ErrorKind::UnexpectedEof => {
            Err(format!("its zlib stream: {error}"))
        }
        _ => Ok(unpacked),
    }
}

#[cfg(not(feature = "archives"))]
fn unpack(_: &[u8], _: usize, _: usize, _: usize) -> Result<Vec<u8>, String> {
    Err("its zlib stream cannot be unpacked".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: &str = "DAC-Type=20bit\r\nGainZ / GainZ=3\r\nGainpreamp / GainPre 10^=9\r\n\
                         Rotation / Rotation=30.00\r\n  /  = \r\nScanYDirec / ScanYDirec=1\r\n\
                         Delay X+ / Delay X+=3\r\nDelay X- / Delay X-=1\r\nLength x[A]=60.0\r\n\
                         Length y[A]=40.0\r\nBiasvolt[mV]=50.00\r\nSec/Image:=8.0\r\nZPiezoconst=  9.21\r\n";
    const STM: &str = "Channels / Channels=4\r\nChannelselectval / Channelselectval=3\r\n";

    /// Lines of three samples and the numbers of the pixels, in the order of the file.
    fn file(kind: &str, rows: usize, head: &str, samples: &[i16]) -> Vec<u8> {
        let mut bytes =
            format!("[{kind}]\r\nNum.X / Num.X=3\r\nNum.Y / Num.Y={rows}\r\n{head}").into_bytes();
        bytes.extend(b"\x0cICON=\n=\0DAT");
        bytes.resize(HEADER - DATA.len(), 0);
        bytes.extend(DATA);
        // The first one is no pixel.
        let stored = [77].iter().chain(samples);
        let stored: Vec<u8> = match kind {
            "Parameter" => stored.flat_map(|n| n.to_le_bytes()).collect(),
            _ => stored.flat_map(|&n| f32::from(n).to_le_bytes()).collect(),
        };
        bytes.extend(match kind {
            "Paramco32" => packed(&[&stored[..], &[0; 4 * 3 * 4]].concat()),
            _ => stored,
        });
        bytes
    }

    fn packed(bytes: &[u8]) -> Vec<u8> {
        use std::io::Write;
        let mut stream =
            flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
        stream.write_all(bytes).expect("memory");
        stream.finish().expect("memory")
    }

    const KINDS: [&str; 3] = ["Parameter", "Paramet32", "Paramco32"];

    fn counts(channel: &crate::Channel) -> Vec<f64> {
        channel
            .values()
            .iter()
            .map(|v| (v / channel.scale).round())
            .collect()
    }

    #[test]
    fn heights_and_currents_forward_and_backward() {
        let samples: Vec<i16> = (1..25).collect();
        for kind in KINDS {
            let scan = crate::read(&file(kind, 2, &[FRAME, STM].concat(), &samples)).expect(kind);
            assert_eq!(scan.notes.len(), usize::from(kind != "Paramco32"), "{kind}");
            let told: Vec<_> = scan
                .channels
                .iter()
                .map(|c| (&*c.name, &*c.unit, c.line_direction))
                .collect();
            let [trace, retrace] = [Some(LineDirection::Trace), Some(LineDirection::Retrace)];
            assert_eq!(
                told,
                [
                    ("Topography", "nm", trace),
                    ("Current", "A", trace),
                    ("Topography", "nm", retrace),
                    ("Current", "A", retrace)
                ]
            );
            assert_eq!(
                counts(&scan.channels[0]),
                [4.0, 5.0, 6.0, 1.0, 2.0, 3.0],
                "{kind}"
            );
            assert_eq!(
                counts(&scan.channels[3]),
                [22.0, 23.0, 24.0, 19.0, 20.0, 21.0],
                "{kind}"
            );
            let volts = 20.0 / 1_048_576.0;
            let [height, current] = [scan.channels[0].scale, scan.channels[1].scale];
            assert!((height / (volts * 3.0 * 0.921) - 1.0).abs() < 1e-12);
            assert!((current / (volts * 1e-9) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_frame_is_told() {
        let scan =
            crate::read(&file("Paramet32", 2, &[FRAME, STM].concat(), &[1; 24])).expect("whole");
        let size = scan.size_nm.expect("a size");
        assert!((size[0] - 6.0).abs() + (size[1] - 4.0).abs() < 1e-12);
        let pitch = scan.channels[0].pitch_nm().expect("a pitch");
        assert!((pitch[0] - 2.0).abs() + (pitch[1] - 2.0).abs() < 1e-12);
        assert!((scan.rotation_rad - 30f64.to_radians()).abs() < 1e-12);
        assert_eq!(scan.line_times_s, Some([3.0, 1.0]));
        assert_eq!(scan.line_rate_hz, Some(0.25));
        assert_eq!(scan.frame_direction, Some(FrameDirection::Down));
        let bias = ("Biasvolt[mV]".to_owned(), "50.00".to_owned());
        assert!(scan.metadata.contains(&bias));
        assert!(scan.metadata.iter().all(|(key, _)| !key.contains("ICON")));
    }

    /// The third of four lines was stopped in its second sample.
    #[test]
    fn lines_that_were_not_recorded_are_missing() {
        let forward = [1, 2, 3, 4, 0, 6, 7, 8, 0, 0, 0, 0];
        let backward = [1, 2, 3, 4, 5, 6, 0, 0, 0, 0, 0, 0];
        let head = format!("{FRAME}Channels=2\r\nChannelselectval=1\r\n");
        for kind in KINDS {
            let scan =
                crate::read(&file(kind, 4, &head, &[forward, backward].concat())).expect(kind);
            let [a, b] = [0, 1].map(|n| counts(&scan.channels[n]));
            assert!(a[..3].iter().chain(&b[..6]).all(|n| n.is_nan()), "{kind}");
            assert!(a[3] == 7.0 && a[4] == 8.0 && a[5].is_nan(), "{kind}: {a:?}");
            assert_eq!(a[6..], [4.0, 0.0, 6.0, 1.0, 2.0, 3.0], "{kind}");
            let none = crate::read(&file(kind, 4, &head, &[0; 24]));
            assert!(
                matches!(none, Err(ReadError::AllMissing { channels: 2 })),
                "{kind}"
            );
        }
    }

    #[test]
    fn what_is_not_known_keeps_its_counts() {
        let read = |head: &str| {
            crate::read(&file("Paramet32", 2, head, &[5; 24]))
                .expect("whole")
                .channels
        };
        let unknown = read("Channels=4\r\nChannelselectval=7\r\n");
        assert_eq!(
            (&*unknown[1].name, unknown[1].line_direction),
            ("Channel 2", None)
        );
        assert_eq!((&*unknown[0].unit, unknown[0].values()[0]), ("", 5.0));
        let more = read(&format!("{FRAME}Channels=4\r\nChan(1,2,4)=4\r\n"));
        assert_eq!((&*more[3].name, &*more[3].unit), ("Signal 4", ""));
        assert_eq!(more[3].line_direction, Some(LineDirection::Trace));
        // 60 Å are 3 steps of 256 counts at 10 × 40 Å/V.
        let step = "Delta X=256\r\nGainX=10\r\nXpiezoconst=40\r\n";
        let by_step = read(&format!(
            "{STM}{}{step}",
            FRAME.replace("DAC-Type=20bit", "")
        ));
        let volts = 60.0 / (3.0 * 256.0 * 10.0 * 40.0);
        assert!((by_step[1].scale / (volts * 1e-9) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn channels_that_are_cut_off_are_lost() {
        let samples: Vec<i16> = (0..2400).map(|n| n * 13 % 997 + 1).collect();
        for kind in KINDS {
            let whole = file(kind, 200, &[FRAME, STM].concat(), &samples);
            let cut = HEADER + (whole.len() - HEADER) * 2 / 3;
            let Err(ReadError::Incomplete { readable, reason }) = crate::read(&whole[..cut]) else {
                panic!("{kind}: cut off");
            };
            let found = [readable.channels.len(), readable.unreadable.len()];
            assert!(
                found == [2, 2] || kind == "Paramco32" && found.iter().sum::<usize>() == 4,
                "{kind}: {found:?}"
            );
            let top = counts(&readable.channels[0]);
            assert_eq!(top[top.len() - 3..], [1.0, 14.0, 27.0], "{kind}");
            assert!(reason.contains("Current"), "{reason}");
            assert!(crate::read(&whole[..HEADER - 1]).is_err());
            assert!(crate::read(&whole[..HEADER]).is_err());
        }
    }

    #[test]
    fn streams_that_lie_are_found_out() {
        let read = |bytes: &[u8]| crate::read(bytes).expect_err("damaged").to_string();
        let whole = file("Paramco32", 2, &[FRAME, STM].concat(), &[3; 24]);
        let mut wrong = whole.clone();
        *wrong.last_mut().expect("a sum") ^= 1;
        assert!(read(&wrong).contains("zlib"));
        // A small file does not become gigabytes.
        assert!(read(&file("Paramco32", 400_000_000, STM, &[3; 24])).contains("400000000 lines"));
        assert!(
            read(&file("Paramco32", 400_000, STM, &[3; 24])).contains("12 of its 400000 lines")
        );
    }

    /// Programs that take names out leave the header shorter.
    #[test]
    fn shortened_headers() {
        let mut bytes = file("Paramet32", 2, &[FRAME, STM].concat(), &[9; 24]);
        bytes.drain(5000..5116);
        bytes[HEADER - 116 - DATA.len() - 1] = b'\n';
        assert_eq!(
            counts(&crate::read(&bytes).expect("whole").channels[0]),
            [9.0; 6]
        );
    }

    #[test]
    fn spectra_and_other_files_are_told() {
        let spectrum = crate::read(b"[ParVERT30]\r\nNum.X / Num.X=3\r\n").expect_err("no image");
        assert!(
            spectrum
                .to_string()
                .contains("a spectrum of a Createc controller: no image")
        );
        assert_eq!(
            crate::detect(b"[Parameter]\r\nspeed=3\r\n"),
            crate::Format::Text
        );
        assert_eq!(
            crate::detect(b"[Parameter]\r\nNum.X=3\r\n"),
            crate::Format::Createc
        );
    }
}
