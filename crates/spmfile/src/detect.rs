//! Which format is this? Told by the first bytes, never by the name of the file.

/// What the first bytes of a file say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// NanoScope images.
    NanoScope,
    /// NanoScope force curves or a force volume.
    NanoScopeForce,
    /// ISO 28632 text (`ISO/TC 201 SPM data transfer format`), often named `.spm`.
    Iso28632,
    /// Some other kind of file, in words.
    Other(&'static str),
    /// Readable text of unknown meaning.
    Text,
    /// No bytes at all.
    Empty,
    /// Nothing known.
    Unknown,
}

/// First bytes of files that people confuse with scans or that other programs read.
const SIGNATURES: [(&[u8], &str); 14] = [
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"\x89PNG\r\n\x1a\n", "a PNG picture"),
    (b"GIF8", "a GIF picture"),
    (b"BM", "a BMP picture"),
    (b"II*\0", "a TIFF file (a picture, or a Park or JPK scan)"),
    (b"MM\0*", "a TIFF file (a picture, or a Park or JPK scan)"),
    (b"%PDF", "a PDF document"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
    (b"GWYP", "a Gwyddion file"),
    (b":NANONIS_VERSION:", "a Nanonis scan"),
    (b"WSxM file", "a WSxM scan"),
    (b"?*File list", "a NanoScope text export"),
];

/// Tells the format from the first bytes of a file; a few hundred are enough.
pub fn detect(bytes: &[u8]) -> Format {
    let head = &bytes[..bytes.len().min(512)];
    if head.is_empty() {
        return Format::Empty;
    }
    if head.starts_with(b"\\*") {
        let end = head.iter().position(|&b| b == b'\n' || b == b'\r');
        let first = head[..end.unwrap_or(head.len())].to_ascii_lowercase();
        if first.ends_with(b"file list") {
            return if first.starts_with(b"\\*force") {
                Format::NanoScopeForce
            } else {
                Format::NanoScope
            };
        }
    }
    if head.starts_with(b"ISO/TC 201 SPM data transfer format") {
        return Format::Iso28632;
    }
    if let Some((_, name)) = SIGNATURES.iter().find(|(magic, _)| head.starts_with(magic)) {
        return Format::Other(name);
    }
    let printable = |b: &u8| *b >= 0x20 || matches!(b, b'\t' | b'\n' | b'\r');
    if head.iter().all(printable) {
        Format::Text
    } else {
        Format::Unknown
    }
}

/// Whether a file that begins like this is meant to be a scan, readable or not.
///
/// For picking the scans out of a folder that also holds notes and pictures.
pub fn looks_like_scan(head: &[u8]) -> bool {
    matches!(
        detect(head),
        Format::NanoScope | Format::NanoScopeForce | Format::Iso28632
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_bytes_tell_the_format() {
        assert_eq!(detect(b""), Format::Empty);
        assert_eq!(detect(b"\\*File list\r\n"), Format::NanoScope);
        assert_eq!(detect(b"\\*EC File list\n"), Format::NanoScope);
        assert_eq!(detect(b"\\*Force file list\r\n"), Format::NanoScopeForce);
        assert_eq!(
            detect(b"ISO/TC 201 SPM data transfer format\n"),
            Format::Iso28632
        );
        assert_eq!(
            detect(b"\xff\xd8\xff\xe0\0\x10JFIF"),
            Format::Other("a JPEG picture")
        );
        assert_eq!(detect("Grüße aus dem Labor\n".as_bytes()), Format::Text);
        assert_eq!(detect(b"\0\x01\x02"), Format::Unknown);
    }
}
