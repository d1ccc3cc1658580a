//! Texts of files: how their bytes become words, and which of their entries cannot be read.

use std::borrow::Cow;
use std::cell::RefCell;

use encoding_rs::{Encoding, UTF_16BE, UTF_16LE, WINDOWS_1252};

/// The text of a file or a part of one: UTF-16 with its mark or where its zeros tell it, UTF-8 where it is,
/// otherwise Windows-1252.
///
/// Of lines that are no UTF-8 each is decoded by itself: programs put texts of their users, in whatever encoding,
/// between their own. Of the signs that matter (µ, °, Å) none is UTF-8 by chance in Windows-1252.
pub(crate) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    if let Some(encoding) = utf_16(bytes) {
        return encoding.decode_with_bom_removal(bytes).0;
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if let Ok(text) = std::str::from_utf8(bytes) {
        return text.into();
    }
    let lines = bytes.split_inclusive(|&b| b == b'\n').map(one_encoding);
    lines.collect::<String>().into()
}

fn one_encoding(line: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(line) {
        Ok(text) => text.into(),
        Err(_) => WINDOWS_1252.decode_without_bom_handling(line).0,
    }
}

/// The text of fields of fixed width: up to the first NUL, without outer blanks.
pub(crate) fn field(bytes: &[u8]) -> String {
    let end = memchr::memchr(0, bytes).unwrap_or(bytes.len());
    one_encoding(&bytes[..end]).trim().to_owned()
}

/// The text of fields of fixed width in UTF-16, little endian.
pub(crate) fn wide_field(bytes: &[u8]) -> String {
    let text = wide(bytes);
    text.split('\0').next().unwrap_or("").trim().to_owned()
}

/// The text of bytes in UTF-16, little endian.
pub(crate) fn wide(bytes: &[u8]) -> Cow<'_, str> {
    UTF_16LE.decode_without_bom_handling(bytes).0
}

/// The encoding of a text in UTF-16: told by its mark, or by the zero byte of each of its first characters.
pub(crate) fn utf_16(bytes: &[u8]) -> Option<&'static Encoding> {
    const CERTAIN: usize = 4;
    match bytes {
        [0xff, 0xfe, ..] => return Some(UTF_16LE),
        [0xfe, 0xff, ..] => return Some(UTF_16BE),
        _ => {}
    }
    let (pairs, _) = bytes.get(..2 * CERTAIN)?.as_chunks::<2>();
    let printable = |b: u8| matches!(b, b'\t' | b'\n' | b'\r' | b' '..=b'~');
    if pairs.iter().all(|&[low, high]| high == 0 && printable(low)) {
        Some(UTF_16LE)
    } else if pairs.iter().all(|&[high, low]| high == 0 && printable(low)) {
        Some(UTF_16BE)
    } else {
        None
    }
}

/// The first words of a text.
pub(crate) fn beginning(bytes: &[u8]) -> String {
    const CHARACTERS: usize = 40;
    let text = decode(crate::signature::head(bytes));
    let first = text.lines().next().unwrap_or("");
    first.chars().take(CHARACTERS).collect()
}

/// A text without line ends and NULs.
pub(crate) fn one_line(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect::<String>()
        .trim()
        .to_owned()
}

/// Entries of a header that are there and cannot be read: one rule for all readers. They count as not told, and each is
/// a note with its text.
#[derive(Default)]
pub(crate) struct Unread(RefCell<Vec<String>>);

impl Unread {
    /// What `read` makes of an entry; where it makes nothing of a text, the text is kept.
    pub(crate) fn entry<'t, T>(
        &self,
        key: &str,
        text: Option<&'t str>,
        read: impl FnOnce(&'t str) -> Option<T>,
    ) -> Option<T> {
        /// What programs write where they have nothing to say.
        const NOTHING: [&str; 7] = ["-", "--", "n/a", "nan", "none", "unknown", "undefined"];
        const LONGEST: usize = 80;
        let text = text?.trim();
        let found = read(text);
        let lower = text.to_ascii_lowercase();
        let says_nothing = lower.split_whitespace().all(|word| NOTHING.contains(&word));
        if found.is_none() && !says_nothing {
            let text: String = one_line(text).chars().take(LONGEST).collect();
            let note =
                format!("expected {key} to be readable, found {text:?}: it counts as not told");
            let mut notes = self.0.borrow_mut();
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        found
    }

    /// A finite number.
    pub(crate) fn number(&self, key: &str, text: Option<&str>) -> Option<f64> {
        self.entry(key, text, number)
    }

    /// Words for what could not be read.
    pub(crate) fn notes(&self) -> Vec<String> {
        self.0.take()
    }
}

/// A finite number and nothing else.
pub(crate) fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|n: &f64| n.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_stay_lines() {
        assert_eq!(one_line(" a\r\nb\0c "), "a  b c");
    }

    #[test]
    fn texts_in_any_encoding() {
        let text = "0.6 µm, 5 °\nHöhe";
        let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        for bytes in [
            text.as_bytes(),
            b"0.6 \xb5m, 5 \xb0\nH\xf6he",
            "0.6 µm, 5 °\n"
                .as_bytes()
                .iter()
                .copied()
                .chain(*b"H\xf6he")
                .collect::<Vec<u8>>()
                .as_slice(),
            &[b"\xef\xbb\xbf", text.as_bytes()].concat(),
            &little,
            &big,
            &[b"\xff\xfe", &little[..]].concat(),
            &[b"\xfe\xff", &big[..]].concat(),
        ] {
            assert_eq!(decode(bytes), text, "{bytes:02x?}");
        }
        assert_eq!(decode(b""), "");
        assert_eq!(field(b" \xb5m\0rest"), "µm");
        assert_eq!(field("µm".as_bytes()), "µm");
        assert_eq!(wide_field(b"\xb5\0m\0\0\0x\0"), "µm");
    }

    #[test]
    fn what_cannot_be_read_is_kept() {
        let unread = Unread::default();
        assert_eq!(unread.number("A", Some(" 1.5 ")), Some(1.5));
        for nothing in [None, Some(""), Some("N/A"), Some("NaN")] {
            assert_eq!(unread.number("A", nothing), None);
        }
        assert_eq!(unread.number("A", Some("4,5")), None);
        assert_eq!(unread.number("A", Some("4,5")), None);
        let notes = unread.notes();
        assert_eq!(notes.len(), 1);
        assert!(notes[0].contains("\"4,5\""), "{notes:?}");
    }
}
