//! Blocks of samples as files hold them → [`Samples`] from the bottom line up, left to right.
//!
//! One pass over the bytes: decoding and bringing lines and columns into order happen together.

use crate::cursor::Endian;
use crate::scan::Samples;

/// How one sample is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
}

/// Where the first stored sample lies and which way the lines run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(crate) struct Order {
    /// The first stored line is the top one.
    pub(crate) top_first: bool,
    /// The first stored sample of a line is the right one.
    pub(crate) mirrored: bool,
}

impl Encoding {
    /// Width of a sample in bytes.
    pub(crate) fn width(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// Number of bytes of an image, if it can be addressed and is not empty.
pub(crate) fn byte_length(rows: usize, columns: usize, encoding: Encoding) -> Option<usize> {
    let samples = rows.checked_mul(columns).filter(|&n| n > 0)?;
    samples.checked_mul(encoding.width())
}

/// Decodes lines of `columns` samples; bytes after the last whole line are left out.
///
/// Unsigned and 64-bit integers go into the next type that holds them (64-bit ones into double
/// precision).
pub(crate) fn decode(
    bytes: &[u8],
    columns: usize,
    encoding: Encoding,
    endian: Endian,
    order: Order,
) -> Samples {
    macro_rules! samples {
        ($kind:ident, $stored:ty, $kept:ty) => {
            Samples::$kind(match endian {
                Endian::Little => lines(bytes, columns, order, |b| {
                    <$kept>::from(<$stored>::from_le_bytes(b))
                }),
                Endian::Big => lines(bytes, columns, order, |b| {
                    <$kept>::from(<$stored>::from_be_bytes(b))
                }),
            })
        };
    }
    match encoding {
        Encoding::I8 => samples!(I16, i8, i16),
        Encoding::U8 => samples!(I16, u8, i16),
        Encoding::I16 => samples!(I16, i16, i16),
        Encoding::U16 => samples!(I32, u16, i32),
        Encoding::I32 => samples!(I32, i32, i32),
        Encoding::U32 => samples!(F64, u32, f64),
        Encoding::F32 => samples!(F32, f32, f32),
        Encoding::F64 => samples!(F64, f64, f64),
        Encoding::F16 => Samples::F32(match endian {
            Endian::Little => lines(bytes, columns, order, |b| single(u16::from_le_bytes(b))),
            Endian::Big => lines(bytes, columns, order, |b| single(u16::from_be_bytes(b))),
        }),
        Encoding::I64 => Samples::F64(match endian {
            Endian::Little => lines(bytes, columns, order, |b| i64::from_le_bytes(b) as f64),
            Endian::Big => lines(bytes, columns, order, |b| i64::from_be_bytes(b) as f64),
        }),
        Encoding::U64 => Samples::F64(match endian {
            Endian::Little => lines(bytes, columns, order, |b| u64::from_le_bytes(b) as f64),
            Endian::Big => lines(bytes, columns, order, |b| u64::from_be_bytes(b) as f64),
        }),
    }
}

fn lines<T, const N: usize>(
    bytes: &[u8],
    columns: usize,
    order: Order,
    sample: impl Fn([u8; N]) -> T,
) -> Vec<T> {
    let mut all = Vec::with_capacity(bytes.len() / N);
    let Some(length) = columns.checked_mul(N).filter(|&n| n > 0) else {
        return all;
    };
    let mut line = |line: &[u8]| {
        let (samples, _) = line.as_chunks::<N>();
        if order.mirrored {
            all.extend(samples.iter().rev().map(|&b| sample(b)));
        } else {
            all.extend(samples.iter().map(|&b| sample(b)));
        }
    };
    if order.top_first {
        let whole = bytes.len() - bytes.len() % length;
        bytes[..whole].rchunks_exact(length).for_each(&mut line);
    } else {
        bytes.chunks_exact(length).for_each(&mut line);
    }
    all
}

/// Half precision as single precision (IEEE 754).
fn single(bits: u16) -> f32 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let exponent = i32::from(bits >> 10 & 0x1f);
    let fraction = f32::from(bits & 0x3ff);
    match exponent {
        0 => sign * fraction * 2f32.powi(-24),
        31 if fraction == 0.0 => sign * f32::INFINITY,
        31 => f32::NAN,
        _ => sign * (1024.0 + fraction) * 2f32.powi(exponent - 25),
    }
}

/// Values in order of rows from the top, as text files list them, turned bottom line first.
pub(crate) fn turned(values: &[f64], columns: usize, order: Order) -> Vec<f64> {
    if columns == 0 {
        return Vec::new();
    }
    let line = |line: &[f64]| -> Vec<f64> {
        if order.mirrored {
            line.iter().rev().copied().collect()
        } else {
            line.to_vec()
        }
    };
    if order.top_first {
        values.rchunks_exact(columns).flat_map(line).collect()
    } else {
        values.chunks_exact(columns).flat_map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOP: Order = Order {
        top_first: true,
        mirrored: false,
    };

    #[test]
    fn lines_and_columns_are_brought_into_order() {
        let bytes: Vec<u8> = (0..6i16).flat_map(i16::to_be_bytes).collect();
        let read = |order| decode(&bytes, 3, Encoding::I16, Endian::Big, order);
        assert_eq!(read(Order::default()), Samples::I16(vec![0, 1, 2, 3, 4, 5]));
        assert_eq!(read(TOP), Samples::I16(vec![3, 4, 5, 0, 1, 2]));
        let mirrored = Order {
            top_first: false,
            mirrored: true,
        };
        assert_eq!(read(mirrored), Samples::I16(vec![2, 1, 0, 5, 4, 3]));
        assert_eq!(
            turned(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], 3, TOP),
            [3.0, 4.0, 5.0, 0.0, 1.0, 2.0]
        );
    }

    #[test]
    fn unsigned_samples_keep_their_value() {
        let read =
            |bytes: &[u8], encoding| decode(bytes, 1, encoding, Endian::Little, Order::default());
        assert_eq!(read(&[0xff], Encoding::U8), Samples::I16(vec![255]));
        assert_eq!(read(&[0xff; 2], Encoding::U16), Samples::I32(vec![65535]));
        assert_eq!(
            read(&[0xff; 4], Encoding::U32),
            Samples::F64(vec![4_294_967_295.0])
        );
        // Half a sample too many is left out.
        assert_eq!(read(&[1, 0, 2], Encoding::I16), Samples::I16(vec![1]));
        assert_eq!(
            decode(&[1, 2], 0, Encoding::I8, Endian::Big, TOP),
            Samples::I16(vec![])
        );
    }

    #[test]
    fn lengths_beyond_memory_are_none() {
        assert_eq!(byte_length(2, 3, Encoding::F64), Some(48));
        assert_eq!(byte_length(0, 3, Encoding::F64), None);
        assert_eq!(byte_length(usize::MAX / 2, 3, Encoding::U8), None);
    }

    /// Values from the table of examples of binary16 in IEEE 754-2008.
    #[test]
    fn half_precision() {
        for (bits, value) in [
            (0x0001, 2f32.powi(-24)),
            (0x03ff, 1023.0 * 2f32.powi(-24)),
            (0x0400, 2f32.powi(-14)),
            (0x3555, 0.333_251_95),
            (0x3c00, 1.0),
            (0x7bff, 65504.0),
            (0xc000, -2.0),
            (0xfc00, f32::NEG_INFINITY),
        ] {
            assert_eq!(single(bits), value);
        }
        assert!(single(0x7e00).is_nan());
    }
}
