//! Nanonis scans (SPECS), `.sxm`.
//!
//! A text header of `:KEY:` lines with the value below each, up to `:SCANIT_END:`, then the bytes
//! 1A 04 and the images as big-endian single-precision numbers in SI units. The table `DATA_INFO`
//! names the images; `both` stands for two, forward and then backward.
//!
//! - Lines are stored in the order of acquisition: `SCAN_DIR` `up` begins with the bottom line.
//! - Backward lines are stored in the order of time, so right to left.
//! - `SCAN_PIXELS` and `SCAN_RANGE` are along the fast, then the slow axis; `SCAN_OFFSET` is the
//!   centre of the frame.
//! - `SCAN_ANGLE` turns the frame clockwise, in degrees (programming interface of the software,
//!   `Scan.FrameSet`).
//! - `SCAN_TIME` holds the time of a forward and of a backward line; they may differ.
//! - `REC_DATE` and `REC_TIME` are the start, `ACQ_TIME` later the frame ended (in files named by
//!   the time of saving, the name agrees with the sum to the second).
//! - Lines that were not recorded are NaN.

use memchr::memmem;

use crate::clock;
use crate::cursor::Endian;
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::outline::{Input, Outline};
use crate::raster::{self, Encoding, Order};
use crate::scan::{ChannelInfo, DateTime, FrameDirection, LineDirection, Scan};
use crate::stored::Flat;
use crate::whole::{Extent, MOST_CHANNELS};
use crate::words::{self, Unread};

const FORMAT: &str = "Nanonis";
const END: &[u8] = b":SCANIT_END:";

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let (text, start) = header(bytes)?;
    let fields = fields(&text);
    let endian = sample_kind(&fields)?;
    let [columns, rows] = pixels(&fields)?;
    let length = raster::byte_length(rows, columns, Encoding::F32)
        .ok_or_else(|| damaged(format!("its size is {rows} lines of {columns} samples")))?;
    let images = images(&fields)?;

    let scan = frame(&fields);
    let size = scan.size_nm;
    let top_first = match scan.frame_direction {
        Some(direction) => direction == FrameDirection::Down,
        None => return Err(damaged("expected SCAN_DIR up or down, found neither")),
    };
    let mut outline = Outline::of(scan);
    let mut extent = Extent::default();
    for (index, (info, unit)) in images.into_iter().enumerate() {
        let start = index.saturating_mul(length).saturating_add(start);
        if !extent.take(input.length, start, length, &info.name) {
            continue;
        }
        let order = Order {
            top_first,
            mirrored: info.line_direction == Some(LineDirection::Retrace),
        };
        outline.add_flat(
            ChannelHeader::new(info, rows, columns)
                .in_unit(&unit)
                .of_size(size),
            Flat::at(start, Encoding::F32, endian).in_order(order),
        );
    }
    extent.judge(outline, input.length)
}

/// The header's text and the byte at which the images begin.
fn header(bytes: &[u8]) -> Result<(String, usize), ReadError> {
    let find = |needle: &[u8], from: usize| {
        let rest = bytes.get(from..)?;
        let place = memmem::find(rest, needle)?;
        Some(from + place)
    };
    let cut_off = |what: &str| {
        damaged(format!(
            "expected {what}, found none in {} bytes: the file was cut off inside the header",
            bytes.len()
        ))
    };
    let end = find(END, 0).ok_or_else(|| cut_off(":SCANIT_END:"))?;
    let mark = find(&[0x1a, 0x04], end).ok_or_else(|| cut_off("the bytes 1A 04"))?;
    let text = words::decode(&bytes[..end]);
    Ok((text.into_owned(), mark + 2))
}

/// Keys and their values, in the order of the file.
fn fields(text: &str) -> Vec<(&str, String)> {
    let mut fields: Vec<(&str, String)> = Vec::new();
    for line in text.lines() {
        let key = line
            .trim_end()
            .strip_prefix(':')
            .and_then(|line| line.strip_suffix(':'));
        match (key, fields.last_mut()) {
            (Some(key), _) => fields.push((key, String::new())),
            (None, Some((_, value))) => {
                value.push_str(line);
                value.push('\n');
            }
            (None, None) => {}
        }
    }
    fields
}

fn field<'a>(fields: &'a [(&str, String)], key: &str) -> Option<&'a str> {
    let (_, value) = fields.iter().find(|(k, _)| k.eq_ignore_ascii_case(key))?;
    Some(value.trim())
}

/// The numbers of a field, if they are `N` finite ones.
fn numbers<const N: usize>(
    fields: &[(&str, String)],
    key: &str,
    unread: &Unread,
) -> Option<[f64; N]> {
    unread.entry(key, field(fields, key), |text| {
        let numbers: Option<Vec<f64>> = text.split_whitespace().map(words::number).collect();
        numbers?.try_into().ok()
    })
}

fn sample_kind(fields: &[(&str, String)]) -> Result<Endian, ReadError> {
    let kind = field(fields, "SCANIT_TYPE").unwrap_or("");
    let words: Vec<String> = kind
        .split_whitespace()
        .map(str::to_ascii_uppercase)
        .collect();
    match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["FLOAT", "MSBFIRST"] => Ok(Endian::Big),
        ["FLOAT", "LSBFIRST"] => Ok(Endian::Little),
        _ => Err(damaged(format!(
            "expected SCANIT_TYPE FLOAT MSBFIRST, found {kind:?}"
        ))),
    }
}

/// Samples per line and lines.
fn pixels(fields: &[(&str, String)]) -> Result<[usize; 2], ReadError> {
    let text = field(fields, "SCAN_PIXELS").unwrap_or("");
    let numbers: Vec<usize> = text
        .split_whitespace()
        .filter_map(|word| word.parse().ok())
        .collect();
    numbers.try_into().map_err(|_| {
        damaged(format!(
            "expected SCAN_PIXELS with samples and lines, found {text:?}"
        ))
    })
}

/// Name and unit of every image, in the order of the file.
fn images(fields: &[(&str, String)]) -> Result<Vec<(ChannelInfo, String)>, ReadError> {
    let table = field(fields, "DATA_INFO").unwrap_or("");
    let mut lines = table.lines().map(str::trim).filter(|line| !line.is_empty());
    let cells = |line: &'_ str| -> Vec<String> {
        // Names may hold blanks; cells are separated by tabs, in retyped files by blanks.
        if line.contains('\t') {
            line.split('\t')
                .map(|cell| cell.trim().to_owned())
                .collect()
        } else {
            line.split_whitespace().map(str::to_owned).collect()
        }
    };
    let heads = cells(lines.next().unwrap_or(""));
    let column = |name: &str| {
        heads
            .iter()
            .position(|head| head.eq_ignore_ascii_case(name))
            .ok_or_else(|| {
                damaged(format!(
                    "expected a column {name:?} in DATA_INFO, found {heads:?}"
                ))
            })
    };
    let (name, unit, direction) = (column("Name")?, column("Unit")?, column("Direction")?);
    let mut images = Vec::new();
    for line in lines {
        let cells = cells(line);
        let cell = |index: usize| cells.get(index).cloned().unwrap_or_default();
        let lines: &[LineDirection] = match cell(direction).to_ascii_lowercase().as_str() {
            "both" => &[LineDirection::Trace, LineDirection::Retrace],
            "forward" | "fwd" => &[LineDirection::Trace],
            "backward" | "bwd" => &[LineDirection::Retrace],
            other => {
                return Err(damaged(format!(
                    "expected a channel's direction both, forward or backward, found {other:?}"
                )));
            }
        };
        for &line in lines {
            let info = ChannelInfo {
                name: cell(name),
                internal_name: String::new(),
                line_direction: Some(line),
                scan_line: None,
            };
            images.push((info, cell(unit)));
        }
    }
    match images.len() {
        0 => Err(damaged("its table DATA_INFO announces no image")),
        found if found > MOST_CHANNELS => Err(ReadError::TooManyChannels {
            found,
            limit: MOST_CHANNELS,
        }),
        _ => Ok(images),
    }
}

/// Everything about the frame but its channels.
fn frame(fields: &[(&str, String)]) -> Scan {
    let unread = Unread::default();
    let nm = |key: &str| numbers::<2>(fields, key, &unread).map(|lengths| lengths.map(|m| m * 1e9));
    let line_times_s = numbers::<2>(fields, "SCAN_TIME", &unread)
        .filter(|&[forward, backward]| forward > 0.0 && backward >= 0.0);
    let clockwise = numbers::<1>(fields, "SCAN_ANGLE", &unread).map_or(0.0, |[angle]| angle);
    Scan {
        format: match field(fields, "NANONIS_VERSION") {
            Some(version) => format!("Nanonis {version}"),
            None => FORMAT.to_owned(),
        },
        acquired: saved(fields, &unread),
        frame_direction: field(fields, "SCAN_DIR").and_then(FrameDirection::named),
        line_rate_hz: line_times_s.map(|[forward, backward]| 1.0 / (forward + backward)),
        line_times_s,
        rotation_rad: if clockwise == 0.0 {
            0.0
        } else {
            -clockwise.to_radians()
        },
        offset_nm: nm("SCAN_OFFSET").unwrap_or([0.0, 0.0]),
        size_nm: nm("SCAN_RANGE").filter(|&[x, y]| x > 0.0 && y > 0.0),
        metadata: fields
            .iter()
            .filter(|(key, _)| *key != "DATA_INFO")
            .map(|(key, value)| ((*key).to_owned(), value.trim().to_owned()))
            .collect(),
        notes: unread.notes(),
        ..Scan::default()
    }
}

/// When the frame ended.
fn saved(fields: &[(&str, String)], unread: &Unread) -> Option<DateTime> {
    let date = unread.entry("REC_DATE", field(fields, "REC_DATE"), |text| {
        let date: Option<Vec<i64>> = text
            .split('.')
            .map(|part| part.trim().parse().ok())
            .collect();
        <[i64; 3]>::try_from(date?).ok()
    });
    let time = unread.entry("REC_TIME", field(fields, "REC_TIME"), clock::clock);
    let [day, month, year] = date?;
    let start = clock::date([year, month, day], time?)?;
    let duration =
        numbers::<1>(fields, "ACQ_TIME", unread).map_or(0.0, |[seconds]| seconds.max(0.0));
    Some(clock::later(start, duration))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two channels of 2 lines with 3 samples, counted up in the order of the file.
    fn file(direction: &str, table: &str, images: usize) -> Vec<u8> {
        let mut bytes = format!(
            ":NANONIS_VERSION:\n2\n:SCANIT_TYPE:\n  FLOAT   MSBFIRST\n:REC_DATE:\n 31.12.2019\n\
             :REC_TIME:\n23:59:00\n:ACQ_TIME:\n  90.0\n:SCAN_PIXELS:\n  3  2\n:SCAN_TIME:\n 1.5 0.5\n\
             :SCAN_RANGE:\n 3E-9 4E-9\n:SCAN_OFFSET:\n 1E-8 -2E-8\n:SCAN_ANGLE:\n 33\n\
             :SCAN_DIR:\n{direction}\n:DATA_INFO:\n\tChannel\tName\tUnit\tDirection\n{table}\n\
             :SCANIT_END:\n\n\n"
        )
        .into_bytes();
        bytes.extend([0x1a, 0x04]);
        let samples = (0..6 * images).map(|n| n as f32);
        bytes.extend(samples.flat_map(f32::to_be_bytes));
        bytes
    }

    const BOTH: &str = "\t14\tZ\tm\tboth\n";

    #[test]
    fn lines_go_bottom_up_and_backward_lines_are_turned() {
        let up = crate::read(&file("up", BOTH, 2)).expect("whole");
        assert_eq!(up.frame_direction, Some(FrameDirection::Up));
        assert_eq!(up.channels[0].values(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(up.channels[1].values(), [8.0, 7.0, 6.0, 11.0, 10.0, 9.0]);
        let down = crate::read(&file("down", BOTH, 2)).expect("whole");
        assert_eq!(down.channels[0].values(), [3.0, 4.0, 5.0, 0.0, 1.0, 2.0]);
        assert_eq!(down.channels[1].values(), [11.0, 10.0, 9.0, 8.0, 7.0, 6.0]);
        let lines = down.channels.iter().map(|c| c.line_direction);
        assert!(lines.eq([Some(LineDirection::Trace), Some(LineDirection::Retrace)]));
    }

    #[test]
    fn the_frame_is_told() {
        let scan = crate::read(&file("up", BOTH, 2)).expect("whole");
        assert_eq!(scan.format, "Nanonis 2");
        assert_eq!(scan.line_times_s, Some([1.5, 0.5]));
        assert_eq!(scan.line_rate_hz, Some(0.5));
        assert!(
            (scan.rotation_rad + 33f64.to_radians()).abs() < 1e-12,
            "clockwise"
        );
        let close = |[x, y]: [f64; 2], [a, b]: [f64; 2]| (x - a).abs() + (y - b).abs() < 1e-9;
        assert!(close(scan.offset_nm, [10.0, -20.0]));
        assert!(close(scan.size_nm.expect("a size"), [3.0, 4.0]));
        assert_eq!(scan.acquired, clock::date([2020, 1, 1], [0, 0, 30]));
        let crate::Channel {
            width_nm,
            height_nm,
            ..
        } = scan.channels[0];
        assert!(close(
            [width_nm.expect("width"), height_nm.expect("height")],
            [3.0, 4.0]
        ));
    }

    #[test]
    fn single_directions_and_names_with_blanks() {
        let table = "\t1\tLI Demod 1 X\tV\tbackward\n\t0\tCurrent\tA\tforward\n";
        let scan = crate::read(&file("up", table, 2)).expect("whole");
        assert_eq!(scan.channels[0].name, "LI Demod 1 X");
        assert_eq!(scan.channels[0].values(), [2.0, 1.0, 0.0, 5.0, 4.0, 3.0]);
        assert_eq!(scan.channels[1].unit, "A");
        assert_eq!(scan.channels[1].values()[0], 6.0);
    }

    #[test]
    fn only_wanted_channels_are_decoded() {
        let wanted = |info: &ChannelInfo| info.line_direction == Some(LineDirection::Retrace);
        let scan = crate::read_selected(&file("up", BOTH, 2), &wanted).expect("whole");
        assert_eq!(scan.channels.len(), 1);
        assert_eq!(scan.channels[0].values()[0], 8.0);
    }

    #[test]
    fn what_is_missing_is_said() {
        let whole = file("up", BOTH, 2);
        let Err(ReadError::Incomplete { readable, reason }) =
            crate::read(&whole[..whole.len() - 1])
        else {
            panic!("one byte is missing");
        };
        assert_eq!((readable.channels.len(), readable.unreadable.len()), (1, 1));
        assert!(
            reason.contains("23 bytes") && reason.contains("24"),
            "{reason}"
        );
        let header = file("up", BOTH, 0);
        assert!(matches!(
            crate::read(&header),
            Err(ReadError::HeaderOnly { announced: 2, .. })
        ));
        let inside = crate::read(&whole[..200]).expect_err("cut off").to_string();
        assert!(inside.contains("inside the header"), "{inside}");
        let error = |from: &str, to: &str| {
            let text: String = whole.iter().map(|&b| char::from(b)).collect();
            let bytes: Vec<u8> = text.replace(from, to).chars().map(|c| c as u8).collect();
            crate::read(&bytes).expect_err("damaged").to_string()
        };
        assert!(error("  3  2", "99999999999 99999999999").contains("99999999999"));
        assert!(error("  3  2", " 0 2").contains("0 samples"));
        assert!(error("FLOAT", "INT").contains("INT"));
        assert!(error("SCAN_DIR", "XXXX").contains("SCAN_DIR"));
        assert!(error("both", "all").contains("all"));
    }

    #[test]
    fn a_scan_without_a_sample_is_refused() {
        let mut bytes = file("up", BOTH, 0);
        bytes.extend([f32::NAN; 12].map(f32::to_be_bytes).concat());
        assert!(matches!(
            crate::read(&bytes),
            Err(ReadError::AllMissing { channels: 2 })
        ));
        let end = bytes.len();
        bytes[end - 4..].copy_from_slice(&1f32.to_be_bytes());
        assert!(crate::read(&bytes).is_ok());
    }
}
