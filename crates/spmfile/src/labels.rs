//! What formats without fields for it carry along as keys and values: how a frame was scanned.
//!
//! [`describe`] writes it, [`apply`] takes it back; the keys begin with `spmfile`. Numbers are
//! written so that they are read back to the last bit.

use crate::fields;
use crate::scan::{Channel, DateTime, FrameDirection, LineDirection, Scan};
use crate::words::{self, Unread};

/// The line direction that a title tells: `Z (Backward)`, `Height [Trace]`, `Phase Retrace`.
pub(crate) fn line_direction(title: &str) -> Option<LineDirection> {
    let last = title
        .trim_end_matches([')', ']', ' '])
        .rsplit(|c: char| !c.is_alphanumeric())
        .next()?
        .to_ascii_lowercase();
    match last.as_str() {
        "forward" | "trace" => Some(LineDirection::Trace),
        "backward" | "retrace" => Some(LineDirection::Retrace),
        _ => None,
    }
}

/// The keys of a frame.
pub(crate) fn describe(scan: &Scan) -> Vec<(String, String)> {
    let mut lines = Vec::new();
    let mut put = |key: &str, value: Option<String>| {
        if let Some(value) = value {
            lines.push((format!("spmfile {key}"), value));
        }
    };
    let pair = |[a, b]: [f64; 2]| format!("{a} {b}");
    put("format", Some(scan.format.clone()));
    put("instrument", scan.instrument.clone());
    put("acquired", scan.acquired.map(iso));
    put(
        "frame direction",
        scan.frame_direction.map(|direction| {
            match direction {
                FrameDirection::Up => "up",
                FrameDirection::Down => "down",
            }
            .to_owned()
        }),
    );
    put("line rate (Hz)", scan.line_rate_hz.map(|n| n.to_string()));
    put("line times (s)", scan.line_times_s.map(pair));
    put("rounding", scan.rounding.map(|n| n.to_string()));
    put("rotation (rad)", Some(scan.rotation_rad.to_string()));
    put("offset (nm)", Some(pair(scan.offset_nm)));
    put("size (nm)", scan.size_nm.map(pair));
    put("closed loop", scan.closed_loop.map(|on| on.to_string()));
    for (n, note) in scan.notes.iter().enumerate() {
        put(&format!("note {}", n + 1), Some(note.clone()));
    }
    lines
}

/// The keys of a channel beside its name.
pub(crate) fn describe_channel(channel: &Channel) -> Vec<(String, String)> {
    let mut lines = Vec::new();
    let mut put = |key: &str, value: Option<&str>| {
        if let Some(value) = value.filter(|v| !v.is_empty()) {
            lines.push((format!("spmfile {key}"), value.to_owned()));
        }
    };
    put("internal name", Some(&channel.internal_name));
    put(
        "line direction",
        channel.line_direction.map(|direction| match direction {
            LineDirection::Trace => "trace",
            LineDirection::Retrace => "retrace",
        }),
    );
    put("scan line", channel.scan_line.as_deref());
    put("plane fit", channel.plane_fit.as_deref());
    lines
}

/// Everything about a channel and its frame as lines `key = value`, for files without fields for it.
pub(crate) fn text(scan: &Scan, channel: &Channel, log: &[String]) -> String {
    let mut text = String::new();
    let mut put = |key: &str, value: &str| fields::put(&mut text, key, value);
    put("spmfile name", &channel.name);
    put("spmfile unit", &channel.unit);
    put("spmfile shape", &shape([channel.rows, channel.columns]));
    if let Some([width, height]) = channel.edges_nm() {
        put("spmfile width (nm)", &width.to_string());
        put("spmfile height (nm)", &height.to_string());
    }
    let ours = describe_channel(channel).into_iter().chain(describe(scan));
    for (key, value) in ours.chain(scan.metadata.iter().cloned()) {
        put(&key, &value);
    }
    for (step, line) in log.iter().enumerate() {
        put(&format!("log {}", step + 1), line);
    }
    text
}

/// The lines `key = value` of a text; others are ignored.
pub(crate) fn lines(text: &str) -> Vec<(String, String)> {
    text.lines()
        .filter_map(|line| line.split_once('='))
        .map(|(key, value)| (key.trim().to_owned(), value.trim().to_owned()))
        .collect()
}

/// Whether lines were made by [`text`] for an image of this many rows and columns: of an image that
/// was cropped or scaled since, size and times are no longer right.
pub(crate) fn fits(lines: &[(String, String)], size: [usize; 2]) -> bool {
    value(lines, "shape") == Some(&shape(size))
}

fn shape([rows, columns]: [usize; 2]) -> String {
    format!("{rows} {columns}")
}

/// Lines of [`text`], those of the frame and those of the channel apart.
pub(crate) fn carried(lines: Vec<(String, String)>) -> (Labels, Labels) {
    const CHANNEL: [&str; 9] = [
        "name",
        "unit",
        "shape",
        "width (nm)",
        "height (nm)",
        "internal name",
        "line direction",
        "scan line",
        "plane fit",
    ];
    // What image programs want to find in a TIFF file.
    const FOREIGN: [&str; 4] = ["ImageJ", "images", "slices", "unit"];
    lines
        .into_iter()
        .filter(|(key, _)| !FOREIGN.contains(&key.as_str()))
        .partition(|(key, _)| {
            !key.strip_prefix("spmfile ")
                .is_some_and(|key| CHANNEL.contains(&key))
        })
}

/// Keys and values.
pub(crate) type Labels = Vec<(String, String)>;

/// Text in ASCII: other characters as `\u{b0}`, backslashes doubled.
pub(crate) fn to_ascii(text: &str) -> String {
    let mut ascii = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\\' => ascii.push_str("\\\\"),
            c if c.is_ascii() => ascii.push(c),
            c => ascii.extend(c.escape_unicode()),
        }
    }
    ascii
}

/// The inverse of [`to_ascii`]; what is no such escape stays.
pub(crate) fn from_ascii(ascii: &str) -> String {
    let mut text = String::with_capacity(ascii.len());
    let mut rest = ascii;
    while let Some((before, after)) = rest.split_once('\\') {
        text.push_str(before);
        let escaped = || {
            let (code, rest) = after.strip_prefix("u{")?.split_once('}')?;
            let c = char::from_u32(u32::from_str_radix(code, 16).ok()?)?;
            Some((c, rest))
        };
        if let Some((c, after)) = escaped() {
            text.push(c);
            rest = after;
        } else {
            text.push('\\');
            rest = after.strip_prefix('\\').unwrap_or(after);
        }
    }
    text + rest
}

/// The value of one of our keys.
pub(crate) fn value<'a>(lines: &'a [(String, String)], key: &str) -> Option<&'a str> {
    let ours = |k: &str| k.strip_prefix("spmfile ") == Some(key);
    let (_, value) = lines.iter().find(|(k, _)| ours(k))?;
    Some(value)
}

/// Moves our keys from the metadata of a scan to where they belong.
pub(crate) fn apply(scan: &mut Scan) {
    let lines = std::mem::take(&mut scan.metadata);
    let unread = Unread::default();
    let number = |key: &str| unread.number(key, value(&lines, key));
    let pair = |key: &str| -> Option<[f64; 2]> {
        unread.entry(key, value(&lines, key), |text| {
            let (a, b) = text.split_once(' ')?;
            Some([words::number(a)?, words::number(b)?])
        })
    };
    if let Some(format) = value(&lines, "format") {
        // Once only, however often it is converted.
        let origin = format.rsplit(" from ").next().unwrap_or(format);
        scan.format = format!("{} from {origin}", scan.format);
    }
    scan.instrument = value(&lines, "instrument").map(str::to_owned);
    scan.acquired = unread.entry("acquired", value(&lines, "acquired"), date);
    scan.frame_direction = value(&lines, "frame direction").and_then(FrameDirection::named);
    scan.line_rate_hz = number("line rate (Hz)").filter(|&n| n > 0.0);
    scan.line_times_s = pair("line times (s)").filter(|&[a, b]| a > 0.0 && b >= 0.0);
    scan.rounding = number("rounding").filter(|&n| n >= 0.0);
    scan.rotation_rad = number("rotation (rad)").unwrap_or(scan.rotation_rad);
    scan.offset_nm = pair("offset (nm)").unwrap_or(scan.offset_nm);
    scan.size_nm = pair("size (nm)").or(scan.size_nm);
    scan.closed_loop = value(&lines, "closed loop").and_then(|v| v.parse().ok());
    let notes = (1..).map_while(|n| value(&lines, &format!("note {n}")));
    scan.notes.extend(notes.map(str::to_owned));
    scan.notes.extend(unread.notes());
    scan.metadata = lines
        .into_iter()
        .filter(|(key, _)| !key.starts_with("spmfile "))
        .collect();
}

/// The line direction of one of our keys.
pub(crate) fn stated_direction(lines: &[(String, String)]) -> Option<LineDirection> {
    match value(lines, "line direction")? {
        "trace" => Some(LineDirection::Trace),
        "retrace" => Some(LineDirection::Retrace),
        _ => None,
    }
}

fn iso(t: DateTime) -> String {
    format!(
        "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}",
        t.year, t.month, t.day, t.hour, t.minute, t.second
    )
}

fn date(text: &str) -> Option<DateTime> {
    let (day, time) = text.split_once('T')?;
    let numbers: Vec<i64> = day.split('-').filter_map(|n| n.parse().ok()).collect();
    crate::clock::date(numbers.try_into().ok()?, crate::clock::clock(time)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn titles_tell_line_directions() {
        let trace = Some(LineDirection::Trace);
        let retrace = Some(LineDirection::Retrace);
        assert_eq!(line_direction("Z (Forward)"), trace);
        assert_eq!(line_direction("Z (Backward)"), retrace);
        assert_eq!(line_direction("Height [Trace]"), trace);
        assert_eq!(line_direction("Phase Retrace"), retrace);
        for none in ["", "Z", "Trace Metals", "Backwards", "Subtrace"] {
            assert_eq!(line_direction(none), None, "{none}");
        }
    }

    #[test]
    fn ascii_and_back() {
        for text in ["1 µm, 5 °\nC:\\users\\u{b5} 💡", "", "\\", "\\\\u{b0}"] {
            let ascii = to_ascii(text);
            assert!(ascii.is_ascii(), "{ascii}");
            assert_eq!(from_ascii(&ascii), text);
        }
        assert_eq!(from_ascii("a\\nb \\u{zz}"), "a\\nb \\u{zz}");
    }

    #[test]
    fn a_description_is_taken_back() {
        let scan = Scan {
            format: "Nanonis 2".to_owned(),
            instrument: Some("LT-STM".to_owned()),
            acquired: crate::clock::date([2024, 2, 29], [23, 59, 58]),
            frame_direction: Some(FrameDirection::Down),
            line_rate_hz: Some(1.0 / 3.0),
            line_times_s: Some([0.1, 0.2]),
            rounding: Some(0.05),
            rotation_rad: -0.575_958_653_158_128_9,
            offset_nm: [1e9 / 7.0, -2e-3],
            size_nm: Some([70.0, 35.1]),
            closed_loop: Some(false),
            notes: vec!["One = doubt".to_owned(), "Another".to_owned()],
            metadata: vec![("Note".to_owned(), "kept".to_owned())],
            ..Scan::default()
        };
        let mut read = Scan {
            format: "Gwyddion".to_owned(),
            metadata: [describe(&scan), scan.metadata.clone()].concat(),
            ..Scan::default()
        };
        apply(&mut read);
        assert_eq!(read.format, "Gwyddion from Nanonis 2");
        read.format.clone_from(&scan.format);
        assert_eq!(format!("{read:?}"), format!("{scan:?}"));
    }
}
