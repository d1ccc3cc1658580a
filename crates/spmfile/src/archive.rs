//! Entries of ZIP archives, unpacked in memory and within limits.
//!
//! Nothing is ever written to a file, so that names with `..` or a leading `/` can do no harm; an
//! entry is taken by its full name only.

use std::io::{Cursor as Bytes, Read};

use zip::ZipArchive;

use crate::limits::unpacked_limit;

/// Largest header of an entry, bytes: that of an array has two bytes for its length.
const HEAD: u64 = 1 << 17;
/// More entries than an archive of scans has; every curve of a map is one or two.
const MOST_ENTRIES: usize = 1 << 22;

/// An archive and how much more of it may be unpacked.
pub(crate) struct Archive<'a> {
    zip: ZipArchive<Bytes<&'a [u8]>>,
    left: u64,
}

impl<'a> Archive<'a> {
    /// Reads the directory of an archive.
    pub(crate) fn open(bytes: &'a [u8]) -> Result<Self, String> {
        Self::with_limit(bytes, unpacked_limit(bytes.len()))
    }

    fn with_limit(bytes: &'a [u8], left: u64) -> Result<Self, String> {
        let zip = ZipArchive::new(Bytes::new(bytes)).map_err(|e| format!("its archive: {e}"))?;
        if zip.len() > MOST_ENTRIES {
            return Err(format!("its archive announces {} entries", zip.len()));
        }
        Ok(Self { zip, left })
    }

    /// Names of all entries, in the order of the archive.
    pub(crate) fn names(&self) -> Vec<String> {
        (0..self.zip.len())
            .filter_map(|index| Some(self.zip.name_for_index(index)?.ok()?.into_owned()))
            .collect()
    }

    /// The contents of an entry; `None` if there is no entry of that name.
    pub(crate) fn entry(&mut self, name: &str) -> Option<Result<Vec<u8>, String>> {
        let index = self.zip.index_for_name(name)?;
        Some(self.unpack(index, name))
    }

    /// The first bytes of an entry, without counting them.
    pub(crate) fn head(&mut self, name: &str) -> Result<Vec<u8>, String> {
        let entry = self.zip.by_name(name);
        let entry = entry.map_err(|e| format!("{name:?}: {e}"))?;
        let mut content = Vec::new();
        let read = entry.take(HEAD).read_to_end(&mut content);
        read.map_err(|e| format!("{name:?}: {e}"))?;
        Ok(content)
    }

    /// Counts the bytes of an entry that is unpacked later.
    pub(crate) fn reserve(&mut self, name: &str, length: usize) -> Result<(), String> {
        let length = length as u64;
        let left = self.left.checked_sub(length);
        self.left = left.ok_or_else(|| trap(name, length, self.left))?;
        Ok(())
    }

    fn unpack(&mut self, index: usize, name: &str) -> Result<Vec<u8>, String> {
        let entry = self
            .zip
            .by_index(index)
            .map_err(|e| format!("{name:?}: {e}"))?;
        if entry.size() > self.left {
            return Err(trap(name, entry.size(), self.left));
        }
        // The directory may lie about the length.
        let mut content = Vec::new();
        entry
            .take(self.left.saturating_add(1))
            .read_to_end(&mut content)
            .map_err(|e| format!("{name:?}: {e}"))?;
        let length = content.len() as u64;
        self.left = self
            .left
            .checked_sub(length)
            .ok_or_else(|| trap(name, length, self.left))?;
        Ok(content)
    }
}

fn trap(name: &str, length: u64, left: u64) -> String {
    format!(
        "{name:?} unpacks to {length} bytes or more, but {left} are allowed: the archive may be an attack"
    )
}

/// Makes archives for tests.
#[cfg(test)]
pub(crate) mod tests {
    use std::io::Write;

    use super::*;

    pub(crate) fn zip(entries: &[(&str, &[u8])]) -> Vec<u8> {
        let mut zip = zip::ZipWriter::new(Bytes::new(Vec::new()));
        let options = zip::write::SimpleFileOptions::default();
        for (name, content) in entries {
            zip.start_file(*name, options).expect("an entry");
            zip.write_all(content).expect("memory");
        }
        zip.finish().expect("memory").into_inner()
    }

    #[test]
    fn entries_are_unpacked_within_limits() {
        let bytes = zip(&[("a", &[0; 1000]), ("../b", b"text"), ("c", &[1; 1000])]);
        let mut archive = Archive::with_limit(&bytes, 1500).expect("an archive");
        assert_eq!(archive.names(), ["a", "../b", "c"]);
        assert!(archive.entry("b").is_none());
        assert_eq!(
            archive.entry("a").expect("there").expect("small").len(),
            1000
        );
        let error = archive.entry("c").expect("there").expect_err("too much");
        assert!(error.contains("500 are allowed"), "{error}");
        assert_eq!(
            archive.entry("../b").expect("there").expect("small"),
            b"text"
        );
    }

    /// The length in the directory is put down to 1 byte; 1000 bytes come out.
    #[test]
    fn a_lying_directory_is_found_out() {
        let mut bytes = zip(&[("a", &[0; 1000])]);
        for place in 0..bytes.len() - 4 {
            if bytes[place..place + 4] == 1000u32.to_le_bytes() {
                bytes[place..place + 4].copy_from_slice(&1u32.to_le_bytes());
            }
        }
        let mut archive = Archive::with_limit(&bytes, 500).expect("an archive");
        assert!(archive.entry("a").expect("there").is_err());
    }

    #[test]
    fn damaged_archives() {
        let bytes = zip(&[("a", &[7; 100])]);
        assert!(Archive::open(&bytes[..bytes.len() / 2]).is_err());
        assert!(Archive::open(b"PK\x03\x04").is_err());
    }
}
