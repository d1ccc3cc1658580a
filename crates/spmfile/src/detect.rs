//! Which format is this? Told by the first bytes, never by the name of the file.

use crate::format::Format;
use crate::readers::{Kind, READERS, Reader};
use crate::signature::{head, is_text};

/// First bytes of formats that are not read.
const OTHERS: [(&[u8], &str); 11] = [
    (b"GIF8", "a GIF picture"),
    (b"BM", "a BMP picture"),
    (b"%PDF", "a PDF document"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"CDF\x01", NETCDF),
    (b"CDF\x02", NETCDF),
    (b"CDF\x05", NETCDF),
    (
        b"Experiment\t",
        "a spectrum or a log of a Nanonis controller: no image",
    ),
    (b"[ParVERT", "a spectrum of a Createc controller: no image"),
    (b"?*File list", "a NanoScope text export"),
    (b"PK\x03\x04", "a ZIP archive"),
];

const NETCDF: &str =
    "a NetCDF file without an image of GXSM: save the image as Gwyddion, TIFF or NumPy array";
/// Words of the programs that write HDF5 files, within the first bytes; the last one is in none.
const PROGRAMS_OF_HDF5: [(&[u8], &str); 5] = [
    (b"jpk-", JPK),
    (b"Measurement_0", JPK),
    (b"IGOR", "an HDF5 file of Igor: save the wave as .ibw"),
    (
        b"NX_class",
        "a NeXus file (HDF5): save the image as Gwyddion, TIFF or NumPy array",
    ),
    (
        b"",
        "an HDF5 file: save the image as Gwyddion, TIFF or NumPy array",
    ),
];
const JPK: &str =
    "an HDF5 file of a JPK instrument (.h5-jpk): save the image as JPK (.jpk) or TIFF";

/// A file of a high-speed AFM: version 1, a header of 1 to 65535 bytes, 32 bytes for each frame, Japanese text.
fn is_asd(bytes: &[u8]) -> bool {
    matches!(
        bytes,
        [1, 0, 0, 0, _, _, 0, 0, 32, 0, 0, 0, 0xa4, 3, 0, 0, ..]
    )
}

/// What a file is that is not read, in words.
fn other(bytes: &[u8]) -> Option<&'static str> {
    if is_asd(bytes) {
        return Some("a film of a high-speed AFM (.asd): save frames as Gwyddion or TIFF");
    }
    if let Some((_, found)) = program_of_hdf5(bytes) {
        return Some(found);
    }
    let (_, found) = OTHERS.iter().find(|(magic, _)| bytes.starts_with(magic))?;
    Some(found)
}

/// Which program wrote an HDF5 file: its word, and what to do.
fn program_of_hdf5(bytes: &[u8]) -> Option<&'static (&'static [u8], &'static str)> {
    let head = head_of_hdf5(bytes)?;
    let by = |word: &[u8]| word.is_empty() || memchr::memmem::find(head, word).is_some();
    PROGRAMS_OF_HDF5.iter().find(|(word, _)| by(word))
}

/// An HDF5 file of no program that has a layout of its own.
#[cfg(all(feature = "hdf5", not(target_family = "wasm")))]
pub(crate) fn is_plain_hdf5(bytes: &[u8]) -> bool {
    program_of_hdf5(bytes).is_some_and(|(word, _)| word.is_empty() || *word == b"NX_class")
}

/// What HDF5 files begin with.
const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";

/// The bytes in which names of groups of an HDF5 file stand, mostly.
pub(crate) fn head_of_hdf5(bytes: &[u8]) -> Option<&[u8]> {
    let head = &bytes[..bytes.len().min(1 << 20)];
    head.starts_with(HDF5).then_some(head)
}

/// Tells the format from the first bytes of a file; a few hundred are enough but for TIFF files,
/// whose directory may lie anywhere.
pub fn detect(bytes: &[u8]) -> Format {
    if bytes.is_empty() {
        return Format::Empty;
    }
    if let Some(reader) = READERS.iter().find(|reader| reader.signature.fits(bytes)) {
        return reader.format;
    }
    if let Some(found) = other(bytes) {
        return Format::Other(found);
    }
    if is_text(head(bytes)) {
        Format::Text
    } else {
        Format::Unknown
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
    /// user has to say that they are scans, by naming them. Logs that go with scans do not count.
    pub fn is_scan(self) -> bool {
        Reader::of(self).is_some_and(|reader| reader.kind == Kind::Scan)
    }

    /// Whether files of this kind are arrays or pictures, which tell nothing of a frame: see [`crate::arrays`].
    pub fn is_array(self) -> bool {
        Reader::of(self).is_some_and(|reader| reader.kind == Kind::Array)
    }

    /// The format in words, as in `Nanonis`; `None` for what is not read.
    pub fn name(self) -> Option<&'static str> {
        Reader::of(self).map(|reader| reader.name)
    }

    /// What names of its files end with, without the dot: usual ones, of which no name is believed.
    pub fn extensions(self) -> &'static [&'static str] {
        Reader::of(self).map_or(&[], |reader| reader.names)
    }
}

/// Whether a file of this name should be a scan: instruments have extensions of their own, and number files,
/// `scan.002`.
///
/// For saying of a file that it is empty, cut off or something else; [`detect`] never looks at names.
pub fn named_like_scan(name: &str) -> bool {
    let Some((stem, extension)) = name.rsplit_once('.') else {
        return false;
    };
    let number = extension.len() == 3 && extension.bytes().all(|b| b.is_ascii_digit());
    let known = |known: &&str| extension.eq_ignore_ascii_case(known);
    let known = READERS
        .iter()
        .any(|reader| reader.own_names.iter().any(known));
    !stem.is_empty() && (number || known || extension.ends_with("_mtrx"))
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
