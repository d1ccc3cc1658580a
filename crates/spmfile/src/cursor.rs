//! A bounds-checked walk over the bytes of a file.
//!
//! Goes in: a slice and a byte order; comes out: numbers, texts and sub-slices, or an error that
//! says what was expected and at which byte the file ended. Nothing here allocates by a number
//! read from the file.

/// The order of the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Endian {
    Little,
    Big,
}

/// A position in the bytes of a file.
#[derive(Clone, Debug)]
pub(crate) struct Cursor<'a> {
    bytes: &'a [u8],
    position: usize,
    endian: Endian,
}

/// Reads one number per method; big and little end differ in the constructor's name only.
macro_rules! numbers {
    ($($name:ident: $type:ty),*) => {$(
        /// The number at the position, which moves behind it.
        #[allow(dead_code, reason = "one method per kind of number; formats use what they hold")]
        pub(crate) fn $name(&mut self) -> Result<$type, String> {
            let bytes = self.array(stringify!($name))?;
            Ok(match self.endian {
                Endian::Little => <$type>::from_le_bytes(bytes),
                Endian::Big => <$type>::from_be_bytes(bytes),
            })
        }
    )*};
}

#[allow(
    dead_code,
    reason = "a small complete tool; formats use what they need"
)]
impl<'a> Cursor<'a> {
    /// Starts at the first byte.
    pub(crate) fn new(bytes: &'a [u8], endian: Endian) -> Self {
        Self {
            bytes,
            position: 0,
            endian,
        }
    }

    /// The same bytes from `position` on; a position behind the end fails at the next reading.
    pub(crate) fn at(&self, position: usize) -> Self {
        Self {
            position,
            ..self.clone()
        }
    }

    /// The number of bytes before the position.
    pub(crate) fn position(&self) -> usize {
        self.position
    }

    /// How many bytes are left.
    pub(crate) fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.position)
    }

    /// The next `length` bytes; `what` names them in the error.
    pub(crate) fn slice(&mut self, length: usize, what: &str) -> Result<&'a [u8], String> {
        let end = self.position.checked_add(length);
        let found = end.and_then(|end| self.bytes.get(self.position..end));
        let found = found.ok_or_else(|| {
            format!(
                "expected {what} of {length} bytes at byte {}, found the end of the file after {} bytes",
                self.position,
                self.bytes.len()
            )
        })?;
        self.position += length;
        Ok(found)
    }

    /// Moves on by `length` bytes.
    pub(crate) fn skip(&mut self, length: usize) -> Result<(), String> {
        self.slice(length, "a block").map(|_| ())
    }

    /// A text of fixed width, without what follows its first NUL and outer blanks.
    pub(crate) fn text(&mut self, width: usize, what: &str) -> Result<String, String> {
        let bytes = self.slice(width, what)?;
        Ok(crate::words::field(bytes))
    }

    /// The bytes up to the next NUL, behind which the position moves.
    pub(crate) fn until_nul(&mut self, what: &str) -> Result<&'a [u8], String> {
        let rest = self.bytes.get(self.position..).unwrap_or(&[]);
        let length = rest.iter().position(|&b| b == 0).ok_or_else(|| {
            format!(
                "expected {what} at byte {}, found no end of it",
                self.position
            )
        })?;
        self.position += length + 1;
        Ok(&rest[..length])
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], String> {
        let mut array = [0; N];
        array.copy_from_slice(self.slice(N, what)?);
        Ok(array)
    }

    numbers!(u8: u8, i8: i8, u16: u16, i16: i16, u32: u32, i32: i32, u64: u64, i64: i64, f32: f32, f64: f64);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_either_order() {
        let bytes = [1, 2, 3, 4, 0, 0, 0x80, 0x3f, b'a', b' ', 0, b'x'];
        let mut little = Cursor::new(&bytes, Endian::Little);
        assert_eq!(little.u16(), Ok(0x0201));
        assert_eq!(little.i16(), Ok(0x0403));
        assert_eq!(little.f32(), Ok(1.0));
        assert_eq!(little.text(4, "a name").as_deref(), Ok("a"));
        assert_eq!(little.left(), 0);
        assert_eq!(Cursor::new(&bytes, Endian::Big).u32(), Ok(0x0102_0304));
        assert_eq!(little.at(8).until_nul("a name"), Ok(&b"a "[..]));
    }

    #[test]
    fn the_end_is_named() {
        let mut cursor = Cursor::new(&[1, 2], Endian::Little).at(1);
        let error = cursor.u32().expect_err("one byte is left");
        assert!(
            error.contains("byte 1") && error.contains("after 2"),
            "{error}"
        );
        assert!(cursor.slice(usize::MAX, "a giant").is_err());
        assert!(cursor.at(99).until_nul("a text").is_err());
    }
}
