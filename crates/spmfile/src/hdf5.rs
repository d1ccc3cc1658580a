//! Arrays of HDF5 files: that the file holds them, and images of them.

use std::sync::OnceLock;

use hdf5_pure::{AttrValue, DType, Dataset, Error};

use crate::scan::Samples;
use crate::stored::{Failure, Unpacked};
use crate::words;

/// An array whose samples are in the file.
pub(crate) struct Array {
    dataset: Dataset,
    pub(crate) shape: Vec<u64>,
    samples: usize,
    /// All of them, once an image was wanted.
    whole: OnceLock<Result<Samples, String>>,
}

/// Which samples make an image, the bottom line first.
#[derive(Clone, Copy)]
pub(crate) struct View {
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    /// The sample at the lower left.
    pub(crate) start: usize,
    /// From a sample to the one above it, and to the one on its right.
    pub(crate) steps: [isize; 2],
}

impl Array {
    /// `None` where the file holds fewer samples than the array has, or more than `room` bytes.
    pub(crate) fn of(dataset: Dataset, room: &mut u64) -> Result<Self, String> {
        let words = |error: Error| error.to_string();
        let shape = dataset.shape().map_err(words)?;
        let product = |sides: &[u64]| sides.iter().fold(1, |all: u64, &n| all.saturating_mul(n));
        let stored = match dataset.chunk_shape().map_err(words)? {
            Some(chunk) => {
                let chunks = dataset.chunks().map_err(words)?.len() as u64;
                chunks.saturating_mul(product(&chunk))
            }
            None => u64::MAX,
        };
        let samples = product(&shape);
        let length = samples.saturating_mul(dataset.element_size().map_err(words)?);
        let left = room
            .checked_sub(length)
            .filter(|_| (1..=stored).contains(&samples));
        *room = left.ok_or_else(|| {
            format!("expected as many samples in the file as in its array, {shape:?}")
        })?;
        Ok(Self {
            dataset,
            shape,
            samples: samples as usize,
            whole: OnceLock::new(),
        })
    }

    fn whole(&self) -> Result<Samples, String> {
        let kind = self.dataset.dtype().map_err(|error| error.to_string())?;
        let read = match kind {
            DType::I8 | DType::U8 | DType::I16 => self.dataset.read_i16().map(Samples::I16),
            DType::U16 | DType::I32 => self.dataset.read_i32().map(Samples::I32),
            DType::F32 => self.dataset.read_f32().map(Samples::F32),
            DType::F64 | DType::U32 | DType::I64 | DType::U64 => {
                self.dataset.read_f64().map(Samples::F64)
            }
            other => return Err(format!("expected numbers, found {other}")),
        };
        read.map_err(|error| error.to_string())
    }

    /// An image of it, whose view lies within the array.
    pub(crate) fn image(&self, view: &View) -> Result<Unpacked, Failure> {
        let whole = self.whole.get_or_init(|| self.whole());
        let whole = whole
            .as_ref()
            .map_err(|error| Failure::channel(error.clone()))?;
        if whole.len() != self.samples {
            let (found, samples) = (whole.len(), self.samples);
            return Err(Failure::Lost(format!(
                "{found} of its {samples} samples are there"
            )));
        }
        let [up, right] = view.steps;
        let line = |row: usize| view.start.wrapping_add_signed(up * row as isize);
        let at = |row: usize, column: usize| line(row).wrapping_add_signed(right * column as isize);
        let places = (0..view.rows).flat_map(|row| (0..view.columns).map(move |c| at(row, c)));
        macro_rules! samples {
            ($($kind:ident),*) => {
                match whole {
                    $(Samples::$kind(all) => Samples::$kind(places.map(|place| all[place]).collect()),)*
                }
            };
        }
        Ok(Unpacked::measured(samples!(I16, I32, F32, F64)))
    }

    /// All samples as numbers.
    pub(crate) fn numbers(&self) -> Result<Vec<f64>, String> {
        self.whole().map(Samples::into_doubles)
    }
}

/// An attribute as it is written; nothing of several.
pub(crate) fn text(value: &AttrValue) -> Option<String> {
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
