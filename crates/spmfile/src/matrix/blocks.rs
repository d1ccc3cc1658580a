//! Blocks, texts and values, of which both kinds of file are made.
//!
//! A block is a mark of four letters stored backwards, the length of its body, in the log mostly a
//! time in seconds since 1970, and the body. Texts are UTF-16 behind the number of their units;
//! values stand behind a mark of their kind. All little endian.

use crate::cursor::{Cursor, Endian};
use crate::words;

/// A mark, the right way round.
pub(super) type Mark = [u8; 4];

/// A part of a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block<'a> {
    pub(super) mark: Mark,
    /// Seconds since 1970, of blocks that have it.
    pub(super) time: u64,
    pub(super) body: &'a [u8],
}

/// A value of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Bool(bool),
    Long(i32),
    Double(f64),
    Text(String),
}

impl Value {
    pub(super) fn number(&self) -> Option<f64> {
        match *self {
            Self::Long(n) => Some(f64::from(n)),
            Self::Double(n) => Some(n).filter(|n| n.is_finite()),
            Self::Bool(_) | Self::Text(_) => None,
        }
    }

    pub(super) fn truth(&self) -> Option<bool> {
        match *self {
            Self::Bool(yes) => Some(yes),
            _ => None,
        }
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Bool(yes) => write!(f, "{yes}"),
            Self::Long(n) => write!(f, "{n}"),
            Self::Double(n) => write!(f, "{n}"),
            Self::Text(text) => write!(f, "{text}"),
        }
    }
}

pub(super) fn cursor(bytes: &[u8]) -> Cursor<'_> {
    Cursor::new(bytes, Endian::Little)
}

/// A mark, turned the right way round.
pub(super) fn mark(c: &mut Cursor<'_>) -> Result<Mark, String> {
    let mark = c.slice(4, "a mark")?;
    Ok([mark[3], mark[2], mark[1], mark[0]])
}

/// A mark as text, for messages.
pub(super) fn letters(mark: Mark) -> String {
    mark.escape_ascii().to_string()
}

/// The next block of a log, which has a time.
pub(super) fn timed<'a>(c: &mut Cursor<'a>) -> Result<Block<'a>, String> {
    let mark = mark(c)?;
    let length = c.u32()? as usize;
    let time = c.u64()?;
    let body = c.slice(length, &format!("a block {}", letters(mark)))?;
    Ok(Block { mark, time, body })
}

/// The next block inside another one, which has none.
pub(super) fn inner<'a>(c: &mut Cursor<'a>) -> Result<Block<'a>, String> {
    let mark = mark(c)?;
    let length = c.u32()? as usize;
    let body = c.slice(length, &format!("a block {}", letters(mark)))?;
    let time = 0;
    Ok(Block { mark, time, body })
}

/// A text.
pub(super) fn text(c: &mut Cursor<'_>) -> Result<String, String> {
    let units = c.u32()? as usize;
    let length = units.checked_mul(2).ok_or("a text of impossible length")?;
    Ok(words::wide(c.slice(length, "a text")?).into_owned())
}

/// A value behind the mark of its kind.
pub(super) fn value(c: &mut Cursor<'_>) -> Result<Value, String> {
    let kind = mark(c)?;
    Ok(match &kind {
        b"BOOL" => Value::Bool(c.u32()? != 0),
        b"LONG" => Value::Long(c.i32()?),
        b"DOUB" => Value::Double(c.f64()?),
        b"STRG" => Value::Text(text(c)?),
        _ => {
            return Err(format!(
                "expected a value (BOOL, LONG, DOUB, STRG) before byte {}, found {}",
                c.position(),
                letters(kind)
            ));
        }
    })
}
