//! Images in HDF5 files: those of `NeXus`, and an array of two dimensions that is the only one of its file.
//!
//! Base class `NXdata` of the `NeXus` manual: the group's attribute `signal` names the array, `axes` the positions along its dimensions, the
//! slowest first. Two axes with units of length make an image; along a third one there is an image for each position.

use std::sync::Arc;

use hdf5_pure::{Dataset, Error, File, Group};

use super::plane::Told;
use super::read::{frame, header, info};
use crate::error::ReadError;
use crate::hdf5::{Array, View, text};
use crate::limits::unpacked_limit;
use crate::outline::{Input, Outline};
use crate::scan::UnreadableChannel;
use crate::stored::Stored;
use crate::units::nm_per;
use crate::whole::{MOST_CHANNELS, some_readable};

const FORMAT: &str = "HDF5";
const UNTESTED: &str = "the reader of NeXus files is untested on files of an instrument";
const BARE: &str =
    "the file tells neither positions nor units of length: its first line is taken as the top one";
/// Groups in groups that are looked into.
const DEEPEST: usize = 6;
/// How far positions may be off an even step, in steps.
const EVEN: f64 = 0.1;

fn damaged(error: &dyn ToString) -> ReadError {
    ReadError::damaged(FORMAT, error.to_string())
}

fn words(error: &Error) -> String {
    error.to_string()
}

/// Opens the images of a file.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let file = File::from_bytes(input.bytes.to_vec()).map_err(|error| damaged(&error))?;
    let mut content = Content::default();
    content
        .look(&file.root(), "", 0)
        .map_err(|error| damaged(&error))?;
    let mut room = unpacked_limit(input.bytes.len());
    let mut outline = Outline::default();
    let announced = content.data.len();
    for (name, group) in &content.data {
        match Images::of(name, group, &mut room) {
            Ok(images) => images.add(&mut outline, input),
            Err(error) => outline.scan.unreadable.push(UnreadableChannel {
                name: name.clone(),
                error,
            }),
        }
    }
    if announced == 0 {
        content.single(&mut room)?.add(&mut outline, input);
    }
    if outline.channels.len() > MOST_CHANNELS {
        return Err(ReadError::TooManyChannels {
            found: outline.channels.len(),
            limit: MOST_CHANNELS,
        });
    }
    outline.announced = Some(outline.channels.len() + outline.scan.unreadable.len());
    some_readable(outline, announced)
}

/// What is in a file.
#[derive(Default)]
struct Content {
    /// The groups of the class `NXdata`.
    data: Vec<(String, Group)>,
    /// The arrays outside of them.
    arrays: Vec<(String, Dataset)>,
    groups: usize,
}

impl Content {
    fn look(&mut self, group: &Group, path: &str, depth: usize) -> Result<(), Error> {
        self.groups += 1;
        // Links may go in circles.
        if depth > DEEPEST || self.groups > MOST_CHANNELS {
            return Ok(());
        }
        let class = group.attrs()?.get("NX_class").and_then(text);
        if class.as_deref() == Some("NXdata") {
            self.data.push((path.to_owned(), group.clone()));
            return Ok(());
        }
        let within = |name: &str| match path {
            "" => name.to_owned(),
            path => format!("{path}/{name}"),
        };
        let (mut arrays, mut groups) = (group.datasets()?, group.groups()?);
        arrays.sort();
        groups.sort();
        for name in arrays {
            self.arrays.push((within(&name), group.dataset(&name)?));
        }
        for name in groups {
            self.look(&group.group(&name)?, &within(&name), depth + 1)?;
        }
        Ok(())
    }

    /// The one array of two dimensions.
    fn single(self, room: &mut u64) -> Result<Images, ReadError> {
        let shape = |array: &Dataset| array.shape().unwrap_or_default();
        let list = |all: &[(String, Dataset)]| {
            let all = all.iter().take(5);
            let all: Vec<_> = all
                .map(|(name, array)| format!("{name} {:?}", shape(array)))
                .collect();
            all.join(", ")
        };
        let found = list(&self.arrays);
        let (mut planes, _): (Vec<_>, Vec<_>) = self.arrays.into_iter().partition(
            |(_, array)| matches!(shape(array)[..], [rows, columns] if rows > 1 && columns > 1),
        );
        let (Some((name, array)), true) = (planes.pop(), planes.is_empty()) else {
            let reason = format!(
                "expected a group NXdata or a single array of two dimensions, found {}. Save the image as Gwyddion, TIFF or NumPy array",
                if found.is_empty() { "no array" } else { &found }
            );
            return Err(ReadError::unsupported(FORMAT, reason));
        };
        let array = Array::of(array, room).map_err(|error| damaged(&error))?;
        Images::along(name, array, &["y", "x"].map(Axis::bare)).map_err(|error| damaged(&error))
    }
}

/// The positions along a dimension of an array.
struct Axis {
    name: String,
    unit: String,
    positions: Vec<f64>,
}

impl Axis {
    fn bare(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            unit: String::new(),
            positions: Vec::new(),
        }
    }

    fn of(group: &Group, name: &str, count: u64, room: &mut u64) -> Result<Self, String> {
        let Ok(array) = group.dataset(name) else {
            return Ok(Self::bare(name));
        };
        let unit = array
            .attrs()
            .map_err(|error| words(&error))?
            .get("units")
            .and_then(text);
        let array = Array::of(array, room)?;
        if array.shape != [count] {
            let found = &array.shape;
            return Err(format!(
                "expected {count} positions {name:?}, found {found:?}"
            ));
        }
        Ok(Self {
            name: name.to_owned(),
            unit: unit.unwrap_or_default(),
            positions: array.numbers()?,
        })
    }

    /// From one position to the next, nm; `None` where they are no lengths.
    fn step(&self) -> Result<Option<f64>, String> {
        let Some(nm) = nm_per(&self.unit) else {
            return Ok(None);
        };
        let (all, last) = (&self.positions, self.positions.len().saturating_sub(1));
        let step = (all.last().unwrap_or(&0.0) - all.first().unwrap_or(&0.0)) / last as f64;
        let even = |(i, place): (usize, &f64)| {
            (place - all[0] - step * i as f64).abs() <= EVEN * step.abs()
        };
        if !(step.abs() > 0.0 && all.iter().enumerate().all(even)) {
            let name = &self.name;
            return Err(format!(
                "expected positions {name:?} in even steps, found others"
            ));
        }
        Ok(Some(step * nm))
    }

    fn is_x(&self) -> bool {
        self.name.starts_with(['x', 'X'])
    }

    /// The words for one of its positions behind the name of a channel.
    fn place(&self, n: usize) -> String {
        let Self { name, unit, .. } = self;
        match self.positions.get(n) {
            // Single precision has as many digits as a position needs.
            Some(&at) => format!(" ({name} {} {unit})", at as f32).replace(" )", ")"),
            None => format!(" (image {})", n + 1),
        }
    }
}

/// The images of an array.
struct Images {
    name: String,
    unit: String,
    array: Arc<Array>,
    view: View,
    size_nm: Option<[f64; 2]>,
    /// What is told of each one, and how many samples it lies behind the first.
    places: Vec<(String, usize)>,
}

impl Images {
    /// Those of a group `NXdata`.
    fn of(path: &str, group: &Group, room: &mut u64) -> Result<Self, String> {
        let about = group.attrs().map_err(|error| words(&error))?;
        let signal = about.get("signal").and_then(text);
        let signal = signal.ok_or("expected the attribute `signal` of its group, found none")?;
        let has = |name: &str| group.dataset(name).is_ok();
        if has("scaling_factor") || has("offset") {
            return Err(
                "its samples are scaled by `scaling_factor` or `offset`, which are not read"
                    .to_owned(),
            );
        }
        let dataset = group.dataset(&signal).map_err(|error| words(&error))?;
        let attributes = dataset.attrs().map_err(|error| words(&error))?;
        let told = |key: &str| attributes.get(key).and_then(text).filter(|s| !s.is_empty());
        let (unit, title) = (told("units"), told("long_name"));
        let array = Array::of(dataset, room)?;
        let axes: Vec<String> = match about.get("axes") {
            Some(axes) => axes
                .as_strings()
                .map(<[_]>::to_vec)
                .or_else(|| Some(vec![text(axes)?]))
                .unwrap_or_default(),
            None => vec![".".to_owned(); array.shape.len()],
        };
        if axes.len() != array.shape.len() {
            let shape = &array.shape;
            return Err(format!(
                "expected an axis for each dimension of {shape:?}, found {axes:?}"
            ));
        }
        let axes = axes.iter().zip(&array.shape);
        let axes = axes.map(|(name, &count)| Axis::of(group, name, count, room));
        let axes = axes.collect::<Result<Vec<_>, _>>()?;
        // `data` tells nothing; the group has a name.
        let of_group = path.rsplit('/').next().unwrap_or(path);
        let name = if signal == "data" { of_group } else { &signal };
        Ok(Self {
            unit: unit.unwrap_or_default(),
            ..Self::along(title.unwrap_or_else(|| name.to_owned()), array, &axes)?
        })
    }

    fn along(name: String, array: Array, axes: &[Axis]) -> Result<Self, String> {
        let steps = axes.iter().map(Axis::step).collect::<Result<Vec<_>, _>>()?;
        let lengths: Vec<usize> = (0..axes.len()).filter(|&k| steps[k].is_some()).collect();
        let bare = axes.iter().all(|axis| {
            axis.positions.is_empty() || matches!(&*axis.unit, "" | "pixel" | "pixels" | "px")
        });
        let [mut y, mut x] = match lengths[..] {
            [y, x] if axes.len() < 4 => [y, x],
            [] if axes.len() == 2 && bare => [0, 1],
            _ => {
                let all = axes.iter().zip(&array.shape);
                let all = all.map(|(axis, n)| format!("{} [{n}] in {:?}", axis.name, axis.unit));
                return Err(format!(
                    "expected two axes with units of length and at most one more, found {}",
                    all.collect::<Vec<_>>().join(", ")
                ));
            }
        };
        if axes[y].is_x() && !axes[x].is_x() {
            (y, x) = (x, y);
        }
        let side = |k: usize| array.shape[k] as usize;
        let stride = |k: usize| array.shape[k + 1..].iter().product::<u64>() as usize;
        let (rows, columns) = (side(y), side(x));
        let mut view = View {
            rows,
            columns,
            start: 0,
            steps: [stride(y) as isize, stride(x) as isize],
        };
        // Without positions the first line is the top one.
        let turned = [
            steps[y].is_none_or(|step| step < 0.0),
            steps[x].is_some_and(|step| step < 0.0),
        ];
        for (turned, (k, step)) in turned
            .into_iter()
            .zip([y, x].into_iter().zip(&mut view.steps))
        {
            if turned {
                view.start += (side(k) - 1) * stride(k);
                *step = -*step;
            }
        }
        let size_nm = steps[x].zip(steps[y]);
        let size_nm = size_nm.map(|(x, y)| [x.abs() * columns as f64, y.abs() * rows as f64]);
        let places = match (0..axes.len()).find(|&k| k != x && k != y) {
            Some(k) if side(k) > MOST_CHANNELS => {
                return Err(format!(
                    "expected at most {MOST_CHANNELS} images, found {}",
                    side(k)
                ));
            }
            Some(k) => (0..side(k))
                .map(|n| (axes[k].place(n), n * stride(k)))
                .collect(),
            None => vec![(String::new(), 0)],
        };
        Ok(Self {
            name,
            unit: String::new(),
            array: Arc::new(array),
            view,
            size_nm,
            places,
        })
    }

    fn add(self, outline: &mut Outline<'_>, input: &Input<'_>) {
        let told = Told {
            unit: Some(self.unit),
            size_nm: self.size_nm,
            notes: vec![
                if self.size_nm.is_some() {
                    UNTESTED
                } else {
                    BARE
                }
                .to_owned(),
            ],
            ..Told::default()
        };
        if outline.channels.is_empty() {
            let unreadable = std::mem::take(&mut outline.scan.unreadable);
            outline.scan = frame(FORMAT, &input.options, &told);
            outline.scan.unreadable = unreadable;
        }
        for (place, behind) in self.places {
            let info = info(format!("{}{place}", self.name), &input.options, &told);
            let mut view = self.view;
            view.start += behind;
            let header = header(info, [view.rows, view.columns], &input.options, &told);
            let array = Arc::clone(&self.array);
            outline.add(header, Stored::Packed(Box::new(move || array.image(&view))));
        }
    }
}

#[cfg(test)]
mod tests;
