//! JPK images in HDF5, `.h5-jpk`: films of fast instruments, and single images.
//!
//! A group `Measurement_000` has the grid as attributes. Each group `Channel_000` … in it is a channel in one direction,
//! with an array of pixels × frames: line after line, the bottom one first. Values are
//! count × `net-encoder.scaling.multiplier` + `net-encoder.scaling.offset`.

use std::collections::BTreeMap;
use std::sync::Arc;

use hdf5_pure::{AttrValue, Error, File, Group};

use super::centre;
use crate::error::ReadError;
use crate::hdf5::{Array, View, text};
use crate::header::ChannelHeader;
use crate::limits::unpacked_limit;
use crate::outline::{Input, Outline};
use crate::scan::{ChannelInfo, LineDirection, Scan, UnreadableChannel};
use crate::stored::{Failure, Stored, Unpacked};
use crate::whole::{MOST_CHANNELS, some_readable};
use crate::words::Unread;

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

/// The frames of a channel.
struct Film {
    array: Array,
    rows: usize,
    columns: usize,
    frames: usize,
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
    let array = Array::of(group.dataset(name).map_err(words)?, room)?;
    let pixels = rows as u64 * columns as u64;
    let frames = match array.shape[..] {
        [found] if found == pixels => 1,
        [found, frames] if found == pixels => frames as usize,
        _ => {
            let shape = &array.shape;
            return Err(format!(
                "expected an array of {rows} x {columns} pixels × frames, found {shape:?}"
            ));
        }
    };
    Ok(Film {
        array,
        rows,
        columns,
        frames,
    })
}

impl Film {
    /// One frame.
    fn image(&self, frame: usize) -> Result<Unpacked, Failure> {
        self.array.image(&View {
            rows: self.rows,
            columns: self.columns,
            start: frame,
            steps: [self.columns * self.frames, self.frames].map(|step| step as isize),
        })
    }
}

#[cfg(test)]
mod tests;
