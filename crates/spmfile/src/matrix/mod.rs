//! Omicron Matrix: files of channels, `.Z_mtrx`, with the log of their session, `_0001.mtrx`.
//!
//! **Untested**: written from public descriptions; no file of an instrument was at hand. Every scan
//! says so in [`Scan::notes`].
//!
//! The file of a channel holds raw counts only. Lines, points, size, scale and times stand in the log
//! of the session, in which the state of the instrument has to be found by playing all changes from
//! the start to the line that names the file. [`log_file`] tells the name of the log from that of the
//! file; [`read`] takes the bytes of both.
//!
//! - Samples follow each other in time: trace of the first line, its retrace (`X_Retrace`), the next
//!   line; after the frame upwards that downwards (`Y_Retrace`). The first line upwards is the bottom
//!   one, downwards the top one; a retrace runs from right to left. A file holds both frames; which
//!   one is read is for the caller to say.
//! - Points and lines are those of the parameters `XYScanner.Points`, `Lines`, or those of the axes of
//!   the channel, whichever make the intended number of samples; if neither does, or both do in
//!   different ways, the file is refused.
//! - `TFF_Linear1D`: (count − `Offset`)/`Factor`. `TFF_MultiLinear1D`: (`Raw_1` − `PreOffset`)·(count −
//!   `Offset`)/(`NeutralFactor`·`PreFactor`). Without a function that surely is the channel's, values are
//!   counts.
//! - `X_Offset` and `Y_Offset` are the centre. `Angle` is taken as counter-clockwise, as
//!   access2theMatrix turns offsets.
//! - `Raster_Time` is the time of a point, forth and back; without a retrace that of the way back is
//!   not known.
//! - Times are seconds since 1970, given in UTC. That of the file is when it was stored, after the last
//!   of its frames.
//! - Scans that are bound to a line or a point (`Scan_Constraint`, `Grid_Mode`) and curves are refused.
//!
//! Descriptions compared: Gwyddion's `omicronmatrix.c` (versions of 2008 and 2021), access2theMatrix 0.4
//! (S. Zevenhuizen), pyMTRX, and a description of MATRIX 3.3 files made from their bytes. They agree in
//! blocks, values, order of samples and transfer functions. They differ here:
//!
//! - Size: from edge to edge by Gwyddion and newer access2theMatrix, between the centres of the outer
//!   pixels by pyMTRX and older access2theMatrix. Edges are taken, [`Span::PixelEdges`](crate::Span::PixelEdges).
//! - `Zoom`: Gwyddion divides the size by it, the others know nothing of it. If it is not 1 the size is
//!   left out.
//! - Time of a line: pyMTRX adds `Move_Raster_Time` to it, others do not. It is left out.
//! - Whole numbers: with a sign by access2theMatrix (taken), without one by the others; it matters for
//!   negative angles.
//! - Several functions under the name of a channel: access2theMatrix takes the last one, pyMTRX that of
//!   the key in the file. The key is taken; without it values are counts.
//! - Logs in several parts (`_0002.mtrx` …) are known to access2theMatrix only.
//! - Currents: Gwyddion multiplies those of curves, not of images, by `Preamp_Range`, the others by
//!   nothing, as here.
//! - Unfinished lines: kept by Gwyddion (and here), dropped by access2theMatrix.

mod blocks;
mod data;
mod frame;
mod images;
mod log;
mod names;

use crate::ChannelInfo;
use crate::error::ReadError;
use crate::scan::{FrameDirection, Scan};

pub use names::{frame_and_channel, is_curve, log_file};

const FORMAT: &str = "Omicron Matrix";
const MAGIC: &[u8] = b"ONTMATRX0101";
/// The first block of the file of a channel.
const CHANNEL: &[u8] = b"TLKB";
/// The first block of the log.
const LOG: &[u8] = b"ATEM";
fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::Damaged {
        format: FORMAT,
        reason: reason.into(),
    }
}

fn unsupported(reason: impl Into<String>) -> ReadError {
    ReadError::Unsupported {
        format: FORMAT,
        reason: reason.into(),
    }
}

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
    crate::checked(frames(bytes, log, file_name, frame, wanted))
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
