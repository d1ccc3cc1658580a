//! Arrays of numpy ⇄ scans. Row 0 is the bottom line on both sides.

use numpy::{Element, PyArray2, PyArrayMethods as _, PyReadonlyArray2};
use pyo3::prelude::*;
use serde::Deserialize;
use spmfile::{Channel, FrameDirection, LineDirection, Samples, Scan, Span};

use crate::errors::wrong;

/// What the user tells of a scan in memory.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct About {
    size_nm: [f64; 2],
    offset_nm: [f64; 2],
    line_rate_hz: Option<f64>,
    frame_direction: Option<String>,
    rotation_deg: f64,
    channels: Vec<AboutChannel>,
}

/// What the user tells of one of its arrays.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AboutChannel {
    name: String,
    unit: String,
    line_direction: Option<String>,
}

/// A scan of arrays; each is copied once, before the interpreter is let go: another thread may write into it.
///
/// # Errors
/// `ValueError` for numbers and words that make no sense.
pub(crate) fn scan(about: &str, arrays: &[Bound<'_, PyAny>]) -> PyResult<Scan> {
    let about: About = serde_json::from_str(about).map_err(wrong)?;
    let frame_direction = one_of(
        "frame_direction",
        about.frame_direction.as_deref(),
        [("up", FrameDirection::Up), ("down", FrameDirection::Down)],
    )?;
    let all = about.channels.into_iter().zip(arrays);
    let channels = all.map(|(about_it, array)| channel(about_it, about.size_nm, array));
    Ok(Scan {
        format: "array in memory".to_owned(),
        frame_direction,
        line_rate_hz: about.line_rate_hz,
        rotation_rad: about.rotation_deg.to_radians(),
        offset_nm: about.offset_nm,
        size_nm: Some(about.size_nm),
        channels: channels.collect::<PyResult<_>>()?,
        ..Scan::default()
    })
}

fn channel(about: AboutChannel, size: [f64; 2], array: &Bound<'_, PyAny>) -> PyResult<Channel> {
    let (samples, rows, columns) = samples(array)?;
    let line_direction = one_of(
        "line",
        about.line_direction.as_deref(),
        [
            ("trace", LineDirection::Trace),
            ("retrace", LineDirection::Retrace),
        ],
    )?;
    Ok(Channel {
        name: about.name,
        internal_name: String::new(),
        unit: about.unit,
        line_direction,
        scan_line: None,
        rows,
        columns,
        width_nm: Some(size[0]),
        height_nm: Some(size[1]),
        span: Span::PixelEdges,
        scale: 1.0,
        offset: 0.0,
        scaling: "none".to_owned(),
        plane_fit: None,
        samples,
    })
}

/// What one of two words says, if any is told.
fn one_of<T: Copy>(what: &str, told: Option<&str>, words: [(&str, T); 2]) -> PyResult<Option<T>> {
    let Some(told) = told else {
        return Ok(None);
    };
    let found = words.iter().find(|(word, _)| *word == told);
    let [a, b] = words.map(|(word, _)| word);
    let refused = || wrong(format!("{what}: expected {a:?} or {b:?}, found {told:?}"));
    found.map(|(_, value)| Some(*value)).ok_or_else(refused)
}

/// The values in their own width, and how many rows and columns they have.
fn samples(array: &Bound<'_, PyAny>) -> PyResult<(Samples, usize, usize)> {
    fn copied<'py, T: Element + Copy>(
        array: &Bound<'py, PyAny>,
        wrap: fn(Vec<T>) -> Samples,
    ) -> Option<(Samples, usize, usize)> {
        let array: PyReadonlyArray2<'py, T> = array.extract().ok()?;
        let view = array.as_array();
        let (rows, columns) = view.dim();
        // Whatever its order in memory is.
        Some((wrap(view.iter().copied().collect()), rows, columns))
    }
    copied(array, Samples::F64)
        .or_else(|| copied(array, Samples::F32))
        .or_else(|| copied(array, Samples::I16))
        .or_else(|| copied(array, Samples::I32))
        .ok_or_else(|| wrong("expected a 2-D array of float64, float32, int16 or int32"))
}

/// Values of a channel as an array that owns them.
pub(crate) fn values(
    py: Python<'_>,
    values: Vec<f64>,
    [rows, columns]: [usize; 2],
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    numpy::PyArray1::from_vec(py, values).reshape([rows, columns])
}
