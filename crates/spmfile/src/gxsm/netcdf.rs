//! The classic formats of `NetCDF`: a header with dimensions, attributes and variables, and the variables one after the other, big endian.
//!
//! Versions 1, 2 (long offsets) and 5 (long counts) of the specification (Unidata). Variables along the unlimited dimension, which lie in
//! turns, are left out.

use crate::cursor::{Cursor, Endian};
use crate::raster::{self, Encoding, Order};
use crate::words;

/// Lists in a header: their tags.
const DIMENSIONS: u32 = 10;
const VARIABLES: u32 = 11;
const ATTRIBUTES: u32 = 12;
/// Bytes of a text that are kept: variables may overlap.
const LONGEST: usize = 1 << 12;
/// More dimensions than any variable has.
const MOST_DIMENSIONS: usize = 1024;

/// A file by its header.
pub(super) struct NetCdf<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) attributes: Vec<(String, String)>,
    pub(super) variables: Vec<Variable>,
}

/// A variable and where it is.
pub(super) struct Variable {
    pub(super) name: String,
    /// Its dimensions, the slowest first.
    pub(super) shape: Vec<usize>,
    kind: u32,
    attributes: Vec<(String, String)>,
    pub(super) start: usize,
}

struct Header<'a> {
    cursor: Cursor<'a>,
    version: u8,
}

impl<'a> NetCdf<'a> {
    pub(super) fn of(bytes: &'a [u8]) -> Result<Self, String> {
        let mut header = Header {
            cursor: Cursor::new(bytes, Endian::Big).at(4),
            version: bytes.get(3).copied().unwrap_or(0),
        };
        header.count()?;
        let dimensions = header.list(DIMENSIONS, |header| {
            let name = header.name()?;
            Ok((name, header.count()?))
        })?;
        let attributes = header.attributes()?;
        let variables = header.list(VARIABLES, |header| header.variable(&dimensions))?;
        Ok(Self {
            bytes,
            attributes,
            variables: variables.into_iter().flatten().collect(),
        })
    }

    pub(super) fn variable(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.name == name)
    }

    /// The numbers of a variable.
    pub(super) fn numbers(&self, variable: &Variable) -> Option<Vec<f64>> {
        let encoding = variable.encoding()?;
        let length = variable.count()?.checked_mul(encoding.width())?;
        let bytes = self.bytes.get(variable.start..)?.get(..length)?;
        let samples = raster::decode(
            bytes,
            variable.count()?,
            encoding,
            Endian::Big,
            Order::default(),
        );
        Some(samples.into_doubles())
    }

    /// A single number, or a text.
    pub(super) fn words(&self, variable: &Variable) -> Option<String> {
        if variable.kind == 2 {
            let length = variable.count()?.min(LONGEST);
            let bytes = self.bytes.get(variable.start..)?.get(..length)?;
            return Some(words::one_line(&words::field(bytes)));
        }
        let single = variable.count().filter(|&count| count == 1);
        let number = self.numbers(single.map(|_| variable)?)?;
        number.first().map(ToString::to_string)
    }
}

impl Variable {
    pub(super) fn encoding(&self) -> Option<Encoding> {
        Some(match self.kind {
            1 => Encoding::I8,
            3 => Encoding::I16,
            4 => Encoding::I32,
            5 => Encoding::F32,
            6 => Encoding::F64,
            7 => Encoding::U8,
            8 => Encoding::U16,
            9 => Encoding::U32,
            10 => Encoding::I64,
            11 => Encoding::U64,
            _ => return None,
        })
    }

    fn count(&self) -> Option<usize> {
        self.shape
            .iter()
            .try_fold(1, |all: usize, &side| all.checked_mul(side))
    }

    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(key, _)| key == name);
        found
            .map(|(_, value)| value.as_str())
            .filter(|value| !value.is_empty())
    }
}

impl Header<'_> {
    fn count(&mut self) -> Result<usize, String> {
        let count = match self.version {
            5 => self.cursor.u64()?,
            _ => self.cursor.u32()?.into(),
        };
        usize::try_from(count).map_err(|error| error.to_string())
    }

    /// Some bytes, and what fills them up to a multiple of four.
    fn padded(&mut self, length: usize) -> Result<&[u8], String> {
        let bytes = self.cursor.slice(length, "a text or numbers")?;
        self.cursor.skip(length.next_multiple_of(4) - length)?;
        Ok(bytes)
    }

    fn name(&mut self) -> Result<String, String> {
        let length = self.count()?;
        Ok(words::field(self.padded(length)?))
    }

    fn list<T>(
        &mut self,
        tag: u32,
        one: impl Fn(&mut Self) -> Result<T, String>,
    ) -> Result<Vec<T>, String> {
        let found = self.cursor.u32()?;
        let count = self.count()?;
        if found != tag && (found, count) != (0, 0) {
            return Err(format!(
                "expected the list {tag}, found {found} with {count} entries"
            ));
        }
        // An entry takes bytes: a number that lies ends the file.
        (0..count).map(|_| one(self)).collect()
    }

    /// Names and texts; of numbers nothing is kept.
    fn attributes(&mut self) -> Result<Vec<(String, String)>, String> {
        self.list(ATTRIBUTES, |header| {
            let name = header.name()?;
            let (kind, count) = (header.cursor.u32()?, header.count()?);
            let width = match kind {
                1 | 2 | 7 => 1,
                3 | 8 => 2,
                4 | 5 | 9 => 4,
                6 | 10 | 11 => 8,
                _ => return Err(format!("expected a kind of numbers, found {kind}")),
            };
            let length = count.checked_mul(width).ok_or("an attribute is too long")?;
            let bytes = header.padded(length)?;
            Ok((
                name,
                if kind == 2 {
                    words::one_line(&words::field(bytes))
                } else {
                    String::new()
                },
            ))
        })
    }

    fn variable(&mut self, dimensions: &[(String, usize)]) -> Result<Option<Variable>, String> {
        let name = self.name()?;
        let count = self.count()?;
        if count > MOST_DIMENSIONS {
            return Err(format!("a variable has {count} dimensions"));
        }
        let mut shape = Vec::new();
        for _ in 0..count {
            let number = self.count()?;
            let (_, length) = dimensions
                .get(number)
                .ok_or_else(|| format!("there is no dimension {number}"))?;
            shape.push(*length);
        }
        let attributes = self.attributes()?;
        let kind = self.cursor.u32()?;
        self.count()?;
        let start = match self.version {
            1 => self.cursor.u32()?.into(),
            _ => self.cursor.u64()?,
        };
        let start = usize::try_from(start).map_err(|error| error.to_string())?;
        let fixed = !shape.contains(&0);
        Ok(fixed.then_some(Variable {
            name,
            shape,
            kind,
            attributes,
            start,
        }))
    }
}
