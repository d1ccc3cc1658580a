//! Files → what they hold.

use std::path::{Path, PathBuf};

use moiregauge_pipeline::{Content, Known};
use pyo3::prelude::*;
use pyo3::types::PyList;
use serde_json::json;
use spmfile::{Channel, FrameDirection, LineDirection, Scan};

use crate::arrays;
use crate::errors::unreadable;
use crate::options::told;
use crate::work::work;

/// A file, or the bytes of one of this name: a JSON document about it, and the values of its channels.
#[pyfunction]
#[pyo3(signature = (name, content, known))]
pub(crate) fn read<'py>(
    py: Python<'py>,
    name: PathBuf,
    content: Option<Vec<u8>>,
    known: &str,
) -> PyResult<(String, Bound<'py, PyList>)> {
    let known = Known::new(&told(known)?, std::slice::from_ref(&name));
    let scan = work(py, Some(1), None, |_| of_file(&name, content, &known))?;
    let about = about(&name, &scan).to_string();
    let all = PyList::empty(py);
    for channel in &scan.channels {
        let shape = [channel.rows, channel.columns];
        let values = py.detach(|| channel.values());
        all.append(arrays::values(py, values, shape)?)?;
    }
    Ok((about, all))
}

fn of_file(name: &Path, content: Option<Vec<u8>>, known: &Known) -> PyResult<Scan> {
    let file = moiregauge_pipeline::names::in_words(name);
    let refused = |error: &dyn std::error::Error| {
        unreadable(&file, &moiregauge_pipeline::names::in_full(error))
    };
    let content = match content {
        Some(bytes) => Content::of(bytes),
        None => Content::read(name).map_err(|e| refused(&e))?,
    };
    let (scan, _) = known
        .read(name, &content, &|_| true)
        .map_err(|e| refused(&e))?;
    Ok(scan)
}

fn about(name: &Path, scan: &Scan) -> serde_json::Value {
    let date = scan.acquired.map(|t| {
        let (y, mo, d) = (t.year, t.month, t.day);
        format!(
            "{y:04}-{mo:02}-{d:02}T{:02}:{:02}:{:02}",
            t.hour, t.minute, t.second
        )
    });
    let unreadable = scan.unreadable.iter();
    json!({
        "file": moiregauge_pipeline::names::in_words(name),
        "format": scan.format,
        "instrument": scan.instrument,
        "acquired": date,
        "frame_direction": scan.frame_direction.map(|d| match d {
            FrameDirection::Up => "up",
            FrameDirection::Down => "down",
        }),
        "line_rate_hz": scan.line_rate_hz,
        "rotation_deg": scan.rotation_rad.to_degrees(),
        "offset_nm": scan.offset_nm,
        "size_nm": scan.size_nm,
        "closed_loop": scan.closed_loop,
        "notes": scan.notes,
        "unreadable": unreadable.map(|u| (&u.name, &u.error)).collect::<Vec<_>>(),
        "metadata": scan.metadata,
        "channels": scan.channels.iter().map(about_channel).collect::<Vec<_>>(),
    })
}

fn about_channel(channel: &Channel) -> serde_json::Value {
    json!({
        "name": channel.name,
        "internal_name": channel.internal_name,
        "unit": channel.plain_unit(),
        "line_direction": channel.line_direction.map(|d| match d {
            LineDirection::Trace => "trace",
            LineDirection::Retrace => "retrace",
        }),
        "pitch_nm": channel.pitch_nm(),
        "edges_nm": channel.edges_nm(),
        "plane_fit": channel.plane_fit,
    })
}
