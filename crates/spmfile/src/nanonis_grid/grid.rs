//! The points of a grid in the bytes of its file.

use super::header::Header;
use super::{FORMAT, damaged};
use crate::error::ReadError;
use crate::scan::{Samples, Span};
use crate::whole::MOST_CHANNELS;

/// Width of a number.
const WIDTH: usize = 4;
/// Missing points become NaN as long as all images take at most this multiple of the bytes of the file.
const MOST_GAIN: usize = 3;

/// The points of a grid.
pub(super) struct Grid<'a> {
    /// All bytes behind the header.
    pub(super) data: &'a [u8],
    pub(super) columns: usize,
    /// Lines of the images.
    pub(super) rows: usize,
    /// Lines that were recorded in full.
    pub(super) lines: usize,
    /// Names of the parameters.
    pub(super) names: Vec<String>,
    /// Number of parameters.
    pub(super) parameters: usize,
    pub(super) channels: Vec<String>,
    /// Samples of a channel at a point.
    pub(super) points: usize,
    /// Bytes of a point.
    pub(super) stride: usize,
    /// Points by the header.
    pub(super) announced: usize,
    /// Points in the file.
    pub(super) recorded: usize,
    /// The first line is the top one.
    pub(super) top_first: bool,
}

impl<'a> Grid<'a> {
    /// The shape of the grid, and how much of it was recorded in a file of a number of bytes.
    pub(super) fn of(
        header: &Header,
        data: &'a [u8],
        file: usize,
        notes: &mut Vec<String>,
    ) -> Result<Self, ReadError> {
        let (columns, rows) = shape(header)?;
        let channels = channels(header)?;
        let text = header.get("Points").unwrap_or("");
        let points = text.parse().ok().filter(|&n: &usize| n > 0);
        let points =
            points.ok_or_else(|| damaged(format!("expected Points above 0, found {text:?}")))?;
        let names = [
            header.list("Fixed parameters"),
            header.list("Experiment parameters"),
        ]
        .concat();
        let parameters = header.get("# Parameters");
        let parameters = header
            .unread
            .entry("# Parameters (4 byte)", parameters, |text| {
                text.parse().ok()
            });
        let parameters = parameters.unwrap_or(names.len());
        if parameters != names.len() {
            notes.push(format!(
                "expected the names of {parameters} parameters, found {}",
                names.len()
            ));
        }
        let sizes = || {
            let sweeps = points.checked_mul(channels.len())?.checked_mul(WIDTH)?;
            let stride = parameters.checked_mul(WIDTH)?.checked_add(sweeps)?;
            let announced = columns.checked_mul(rows)?;
            Some((sweeps, stride, announced, announced.checked_mul(stride)?))
        };
        let (sweeps, stride, announced, whole) = sizes().ok_or_else(|| {
            damaged(format!(
                "its size is {columns} x {rows} points of {parameters} parameters and {} channels of {points} samples",
                channels.len()
            ))
        })?;
        let told = header
            .unread
            .number("Experiment size (bytes)", header.get("Experiment size"));
        if let Some(told) = told.filter(|&told| told != sweeps as f64) {
            notes.push(format!("expected an Experiment size of {sweeps} bytes, as channels and points have it, found {told}"));
        }
        let recorded = (data.len() / stride).min(announced);
        let lines = recorded / columns;
        if lines < 2 {
            return Err(damaged(format!(
                "expected {announced} points of {stride} bytes behind the header, found {} bytes: it was stopped or cut off \
                 before two of its {rows} lines of {columns} points were whole",
                data.len()
            )));
        }
        let mut kept = rows;
        if recorded < announced {
            if whole > MOST_GAIN.saturating_mul(file) {
                kept = lines;
            }
            let inside = if data.len().is_multiple_of(stride) {
                ""
            } else {
                " and ends inside one: it may be cut off"
            };
            let missing = if kept < rows {
                "only whole lines are kept"
            } else {
                "the others are missing"
            };
            notes.push(format!(
                "the grid has {recorded} of its {announced} points{inside}; {missing}"
            ));
        }
        Ok(Grid {
            data,
            columns,
            rows: kept,
            lines,
            names,
            parameters,
            channels,
            points,
            stride,
            announced,
            recorded,
            top_first: false,
        })
    }
}

/// Points in a line, and lines.
fn shape(header: &Header) -> Result<(usize, usize), ReadError> {
    let dim = header.get("Grid dim").unwrap_or("");
    let sides: Option<Vec<usize>> = dim
        .split(['x', 'X', ';'])
        .map(|n| n.trim().parse().ok())
        .collect();
    let what = match sides.as_deref() {
        Some(&[0, _] | &[_, 0]) => None,
        Some([1, 1]) => Some("a single spectrum"),
        Some([1, _] | [_, 1]) => Some("a line of spectra"),
        Some(&[columns, rows]) => return Ok((columns, rows)),
        _ => None,
    };
    Err(match what {
        Some(what) => ReadError::unsupported(
            FORMAT,
            format!("its grid of {dim} points is {what}: no image"),
        ),
        None => damaged(format!(
            "expected Grid dim with points and lines, found {dim:?}"
        )),
    })
}

/// The names of the channels.
fn channels(header: &Header) -> Result<Vec<String>, ReadError> {
    let channels = header.list("Channels");
    match channels.len() {
        0 => Err(damaged(
            "expected Channels with the names of channels, found none",
        )),
        found if found > MOST_CHANNELS => Err(ReadError::TooManyChannels {
            found,
            limit: MOST_CHANNELS,
        }),
        _ => Ok(channels),
    }
}

impl Grid<'_> {
    /// The place of a parameter in the numbers of a point.
    pub(super) fn parameter(&self, name: &str) -> Option<usize> {
        let place = self.names.iter().position(|n| n.eq_ignore_ascii_case(name));
        place.filter(|&place| place < self.parameters)
    }

    /// A number of a point, missing ones as NaN.
    pub(super) fn value(&self, point: usize, field: usize) -> f32 {
        let place = || {
            let at = point
                .checked_mul(self.stride)?
                .checked_add(field.checked_mul(WIDTH)?)?;
            self.data.get(at..)?.first_chunk()
        };
        let found = (point < self.recorded).then(place).flatten();
        found.map_or(f32::NAN, |&bytes| f32::from_be_bytes(bytes))
    }

    /// One number of every point, the bottom line first.
    pub(super) fn image(&self, field: usize) -> Samples {
        let line = |row: usize| {
            let row = if self.top_first {
                self.rows - 1 - row
            } else {
                row
            };
            (row * self.columns..(row + 1) * self.columns)
                .map(move |point| self.value(point, field))
        };
        let mut samples = Vec::with_capacity(self.rows * self.columns);
        (0..self.rows).for_each(|row| samples.extend(line(row)));
        Samples::F32(samples)
    }

    /// From a point to the next one of its line, and to that of the next line, by the corners.
    pub(super) fn steps_nm(&self) -> Option<[[f64; 2]; 2]> {
        let fields = [self.parameter("X (m)")?, self.parameter("Y (m)")?];
        let at = |point: usize| fields.map(|field| f64::from(self.value(point, field)) * 1e9);
        let first = at(0);
        let step = |point: usize, steps: usize| {
            let [x, y] = at(point);
            let step = [(x - first[0]) / steps as f64, (y - first[1]) / steps as f64];
            let length = step[0].hypot(step[1]);
            (length > 0.0 && length.is_finite()).then_some(step)
        };
        let [right, up] = [self.columns - 1, self.lines - 1];
        Some([step(right, right)?, step(up * self.columns, up)?])
    }

    /// What the size spans by the distance of points along lines and across; `None` if it is neither.
    pub(super) fn span(&self, size: [f64; 2], pitch: [f64; 2]) -> Option<Span> {
        let counts = [self.columns, self.announced / self.columns].map(|n| n as f64);
        let fits = |less: f64| {
            let near =
                |n: usize| (pitch[n] * (counts[n] - less) / size[n] - 1.0).abs() < 0.25 / counts[n];
            near(0) && near(1)
        };
        match (fits(0.0), fits(1.0)) {
            (true, _) => Some(Span::PixelEdges),
            (_, true) => Some(Span::PixelCentres),
            _ => None,
        }
    }
}
