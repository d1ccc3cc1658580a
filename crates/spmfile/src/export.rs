//! What all writers share: errors, SI base units, texts that fit in a header line.

use crate::scan::Channel;
use crate::units;

/// Why a scan cannot be written in a format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// Nothing to write.
    #[error("there is no channel to write")]
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
    /// The format counts in 32 bits.
    #[error("the file would be longer than 4 GB, which the format cannot hold")]
    TooLong,
}

/// The SI unit without prefix and the factor to it, as Gwyddion wants it.
pub(crate) fn base_unit(unit: &str) -> (String, f64) {
    const ROOTS: [&str; 16] = [
        "V", "A", "Hz", "N", "Pa", "s", "W", "F", "C", "J", "K", "T", "S", "eV", "Ω", "g",
    ];
    let unit = units::clean(unit);
    if unit == "°" {
        return ("deg".to_owned(), 1.0);
    }
    if let Some(nm) = units::nm_per(&unit) {
        // Divided, so that 1 nm is exactly the number 1e-9.
        return ("m".to_owned(), nm / 1e9);
    }
    for root in ROOTS {
        if let Some(factor) = units::prefix_ratio(&unit, root) {
            return (root.to_owned(), factor);
        }
    }
    (unit, 1.0)
}

/// The values of a channel in its base unit, and the unit.
pub(crate) fn base_values(channel: &Channel) -> Result<(Vec<f64>, String), ExportError> {
    let (unit, factor) = base_unit(&channel.unit);
    let mut values = channel.values();
    if channel.rows.checked_mul(channel.columns) != Some(values.len()) || values.is_empty() {
        return Err(ExportError::Shape {
            name: channel.name.clone(),
            rows: channel.rows,
            columns: channel.columns,
            found: values.len(),
        });
    }
    if factor != 1.0 {
        for value in &mut values {
            *value *= factor;
        }
    }
    Ok((values, unit))
}

/// A text without line ends and NULs.
pub(crate) fn one_line(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect::<String>()
        .trim()
        .to_owned()
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

    #[test]
    fn lines_stay_lines() {
        assert_eq!(one_line(" a\r\nb\0c "), "a  b c");
    }
}
