//! The array format of `NumPy`, versions 1 to 3.
//!
//! In: the first bytes of a file; out: where its image is. The header is a Python dictionary of three keys
//! (`numpy.lib.format`), read here by its keys rather than as Python.

use super::plane::{Plane, Trouble};
use crate::cursor::{Cursor, Endian};
use crate::outline::Input;
use crate::raster::{self, Encoding, Order};
use crate::scan::Samples;
use crate::stored::{Failure, Flat, Stored, Unpacked};
use crate::words;

const MAGIC: &[u8] = b"\x93NUMPY";
const TOP_FIRST: Order = Order {
    top_first: true,
    mirrored: false,
};

/// The header of an array of two dimensions, not counting those of length 1 where there are more.
pub(super) struct Array {
    pub(super) rows: usize,
    pub(super) columns: usize,
    encoding: Encoding,
    endian: Endian,
    /// Whether it is stored column by column.
    fortran: bool,
    /// First byte of the samples.
    start: usize,
    /// Bytes of the samples.
    pub(super) length: usize,
}

/// Reads the header of an array.
pub(super) fn header(bytes: &[u8]) -> Result<Array, Trouble> {
    let mut cursor = Cursor::new(bytes, Endian::Little);
    if cursor.slice(MAGIC.len(), "the mark of an array")? != MAGIC {
        return Err("expected the mark of an array, found other bytes".into());
    }
    let major = cursor.u8()?;
    cursor.skip(1)?;
    let length = match major {
        1 => usize::from(cursor.u16()?),
        2 | 3 => cursor.u32()? as usize,
        other => return Err(format!("expected version 1, 2 or 3, found {other}").into()),
    };
    let header = words::decode(cursor.slice(length, "a header")?);
    let (encoding, endian) = kind(&header)?;
    let [rows, columns] = shape(&header)?;
    let length = raster::byte_length(rows, columns, encoding)
        .ok_or_else(|| format!("its shape is {rows} × {columns}"))?;
    Ok(Array {
        rows,
        columns,
        encoding,
        endian,
        fortran: value(&header, "fortran_order")?.starts_with("True"),
        start: cursor.position(),
        length,
    })
}

impl Array {
    /// Whether a file of `available` bytes holds its samples.
    fn fits(&self, available: u64) -> Result<(), String> {
        let left = available.saturating_sub(self.start as u64);
        if left < self.length as u64 {
            return Err(format!(
                "it holds {left} bytes of samples but its header promises {}",
                self.length
            ));
        }
        Ok(())
    }

    /// Decodes the samples of an array whose bytes are all there.
    pub(super) fn samples(&self, bytes: &[u8]) -> Result<Samples, String> {
        self.fits(bytes.len() as u64)?;
        let block = &bytes[self.start..self.start + self.length];
        let ordered;
        let block = if self.fortran {
            ordered = transposed(block, self.rows, self.columns, self.encoding.width());
            &ordered
        } else {
            block
        };
        Ok(raster::decode(
            block,
            self.columns,
            self.encoding,
            self.endian,
            TOP_FIRST,
        ))
    }
}

/// Finds the image of a file of which the first bytes are given.
pub(super) fn open<'a>(input: &Input<'a>) -> Result<Plane<'a>, Trouble> {
    let array = header(input.bytes)?;
    array.fits(input.length)?;
    let (rows, columns) = (array.rows, array.columns);
    let samples = if array.fortran {
        let bytes = input.bytes;
        let samples = move || {
            let samples = array.samples(bytes).map_err(Failure::channel)?;
            Ok(Unpacked::measured(samples))
        };
        Stored::Packed(Box::new(samples))
    } else {
        let flat = Flat::at(array.start, array.encoding, array.endian);
        Stored::Flat(flat.in_order(TOP_FIRST))
    };
    Ok(Plane {
        rows,
        columns,
        samples,
        carried: Vec::new(),
        size_nm: None,
    })
}

/// The text behind a key of the header.
fn value<'a>(header: &'a str, key: &str) -> Result<&'a str, String> {
    let found = ['\'', '"'].iter().find_map(|quote| {
        let (_, rest) = header.split_once(&format!("{quote}{key}{quote}"))?;
        rest.trim_start().strip_prefix(':')
    });
    let value = found.ok_or_else(|| format!("expected {key:?} in its header, found none"))?;
    Ok(value.trim_start())
}

/// How the samples are stored.
fn kind(header: &str) -> Result<(Encoding, Endian), Trouble> {
    let value = value(header, "descr")?;
    let descr: String = value
        .strip_prefix(['\'', '"'])
        .map(|rest| {
            rest.chars()
                .take_while(|c| !matches!(c, '\'' | '"'))
                .collect()
        })
        .ok_or_else(|| {
            Trouble::NotRead("expected numbers, found records of several fields".to_owned())
        })?;
    let (order, kind) = descr.split_at_checked(1).unwrap_or(("", ""));
    let endian = match order {
        "<" | "|" | "=" => Endian::Little,
        ">" => Endian::Big,
        _ => return Err(format!("expected an order of bytes, found {descr:?}").into()),
    };
    let encoding = match kind {
        "b1" | "u1" => Encoding::U8,
        "i1" => Encoding::I8,
        "i2" => Encoding::I16,
        "u2" => Encoding::U16,
        "i4" => Encoding::I32,
        "u4" => Encoding::U32,
        "i8" => Encoding::I64,
        "u8" => Encoding::U64,
        "f2" => Encoding::F16,
        "f4" => Encoding::F32,
        "f8" => Encoding::F64,
        "c8" | "c16" => {
            return Err(Trouble::NotRead(format!(
                "expected real numbers, found complex ones (type {descr:?}); save their real part, size or phase"
            )));
        }
        _ => {
            return Err(Trouble::NotRead(format!(
                "expected real numbers, found the type {descr:?}"
            )));
        }
    };
    Ok((encoding, endian))
}

/// Lines and samples.
fn shape(header: &str) -> Result<[usize; 2], Trouble> {
    let text = value(header, "shape")?;
    let inner = text
        .strip_prefix('(')
        .and_then(|rest| rest.split_once(')'))
        .map(|(inner, _)| inner)
        .ok_or("expected a shape in brackets, found none")?;
    let axes: Option<Vec<usize>> = inner
        .split(',')
        .map(str::trim)
        .filter(|axis| !axis.is_empty())
        // Python 2 wrote long integers with an L.
        .map(|axis| axis.trim_end_matches('L').parse().ok())
        .collect();
    let axes =
        axes.ok_or_else(|| format!("expected whole numbers in its shape, found {inner:?}"))?;
    if let [rows, columns] = axes[..] {
        return Ok([rows, columns]);
    }
    let long: Vec<usize> = axes.iter().copied().filter(|&n| n != 1).collect();
    match long[..] {
        [rows, columns] if axes.len() > 2 => Ok([rows, columns]),
        _ => Err(Trouble::NotRead(format!(
            "expected an array of two dimensions, found the shape ({inner})"
        ))),
    }
}

/// An array stored column by column, line by line.
fn transposed(block: &[u8], rows: usize, columns: usize, width: usize) -> Vec<u8> {
    let mut lines = Vec::with_capacity(block.len());
    for row in 0..rows {
        for column in 0..columns {
            let start = (column * rows + row) * width;
            lines.extend_from_slice(&block[start..start + width]);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows, columns and samples.
    fn read(bytes: &[u8]) -> Result<(usize, usize, Samples), String> {
        let array = super::header(bytes).map_err(Trouble::reason)?;
        Ok((array.rows, array.columns, array.samples(bytes)?))
    }

    fn array(version: u8, header: &str, samples: &[u8]) -> Vec<u8> {
        let mut bytes = [MAGIC, &[version, 0]].concat();
        if version == 1 {
            bytes.extend((header.len() as u16).to_le_bytes());
        } else {
            bytes.extend((header.len() as u32).to_le_bytes());
        }
        [&bytes, header.as_bytes(), samples].concat()
    }

    fn header(descr: &str, fortran: &str, shape: &str) -> String {
        format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}     \n")
    }

    #[test]
    fn orders_of_axes_and_bytes() {
        let samples: Vec<u8> = (0..6i16).flat_map(i16::to_be_bytes).collect();
        let plane = read(&array(1, &header(">i2", "False", "(2, 3)"), &samples));
        let expected = (2, 3, Samples::I16(vec![3, 4, 5, 0, 1, 2]));
        assert_eq!(plane.expect("an image"), expected);
        let plane = read(&array(2, &header(">i2", "True", "(2L, 3L)"), &samples));
        assert_eq!(
            plane.expect("an image").2,
            Samples::I16(vec![1, 3, 5, 0, 2, 4])
        );
        let plane = read(&array(3, &header(">i2", "False", "(1, 3, 2, 1)"), &samples));
        let (rows, columns, _) = plane.expect("an image");
        assert_eq!((rows, columns), (3, 2));
    }

    #[test]
    fn half_precision() {
        let bytes = array(1, &header("<f2", "False", "(1, 2)"), &[0, 0x3c, 0, 0xc0]);
        assert_eq!(
            read(&bytes).expect("an image").2,
            Samples::F32(vec![1.0, -2.0])
        );
    }

    #[test]
    fn what_is_not_read_is_said() {
        let error = |descr: &str, shape: &str, n: usize| {
            let bytes = array(1, &header(descr, "False", shape), &vec![0; n]);
            read(&bytes).expect_err("no image")
        };
        assert!(error("<f8", "(2, 3)", 47).contains("47"));
        assert!(error("<c16", "(2, 3)", 96).contains("c16"));
        assert!(error("|O", "(2, 3)", 96).contains('O'));
        assert!(error("<f8", "(6,)", 48).contains("two dimensions"));
        assert!(error("<f8", "(2, 3, 4)", 192).contains("two dimensions"));
        assert!(error("<f8", "(0, 3)", 0).contains("0 × 3"));
        assert!(error("<f8", "(99999999999, 99999999999)", 0).contains("99999999999"));
        assert!(error("<f8", "(-1, 3)", 0).contains("whole numbers"));
        let fields = "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (1, 1)}";
        assert!(read(&array(1, fields, &[0; 8])).is_err());
        assert!(read(&array(1, "{}", &[])).is_err());
        assert!(read(&array(9, "{}", &[])).is_err());
        assert!(read(b"\x93NUMPY\x01\0\xff\xff").is_err());
    }
}
