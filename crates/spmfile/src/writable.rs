//! The formats that are written, and a scan as the files of one of them.

use crate::export::{ExportError, unique_names};
use crate::scan::{Channel, LineDirection, Scan};
use crate::sensors::{position_sensors, sensor_axis};
use crate::{array, gsf, gwy, gxyzf, zarr};

/// A format that scans are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum WritableFormat {
    /// Gwyddion container: every channel.
    Gwy,
    /// Gwyddion simple field: a file for each channel.
    Gsf,
    /// Gwyddion XYZ field: the positions that the sensors recorded; a file for each line direction.
    Gxyzf,
    /// Archive of `NumPy` arrays: every channel.
    Npz,
    /// Zarr group, version 3: a folder with every channel.
    Zarr,
    /// TIFF of single-precision values: every channel.
    Tiff,
    /// Matrix as text: a file for each channel.
    Csv,
}

impl WritableFormat {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Gwy,
        Self::Gsf,
        Self::Gxyzf,
        Self::Npz,
        Self::Zarr,
        Self::Tiff,
        Self::Csv,
    ];

    /// What the names of its files end with.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Gwy => "gwy",
            Self::Gsf => "gsf",
            Self::Gxyzf => "gxyzf",
            Self::Npz => "npz",
            Self::Zarr => "zarr",
            Self::Tiff => "tiff",
            Self::Csv => "csv",
        }
    }

    /// The format of an extension without its dot, in upper or lower case; `tif` and `txt` are known.
    pub fn from_extension(extension: &str) -> Option<Self> {
        let lower = extension.to_ascii_lowercase();
        let plain = match lower.as_str() {
            "tif" => "tiff",
            "txt" => "csv",
            other => other,
        };
        Self::ALL.into_iter().find(|f| f.extension() == plain)
    }
}

/// A scan as files of a format: their names, which begin with `stem`, and their bytes.
///
/// A single file is `stem.extension`, with the extension as given here. Of formats that hold one
/// image, each of several channels has its name behind the stem; the files of a Zarr group lie in the
/// folder `stem.zarr`.
///
/// # Errors
/// - There is no channel, or one whose samples do not fill its lines.
/// - The format needs position sensors and there are none.
pub fn write(
    scan: &Scan,
    format: WritableFormat,
    stem: &str,
    log: &[String],
) -> Result<Vec<(String, Vec<u8>)>, ExportError> {
    write_between(scan, format, stem, log, &|| ())
}

/// As [`write()`], which takes seconds for large images as text: `between` is called before each line or megabyte. It ends the
/// work by unwinding.
///
/// # Errors
/// As [`write()`].
pub fn write_between(
    scan: &Scan,
    format: WritableFormat,
    stem: &str,
    log: &[String],
    between: &dyn Fn(),
) -> Result<Vec<(String, Vec<u8>)>, ExportError> {
    let one = |bytes: Vec<u8>| vec![(format!("{stem}.{}", format.extension()), bytes)];
    match format {
        WritableFormat::Gwy => gwy::write_between(scan, log, between).map(one),
        #[cfg(feature = "archives")]
        WritableFormat::Npz => array::npz_between(scan, log, between).map(one),
        #[cfg(not(feature = "archives"))]
        WritableFormat::Npz => Err(left_out("archives")),
        #[cfg(feature = "pictures")]
        WritableFormat::Tiff => array::tiff_between(scan, log, between).map(one),
        #[cfg(not(feature = "pictures"))]
        WritableFormat::Tiff => Err(left_out("pictures")),
        WritableFormat::Gsf => each(scan, format, stem, |c| {
            gsf::write_between(scan, c, log, between)
        }),
        WritableFormat::Csv => each(scan, format, stem, |c| {
            array::csv_between(scan, c, log, between)
        }),
        WritableFormat::Gxyzf => points(scan, stem, log, between),
        WritableFormat::Zarr => {
            let files = zarr::write_between(scan, log, between)?;
            let inside = |(name, bytes)| (format!("{stem}.zarr/{name}"), bytes);
            Ok(files.into_iter().map(inside).collect())
        }
    }
}

/// The refusal of a format that this build leaves out.
#[cfg(not(all(feature = "archives", feature = "pictures")))]
fn left_out(feature: &str) -> ExportError {
    ExportError::Library(format!(
        "it needs the feature `{feature}` of the crate spmfile, which this build does not have"
    ))
}

/// A file for each channel.
fn each(
    scan: &Scan,
    format: WritableFormat,
    stem: &str,
    bytes: impl Fn(&Channel) -> Result<Vec<u8>, ExportError>,
) -> Result<Vec<(String, Vec<u8>)>, ExportError> {
    let names = unique_names(scan)?;
    let several = names.len() > 1;
    let extension = format.extension();
    names
        .into_iter()
        .zip(&scan.channels)
        .map(|(name, channel)| {
            let name = if several {
                format!("{stem}-{name}.{extension}")
            } else {
                format!("{stem}.{extension}")
            };
            Ok((name, bytes(channel)?))
        })
        .collect()
}

/// The points of each line direction that has position sensors.
fn points(
    scan: &Scan,
    stem: &str,
    log: &[String],
    between: &dyn Fn(),
) -> Result<Vec<(String, Vec<u8>)>, ExportError> {
    let mut files = Vec::new();
    let mut problem = None;
    for (line, name) in [
        (LineDirection::Trace, "trace"),
        (LineDirection::Retrace, "retrace"),
    ] {
        let channels: Vec<&Channel> = scan
            .channels
            .iter()
            .filter(|c| sensor_axis(&c.name, &c.internal_name).is_none())
            .filter(|c| c.line_direction.unwrap_or(LineDirection::Trace) == line)
            .collect();
        if channels.is_empty() {
            continue;
        }
        match position_sensors(scan, line) {
            Ok(sensors) => {
                let bytes =
                    gxyzf::write_between(scan, [sensors.x, sensors.y], &channels, log, between)?;
                files.push((name, bytes));
            }
            Err(error) => problem = Some(ExportError::NoPositions(error)),
        }
    }
    let several = files.len() > 1;
    if files.is_empty() {
        return Err(problem.unwrap_or(ExportError::NoChannel));
    }
    let named = |(line, bytes)| {
        let name = if several {
            format!("{stem}-{line}.gxyzf")
        } else {
            format!("{stem}.gxyzf")
        };
        (name, bytes)
    };
    Ok(files.into_iter().map(named).collect())
}
