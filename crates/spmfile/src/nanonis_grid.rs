//! Grids of spectra of Nanonis controllers (SPECS), `.3ds`: the topography, and an image for each point of the sweep.
//!
//! A text header of lines `Key=value` or `Key="value"`, ended by `:HEADER_END:` and a line end. Then, for each point of
//! the grid, the parameters (`Fixed parameters`, then `Experiment parameters`) and `Points` samples of every channel,
//! all of them big-endian single-precision numbers in SI units.
//!
//! - Points are stored in the order of acquisition, those of a line from left to right, the bottom line first.
//! - `Grid settings` are the centre, width, height (m), and the angle, clockwise in degrees, as in `.sxm`.
//! - The parameters `X (m)` and `Y (m)` are where each point was. They decide the sign of the angle, which line is the
//!   first, and whether the size reaches from edge to edge or from centre to centre: public readers differ on it.
//! - The sweep goes evenly from `Sweep Start` to `Sweep End`, or through the segments of the header (`Filetype=MLS`),
//!   which share their ends.
//! - Points that were not recorded are NaN.

mod grid;
mod header;
mod sweep;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use memchr::memmem;

use grid::Grid;
use header::Header;

use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::outline::{Input, Outline};
use crate::scan::{ChannelInfo, LineDirection, Span};
use crate::stored::{Stored, Unpacked};
use crate::words;

const FORMAT: &str = "Nanonis grid";
/// The format where its positions tell what its size spans.
pub(crate) const WITH_POSITIONS: &str = "Nanonis grid with positions";
/// What every grid says.
const UNTESTED: &str = "the reader of Nanonis grids is untested on files of an instrument";
pub(crate) const BEGIN: &[u8] = b"Grid dim=";
const END: &[u8] = b":HEADER_END:";

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// Reads the header and finds the points.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    let place = memmem::find(bytes, END).ok_or_else(|| {
        let found = bytes.len();
        damaged(format!(
            "expected :HEADER_END:, found none in {found} bytes: the file was cut off inside the header"
        ))
    })?;
    let text = words::decode(&bytes[..place]);
    let header = Header::of(&text);
    let mut data = &bytes[place + END.len()..];
    data = data.strip_prefix(b"\r").unwrap_or(data);
    data = data.strip_prefix(b"\n").unwrap_or(data);

    let mut notes = vec![UNTESTED.to_owned()];
    let mut grid = Grid::of(&header, data, bytes.len(), &mut notes)?;
    let whole = grid.announced * grid.stride;
    let values = header.sweep(&grid, &mut notes);
    let (scan, span) = header.frame(&mut grid, &mut notes);
    // Of lines that are left out the height has no share.
    let less = f64::from(u8::from(span == Span::PixelCentres));
    let lines = |points: usize| (points / grid.columns) as f64 - less;
    let share = lines(grid.rows * grid.columns) / lines(grid.announced);
    let size = scan.size_nm.map(|[width, height]| [width, height * share]);
    let mut outline = Outline::of(scan);
    if let Some(more) = data.len().checked_sub(whole).filter(|&more| more > 0) {
        let reason = format!(
            "expected {} points of {} bytes behind the header, found {more} bytes more: its header is not that of its data",
            grid.announced, grid.stride
        );
        // A line end behind the last point moves nothing.
        if more < grid.stride {
            notes.push(reason);
        } else {
            outline.damage = Some(reason);
        }
    }

    let points = header.points(&grid, values, &mut notes);
    let grid = Arc::new(grid);
    let mut add = |name: String, unit: &str, field: usize| {
        let info = ChannelInfo {
            name,
            internal_name: String::new(),
            line_direction: Some(LineDirection::Trace),
            scan_line: None,
        };
        let mut channel = ChannelHeader::new(info, grid.rows, grid.columns)
            .in_unit(unit)
            .of_size(size);
        channel.span = span;
        let grid = Arc::clone(&grid);
        let samples = move || Ok(Unpacked::measured(grid.image(field)));
        outline.add(channel, Stored::Packed(Box::new(samples)));
    };
    match grid.parameter("Z (m)") {
        Some(field) => add("Z".to_owned(), "m", field),
        None => notes
            .push("expected the parameter Z (m), found none: there is no topography".to_owned()),
    }
    for (number, channel) in grid.channels.iter().enumerate() {
        let (name, unit) = name_and_unit(channel);
        for (point, label) in &points {
            let field = grid.parameters + number * grid.points + point;
            add(format!("{name} ({label})"), unit, field);
        }
    }
    outline.scan.notes.extend(notes);
    outline.scan.notes.extend(header.unread.notes());
    Ok(outline)
}

/// `LI Demod 1 X (A)` as its name and its unit.
fn name_and_unit(text: &str) -> (&str, &str) {
    let inside = text.strip_suffix(')');
    match inside.and_then(|text| text.rsplit_once('(')) {
        Some((name, unit)) => (name.trim(), unit.trim()),
        None => (text, ""),
    }
}
