//! Archives of arrays, `.npz`: each array of two dimensions is a channel.

use super::npy;
use super::plane::{Plane, Told};
use super::read::{frame, header, info};
use crate::archive::Archive;
use crate::error::ReadError;
use crate::labels;
use crate::outline::{Input, Outline};
use crate::scan::Scan;
use crate::stored::{Failure, Stored, Unpacked};
use crate::whole::MOST_CHANNELS;
use crate::words;

const FORMAT: &str = "NumPy archive";
/// Arrays of one dimension beside the images: positions of columns and of lines.
const COORDINATES: [&str; 2] = ["x_nm", "y_nm"];

fn damaged(reason: String) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// Opens an archive of arrays.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let options = &input.options;
    let mut archive = Archive::open(input.bytes).map_err(damaged)?;
    let names: Vec<String> = archive
        .names()
        .into_iter()
        .filter(|name| name.strip_suffix(".npy").is_some())
        .collect();
    if names.len() > MOST_CHANNELS {
        return Err(ReadError::TooManyChannels {
            found: names.len(),
            limit: MOST_CHANNELS,
        });
    }
    let mut outline = Outline::default();
    let mut first: Option<Scan> = None;
    for entry in &names {
        let stem = entry.trim_end_matches(".npy");
        let carried = match archive.entry(&format!("{stem}.txt")) {
            Some(text) => labels::lines(&words::decode(&text.map_err(damaged)?)),
            None => Vec::new(),
        };
        let head = archive.head(entry).map_err(damaged)?;
        let mut plane = match npy::header(&head) {
            Ok(array) => {
                archive.reserve(entry, array.length).map_err(damaged)?;
                let fits = labels::fits(&carried, [array.rows, array.columns]);
                Plane {
                    rows: array.rows,
                    columns: array.columns,
                    samples: unpacked(input.bytes, entry.clone()),
                    carried: if fits { carried } else { Vec::new() },
                    size_nm: None,
                }
            }
            // Positions of the pixels, written beside the images.
            Err(_) if COORDINATES.contains(&stem) => continue,
            Err(error) => Plane {
                rows: 0,
                columns: 0,
                samples: Stored::Refused(error.reason()),
                carried: Vec::new(),
                size_nm: None,
            },
        };
        let told = Told::by(&mut plane);
        first.get_or_insert_with(|| frame(FORMAT, options, &told));
        let name = told.name.clone().unwrap_or_else(|| stem.to_owned());
        let info = info(name, options, &told);
        let header = header(info, [plane.rows, plane.columns], options, &told);
        outline.add(header, plane.samples);
    }
    outline.scan = first.unwrap_or_else(|| frame(FORMAT, options, &Told::default()));
    outline.announced = Some(outline.channels.len()).filter(|&count| count > 0);
    Ok(outline)
}

/// An array in an archive, unpacked when it is wanted.
fn unpacked(archive: &[u8], entry: String) -> Stored<'_> {
    let samples = move || {
        let whole = |reason| Failure::File(damaged(reason));
        let mut archive = Archive::open(archive).map_err(whole)?;
        let content = archive.entry(&entry);
        let content = content.unwrap_or_else(|| Err(format!("{entry:?} is gone")));
        let content = content.map_err(whole)?;
        let array = npy::header(&content).map_err(|trouble| Failure::channel(trouble.reason()))?;
        let samples = array.samples(&content).map_err(Failure::channel)?;
        Ok(Unpacked::measured(samples))
    };
    Stored::Packed(Box::new(samples))
}
