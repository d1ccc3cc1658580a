//! Which format is this? Told by the first bytes, never by the name of the file.

use crate::cursor::{Cursor, Endian};

/// What the first bytes of a file say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// NanoScope images.
    NanoScope,
    /// NanoScope force curves or a force volume.
    NanoScopeForce,
    /// Nanonis scan (`.sxm`).
    Nanonis,
    /// Gwyddion container (`.gwy`).
    Gwy,
    /// Gwyddion simple field (`.gsf`).
    Gsf,
    /// Gwyddion XYZ field (`.gxyzf`).
    Gxyzf,
    /// Igor binary wave (`.ibw`), as of Asylum instruments.
    Igor,
    /// JPK image (`.jpk`, `.jpk-qi-image`), a TIFF container.
    Jpk,
    /// JPK archive (`.jpk-force`, `.jpk-force-map`, `.jpk-qi-data`), a ZIP container.
    JpkZip,
    /// Nanosurf (`.nid`).
    Nid,
    /// Park Systems (`.tiff`), a TIFF container.
    ParkTiff,
    /// `WSxM` (`.stp`, `.top` …).
    Wsxm,
    /// RHK (`.sm4` and its elders).
    Rhk,
    /// Agilent, Molecular Imaging (`.mi`).
    AgilentMi,
    /// Omicron Matrix, the file of a channel (`.Z_mtrx`).
    OmicronMatrix,
    /// Omicron Matrix, the log of a session (`_0001.mtrx`).
    OmicronMatrixLog,
    /// ISO 28632 text (`ISO/TC 201 SPM data transfer format`), often named `.spm`.
    Iso28632,
    /// `NumPy` array.
    Npy,
    /// Archive of `NumPy` arrays.
    Npz,
    /// TIFF that no instrument is known for.
    Tiff,
    /// PNG picture.
    Png,
    /// JPEG picture.
    Jpeg,
    /// A matrix of numbers as text.
    TextMatrix,
    /// Some other kind of file, in words.
    Other(&'static str),
    /// Readable text of unknown meaning.
    Text,
    /// No bytes at all.
    Empty,
    /// Nothing known.
    Unknown,
}

/// First bytes that say it all.
const SIGNATURES: [(&[u8], Format); 20] = [
    (b":NANONIS_VERSION:", Format::Nanonis),
    (b"GWYP", Format::Gwy),
    (b"GWYO", Format::Gwy),
    (b"Gwyddion Simple Field", Format::Gsf),
    (b"Gwyddion XYZ Field", Format::Gxyzf),
    (b"[DataSet]", Format::Nid),
    (b"WSxM file", Format::Wsxm),
    (b"fileType ", Format::AgilentMi),
    (b"ONTMATRX0101ATEM", Format::OmicronMatrixLog),
    (b"ONTMATRX", Format::OmicronMatrix),
    (b"ISO/TC 201 SPM data transfer format", Format::Iso28632),
    (b"\x93NUMPY", Format::Npy),
    (b"\xff\xd8\xff", Format::Jpeg),
    (b"\x89PNG\r\n\x1a\n", Format::Png),
    (b"GIF8", Format::Other("a GIF picture")),
    (b"BM", Format::Other("a BMP picture")),
    (b"%PDF", Format::Other("a PDF document")),
    (b"\x1f\x8b", Format::Other("a gzip archive")),
    (b"\x89HDF\r\n\x1a\n", Format::Other("an HDF5 file")),
    (b"?*File list", Format::Other("a NanoScope text export")),
];

/// Private tags that mark the TIFF files of an instrument: first, last, format.
const TIFF_TAGS: [(u16, u16, Format); 2] = [
    (50432, 50441, Format::ParkTiff),
    (0x8000, 0x80ff, Format::Jpk),
];

/// Tells the format from the first bytes of a file; a few hundred are enough but for TIFF files,
/// whose directory may lie anywhere.
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
    if let Some((_, format)) = SIGNATURES.iter().find(|(magic, _)| head.starts_with(magic)) {
        return *format;
    }
    if head.starts_with(b"PK\x03\x04") {
        return zip(head);
    }
    // RHK: the text stands behind a length, in UTF-16 since version 4.
    let rhk = b"STiMage";
    let wide: Vec<u8> = rhk.iter().flat_map(|&b| [b, 0]).collect();
    if head.starts_with(rhk) || head[2.min(head.len())..].starts_with(&wide) {
        return Format::Rhk;
    }
    if head.starts_with(b"II*\0") {
        return tiff(bytes, Endian::Little);
    }
    if head.starts_with(b"MM\0*") {
        return tiff(bytes, Endian::Big);
    }
    // BigTIFF; no instrument is known to use it.
    if head.starts_with(b"II+\0") || head.starts_with(b"MM\0+") {
        return Format::Tiff;
    }
    if igor(head) {
        return Format::Igor;
    }
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    let printable = |b: &u8| *b >= 0x20 || matches!(b, b'\t' | b'\n' | b'\r');
    if !text.iter().all(printable) {
        Format::Unknown
    } else if numbers_only(behind_comments(bytes)) {
        Format::TextMatrix
    } else {
        Format::Text
    }
}

/// Whether a file that begins like this is meant to be a scan, readable or not: see [`Format::is_scan`].
pub fn looks_like_scan(head: &[u8]) -> bool {
    detect(head).is_scan()
}

impl Format {
    /// Whether files of this kind are meant to be scans, readable or not.
    ///
    /// For picking the scans out of a folder that also holds notes, pictures and arrays: of these the
    /// user has to say that they are scans, by naming them. Logs that go with scans are none.
    pub fn is_scan(self) -> bool {
        let is_none = matches!(
            self,
            Self::OmicronMatrixLog | Self::Text | Self::Other(_) | Self::Empty | Self::Unknown
        );
        !is_none && !self.is_array()
    }

    /// Whether files of this kind are arrays or pictures, which tell nothing of a frame: see [`crate::arrays`].
    pub fn is_array(self) -> bool {
        matches!(
            self,
            Self::Npy | Self::Npz | Self::Tiff | Self::Png | Self::Jpeg | Self::TextMatrix
        )
    }
}

/// Whether a file of this name should be a scan: instruments have extensions of their own, and number files,
/// `scan.002`.
///
/// For saying of a file that it is empty, cut off or something else; [`detect`] never looks at names.
pub fn named_like_scan(name: &str) -> bool {
    const EXTENSIONS: [&str; 15] = [
        "spm",
        "sxm",
        "gwy",
        "gsf",
        "gxyzf",
        "ibw",
        "jpk",
        "jpk-qi-image",
        "nid",
        "stp",
        "top",
        "sm2",
        "sm3",
        "sm4",
        "mi",
    ];
    let Some((stem, extension)) = name.rsplit_once('.') else {
        return false;
    };
    let number = extension.len() == 3 && extension.bytes().all(|b| b.is_ascii_digit());
    let known = |known: &&str| extension.eq_ignore_ascii_case(known);
    !stem.is_empty() && (number || EXTENSIONS.iter().any(known) || extension.ends_with("_mtrx"))
}

/// A TIFF file's first directory tells whose it is.
fn tiff(bytes: &[u8], endian: Endian) -> Format {
    let tags = || -> Result<Vec<u16>, String> {
        let start = Cursor::new(bytes, endian).at(4).u32()?;
        let mut directory = Cursor::new(bytes, endian).at(start as usize);
        let count = directory.u16()?;
        let mut tags = Vec::new();
        for _ in 0..count {
            match directory.u16() {
                Ok(tag) => tags.push(tag),
                Err(_) => break,
            }
            if directory.skip(10).is_err() {
                break;
            }
        }
        Ok(tags)
    };
    let tags = tags().unwrap_or_default();
    TIFF_TAGS
        .iter()
        .find(|(first, last, _)| tags.iter().any(|tag| (first..=last).contains(&tag)))
        .map_or(Format::Tiff, |(_, _, format)| *format)
}

/// A ZIP archive is told by the name of its first entry.
fn zip(head: &[u8]) -> Format {
    let name = || -> Result<&[u8], String> {
        let mut cursor = Cursor::new(head, Endian::Little).at(26);
        let length = usize::from(cursor.u16()?);
        cursor.skip(2)?;
        cursor.slice(length, "a name")
    };
    let name = name().unwrap_or_default();
    let folder = |prefix: &[u8]| name.starts_with(prefix);
    if name.ends_with(b".npy") {
        Format::Npz
    } else if name == b"header.properties"
        || name.ends_with(b".jpk-qi-image")
        || [&b"index/"[..], b"segments/", b"shared-data/", b"data-image"]
            .iter()
            .any(|prefix| folder(prefix))
    {
        Format::JpkZip
    } else {
        Format::Other("a ZIP archive")
    }
}

/// An Igor binary wave has no signature: a version, and a kind of number that exists.
fn igor(head: &[u8]) -> bool {
    let little = matches!(head, [1..=3 | 5, 0, ..]);
    let big = matches!(head, [0, 1..=3 | 5, ..]);
    if !little && !big {
        return false;
    }
    let endian = if little { Endian::Little } else { Endian::Big };
    let cursor = Cursor::new(head, endian);
    // The place of the wave's type in its header.
    let place = match cursor.clone().u16() {
        Ok(1) => 8,
        Ok(2) => 16,
        Ok(3) => 20,
        _ => 80,
    };
    let kind = cursor.at(place).u16();
    // Bits: complex 1, float 2, double 4, 8-, 16-, 32-bit integer 8, 16, 32, unsigned 64; 0 is text.
    kind.is_ok_and(|kind| kind == 0 || matches!(kind & !0x41, 2 | 4 | 8 | 16 | 32 | 128))
}

/// So many bytes tell the format.
const HEAD: usize = 512;

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
        assert_eq!(detect(b"\xff\xd8\xff\xe0\0\x10JFIF"), Format::Jpeg);
        assert_eq!(detect("Grüße aus dem Labor\n".as_bytes()), Format::Text);
        assert_eq!(detect(b"\0\x01\x02"), Format::Unknown);
        assert_eq!(
            detect(b"# nm\n1.0 2e-3\n-4\tNaN\n0.5 0."),
            Format::TextMatrix
        );
        assert_eq!(detect(b"1 apple\n"), Format::Text);
        let comments = "# a comment of some length\n".repeat(40);
        let long = "-1.25e-3,".repeat(200);
        for text in [format!("{comments}{long}1\n"), format!("{long}1\n")] {
            assert_eq!(detect(text.as_bytes()), Format::TextMatrix);
        }
        assert_eq!(detect(comments.as_bytes()), Format::Text);
        assert_eq!(
            detect(format!("{comments}1 apple\n").as_bytes()),
            Format::Text
        );
    }

    #[test]
    fn private_tags_tell_instruments_from_pictures() {
        let tiff = |tag: u16| {
            let mut bytes = b"II*\0\x08\0\0\0\x01\0".to_vec();
            bytes.extend(tag.to_le_bytes());
            bytes.extend([0; 14]);
            detect(&bytes)
        };
        assert_eq!(tiff(50434), Format::ParkTiff);
        assert_eq!(tiff(0x8001), Format::Jpk);
        assert_eq!(tiff(256), Format::Tiff);
        assert_eq!(detect(b"MM\0*\xff\xff\xff\xff"), Format::Tiff);
    }

    #[test]
    fn the_first_entry_tells_archives_apart() {
        let zip = |name: &str| {
            let mut bytes = b"PK\x03\x04".to_vec();
            bytes.extend([0; 22]);
            bytes.extend((name.len() as u16).to_le_bytes());
            bytes.extend([0; 2]);
            bytes.extend(name.bytes());
            detect(&bytes)
        };
        assert_eq!(zip("phase.npy"), Format::Npz);
        assert_eq!(zip("header.properties"), Format::JpkZip);
        assert_eq!(zip("letter.txt"), Format::Other("a ZIP archive"));
    }

    #[test]
    fn folders_hold_scans_and_other_things() {
        assert!(looks_like_scan(b":NANONIS_VERSION:\n2\n"));
        assert!(looks_like_scan(b"\\*Force file list\r\n"));
        assert!(!looks_like_scan(b"\x93NUMPY\x01\0"));
        assert!(!looks_like_scan(b"1 2 3\n4 5 6\n"));
        assert!(looks_like_scan(b"ONTMATRX0101TLKB"));
        assert!(!looks_like_scan(b"ONTMATRX0101ATEM"));
        assert!(!looks_like_scan(b""));
    }

    #[test]
    fn names_of_scans() {
        for name in ["a.spm", "scan.002", "x.0_00001.SPM", "b.Z_mtrx", "c.sm4"] {
            assert!(named_like_scan(name), "{name}");
        }
        for name in [
            "spm", ".spm", "a.2024", "a.txt", "a.npy", "a.mtrx", "a.tiff", "a.12",
        ] {
            assert!(!named_like_scan(name), "{name}");
        }
    }
}
