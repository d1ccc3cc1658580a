//! The file of one channel: counts in the order of recording.

use super::blocks::{self, cursor, letters};
use super::format::{FORMAT, MAGIC, damaged};
use crate::error::ReadError;

/// What the file of a channel holds.
#[derive(Debug)]
pub(super) struct Data<'a> {
    /// When it was stored, seconds since 1970.
    pub(super) time: u64,
    /// The channel in the dictionaries of the log.
    pub(super) channel: u64,
    /// Samples that were to be recorded.
    pub(super) intended: u32,
    /// The samples that were, 32 bits each.
    pub(super) counts: &'a [u8],
}

/// Finds the parts of the file.
pub(super) fn parts(bytes: &[u8]) -> Result<Data<'_>, ReadError> {
    let (description, time, block) = blocks(bytes).map_err(damaged)?;
    let description = describe(description).map_err(damaged)?;
    if let Some(kind) = description.kind.filter(|kind| kind != "SI32") {
        return Err(ReadError::Unsupported {
            format: FORMAT,
            reason: format!("expected samples SI32 (32 bits with sign), found {kind:?}"),
        });
    }
    let (recorded, intended) = (description.recorded, description.intended);
    if recorded > intended {
        return Err(damaged(format!(
            "it has {recorded} samples of {intended} intended ones"
        )));
    }
    let length = u64::from(recorded) * 4;
    let counts = usize::try_from(length)
        .ok()
        .and_then(|length| block.get(..length))
        .ok_or_else(|| {
            damaged(format!(
                "expected {recorded} samples of 4 bytes, found {} bytes",
                block.len()
            ))
        })?;
    if recorded == 0 {
        return Err(ReadError::Unsupported {
            format: FORMAT,
            reason: "it holds no sample: the scan was stopped before its first one".to_owned(),
        });
    }
    Ok(Data {
        time,
        channel: description.channel,
        intended,
        counts,
    })
}

/// The blocks DESC and DATA, and the time of the file.
fn blocks(bytes: &[u8]) -> Result<(&[u8], u64, &[u8]), String> {
    let mut c = cursor(bytes).at(MAGIC.len());
    // The mark and the length of the whole.
    c.skip(8)?;
    let time = c.u64()?;
    c.skip(4)?;
    let mut description = None;
    loop {
        let block = blocks::inner(&mut c)?;
        match (&block.mark, description) {
            (b"DESC", _) => description = Some(block.body),
            (b"DATA", Some(description)) => return Ok((description, time, block.body)),
            _ => {
                return Err(format!(
                    "expected the blocks DESC and DATA, found {}",
                    letters(block.mark)
                ));
            }
        }
    }
}

struct Description {
    channel: u64,
    intended: u32,
    recorded: u32,
    kind: Option<String>,
}

fn describe(body: &[u8]) -> Result<Description, String> {
    let mut c = cursor(body);
    let channel = c.u64()?;
    // Numbers of the run, of no known use here.
    c.skip(12)?;
    Ok(Description {
        channel,
        intended: c.u32()?,
        recorded: c.u32()?,
        // Not every description knows of it.
        kind: blocks::text(&mut c).ok(),
    })
}
