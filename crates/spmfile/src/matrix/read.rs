//! Both files → a scan.

use super::format::{CHANNEL, LOG, MAGIC, damaged, unsupported};
use super::names::{is_curve, log_file};
use super::{data, frame, images, log, names};
use crate::error::ReadError;
use crate::scan::{ChannelInfo, FrameDirection, Scan};
use crate::whole::checked;

/// Says what a file that comes alone lacks.
pub(crate) fn refuse(bytes: &[u8]) -> ReadError {
    match bytes.get(MAGIC.len()..MAGIC.len() + 4) {
        Some(LOG) => unsupported(
            "it is the log of a session and holds no image; give the images beside it, as in \
             NAME--1_1.Z_mtrx",
        ),
        Some(CHANNEL) => unsupported(
            "it holds counts only; lines, size and scale are in the log of its session, the file beside it \
             whose name ends in _0001.mtrx, and are found there by the name of this file",
        ),
        first => damaged(format!(
            "expected the mark TLKB or ATEM, found {:02x?}",
            first.unwrap_or_default()
        )),
    }
}

/// Reads a frame from the file of a channel and the parts of the log of its session.
///
/// `file_name` is the name under which the log knows the file. A file may hold two frames: without a
/// `frame` the one upwards is read.
///
/// # Errors
/// - The bytes are not those of such files, or damaged.
/// - The log does not name the file.
/// - The file holds curves, no image, not the wanted frame, or a shape that contradicts the log.
pub fn read(
    bytes: &[u8],
    log: &[&[u8]],
    file_name: &str,
    frame: Option<FrameDirection>,
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    #[cfg(test)]
    crate::seeds::keep_session(bytes, log, file_name);
    checked(frames(bytes, log, file_name, frame, wanted))
}

fn frames(
    bytes: &[u8],
    log: &[&[u8]],
    file_name: &str,
    frame: Option<FrameDirection>,
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    let is = |bytes: &[u8], kind: &[u8]| {
        let rest = bytes.strip_prefix(MAGIC);
        rest.is_some_and(|rest| rest.starts_with(kind))
    };
    if !is(bytes, CHANNEL) {
        return Err(refuse(bytes));
    }
    let name = names::parse(file_name).ok_or_else(|| {
        unsupported(format!(
            "expected a name like NAME--1_1.Z_mtrx, by which its log knows it, found {file_name:?}"
        ))
    })?;
    if is_curve(name.channel) {
        return Err(unsupported(format!(
            "channel {} is a spectroscopy curve and no image",
            name.channel
        )));
    }
    let whole_log = log.first().is_some_and(|first| is(first, LOG))
        && log.iter().all(|part| part.starts_with(MAGIC));
    if !whole_log {
        return Err(unsupported(format!(
            "expected the log of its session in {}, found something else",
            log_file(file_name, 1).unwrap_or_default()
        )));
    }
    let data = data::parts(bytes)?;
    let state = log::play(log, file_name)?.ok_or_else(|| not_named(log, file_name))?;
    let constraint = state.any(&["Scan_Constraint", "Grid_Mode"]);
    if let Some(bound) = constraint.filter(|value| value.number() != Some(0.0)) {
        return Err(unsupported(format!(
            "the scan was bound to a line or a point (Scan_Constraint {bound}) and is no image"
        )));
    }
    let understood = frame::understand(&state, &data, name.channel).map_err(unsupported)?;
    let mut scan = images::read(&state, &data, name.channel, &understood, frame, wanted)?;
    images::tell(&mut scan, &state, log, &name, file_name);
    Ok(scan)
}

fn not_named(log: &[&[u8]], file_name: &str) -> ReadError {
    let names = log::files(log);
    let such_as = match names.first() {
        Some(first) => format!("{} files, such as {first}", names.len()),
        None => "no file".to_owned(),
    };
    unsupported(format!(
        "its log does not name {file_name}; it names {such_as}: files that were renamed or belong to \
         another session cannot be read"
    ))
}

#[cfg(test)]
mod tests;
