//! What all writers share: errors, SI base units, texts that fit in a header line.

use crate::scan::{Channel, LineDirection, Scan};
use crate::sensors::SensorProblem;
use crate::units;

/// Why a scan cannot be written in a format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// Nothing to write.
    #[error("no channel to write")]
    NoChannel,
    /// The number of samples is not lines × samples.
    #[error("channel {name:?} has {found} samples; its {rows} lines of {columns} need {expected}", expected = .rows * .columns)]
    Shape {
        /// The channel.
        name: String,
        /// Lines.
        rows: usize,
        /// Samples in a line.
        columns: usize,
        /// Samples found.
        found: usize,
    },
    /// Channels that must be of one shape are not.
    #[error("channel {name:?} has not the {rows} lines of {columns} samples of the X sensor")]
    Unlike {
        /// The channel.
        name: String,
        /// Lines of the X sensor.
        rows: usize,
        /// Samples in a line of the X sensor.
        columns: usize,
    },
    /// A position that is no length.
    #[error("channel {name:?} is in {unit:?}, not in a unit of length")]
    NotALength {
        /// The channel.
        name: String,
        /// Its unit.
        unit: String,
    },
    /// The format holds points at positions, and there are none.
    #[error("points need positions: {0}")]
    NoPositions(SensorProblem),
    /// The library that makes the file refuses.
    #[error("the file cannot be made: {0}")]
    Library(String),
    /// The format counts in 32 bits.
    #[error("the file would be longer than 4 GB, which the format cannot hold")]
    TooLong,
}

/// The SI unit without prefix and the factor to it, as Gwyddion wants it.
pub(crate) fn base_unit(unit: &str) -> (String, f64) {
    let unit = units::clean(unit);
    if unit == "°" {
        return ("deg".to_owned(), 1.0);
    }
    if let Some(nm) = units::nm_per(&unit) {
        // Divided, so that 1 nm is exactly the number 1e-9.
        return ("m".to_owned(), nm / 1e9);
    }
    for root in units::ROOTS {
        if let Some(factor) = units::prefix_ratio(&unit, root) {
            return (root.to_owned(), factor);
        }
    }
    (unit, 1.0)
}

/// The values of a channel in its base unit, and the unit.
pub(crate) fn base_values(channel: &Channel) -> Result<(Vec<f64>, String), ExportError> {
    let (unit, factor) = base_unit(&channel.unit);
    let mut values = checked_values(channel)?;
    if factor != 1.0 {
        for value in &mut values {
            *value *= factor;
        }
    }
    Ok((values, unit))
}

/// The values of a channel, if they fill its lines.
pub(crate) fn checked_values(channel: &Channel) -> Result<Vec<f64>, ExportError> {
    let values = channel.values();
    if channel.rows.checked_mul(channel.columns) != Some(values.len()) || values.is_empty() {
        return Err(ExportError::Shape {
            name: channel.name.clone(),
            rows: channel.rows,
            columns: channel.columns,
            found: values.len(),
        });
    }
    Ok(values)
}

/// The lines of an image, the top one first; `between` is called before each.
pub(crate) fn from_the_top<'a>(
    values: &'a [f64],
    channel: &Channel,
    between: &'a dyn Fn(),
) -> impl Iterator<Item = &'a [f64]> {
    values
        .rchunks_exact(channel.columns)
        .inspect(move |_| between())
}

/// Positions of the columns and of the lines from the bottom, nm: pixel centres in a frame about
/// [`Scan::offset_nm`], before it is turned by [`Scan::rotation_rad`]. `None` without a size.
pub(crate) fn positions(scan: &Scan, channel: &Channel) -> Option<[Vec<f64>; 2]> {
    let pitch = channel.pitch_nm()?;
    let axis = |axis: usize, count: usize| {
        let middle = 0.5 * (count as f64 - 1.0);
        (0..count)
            .map(|n| scan.offset_nm[axis] + pitch[axis] * (n as f64 - middle))
            .collect()
    };
    Some([axis(0, channel.columns), axis(1, channel.rows)])
}

/// A name for every channel that can be that of a file and of a variable: letters, digits, `_`.
/// Channels that share one are told apart by their line direction, then by numbers.
///
/// # Errors
/// There is no channel.
pub(crate) fn unique_names(scan: &Scan) -> Result<Vec<String>, ExportError> {
    if scan.channels.is_empty() {
        return Err(ExportError::NoChannel);
    }
    let plain = |name: &str| {
        let kept = |c: char| if c.is_alphanumeric() { c } else { ' ' };
        let words: String = name.chars().map(kept).collect();
        let joined = words.split_whitespace().collect::<Vec<_>>().join("_");
        if joined.is_empty() {
            "image".to_owned()
        } else {
            joined
        }
    };
    // Some file systems do not tell upper from lower case.
    let same = |a: &str, b: &str| a.to_lowercase() == b.to_lowercase();
    let stems: Vec<String> = scan.channels.iter().map(|c| plain(&c.name)).collect();
    let mut names: Vec<String> = Vec::with_capacity(stems.len());
    for (stem, channel) in stems.iter().zip(&scan.channels) {
        let shared = stems.iter().filter(|s| same(s, stem)).count() > 1;
        let name = match channel.line_direction.filter(|_| shared) {
            Some(LineDirection::Trace) => format!("{stem}_trace"),
            Some(LineDirection::Retrace) => format!("{stem}_retrace"),
            None => stem.clone(),
        };
        let mut unique = name.clone();
        let mut number = 1;
        while names.iter().any(|n| same(n, &unique)) {
            number += 1;
            unique = format!("{name}_{number}");
        }
        names.push(unique);
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes_are_taken_off() {
        assert_eq!(base_unit("nm"), ("m".to_owned(), 1e-9));
        assert_eq!(base_unit("mV"), ("V".to_owned(), 1e-3));
        assert_eq!(base_unit("~A"), ("A".to_owned(), 1e-6));
        assert_eq!(base_unit("°"), ("deg".to_owned(), 1.0));
        assert_eq!(base_unit("log(Arb)"), ("log(Arb)".to_owned(), 1.0));
        assert_eq!(base_unit("m"), ("m".to_owned(), 1.0));
        assert_eq!(base_unit("T"), ("T".to_owned(), 1.0));
        assert_eq!(base_unit(""), (String::new(), 1.0));
    }
}
