//! Both files → a scan.

use super::format::{CHANNEL, LOG, MAGIC, unsupported};
use super::names::{is_curve, log_file};
use super::refuse::refuse;
use super::{data, frame, images, log, names};
use crate::error::ReadError;
use crate::frame::Frame;
use crate::outline::Outline;
use crate::scan::{ChannelInfo, FrameDirection, Scan};
use crate::source::Data;

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
    let [up, down] = outlines(bytes, log, file_name)?;
    let wanted_one = match frame {
        Some(FrameDirection::Down) => down,
        _ => up,
    };
    let outline = wanted_one
        .ok_or_else(|| unsupported("expected a frame downwards, found one upwards only"))?;
    Frame::new(outline, Data::Bytes(bytes)).into_scan(wanted)
}

/// Opens the frames of the file of a channel, the one upwards first, with the parts of the log of its
/// session.
///
/// # Errors
/// As [`read`], except for what lies in the samples.
pub fn open<'a>(
    bytes: &'a [u8],
    log: &[&[u8]],
    file_name: &str,
) -> Result<Vec<Frame<'a>>, ReadError> {
    let outlines = outlines(bytes, log, file_name)?.into_iter().flatten();
    Ok(outlines
        .map(|outline| Frame::new(outline, Data::Bytes(bytes)))
        .collect())
}

/// The frame upwards and that downwards, as far as any of their samples was recorded.
fn outlines<'a>(
    bytes: &'a [u8],
    log: &[&[u8]],
    file_name: &str,
) -> Result<[Option<Outline<'a>>; 2], ReadError> {
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
    let of = |frame| {
        let mut outline = images::outline(&state, &data, name.channel, &understood, frame)?;
        images::tell(&mut outline.scan, &state, log, &name, file_name);
        Some(outline)
    };
    Ok([FrameDirection::Up, FrameDirection::Down].map(of))
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
