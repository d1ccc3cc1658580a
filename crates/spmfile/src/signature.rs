//! What the first bytes of containers and texts tell: tags of a TIFF file, entries of a ZIP archive,
//! numbers or words.

use crate::cursor::{Cursor, Endian};

/// So many bytes tell the format.
const HEAD: usize = 512;

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

/// The name of the first entry of a ZIP archive; empty where it is none.
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
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    let printable = |b: &u8| *b >= 0x20 || matches!(b, b'\t' | b'\n' | b'\r');
    text.iter().all(printable)
}

/// Whether a text is a matrix of numbers, as far as its first lines behind comments tell.
pub(crate) fn is_matrix(bytes: &[u8]) -> bool {
    is_text(bytes) && numbers_only(behind_comments(bytes))
}

/// The head of a text behind its leading comments, however long they are.
fn behind_comments(text: &[u8]) -> &[u8] {
    let mut rest = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    while rest.first() == Some(&b'#') {
        let end = rest.iter().position(|&b| b == b'\n');
        rest = end.map_or(&[][..], |end| &rest[end + 1..]);
    }
    &rest[..rest.len().min(HEAD)]
}

/// Whether the lines, comments aside, hold numbers and nothing else. The last one may be cut off.
fn numbers_only(text: &[u8]) -> bool {
    let text = String::from_utf8_lossy(text);
    // Of a single line that is longer than the head the last number may be cut off, too.
    let cut = |text| str::rsplit_once(text, [',', ';', '\t', ' ']);
    let whole = match text.rsplit_once('\n') {
        Some((whole, _)) => whole,
        None if text.len() >= HEAD => cut(&*text).map_or("", |(whole, _)| whole),
        None => &text,
    };
    let mut lines = whole
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .peekable();
    lines.peek().is_some()
        && lines.all(|line| {
            let mut words = line
                .split([',', ';', '\t', ' '])
                .filter(|word| !word.is_empty())
                .peekable();
            words.peek().is_some() && words.all(|word| word.parse::<f64>().is_ok())
        })
}
