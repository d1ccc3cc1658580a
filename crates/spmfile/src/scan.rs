//! The common shape of a scan, whatever instrument wrote it.
//!
//! Positions: `x` to the right, `y` up. Row 0 is the bottom line (smallest y), column 0 the left
//! one. Lengths in nm, angles in rad counter-clockwise, times in s.

use std::ops::Range;

use crate::units::plain_unit;

/// Sense of the slow motion: which line of the frame was acquired first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameDirection {
    /// The bottom line (row 0) was acquired first.
    Up,
    /// The top line (last row) was acquired first.
    Down,
}

impl FrameDirection {
    /// The one that is called `up` or `down`.
    pub(crate) fn named(name: &str) -> Option<Self> {
        match name.trim().to_ascii_lowercase().as_str() {
            "up" => Some(Self::Up),
            "down" => Some(Self::Down),
            _ => None,
        }
    }
}

/// Sense of the fast motion within a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LineDirection {
    /// Column 0 was acquired first.
    Trace,
    /// The last column was acquired first. The samples are stored in order of position all the same.
    Retrace,
}

/// A calendar date and time as the instrument's clock showed it, without a time zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DateTime {
    /// Year, as in 2024.
    pub year: i32,
    /// Month, 1 to 12.
    pub month: u8,
    /// Day of the month, 1 to 31.
    pub day: u8,
    /// Hour, 0 to 23.
    pub hour: u8,
    /// Minute.
    pub minute: u8,
    /// Second.
    pub second: u8,
}

/// The stored samples of one channel, kept in the width in which the file holds them.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// 16-bit counts.
    I16(Vec<i16>),
    /// 32-bit counts.
    I32(Vec<i32>),
    /// Single-precision values.
    F32(Vec<f32>),
    /// Double-precision values.
    F64(Vec<f64>),
}

/// What the nominal width and height of a channel reach across.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Span {
    /// From the centre of the first to that of the last pixel: N pixels are width/(N − 1) apart.
    PixelCentres,
    /// As [`Span::PixelCentres`] along the line; the height is the share of the recorded lines in that
    /// of the full frame, so that lines have the pitch that the aspect ratio gives them.
    Frame,
    /// From edge to edge: N pixels are width/N apart.
    PixelEdges,
}

/// One image: a quantity recorded at every pixel of the frame.
#[derive(Clone, Debug)]
pub struct Channel {
    /// The name the user sees, as in `TR Phase`.
    pub name: String,
    /// The instrument's own name, as in `TRPhase`; empty where there is none.
    pub internal_name: String,
    /// The unit of [`Channel::values`] as written in the file (`nm`, `°`, `mV`), empty if none.
    pub unit: String,
    /// Trace or retrace, where the file tells.
    pub line_direction: Option<LineDirection>,
    /// `Main`, `Interleave` and the like, where the file tells.
    pub scan_line: Option<String>,
    /// Number of lines.
    pub rows: usize,
    /// Number of samples in a line.
    pub columns: usize,
    /// Nominal length of a line; `None` where the file gives no size.
    pub width_nm: Option<f64>,
    /// Nominal height of the recorded lines: of an unfinished frame their share of the full height.
    pub height_nm: Option<f64>,
    /// What [`Channel::width_nm`] reaches across. [`Channel::pitch_nm`] takes it into account.
    pub span: Span,
    /// `value = count · scale + offset`.
    pub scale: f64,
    /// See [`Channel::scale`].
    pub offset: f64,
    /// How [`Channel::scale`] came about, in words for the user.
    pub scaling: String,
    /// What the instrument subtracted while or after recording (`Line`, `Full` …); `None` if nothing.
    pub plane_fit: Option<String>,
    /// The samples, row 0 at the bottom.
    pub samples: Samples,
}

/// A channel that the file announces but that could not be read.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct UnreadableChannel {
    /// Its name, or its position in the file where the name is lost.
    pub name: String,
    /// What was expected, what was found.
    pub error: String,
}

/// One frame as the instrument wrote it.
#[derive(Clone, Debug, Default)]
pub struct Scan {
    /// The file format in words, as in `NanoScope 9.70`.
    pub format: String,
    /// The instrument, where the file names it.
    pub instrument: Option<String>,
    /// When the frame was saved (roughly its end), by the instrument's clock.
    pub acquired: Option<DateTime>,
    /// Sense of the slow motion.
    pub frame_direction: Option<FrameDirection>,
    /// Lines per second, a line being trace and retrace together.
    pub line_rate_hz: Option<f64>,
    /// Time of the trace and of the retrace within the frame, s, where the file gives them apart;
    /// otherwise each takes half a line, shortened by [`Scan::rounding`].
    pub line_times_s: Option<[f64; 2]>,
    /// Overscan: the fraction by which the fast motion exceeds the frame (NanoScope `X round`).
    pub rounding: Option<f64>,
    /// Rotation of the fast axis against x, counter-clockwise, rad.
    pub rotation_rad: f64,
    /// Centre of the frame as set by the user, nm.
    pub offset_nm: [f64; 2],
    /// Nominal size of the full frame (fast, slow), nm.
    pub size_nm: Option<[f64; 2]>,
    /// Whether the x/y scanner was under closed-loop control.
    pub closed_loop: Option<bool>,
    /// Every channel that could be read, in file order.
    pub channels: Vec<Channel>,
    /// Channels that could not be read.
    pub unreadable: Vec<UnreadableChannel>,
    /// Doubts about how the file was understood, in words for the user.
    pub notes: Vec<String>,
    /// What else the header says, as names and values, in the order of the file.
    pub metadata: Vec<(String, String)>,
}

impl Samples {
    /// Number of samples.
    pub fn len(&self) -> usize {
        match self {
            Self::I16(v) => v.len(),
            Self::I32(v) => v.len(),
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A part of them as values.
    pub(crate) fn values(&self, part: Range<usize>, scale: f64, offset: f64) -> Vec<f64> {
        let value = |count: f64| count * scale + offset;
        match self {
            Self::I16(v) => v[part].iter().map(|&c| value(f64::from(c))).collect(),
            Self::I32(v) => v[part].iter().map(|&c| value(f64::from(c))).collect(),
            Self::F32(v) => v[part].iter().map(|&c| value(f64::from(c))).collect(),
            Self::F64(v) => v[part].iter().map(|&c| value(c)).collect(),
        }
    }

    /// Shows a part of them to `look`, one after the other.
    pub(crate) fn each(&self, part: Range<usize>, mut look: impl FnMut(f64)) {
        match self {
            Self::I16(v) => v[part].iter().for_each(|&n| look(f64::from(n))),
            Self::I32(v) => v[part].iter().for_each(|&n| look(f64::from(n))),
            Self::F32(v) => v[part].iter().for_each(|&n| look(f64::from(n))),
            Self::F64(v) => v[part].iter().for_each(|&n| look(n)),
        }
    }

    /// The same in double precision, which knows NaN.
    pub(crate) fn into_doubles(self) -> Vec<f64> {
        match self {
            Self::I16(v) => v.into_iter().map(f64::from).collect(),
            Self::I32(v) => v.into_iter().map(f64::from).collect(),
            Self::F32(v) => v.into_iter().map(f64::from).collect(),
            Self::F64(v) => v,
        }
    }
}

/// Formats that do not say whether their size spans N pixels or N − 1: see FORMATS.md.
const SIZE_TAKEN_AS: [&str; 8] = [
    "NanoScope",
    "Nanonis",
    "Nanosurf",
    "Park",
    "WSxM",
    "Agilent",
    "ISO 28632",
    "Omicron Matrix",
];

impl Scan {
    /// Whether the format defines what its size spans. Otherwise the pitch of the pixels may be off by 1/N of N pixels.
    pub fn size_is_defined(&self) -> bool {
        self.format == crate::nanonis_grid::WITH_POSITIONS
            || !SIZE_TAKEN_AS
                .iter()
                .any(|format| self.format.starts_with(format))
    }
}

impl Channel {
    /// All values in [`Channel::unit`], row by row from the bottom line; missing ones are NaN.
    pub fn values(&self) -> Vec<f64> {
        self.samples
            .values(0..self.samples.len(), self.scale, self.offset)
    }

    /// The values of the lines `rows`, row by row; empty beyond the last one.
    pub fn lines(&self, rows: Range<usize>) -> Vec<f64> {
        let end = (rows.end * self.columns).min(self.samples.len());
        let part = (rows.start * self.columns).min(end)..end;
        self.samples.values(part, self.scale, self.offset)
    }

    /// [`Channel::unit`] in the signs of the SI: `°` for `deg`, `µm` for `um`; see [`crate::plain_unit`].
    pub fn plain_unit(&self) -> String {
        plain_unit(&self.unit)
    }

    /// Nominal distance of neighbouring samples along a line and of neighbouring lines, nm.
    ///
    /// `None` without a size, or for a single pixel between whose centre and itself nothing lies.
    pub fn pitch_nm(&self) -> Option<[f64; 2]> {
        let (width, height) = self.width_nm.zip(self.height_nm)?;
        let (columns, rows) = (self.columns as f64, self.rows as f64);
        let fast = match self.span {
            Span::PixelCentres | Span::Frame => width / (columns - 1.0),
            Span::PixelEdges => width / columns,
        };
        let slow = match self.span {
            Span::PixelCentres => height / (rows - 1.0),
            Span::Frame => fast * (height / rows) / (width / columns),
            Span::PixelEdges => height / rows,
        };
        let possible = |n: f64| n > 0.0 && n.is_finite();
        (possible(fast) && possible(slow)).then_some([fast, slow])
    }

    /// Width and height from edge to edge, N times the pitch, nm; `None` without a size.
    pub fn edges_nm(&self) -> Option<[f64; 2]> {
        if self.span == Span::PixelEdges {
            return Some([self.width_nm?, self.height_nm?]);
        }
        let [fast, slow] = self.pitch_nm()?;
        Some([fast * self.columns as f64, slow * self.rows as f64])
    }
}

/// The names and directions of a channel.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ChannelInfo {
    /// The name the user sees, as in `TR Phase`.
    pub name: String,
    /// The instrument's own name, as in `TRPhase`; empty where there is none.
    pub internal_name: String,
    /// Trace or retrace, where the file tells.
    pub line_direction: Option<LineDirection>,
    /// `Main`, `Interleave` and the like, where the file tells.
    pub scan_line: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 70 nm of 8 samples: 10 nm apart from centre to centre, 8.75 nm from edge to edge. Of 8 lines
    /// that make a square, 2 are there.
    #[test]
    fn pitches_by_span() {
        let mut channel = Channel {
            name: String::new(),
            internal_name: String::new(),
            unit: String::new(),
            line_direction: None,
            scan_line: None,
            rows: 2,
            columns: 8,
            width_nm: Some(70.0),
            height_nm: Some(17.5),
            span: Span::Frame,
            scale: 1.0,
            offset: 0.0,
            scaling: String::new(),
            plane_fit: None,
            samples: Samples::F64(vec![0.0; 16]),
        };
        assert_eq!(channel.pitch_nm(), Some([10.0, 10.0]));
        assert_eq!(channel.edges_nm(), Some([80.0, 20.0]));
        channel.span = Span::PixelCentres;
        assert_eq!(channel.pitch_nm(), Some([10.0, 17.5]));
        channel.span = Span::PixelEdges;
        assert_eq!(channel.pitch_nm(), Some([8.75, 8.75]));
        assert_eq!(channel.edges_nm(), Some([70.0, 17.5]));
        (channel.columns, channel.span) = (1, Span::PixelCentres);
        assert_eq!((channel.pitch_nm(), channel.edges_nm()), (None, None));
        channel.columns = 8;
        assert_eq!(channel.lines(1..2), channel.values()[8..]);
        assert!(channel.lines(2..5).is_empty());
    }
}
