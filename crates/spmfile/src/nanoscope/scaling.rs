//! Counts to values: `value = count · b / 256^L · s`.
//!
//! `b` is the hard value at the end of `\@2:Z scale: V [Sens. NAME] (a V/LSB) b V`, `L` the label
//! `Bytes/pixel` (not the stored width) and `s` the sensitivity `\@Sens. NAME: V s nm/V`. The
//! number `a` in brackets is left alone: it is wrong wherever a channel was re-levelled or stored
//! with a smaller range. A sensitivity without a unit leaves the value in the unit of `b`. The Z
//! offset is not added.

use super::header::{Section, leading_number};
use crate::units;

/// How counts become values.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scaling {
    /// Value of one count.
    pub(super) scale: f64,
    /// Unit of the value.
    pub(super) unit: String,
    /// The same as the file spells it.
    pub(super) written: String,
    /// The rule in words.
    pub(super) words: String,
}

/// A parsed `Z scale`.
#[derive(Debug, PartialEq)]
struct ZScale<'a> {
    sensitivity: Option<&'a str>,
    hard_value: f64,
    hard_unit: &'a str,
}

/// Reads the scaling of an image section; the error says what is odd.
pub(super) fn scaling(
    image: &Section<'_>,
    sections: &[Section<'_>],
    label: i32,
) -> Result<Scaling, String> {
    let text = image.grouped("Z scale").next().ok_or("it has no Z scale")?;
    let z = z_scale(text).ok_or_else(|| format!("its Z scale {text:?} is not understood"))?;
    let hard_unit = units::clean(z.hard_unit);
    let divisor_bits = 8 * label;
    let count = z.hard_value / 256f64.powi(label);
    let per_count = format!("count × {} {hard_unit} / 2^{divisor_bits}", z.hard_value);
    let scaling =
        match z.sensitivity {
            None => Scaling {
                scale: count,
                written: z.hard_unit.to_owned(),
                unit: hard_unit,
                words: per_count,
            },
            Some(name) => {
                let key = format!("@{name}");
                let text = sensitivity_line(sections, &key)
                    .ok_or_else(|| format!("its sensitivity {name:?} is not in the file"))?;
                let (value, unit) = text
                    .strip_prefix('V')
                    .and_then(leading_number)
                    .ok_or_else(|| format!("its sensitivity {name:?} is {text:?}, not a number"))?;
                let written = unit;
                let (factor, unit) = combined_unit(&hard_unit, &units::clean(unit)).ok_or_else(|| {
                format!("its Z scale is in {hard_unit:?}, but its sensitivity {name:?} in {unit:?}")
            })?;
                Scaling {
                    scale: count * value * factor,
                    words: format!("{per_count} × {} ({name})", units::clean(&text[1..])),
                    written: match written.rsplit_once('/') {
                        Some((above, _)) => above.to_owned(),
                        None => z.hard_unit.to_owned(),
                    },
                    unit,
                }
            }
        };
    if scaling.scale.is_normal() {
        Ok(scaling)
    } else {
        Err(format!(
            "one count would be {} {}",
            scaling.scale, scaling.unit
        ))
    }
}

/// Sensitivities stand in the scanner list or in the scan list; elsewhere only as a last resort.
fn sensitivity_line<'a>(sections: &[Section<'a>], key: &str) -> Option<&'a str> {
    let rank = |s: &Section<'_>| match () {
        () if s.is("Scanner list") => 0,
        () if s.is("Ciao scan list") => 1,
        () => 2,
    };
    (0..3).find_map(|wanted| {
        sections
            .iter()
            .filter(|s| rank(s) == wanted)
            .find_map(|s| s.get(key))
    })
}

/// `V [Sens. NAME] (a unit/LSB) b unit`, the two brackets being optional.
fn z_scale(text: &str) -> Option<ZScale<'_>> {
    let mut rest = text.strip_prefix('V')?.trim_start();
    let mut sensitivity = None;
    if let Some(after) = rest.strip_prefix('[') {
        let (name, after) = after.split_once(']')?;
        sensitivity = Some(name.trim()).filter(|n| !n.is_empty());
        rest = after.trim_start();
    }
    if rest.starts_with('(') {
        rest = rest[closing_bracket(rest)? + 1..].trim_start();
    }
    let (hard_value, hard_unit) = leading_number(rest)?;
    Some(ZScale {
        sensitivity,
        hard_value,
        hard_unit,
    })
}

/// Where the bracket at the start of `text` is closed; units hold brackets too, as in `log(Pa)`.
fn closing_bracket(text: &str) -> Option<usize> {
    let mut depth = 0_usize;
    text.char_indices().find_map(|(at, c)| {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        (depth == 0).then_some(at)
    })
}

/// Unit of `hard · sensitivity` and the factor by which prefixes differ (`mV · nm/V`).
fn combined_unit(hard: &str, sensitivity: &str) -> Option<(f64, String)> {
    if sensitivity.is_empty() {
        return Some((1.0, hard.to_owned()));
    }
    let (above, below) = sensitivity.rsplit_once('/')?;
    let factor = units::prefix_ratio(hard, below)?;
    Some((factor, above.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::super::header::sections;
    use super::*;

    fn of(z_scale: &str, sensitivity: &str, label: i32) -> Result<Scaling, String> {
        let text = format!(
            "\\*Scanner list\n\\@Sens. A: {sensitivity}\n\\*Ciao image list\n\\@2:Z scale: {z_scale}\n"
        );
        let all = sections(&text);
        scaling(&all[1], &all, label)
    }

    #[test]
    fn the_number_in_brackets_is_ignored() {
        let s = of("V [Sens. A] (99 V/LSB) 65536 V", "V 2.5 nm/V", 2).expect("scales");
        assert_eq!((s.scale, s.unit.as_str()), (2.5, "nm"));
    }

    #[test]
    fn the_divisor_follows_the_label() {
        let s = of("V [Sens. A] (1 V/LSB) 4294967296 V", "V 1.000000 ", 4).expect("scales");
        assert_eq!((s.scale, s.unit.as_str()), (1.0, "V"));
    }

    #[test]
    fn prefixes_between_scale_and_sensitivity() {
        let s = of("V [Sens. A] (1 mV/LSB) 65536 mV", "V 3 nm/V", 2).expect("scales");
        assert!((s.scale - 3e-3).abs() < 1e-18 && s.unit == "nm");
        let s = of(
            "V [Sens. A] (1 log(Arb)/LSB) 65536 log(Arb)",
            "V 1 log(Pa)/log(Arb)",
            2,
        );
        assert_eq!(s.expect("scales").unit, "log(Pa)");
    }

    #[test]
    fn without_a_sensitivity() {
        let s = of("V (1 º/LSB) 65536 º", "", 2).expect("scales");
        assert_eq!((s.scale, s.unit.as_str()), (1.0, "°"));
    }

    #[test]
    fn oddities_have_words() {
        assert!(of("V [Sens. B] (1 V/LSB) 1 V", "V 1", 2).is_err_and(|e| e.contains("Sens. B")));
        assert!(of("V [Sens. A] (1 V/LSB) 1 V", "V x", 2).is_err_and(|e| e.contains("number")));
        assert!(of("V [Sens. A] (1 V/LSB) 1 V", "V 1 nm/A", 2).is_err_and(|e| e.contains("nm/A")));
        assert!(of("V [Sens. A] (1 V/LSB 1 V", "V 1", 2).is_err_and(|e| e.contains("Z scale")));
        assert!(of("V [Sens. A] (1 V/LSB) 0 V", "V 1", 2).is_err_and(|e| e.contains("one count")));
    }
}
