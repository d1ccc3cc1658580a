//! Where the samples of a channel lie, and how they are decoded: whole, or line by line.

use std::borrow::Cow;
use std::ops::Range;

use crate::cursor::Endian;
use crate::error::ReadError;
use crate::header::{ChannelHeader, Scaling};
use crate::judge::{Check, Judge, Verdict};
use crate::raster::{self, Encoding, Order};
use crate::scan::Samples;
use crate::source::Data;

/// Samples that are decoded together where all of them are examined first.
const AT_ONCE: usize = 1 << 20;

/// The samples of a channel in its file.
pub(crate) enum Stored<'a> {
    /// Line by line.
    Flat(Flat<'a>),
    /// In some other way, decoded as a whole.
    Packed(Packed<'a>),
    /// Between those of other channels: see [`crate::outline::Together`].
    Mixed,
    /// Not to be read, and why.
    Refused(String),
}

/// Decodes all samples of a channel.
pub(crate) type Packed<'a> = Box<dyn Fn() -> Result<Unpacked, Failure> + Send + Sync + 'a>;

/// What came out of a packed channel.
pub(crate) struct Unpacked {
    pub(crate) samples: Samples,
    /// Whether they are the luminance of a coloured picture.
    pub(crate) rendering: bool,
}

impl Unpacked {
    /// Samples that were measured.
    pub(crate) fn measured(samples: Samples) -> Self {
        Self {
            samples,
            rendering: false,
        }
    }
}

/// Why a channel is not decoded.
pub(crate) enum Failure {
    /// It alone cannot be read; a name stands for its own where it has none.
    Channel { name: Option<String>, error: String },
    /// The file ends before it does.
    Lost(String),
    /// Its scale is no number.
    Scale(String),
    /// The file is refused.
    File(ReadError),
}

/// Samples line by line.
pub(crate) struct Flat<'a> {
    pub(crate) place: Place<'a>,
    pub(crate) encoding: Encoding,
    pub(crate) endian: Endian,
    pub(crate) order: Order,
    /// What holds samples of the image, in stored rows and columns; others are missing.
    pub(crate) valid: Option<Valid>,
    /// What only all samples together tell.
    pub(crate) check: Check,
}

/// Where the lines are.
pub(crate) enum Place<'a> {
    /// From this byte of the file on.
    At(u64),
    /// In these bytes.
    Block(Cow<'a, [u8]>),
}

/// The part of an image that was recorded.
#[derive(Clone, Debug)]
pub(crate) struct Valid {
    pub(crate) rows: Range<usize>,
    pub(crate) columns: Range<usize>,
}

impl Stored<'_> {
    /// The same without anything borrowed, if it borrows nothing.
    pub(crate) fn detached(self) -> Option<Stored<'static>> {
        match self {
            Stored::Flat(flat) => match flat.place {
                Place::At(at) => Some(Stored::Flat(flat.moved(Place::At(at)))),
                Place::Block(_) => None,
            },
            Stored::Refused(error) => Some(Stored::Refused(error)),
            _ => None,
        }
    }

    /// The same with its block copied, if it has one.
    pub(crate) fn owned(self) -> Option<Stored<'static>> {
        match self {
            Stored::Flat(mut flat) => {
                let place = std::mem::replace(&mut flat.place, Place::At(0));
                let Place::Block(block) = place else {
                    return None;
                };
                let block = Cow::Owned(block.into_owned());
                Some(Stored::Flat(flat.moved(Place::Block(block))))
            }
            other => other.detached(),
        }
    }
}

impl Flat<'static> {
    /// Lines from a byte of the file on, the bottom line first.
    pub(crate) fn at(start: usize, encoding: Encoding, endian: Endian) -> Self {
        Self {
            place: Place::At(start as u64),
            encoding,
            endian,
            order: Order::default(),
            valid: None,
            check: Check::Nothing,
        }
    }
}

impl<'a> Flat<'a> {
    /// Lines in a block, the bottom line first.
    pub(crate) fn block(block: Cow<'a, [u8]>, encoding: Encoding, endian: Endian) -> Self {
        Self {
            place: Place::Block(block),
            ..Flat::at(0, encoding, endian)
        }
    }

    /// The same in another place.
    fn moved(self, place: Place<'_>) -> Flat<'_> {
        Flat {
            place,
            encoding: self.encoding,
            endian: self.endian,
            order: self.order,
            valid: self.valid,
            check: self.check,
        }
    }

    /// The same in another order.
    pub(crate) fn in_order(self, order: Order) -> Self {
        Self { order, ..self }
    }

    /// The samples of some rows, counted from the bottom, as they are stored.
    fn decode(
        &self,
        data: &Data<'_>,
        header: &ChannelHeader,
        rows: &Range<usize>,
    ) -> Result<Samples, ReadError> {
        let line = header.columns * self.encoding.width();
        let first = if self.order.top_first {
            header.rows - rows.end
        } else {
            rows.start
        };
        let (start, length) = (first * line, rows.len() * line);
        let bytes = match &self.place {
            Place::At(at) => data.get(at + start as u64, length)?,
            Place::Block(block) => {
                let part = block.get(start..start + length);
                Cow::Borrowed(part.ok_or_else(|| ReadError::Source {
                    at: start as u64,
                    length,
                    reason: "its samples end before".to_owned(),
                })?)
            }
        };
        Ok(raster::decode(
            &bytes,
            header.columns,
            self.encoding,
            self.endian,
            self.order,
        ))
    }

    /// All samples, and what they tell of their own.
    pub(crate) fn whole(
        &self,
        data: &Data<'_>,
        header: &ChannelHeader,
    ) -> Result<(Samples, Verdict), Failure> {
        let samples = self
            .decode(data, header, &(0..header.rows))
            .map_err(Failure::File)?;
        let mut judge = Judge::new(&self.check, header.columns);
        judge.look(0, &samples);
        let verdict = judge.verdict().map_err(Failure::channel)?;
        let blanked = verdict.blank(samples, header.columns);
        Ok((self.without_invalid(blanked, 0, header.columns), verdict))
    }

    /// What all samples tell, without keeping them.
    pub(crate) fn judged(
        &self,
        data: &Data<'_>,
        header: &ChannelHeader,
    ) -> Result<Verdict, Failure> {
        let mut judge = Judge::new(&self.check, header.columns);
        if !matches!(self.check, Check::Nothing) {
            let step = (AT_ONCE / header.columns.max(1)).max(1);
            for start in (0..header.rows).step_by(step) {
                let rows = start..(start + step).min(header.rows);
                let samples = self.decode(data, header, &rows).map_err(Failure::File)?;
                judge.look(start, &samples);
            }
        }
        judge.verdict().map_err(Failure::channel)
    }

    /// The values of some rows, of which the verdict is known.
    pub(crate) fn rows(
        &self,
        data: &Data<'_>,
        header: &ChannelHeader,
        rows: Range<usize>,
        verdict: &Verdict,
        scaling: &Scaling,
    ) -> Result<Vec<f64>, ReadError> {
        let samples = self.decode(data, header, &rows)?;
        let samples = self.without_invalid(samples, rows.start, header.columns);
        let mut values = samples.values(0..samples.len(), scaling.scale, scaling.offset);
        for blank in &verdict.blank {
            let start = blank.start.max(rows.start);
            let end = blank.end.min(rows.end);
            if start < end {
                let part =
                    (start - rows.start) * header.columns..(end - rows.start) * header.columns;
                values[part].fill(f64::NAN);
            }
        }
        Ok(values)
    }

    /// Samples from row `first` on with those outside the valid region marked as missing.
    fn without_invalid(&self, samples: Samples, first: usize, columns: usize) -> Samples {
        let Some(Valid {
            rows,
            columns: valid,
        }) = &self.valid
        else {
            return samples;
        };
        let mut values = samples.into_doubles();
        for (n, line) in values.chunks_exact_mut(columns.max(1)).enumerate() {
            if rows.contains(&(first + n)) {
                line[..valid.start].fill(f64::NAN);
                line[valid.end..].fill(f64::NAN);
            } else {
                line.fill(f64::NAN);
            }
        }
        Samples::F64(values)
    }
}

impl Failure {
    /// The channel alone cannot be read.
    pub(crate) fn channel(error: String) -> Self {
        Self::Channel { name: None, error }
    }

    /// The error of reading a channel alone.
    pub(crate) fn of(self, header: &ChannelHeader) -> ReadError {
        let (name, reason) = match self {
            Self::File(error) => return error,
            Self::Channel { name, error } => (name, error),
            Self::Lost(error) | Self::Scale(error) => (None, error),
        };
        ReadError::Channel {
            name: name.unwrap_or_else(|| header.info.name.clone()),
            reason,
        }
    }
}
