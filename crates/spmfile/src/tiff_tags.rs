//! The directories of a TIFF file with their private tags, and its plain images.
//!
//! For instruments that keep their data in TIFF containers (JPK, Park); pictures go through a
//! library. In: the bytes of a file; out: tags as numbers, texts and bytes, and samples as stored.
//! TIFF 6.0 specification (Adobe, 1992), section 2.

use std::borrow::Cow;
use std::ops::RangeInclusive;

use crate::cursor::{Cursor, Endian};
use crate::raster::Encoding;
use crate::words;

/// Tags of pictures, from the kind of the image to the tables of JPEG; private ones are larger.
const OF_PICTURES: RangeInclusive<u16> = 254..=347;
/// More directories than any instrument writes.
const MOST_DIRECTORIES: usize = 1024;

const WIDTH: u16 = 256;
const HEIGHT: u16 = 257;
const BITS: u16 = 258;
const COMPRESSION: u16 = 259;
const STRIP_OFFSETS: u16 = 273;
const SAMPLES_PER_PIXEL: u16 = 277;
const STRIP_LENGTHS: u16 = 279;
const SAMPLE_FORMAT: u16 = 339;

/// One directory: an image and its tags.
#[derive(Debug)]
pub(crate) struct Directory<'a> {
    bytes: &'a [u8],
    pub(crate) endian: Endian,
    entries: Vec<Entry<'a>>,
    /// The first tag of pictures whose values lie outside the file.
    pub(crate) outside: Option<u16>,
}

#[derive(Debug)]
struct Entry<'a> {
    tag: u16,
    kind: u16,
    value: &'a [u8],
}

/// Shape and kind of the samples of an image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) encoding: Encoding,
}

/// Width of a value of a kind; 0 where the kind is unknown.
fn width(kind: u16) -> usize {
    match kind {
        1 | 2 | 6 | 7 => 1,
        3 | 8 => 2,
        4 | 9 | 11 => 4,
        5 | 10 | 12 => 8,
        _ => 0,
    }
}

/// Every directory of a file. Tags whose values lie outside the file are left out.
pub(crate) fn directories(bytes: &[u8]) -> Result<Vec<Directory<'_>>, String> {
    let endian = match bytes {
        [b'I', b'I', ..] => Endian::Little,
        [b'M', b'M', ..] => Endian::Big,
        _ => return Err("expected the byte order II or MM, found neither".to_owned()),
    };
    let file = Cursor::new(bytes, endian);
    let mut next = file.at(4).u32()? as usize;
    let mut directories = Vec::new();
    // Directories that share their entries would multiply the memory taken.
    let mut entries_left = bytes.len() / 12;
    while next != 0 {
        let mut cursor = file.at(next);
        let count = usize::from(cursor.u16()?);
        if directories.len() == MOST_DIRECTORIES || count > entries_left {
            return Err("its directories overlap or run in a circle".to_owned());
        }
        entries_left -= count;
        let mut entries = Vec::with_capacity(count);
        let mut outside = None;
        for _ in 0..count {
            let (tag, kind, number) = (cursor.u16()?, cursor.u16()?, cursor.u32()?);
            let length = (number as usize).checked_mul(width(kind));
            let inline = cursor.clone();
            let target = cursor.u32()? as usize;
            let value = length.filter(|&length| length > 0).and_then(|length| {
                let mut place = if length <= 4 { inline } else { file.at(target) };
                place.slice(length, "a tag").ok()
            });
            match value {
                Some(value) => entries.push(Entry { tag, kind, value }),
                None if OF_PICTURES.contains(&tag) && number > 0 && width(kind) > 0 => {
                    outside = outside.or(Some(tag));
                }
                None => {}
            }
        }
        directories.push(Directory {
            bytes,
            endian,
            entries,
            outside,
        });
        next = cursor.u32()? as usize;
    }
    Ok(directories)
}

impl<'a> Directory<'a> {
    fn entry(&self, tag: u16) -> Option<&Entry<'a>> {
        self.entries.iter().find(|entry| entry.tag == tag)
    }

    /// The bytes of a tag, whatever they are.
    pub(crate) fn raw(&self, tag: u16) -> Option<&'a [u8]> {
        self.entry(tag).map(|entry| entry.value)
    }

    /// A text without its end mark.
    pub(crate) fn text(&self, tag: u16) -> Option<String> {
        let entry = self.entry(tag).filter(|entry| entry.kind == 2)?;
        let end = memchr::memchr(0, entry.value).unwrap_or(entry.value.len());
        Some(words::decode(&entry.value[..end]).trim().to_owned())
    }

    /// The first number of a tag.
    pub(crate) fn number(&self, tag: u16) -> Option<f64> {
        let entry = self.entry(tag)?;
        let mut cursor = Cursor::new(entry.value, self.endian);
        match entry.kind {
            1 => cursor.u8().map(f64::from),
            3 => cursor.u16().map(f64::from),
            4 => cursor.u32().map(f64::from),
            5 => cursor
                .u32()
                .and_then(|n| Ok(f64::from(n) / f64::from(cursor.u32()?))),
            6 => cursor.i8().map(f64::from),
            8 => cursor.i16().map(f64::from),
            9 => cursor.i32().map(f64::from),
            11 => cursor.f32().map(f64::from),
            12 => cursor.f64(),
            _ => return None,
        }
        .ok()
    }

    /// The first number of a tag, if it is a count.
    pub(crate) fn count(&self, tag: u16) -> Option<usize> {
        let number = self.number(tag)?;
        (number >= 0.0 && number.fract() == 0.0).then_some(number as usize)
    }

    /// Numbers and texts of all tags that begin a metadata list, as words.
    pub(crate) fn words(&self, tag: u16) -> Option<String> {
        self.text(tag)
            .or_else(|| self.number(tag).map(|number| number.to_string()))
    }

    /// Shape of the image, if its samples can be taken as they lie in the file.
    pub(crate) fn shape(&self) -> Result<Shape, String> {
        let tag = |tag: u16, name: &str| {
            self.count(tag)
                .ok_or_else(|| format!("expected the tag {name}, found none"))
        };
        let (columns, rows) = (tag(WIDTH, "ImageWidth")?, tag(HEIGHT, "ImageLength")?);
        let compression = self.count(COMPRESSION).unwrap_or(1);
        if compression != 1 {
            return Err(format!(
                "expected samples as they are (compression 1), found compression {compression}"
            ));
        }
        let per_pixel = self.count(SAMPLES_PER_PIXEL).unwrap_or(1);
        if per_pixel != 1 {
            return Err(format!(
                "expected one sample per pixel, found {per_pixel}: it is a coloured picture"
            ));
        }
        let bits = tag(BITS, "BitsPerSample")?;
        let format = self.count(SAMPLE_FORMAT).unwrap_or(1);
        let encoding = match (format, bits) {
            (1, 8) => Encoding::U8,
            (1, 16) => Encoding::U16,
            (1, 32) => Encoding::U32,
            (2, 8) => Encoding::I8,
            (2, 16) => Encoding::I16,
            (2, 32) => Encoding::I32,
            (3, 32) => Encoding::F32,
            (3, 64) => Encoding::F64,
            _ => {
                return Err(format!(
                    "expected samples of 8, 16, 32 or 64 bits, found {bits} bits of format {format}"
                ));
            }
        };
        Ok(Shape {
            rows,
            columns,
            encoding,
        })
    }

    /// The `length` bytes of the image, its strips one behind the other; the error says how many of
    /// them lie within the file. No more is taken than the file is long.
    pub(crate) fn image(&self, length: usize) -> Result<Cow<'a, [u8]>, String> {
        let missing =
            |found: usize| format!("it is {found} bytes long, but its header promises {length}");
        if length > self.bytes.len() {
            return Err(missing(0));
        }
        let offsets = self.list(STRIP_OFFSETS);
        let lengths = self.list(STRIP_LENGTHS);
        // One strip after the other, as they mostly lie: nothing to copy.
        let joined = offsets.first().and_then(|&start| {
            let mut end = start;
            for (&offset, &length) in offsets.iter().zip(&lengths) {
                if offset != end {
                    return None;
                }
                end = end.checked_add(length)?;
            }
            (end.checked_sub(start)? >= length).then_some(start)
        });
        if let Some(start) = joined {
            let end = start.checked_add(length);
            let block = end.and_then(|end| self.bytes.get(start..end));
            return block
                .map(Cow::Borrowed)
                .ok_or_else(|| missing(self.bytes.len().saturating_sub(start)));
        }
        let mut block = Vec::with_capacity(length);
        for (&offset, &strip) in offsets.iter().zip(&lengths) {
            let take = strip.min(length - block.len());
            let end = offset.checked_add(take);
            match end.and_then(|end| self.bytes.get(offset..end)) {
                Some(bytes) => block.extend_from_slice(bytes),
                None => return Err(missing(block.len())),
            }
        }
        if block.len() < length {
            return Err(missing(block.len()));
        }
        Ok(Cow::Owned(block))
    }

    /// All numbers of a tag of whole numbers.
    fn list(&self, tag: u16) -> Vec<usize> {
        let Some(entry) = self.entry(tag) else {
            return Vec::new();
        };
        let number = |bytes: &[u8]| {
            let mut cursor = Cursor::new(bytes, self.endian);
            let number = match entry.kind {
                3 => cursor.u16().map(u32::from),
                4 => cursor.u32(),
                _ => return None,
            };
            number.ok().map(|number| number as usize)
        };
        entry
            .value
            .chunks_exact(width(entry.kind).max(1))
            .map_while(number)
            .collect()
    }
}

/// Makes small files for tests.
#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A value of a tag, with its kind.
    pub(crate) enum Value {
        Short(u16),
        Long(Vec<u32>),
        Double(f64),
        Text(&'static str),
        Bytes(Vec<u8>),
    }

    /// Tags and strips.
    pub(crate) type Page = (Vec<(u16, Value)>, Vec<Vec<u8>>);

    /// A file of directories, each with tags and the bytes of its image in strips.
    pub(crate) fn file(endian: Endian, pages: &[Page]) -> Vec<u8> {
        let big = endian == Endian::Big;
        let u16b = |n: u16| {
            if big {
                n.to_be_bytes()
            } else {
                n.to_le_bytes()
            }
        };
        let u32b = |n: u32| {
            if big {
                n.to_be_bytes()
            } else {
                n.to_le_bytes()
            }
        };
        let mut bytes = if big {
            b"MM\0*".to_vec()
        } else {
            b"II*\0".to_vec()
        };
        let mut link = bytes.len();
        bytes.extend([0; 4]);
        for (tags, strips) in pages {
            let place = |bytes: &mut Vec<u8>, block: &[u8]| {
                let at = bytes.len() as u32;
                bytes.extend(block);
                at
            };
            let mut entries = Vec::new();
            let offsets: Vec<u32> = strips.iter().map(|s| place(&mut bytes, s)).collect();
            let lengths = strips.iter().map(|s| s.len() as u32).collect();
            let own = [
                (STRIP_OFFSETS, Value::Long(offsets)),
                (STRIP_LENGTHS, Value::Long(lengths)),
            ];
            for (tag, value) in tags.iter().chain(&own) {
                let (kind, count, block) = match value {
                    Value::Short(n) => (3, 1, u16b(*n).to_vec()),
                    Value::Long(list) => {
                        let block = list.iter().flat_map(|&n| u32b(n)).collect();
                        (4, list.len(), block)
                    }
                    Value::Double(n) if big => (12, 1, n.to_be_bytes().to_vec()),
                    Value::Double(n) => (12, 1, n.to_le_bytes().to_vec()),
                    Value::Text(text) => {
                        let block: Vec<u8> = text.bytes().chain([0]).collect();
                        (2, block.len(), block)
                    }
                    Value::Bytes(block) => (7, block.len(), block.clone()),
                };
                let mut inline = block;
                if inline.len() > 4 {
                    inline = u32b(place(&mut bytes, &inline)).to_vec();
                }
                inline.resize(4, 0);
                entries.extend(u16b(*tag));
                entries.extend(u16b(kind));
                entries.extend(u32b(count as u32));
                entries.extend(inline);
            }
            let here = u32b(bytes.len() as u32);
            bytes[link..link + 4].copy_from_slice(&here);
            bytes.extend(u16b((entries.len() / 12) as u16));
            bytes.extend(entries);
            link = bytes.len();
            bytes.extend([0; 4]);
        }
        bytes
    }

    /// Tags of an image of signed numbers.
    pub(crate) fn plain(rows: u16, columns: u16, bits: u16) -> Vec<(u16, Value)> {
        vec![
            (WIDTH, Value::Short(columns)),
            (HEIGHT, Value::Short(rows)),
            (BITS, Value::Short(bits)),
            (COMPRESSION, Value::Short(1)),
            (SAMPLE_FORMAT, Value::Short(2)),
        ]
    }

    #[test]
    fn strips_are_joined_in_either_byte_order() {
        for endian in [Endian::Little, Endian::Big] {
            let mut tags = plain(2, 2, 16);
            tags.push((0x8042, Value::Double(1.5)));
            tags.push((0x8050, Value::Text("height")));
            let strips = vec![vec![1, 2, 3, 4], vec![5, 6, 7, 8]];
            let bytes = file(endian, &[(tags, strips), (plain(1, 2, 16), vec![])]);
            let pages = directories(&bytes).expect("two pages");
            assert_eq!(pages.len(), 2);
            assert_eq!(pages[0].number(0x8042), Some(1.5));
            assert_eq!(pages[0].text(0x8050).as_deref(), Some("height"));
            assert_eq!(pages[0].number(0x8050), None);
            assert_eq!(
                &*pages[0].image(8).expect("whole"),
                [1, 2, 3, 4, 5, 6, 7, 8]
            );
            assert!(
                pages[0]
                    .image(9)
                    .expect_err("too long")
                    .contains("promises 9")
            );
            assert!(pages[1].image(4).is_err());
            let shape = pages[0].shape().expect("plain");
            assert_eq!(
                (shape.rows, shape.columns, shape.encoding),
                (2, 2, Encoding::I16)
            );
        }
    }

    #[test]
    fn circles_and_foreign_images_are_refused() {
        let mut bytes = file(Endian::Little, &[(plain(1, 1, 16), vec![vec![0, 0]])]);
        let start = u32::from_le_bytes([bytes[4], bytes[5], bytes[6], bytes[7]]);
        let end = bytes.len();
        bytes[end - 4..].copy_from_slice(&start.to_le_bytes());
        let error = directories(&bytes).expect_err("a circle");
        assert!(error.contains("circle"), "{error}");
        assert!(directories(&bytes[..end - 1]).is_err());
        assert!(directories(b"II*\0\xff\xff\xff\xff").is_err());

        let shape = |change: (u16, Value)| {
            let mut tags = plain(1, 1, 16);
            tags.retain(|(tag, _)| *tag != change.0);
            tags.push(change);
            let bytes = file(Endian::Little, &[(tags, vec![])]);
            let pages = directories(&bytes).expect("one page");
            pages[0].shape().expect_err("not plain")
        };
        assert!(shape((COMPRESSION, Value::Short(5))).contains("compression 5"));
        assert!(shape((SAMPLES_PER_PIXEL, Value::Short(3))).contains('3'));
        assert!(shape((BITS, Value::Short(12))).contains("12 bits"));
    }
}
