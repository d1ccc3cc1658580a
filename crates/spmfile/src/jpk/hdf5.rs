//! JPK images in HDF5, `.h5-jpk`: films of fast instruments, and single images.
//!
//! A group `Measurement_000` has the grid as attributes. Each group `Channel_000` … in it is a channel in one direction,
//! with an array of pixels × frames: line after line, the bottom one first. Values are
//! count × `net-encoder.scaling.multiplier` + `net-encoder.scaling.offset`.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use hdf5_pure::{AttrValue, DType, Dataset, Error, File, Group};

use super::centre;
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::limits::unpacked_limit;
use crate::outline::{Input, Outline};
use crate::scan::{ChannelInfo, LineDirection, Samples, Scan, UnreadableChannel};
use crate::stored::{Failure, Stored, Unpacked};
use crate::whole::{MOST_CHANNELS, some_readable};
use crate::words::{self, Unread};

const FORMAT: &str = "JPK in HDF5";
/// What every scan says.
const UNTESTED: &str = "the reader of JPK images in HDF5 is untested on files of an instrument";

impl From<Error> for ReadError {
    fn from(error: Error) -> Self {
        ReadError::damaged(FORMAT, error.to_string())
    }
}

fn nothing() -> ReadError {
    ReadError::unsupported(
        FORMAT,
        "expected groups Measurement_… with groups Channel_…, found none",
    )
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let file = File::from_bytes(input.bytes.to_vec())?;
    let groups = named(&file.root(), "Measurement_")?;
    let (measurement, others) = groups.split_first().ok_or_else(nothing)?;
    let measurement = file.group(measurement)?;
    let grid = Attributes::of(&measurement)?;
    let shape = [grid.count("jlength")?, grid.count("ilength")?];
    let mut outline = Outline::of(grid.frame());
    outline.scan.notes.push(UNTESTED.to_owned());
    if !others.is_empty() {
        let more = others.len();
        let note = format!("the file holds {more} measurements more, which are left out");
        outline.scan.notes.push(note);
    }
    let channels = named(&measurement, "Channel_")?;
    let (announced, mut left) = (channels.len(), MOST_CHANNELS);
    // What is packed may become larger, but not all of it.
    let mut room = unpacked_limit(input.bytes.len());
    for name in channels {
        let group = measurement.group(&name)?;
        let about = Attributes::of(&group)?;
        let info = about.channel(&name);
        match film(&group, &info, shape, &mut room) {
            Ok(film) => {
                let film = Arc::new(film);
                let frames = film.frames.min(left);
                if frames < film.frames {
                    let found = film.frames;
                    let note = format!(
                        "of {found} frames of {:?} the first {frames} are read",
                        info.name
                    );
                    outline.scan.notes.push(note);
                }
                left -= frames;
                for frame in 0..frames {
                    about.add(&mut outline, &info, &film, frame);
                }
            }
            Err(error) => outline.scan.unreadable.push(UnreadableChannel {
                name: info.name,
                error,
            }),
        }
        outline.scan.notes.extend(about.unread.notes());
    }
    outline.scan.notes.extend(grid.unread.notes());
    if announced == 0 {
        return Err(nothing());
    }
    some_readable(outline, announced)
}

/// The groups of a group whose names begin so, in order.
fn named(group: &Group, begin: &str) -> Result<Vec<String>, Error> {
    let mut names = group.groups()?;
    names.retain(|name| name.starts_with(begin));
    names.sort();
    Ok(names)
}

/// The attributes of a group, as texts.
struct Attributes {
    all: BTreeMap<String, String>,
    unread: Unread,
}

impl Attributes {
    fn of(group: &Group) -> Result<Self, Error> {
        let told = |(key, value): (String, AttrValue)| Some((key, text(&value)?));
        Ok(Self {
            all: group.attrs()?.into_iter().filter_map(told).collect(),
            unread: Unread::default(),
        })
    }

    fn get(&self, key: &str) -> Option<&str> {
        self.all.get(key).map(String::as_str)
    }

    fn number(&self, key: &str) -> Option<f64> {
        self.unread.number(key, self.get(key))
    }

    /// A number of the grid.
    fn grid(&self, key: &str) -> Option<f64> {
        self.number(&format!("position-pattern.grid.{key}"))
    }

    fn count(&self, key: &str) -> Result<usize, ReadError> {
        let count = self.grid(key).filter(|n| *n >= 1.0 && n.fract() == 0.0);
        let count = count.filter(|n| *n <= f64::from(i32::MAX));
        let found = count.ok_or_else(|| {
            ReadError::damaged(
                FORMAT,
                format!(
                    "expected the {key} of its grid above 0, found {:?}",
                    self.grid(key)
                ),
            )
        })?;
        Ok(found as usize)
    }

    /// Everything about the frame but its channels.
    fn frame(&self) -> Scan {
        let nm = |key: &str| self.grid(key).map(|metres| metres * 1e9);
        let length = |key: &str| nm(key).map(f64::abs).filter(|&n| n > 0.0 && n.is_finite());
        let size_nm = length("ulength").zip(length("vlength")).map(Into::into);
        let rotation_rad = self.grid("theta").unwrap_or(0.0);
        Scan {
            format: FORMAT.to_owned(),
            line_rate_hz: self
                .number("timing-settings.scanRate")
                .filter(|&rate| rate > 0.0),
            rotation_rad,
            offset_nm: match nm("xcenter").zip(nm("ycenter")) {
                Some(centre) => centre.into(),
                None => centre(nm("x0"), nm("y0"), size_nm, rotation_rad, false),
            },
            size_nm,
            metadata: self.all.clone().into_iter().collect(),
            ..Scan::default()
        }
    }

    /// A channel by its group.
    fn channel(&self, group: &str) -> ChannelInfo {
        let name = self.get("channel.name").unwrap_or(group);
        let retrace = self
            .unread
            .entry("retrace", self.get("retrace"), |text| match text {
                "true" | "1" => Some(LineDirection::Retrace),
                "false" | "0" => Some(LineDirection::Trace),
                _ => None,
            });
        ChannelInfo {
            name: name.to_owned(),
            internal_name: name.to_owned(),
            line_direction: retrace,
            scan_line: None,
        }
    }

    /// Adds a frame of a channel.
    fn add(&self, outline: &mut Outline<'_>, info: &ChannelInfo, film: &Arc<Film>, frame: usize) {
        let told = |key: &str| self.number(&format!("net-encoder.scaling.{key}"));
        let [factor, offset] = [
            told("multiplier").unwrap_or(1.0),
            told("offset").unwrap_or(0.0),
        ];
        let mut info = info.clone();
        if frame > 0 {
            info.name = format!("{} (frame {})", info.name, frame + 1);
        }
        let header = ChannelHeader::new(info, film.rows, film.columns)
            .in_unit(self.get("net-encoder.scaling.unit.unit").unwrap_or(""))
            .of_size(outline.scan.size_nm)
            .scaled(factor, offset, format!("counts × {factor} + {offset}"));
        let film = Arc::clone(film);
        outline.add(header, Stored::Packed(Box::new(move || film.image(frame))));
    }
}

/// A value as it is written; nothing of several.
fn text(value: &AttrValue) -> Option<String> {
    use AttrValue as A;
    macro_rules! number {
        ($($one:ident $some:ident),*) => {
            match value {
                $(A::$one(n) => Some(n.to_string()),
                A::$some(all) => all.first().filter(|_| all.len() == 1).map(ToString::to_string),)*
                other => Some(words::one_line(other.as_str()?)),
            }
        };
    }
    number!(
        F32 F32Array, F64 F64Array, I8 I8Array, I16 I16Array, I32 I32Array, I64 I64Array, U8 U8Array, U16 U16Array,
        U32 U32Array, U64 U64Array
    )
}

/// The frames of a channel.
struct Film {
    array: Dataset,
    rows: usize,
    columns: usize,
    frames: usize,
    /// All of them, once one was wanted.
    whole: OnceLock<Result<Samples, String>>,
}

/// The array of a channel: the one of its name, else the first.
fn film(
    group: &Group,
    info: &ChannelInfo,
    [rows, columns]: [usize; 2],
    room: &mut u64,
) -> Result<Film, String> {
    let words = |error: Error| error.to_string();
    let mut names = group.datasets().map_err(words)?;
    names.sort_by_key(|name| (!name.eq_ignore_ascii_case(&info.name), name.clone()));
    let name = names
        .first()
        .ok_or("expected an array of its samples, found none")?;
    let array = group.dataset(name).map_err(words)?;
    let shape = array.shape().map_err(words)?;
    let pixels = rows as u64 * columns as u64;
    let frames = match shape[..] {
        [found] if found == pixels => 1,
        [found, frames] if found == pixels => frames,
        _ => {
            return Err(format!(
                "expected an array of {rows} x {columns} pixels × frames, found {shape:?}"
            ));
        }
    };
    let chunk = array.chunk_shape().map_err(words)?;
    let stored = match chunk {
        Some(chunk) => {
            let chunks = array.chunks().map_err(words)?.len() as u64;
            chunk
                .iter()
                .fold(chunks, |all, &side| all.saturating_mul(side))
        }
        None => u64::MAX,
    };
    let samples = pixels.saturating_mul(frames);
    let length = samples.saturating_mul(array.element_size().map_err(words)?);
    let left = room
        .checked_sub(length)
        .filter(|_| (1..=stored).contains(&samples));
    *room = left.ok_or_else(|| {
        format!("expected as many samples in the file as in its array, {shape:?}")
    })?;
    Ok(Film {
        array,
        rows,
        columns,
        frames: frames as usize,
        whole: OnceLock::new(),
    })
}

impl Film {
    fn whole(&self) -> Result<Samples, String> {
        let kind = self.array.dtype().map_err(|error| error.to_string())?;
        let read = match kind {
            DType::I8 | DType::U8 | DType::I16 => self.array.read_i16().map(Samples::I16),
            DType::U16 | DType::I32 => self.array.read_i32().map(Samples::I32),
            DType::F32 => self.array.read_f32().map(Samples::F32),
            DType::F64 | DType::U32 | DType::I64 | DType::U64 => {
                self.array.read_f64().map(Samples::F64)
            }
            other => return Err(format!("expected numbers, found {other}")),
        };
        read.map_err(|error| error.to_string())
    }

    /// One frame.
    fn image(&self, frame: usize) -> Result<Unpacked, Failure> {
        let whole = self.whole.get_or_init(|| self.whole());
        let whole = whole
            .as_ref()
            .map_err(|error| Failure::channel(error.clone()))?;
        let (pixels, frames) = (self.rows * self.columns, self.frames);
        if whole.len() != pixels * frames {
            let found = whole.len();
            return Err(Failure::Lost(format!(
                "{found} of its {} samples are there",
                pixels * frames
            )));
        }
        macro_rules! samples {
            ($($kind:ident),*) => {
                match whole {
                    $(Samples::$kind(all) => Samples::$kind(all[frame..].iter().step_by(frames).copied().collect()),)*
                }
            };
        }
        Ok(Unpacked::measured(samples!(I16, I32, F32, F64)))
    }
}

#[cfg(test)]
mod tests;
