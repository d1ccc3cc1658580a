//! Scans as Zarr groups, version 3: one array of doubles per channel, with named dimensions.
//!
//! Zarr core specification 3.0: a folder with `zarr.json` is a group or an array; samples lie in
//! chunks `c/0/0`, little endian, none of them compressed. Attributes follow xarray's conventions:
//! `units`, `long_name`, and coordinates that have the name of their dimension.
//!
//! - Lines come from the bottom up, `y` increases; missing samples are NaN.
//! - Channels of one shape and pitch share `x` and `y`; further ones have `x_2`, `y_2` and so on.

use serde_json::{Map, Value, json};

use crate::export::{ExportError, checked_values, positions, unique_names};
use crate::labels;
use crate::scan::Scan;

/// Samples of a chunk, 8 MB of doubles.
const CHUNK: usize = 1 << 20;

/// The files of a group, by their names within its folder.
///
/// # Errors
/// - There is no channel.
/// - A channel's samples do not fill its lines.
pub fn write(scan: &Scan, log: &[String]) -> Result<Vec<(String, Vec<u8>)>, ExportError> {
    write_between(scan, log, &|| ())
}

/// The same; `between` is called before each chunk.
pub(crate) fn write_between(
    scan: &Scan,
    log: &[String],
    between: &dyn Fn(),
) -> Result<Vec<(String, Vec<u8>)>, ExportError> {
    let mut attributes = Map::new();
    for (key, value) in labels::describe(scan)
        .into_iter()
        .chain(scan.metadata.clone())
    {
        attributes.insert(key, Value::String(value));
    }
    attributes.insert("log".to_owned(), json!(log));
    let group = json!({"zarr_format": 3, "node_type": "group", "attributes": attributes});
    let mut files = vec![("zarr.json".to_owned(), text(&group)?)];
    let mut grids: Vec<Grid> = Vec::new();
    for (name, channel) in unique_names(scan)?.into_iter().zip(&scan.channels) {
        let values = checked_values(channel)?;
        let grid = Grid {
            shape: [channel.rows, channel.columns],
            positions: positions(scan, channel),
        };
        let index = grids.iter().position(|g| *g == grid).unwrap_or_else(|| {
            grids.push(grid);
            grids.len() - 1
        });
        let mut about = Map::new();
        about.insert("units".to_owned(), json!(channel.unit));
        about.insert("long_name".to_owned(), json!(channel.name));
        for (key, value) in labels::describe_channel(channel) {
            about.insert(key, Value::String(value));
        }
        let dimensions = dimensions(index);
        // Zarr keeps the names of arrays and dimensions in one folder.
        let name = if name.starts_with(['x', 'y']) && name.len() < 4 {
            format!("channel_{name}")
        } else {
            name
        };
        let shape = [channel.rows, channel.columns];
        array(
            &mut files,
            &name,
            &shape,
            &dimensions,
            &about,
            &values,
            between,
        )?;
    }
    for (index, grid) in grids.iter().enumerate() {
        let Some([x, y]) = &grid.positions else {
            continue;
        };
        for (name, values) in dimensions(index).iter().zip([y, x]) {
            let mut about = Map::new();
            about.insert("units".to_owned(), json!("nm"));
            let names = [name.clone()];
            array(
                &mut files,
                name,
                &[values.len()],
                &names,
                &about,
                values,
                between,
            )?;
        }
    }
    Ok(files)
}

/// Where the pixels of a channel lie.
#[derive(PartialEq)]
struct Grid {
    shape: [usize; 2],
    /// Of columns and of lines.
    positions: Option<[Vec<f64>; 2]>,
}

/// Names of the dimensions of a grid.
fn dimensions(grid: usize) -> [String; 2] {
    ["y", "x"].map(|name| match grid {
        0 => name.to_owned(),
        more => format!("{name}_{}", more + 1),
    })
}

/// Adds an array of one or two dimensions.
fn array(
    files: &mut Vec<(String, Vec<u8>)>,
    name: &str,
    shape: &[usize],
    dimensions: &[String],
    attributes: &Map<String, Value>,
    values: &[f64],
    between: &dyn Fn(),
) -> Result<(), ExportError> {
    let width: usize = shape[1..].iter().product();
    let lines = (CHUNK / width.max(1)).clamp(1, shape[0]);
    let mut chunk = shape.to_vec();
    chunk[0] = lines;
    let description = json!({
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape,
        "data_type": "float64",
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunk}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "fill_value": "NaN",
        "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
        "dimension_names": dimensions,
        "attributes": attributes,
    });
    files.push((format!("{name}/zarr.json"), text(&description)?));
    for (index, block) in values.chunks(lines * width).enumerate() {
        between();
        let mut bytes: Vec<u8> = block.iter().flat_map(|v| v.to_le_bytes()).collect();
        // Every chunk is stored whole.
        for _ in block.len()..lines * width {
            bytes.extend(f64::NAN.to_le_bytes());
        }
        let rest = "/0".repeat(shape.len() - 1);
        files.push((format!("{name}/c/{index}{rest}"), bytes));
    }
    Ok(())
}

fn text(value: &Value) -> Result<Vec<u8>, ExportError> {
    serde_json::to_vec_pretty(value).map_err(|e| ExportError::Library(e.to_string()))
}
