//! What a file tells of a channel before any of its samples is decoded.

use crate::scan::{Channel, ChannelInfo, Samples, Span};
use crate::units;

/// A channel without its samples.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ChannelHeader {
    /// Its names and directions.
    pub info: ChannelInfo,
    /// As [`Channel::unit`].
    pub unit: String,
    /// The unit as the file spells it (`~m`, `º`), empty if none.
    pub unit_as_written: String,
    /// Number of lines.
    pub rows: usize,
    /// Number of samples in a line.
    pub columns: usize,
    /// As [`Channel::width_nm`].
    pub width_nm: Option<f64>,
    /// As [`Channel::height_nm`].
    pub height_nm: Option<f64>,
    /// As [`Channel::span`].
    pub span: Span,
    /// How samples become values; `None` where only the samples tell it.
    pub scaling: Option<Scaling>,
    /// As [`Channel::plane_fit`].
    pub plane_fit: Option<String>,
}

/// `value = sample · scale + offset`.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Scaling {
    /// The factor.
    pub scale: f64,
    /// What is added.
    pub offset: f64,
    /// How they came about, in words for the user.
    pub words: String,
}

impl Scaling {
    /// Samples that are values already.
    pub(crate) fn as_stored() -> Self {
        Self {
            scale: 1.0,
            offset: 0.0,
            words: "values as stored".to_owned(),
        }
    }

    /// Whether it makes numbers of numbers.
    pub(crate) fn is_finite(&self) -> bool {
        self.scale.is_finite() && self.offset.is_finite()
    }
}

impl ChannelHeader {
    /// A channel of which no more is known: no unit, no size, values as stored.
    pub(crate) fn new(info: ChannelInfo, rows: usize, columns: usize) -> Self {
        Self {
            info,
            unit: String::new(),
            unit_as_written: String::new(),
            rows,
            columns,
            width_nm: None,
            height_nm: None,
            span: Span::PixelEdges,
            scaling: Some(Scaling::as_stored()),
            plane_fit: None,
        }
    }

    /// The same with the unit that the file writes.
    pub(crate) fn in_unit(mut self, written: &str) -> Self {
        self.unit = units::clean(written);
        written.clone_into(&mut self.unit_as_written);
        self
    }

    /// The same with a size, nm.
    pub(crate) fn of_size(mut self, size_nm: Option<[f64; 2]>) -> Self {
        self.width_nm = size_nm.map(|[width, _]| width);
        self.height_nm = size_nm.map(|[_, height]| height);
        self
    }

    /// The same with its samples scaled.
    pub(crate) fn scaled(mut self, scale: f64, offset: f64, words: String) -> Self {
        self.scaling = Some(Scaling {
            scale,
            offset,
            words,
        });
        self
    }

    /// The channel with its samples.
    pub(crate) fn with(&self, samples: Samples, scaling: &Scaling) -> Channel {
        Channel {
            name: self.info.name.clone(),
            internal_name: self.info.internal_name.clone(),
            unit: self.unit.clone(),
            line_direction: self.info.line_direction,
            scan_line: self.info.scan_line.clone(),
            rows: self.rows,
            columns: self.columns,
            width_nm: self.width_nm,
            height_nm: self.height_nm,
            span: self.span,
            scale: scaling.scale,
            offset: scaling.offset,
            scaling: scaling.words.clone(),
            plane_fit: self.plane_fit.clone(),
            samples,
        }
    }
}
