//! Scans of GXSM in `NetCDF`, `.nc`: one channel in one direction a file.
//!
//! A variable of time × value × `dimy` × `dimx`, named after the kind of its numbers, holds the image, in counts of `dz`. Lengths are in Å.
//! The variables `dimx` and `dimy` are the positions of the samples from the centre: they tell which line is the top one, and whether
//! `rangex` and `rangey` reach from edge to edge or from centre to centre.

mod netcdf;
#[cfg(test)]
mod tests;

use memchr::memmem;

use netcdf::{NetCdf, Variable};

use crate::cursor::Endian;
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::outline::{Input, Outline};
use crate::raster::{self, Order};
use crate::scan::{ChannelInfo, LineDirection, Scan, Span};
use crate::signature::head;
use crate::stored::Flat;
use crate::units::nm_per;
use crate::whole::{Extent, MOST_CHANNELS};
use crate::words::Unread;

const FORMAT: &str = "GXSM (NetCDF)";
/// What every scan says.
const UNTESTED: &str = "the reader of GXSM files is untested on files of an instrument";
/// Names of the image, by the kind of its numbers.
const IMAGES: [&str; 5] = ["FloatField", "DoubleField", "H", "Intensity", "ByteField"];
const NM_PER_ANGSTROM: f64 = 0.1;
/// How far lengths in single precision may be off, of a step.
const CLOSE: f64 = 0.1;

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// A `NetCDF` file with the dimensions of an image.
pub(crate) fn detect(bytes: &[u8]) -> bool {
    let has = |name: &[u8]| memmem::find(head(bytes), name).is_some();
    matches!(bytes, [b'C', b'D', b'F', 1 | 2 | 5, ..]) && has(b"dimx") && has(b"dimy")
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let file = NetCdf::of(input.bytes).map_err(damaged)?;
    let found = IMAGES
        .iter()
        .find_map(|name| Some((file.variable(name)?, file.variable(name)?.encoding()?)));
    let (image, encoding) = found.ok_or_else(|| {
        ReadError::unsupported(
            FORMAT,
            format!("expected an image ({}), found none", IMAGES.join(", ")),
        )
    })?;
    let &[times, values, rows, columns] = &image.shape[..] else {
        return Err(damaged(format!(
            "expected an image of time × value × y × x, found {:?}",
            image.shape
        )));
    };
    let images = times.saturating_mul(values);
    if images > MOST_CHANNELS {
        return Err(ReadError::TooManyChannels {
            found: images,
            limit: MOST_CHANNELS,
        });
    }
    let length = raster::byte_length(rows, columns, encoding)
        .ok_or_else(|| damaged(format!("its size is {rows} x {columns} samples")))?;

    let unread = Unread::default();
    let number = |name: &str| {
        unread.number(
            name,
            file.variable(name).and_then(|v| file.words(v)).as_deref(),
        )
    };
    let nm = |name: &str| number(name).map(|angstrom| angstrom * NM_PER_ANGSTROM);
    let size = nm("rangex")
        .zip(nm("rangey"))
        .map(|(x, y)| [x.abs(), y.abs()]);
    let mut outline = Outline::of(Scan {
        format: FORMAT.to_owned(),
        rotation_rad: number("alpha").unwrap_or(0.0).to_radians(),
        offset_nm: nm("offsetx")
            .zip(nm("offsety"))
            .map_or([0.0; 2], Into::into),
        size_nm: size.filter(|size| size.iter().all(|&side| side > 0.0)),
        notes: vec![UNTESTED.to_owned()],
        metadata: metadata(&file),
        ..Scan::default()
    });
    let along = |name: &str| {
        file.variable(name)
            .and_then(|v| file.numbers(v))
            .unwrap_or_default()
    };
    let positions = [along("dimx"), along("dimy")];
    let steps = positions.each_ref().map(|all| step(all));
    let order = Order {
        // From the top down, unless positions go up.
        top_first: steps[1].is_none_or(|step| step < 0.0),
        mirrored: steps[0].is_some_and(|step| step < 0.0),
    };
    if steps[1].is_none() {
        outline.scan.notes.push("expected positions of lines (dimy), found none: the first line is taken as the top one".to_owned());
    }
    let span = span(outline.scan.size_nm, steps, [columns, rows]);
    let (unit, factor) = scale(&file, image, &unread);
    let info = info(&file, image);
    let mut extent = Extent::default();
    for n in 0..images {
        let mut info = info.clone();
        if n > 0 {
            info.name = format!("{} (image {})", info.name, n + 1);
        }
        let start = n.saturating_mul(length).saturating_add(image.start);
        if !extent.take(input.length, start, length, &info.name) {
            continue;
        }
        let mut header = ChannelHeader::new(info, rows, columns)
            .in_unit(&unit)
            .of_size(outline.scan.size_nm)
            .scaled(factor, 0.0, format!("counts × dz, {factor}"));
        header.span = span;
        outline.add_flat(
            header,
            Flat::at(start, encoding, Endian::Big).in_order(order),
        );
    }
    outline.scan.notes.extend(unread.notes());
    extent.judge(outline, input.length)
}

/// From one position to the next, Å.
fn step(positions: &[f64]) -> Option<f64> {
    let (first, last) = (positions.first()?, positions.last()?);
    let step = (last - first) / (positions.len() - 1) as f64;
    (step != 0.0 && step.is_finite()).then_some(step)
}

/// What the size spans by the steps between positions; from edge to edge where they do not tell.
fn span(size: Option<[f64; 2]>, steps: [Option<f64>; 2], counts: [usize; 2]) -> Span {
    let centres = || {
        let size = size?;
        let mut all = size.iter().zip(steps).zip(counts);
        Some(all.all(|((size, step), count)| {
            let steps = step.map_or(f64::NAN, |step| size / (step.abs() * NM_PER_ANGSTROM));
            (steps - (count as f64 - 1.0)).abs() < CLOSE
        }))
    };
    if centres() == Some(true) {
        Span::PixelCentres
    } else {
        Span::PixelEdges
    }
}

/// The unit of the values and their factor. Heights are in Å; of others `dz` has a unit only where its alias is plain volts.
fn scale(file: &NetCdf<'_>, image: &Variable, unread: &Unread) -> (String, f64) {
    let dz = file.variable("dz");
    let told = unread.number("dz", dz.and_then(|v| file.words(v)).as_deref());
    let factor = told.filter(|&dz| dz != 0.0);
    let alias = image
        .attribute("ZSrcUnit")
        .or_else(|| dz?.attribute("unit"))
        .unwrap_or("");
    let is_length = matches!(alias, "AA" | "Ang") || nm_per(alias).is_some();
    match factor {
        Some(dz) if is_length => ("nm".to_owned(), dz * NM_PER_ANGSTROM),
        Some(dz) if alias == "V" => ("V".to_owned(), dz),
        Some(dz) => (String::new(), dz),
        None => (String::new(), 1.0),
    }
}

/// `scan042-M-Xp-Topo.nc`, the first name of the file: channel and direction; else the label of its values.
fn info(file: &NetCdf<'_>, image: &Variable) -> ChannelInfo {
    let name = file
        .variable("basename")
        .and_then(|v| file.words(v))
        .unwrap_or_default();
    let stem = name.rsplit(['/', '\\']).next().unwrap_or("");
    let mut parts = stem.strip_suffix(".nc").unwrap_or(stem).rsplit('-');
    let channel = parts.next().filter(|channel| !channel.is_empty());
    let line_direction = match parts.next() {
        Some("Xp") => Some(LineDirection::Trace),
        Some("Xm") => Some(LineDirection::Retrace),
        _ => None,
    };
    let channel = channel.filter(|_| line_direction.is_some());
    let name = channel
        .or_else(|| image.attribute("ZLabel"))
        .unwrap_or("Image");
    ChannelInfo {
        name: name.to_owned(),
        internal_name: name.to_owned(),
        line_direction,
        scan_line: None,
    }
}

/// Attributes, single numbers and texts, without the place where the file once was.
fn metadata(file: &NetCdf<'_>) -> Vec<(String, String)> {
    let told = file.attributes.iter().cloned();
    // Variables of a damaged file overlap: their texts together are no longer than the file.
    let mut left = file.bytes.len();
    let of_variable = |variable: &Variable| {
        let text = file.words(variable).filter(|text| text.len() <= left)?;
        left -= text.len();
        Some((variable.name.clone(), text))
    };
    let variables = file
        .variables
        .iter()
        .filter(|v| v.name != "basename")
        .filter_map(of_variable);
    told.chain(variables)
        .filter(|(_, value)| !value.is_empty())
        .collect()
}
