//! What the first bytes of containers and texts tell: tags of a TIFF file, entries of a ZIP archive,
//! numbers or words.

use std::borrow::Cow;

use crate::array::begins_table;
use crate::cursor::{Cursor, Endian};
use crate::words;

/// Bytes that identify a format.
const HEAD: usize = 512;
/// A line of labels and one of numbers are no longer, mostly.
const HEAD_OF_TABLE: usize = 1 << 16;

/// The first bytes, as many as tell the format.
pub(crate) fn head(bytes: &[u8]) -> &[u8] {
    &bytes[..bytes.len().min(HEAD)]
}

/// Whether the file is a TIFF file whose first directory has a tag in this range.
pub(crate) fn tiff_has(bytes: &[u8], first: u16, last: u16) -> bool {
    let endian = match bytes {
        [b'I', b'I', b'*', 0, ..] => Endian::Little,
        [b'M', b'M', 0, b'*', ..] => Endian::Big,
        _ => return false,
    };
    let found = || -> Result<bool, String> {
        let start = Cursor::new(bytes, endian).at(4).u32()?;
        let mut directory = Cursor::new(bytes, endian).at(start as usize);
        for _ in 0..directory.u16()? {
            if (first..=last).contains(&directory.u16()?) {
                return Ok(true);
            }
            directory.skip(10)?;
        }
        Ok(false)
    };
    found().unwrap_or(false)
}

/// The name of the first entry of a ZIP archive; empty if it is not one.
pub(crate) fn first_entry(bytes: &[u8]) -> &[u8] {
    if !bytes.starts_with(b"PK\x03\x04") {
        return &[];
    }
    let name = || -> Result<&[u8], String> {
        let mut cursor = Cursor::new(head(bytes), Endian::Little).at(26);
        let length = usize::from(cursor.u16()?);
        cursor.skip(2)?;
        cursor.slice(length, "a name")
    };
    name().unwrap_or_default()
}

/// Whether the first bytes are those of a text.
pub(crate) fn is_text(bytes: &[u8]) -> bool {
    let head = head(bytes);
    let printable = |b: &u8| *b >= 0x20 || matches!(b, b'\t' | b'\n' | b'\r');
    head.iter().all(printable) || words::utf_16(head).is_some()
}

/// Whether a text is a matrix of numbers, with labels or without, as far as its first lines behind comments tell.
pub(crate) fn is_matrix(bytes: &[u8]) -> bool {
    is_text(bytes) && begins_table(whole_lines(&behind_comments(bytes)))
}

/// The head of a text behind its leading comments, however long they are.
fn behind_comments(text: &[u8]) -> Cow<'_, str> {
    if words::utf_16(text).is_some() {
        return words::decode(&text[..text.len().min(HEAD_OF_TABLE)]);
    }
    let mut rest = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    while rest.first() == Some(&b'#') {
        let end = rest.iter().position(|&b| b == b'\n');
        rest = end.map_or(&[][..], |end| &rest[end + 1..]);
    }
    words::decode(&rest[..rest.len().min(HEAD_OF_TABLE)])
}

/// The lines of a head without the one that it cuts off; of a single one without its last field.
fn whole_lines(text: &str) -> &str {
    let cut = |text| str::rsplit_once(text, [',', ';', '\t', ' ']);
    match text.rsplit_once('\n') {
        Some((whole, _)) => whole,
        None if text.len() >= HEAD => cut(text).map_or("", |(whole, _)| whole),
        None => text,
    }
}
