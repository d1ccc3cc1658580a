//! Units as instruments write them.

/// How many nanometres one `unit` is; `None` where it is not a length.
pub fn nm_per(unit: &str) -> Option<f64> {
    match &*plain_unit(unit) {
        "pm" => Some(1e-3),
        "Å" => Some(0.1),
        "nm" => Some(1.0),
        "µm" => Some(1e3),
        "mm" => Some(1e6),
        "m" => Some(1e9),
        _ => None,
    }
}

/// `600 nm` as a finite number and the unit behind it, which may be absent.
pub(crate) fn quantity(text: &str) -> Option<(f64, &str)> {
    let text = text.trim();
    let end = text
        .find(|c: char| !(c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | 'e' | 'E')))
        .unwrap_or(text.len());
    // `5e` of `5eV` is no number: the letter belongs to the unit.
    let end = if text[..end].parse::<f64>().is_ok() {
        end
    } else {
        text[..end]
            .trim_end_matches(['e', 'E', '+', '-', '.'])
            .len()
    };
    let number: f64 = text[..end].parse().ok()?;
    number.is_finite().then(|| (number, text[end..].trim()))
}

/// `0.6 µm` in nm; `None` without a unit of length.
pub fn length_nm(text: &str) -> Option<f64> {
    let (number, unit) = quantity(text)?;
    Some(number * nm_per(unit)?)
}

/// A unit in plain signs: `~` and the Greek letter are micro, the ordinal sign and the like are degrees.
pub(crate) fn clean(unit: &str) -> String {
    unit.trim()
        .chars()
        .map(|c| match c {
            '~' | '\u{3bc}' => 'µ',
            'º' | '˚' => '°',
            other => other,
        })
        .collect()
}

/// A unit as the SI writes it, whatever a file wrote: `deg` and `degree` are `°`, `um` and `micron` are `µm`,
/// `angstrom` is `Å`, `Ohm` is `Ω`, `a.u.` is no unit. Units that are not known stay as they are.
///
/// ```
/// assert_eq!(spmfile::plain_unit("um"), "µm");
/// assert_eq!(spmfile::plain_unit("deg"), "°");
/// assert_eq!(spmfile::plain_unit("log(Pa)"), "log(Pa)");
/// ```
pub fn plain_unit(unit: &str) -> String {
    let unit = clean(unit);
    let words = match unit.to_ascii_lowercase().as_str() {
        "deg" | "degree" | "degrees" => "°",
        "micron" | "microns" | "micrometer" | "micrometre" => "µm",
        "nanometer" | "nanometre" => "nm",
        "meter" | "metre" => "m",
        "angstrom" | "ang" | "\u{212b}" => "Å",
        "volt" | "volts" => "V",
        "ampere" | "amp" | "amps" => "A",
        "hertz" => "Hz",
        "ohm" | "ohms" | "\u{2126}" => "Ω",
        "a.u." | "none" => return String::new(),
        _ => "",
    };
    if !words.is_empty() {
        return words.to_owned();
    }
    // A letter u before a unit is the micro of keyboards; `u` alone is the unit of masses.
    match unit.strip_prefix('u') {
        Some(root) if ROOTS.contains(&root) => format!("µ{root}"),
        _ => unit,
    }
}

/// Units that files write with a prefix.
pub(crate) const ROOTS: [&str; 17] = [
    "m", "V", "A", "Hz", "N", "Pa", "s", "W", "F", "C", "J", "K", "T", "S", "eV", "Ω", "g",
];

/// Ratio of `unit` to `base` where they differ by an SI prefix at most.
pub(crate) fn prefix_ratio(unit: &str, base: &str) -> Option<f64> {
    if unit == base {
        return Some(1.0);
    }
    let (prefix, root) = [unit, base]
        .map(|u| {
            let mut chars = u.chars();
            let factor = match chars.next() {
                Some('f') => 1e-15,
                Some('p') => 1e-12,
                Some('n') => 1e-9,
                Some('u' | 'µ' | 'μ' | '~') => 1e-6,
                Some('m') => 1e-3,
                Some('k') => 1e3,
                Some('M') => 1e6,
                Some('G') => 1e9,
                _ => return (1.0, ""),
            };
            (factor, chars.as_str())
        })
        .into();
    match (prefix, root) {
        // mV against V, V against mV, mV against µV.
        ((f, rest), _) if !rest.is_empty() && rest == base => Some(f),
        (_, (f, rest)) if !rest.is_empty() && rest == unit => Some(1.0 / f),
        ((f, a), (g, b)) if !a.is_empty() && a == b => Some(f / g),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes() {
        assert_eq!(prefix_ratio("V", "V"), Some(1.0));
        assert_eq!(prefix_ratio("mV", "V"), Some(1e-3));
        assert_eq!(prefix_ratio("V", "mV"), Some(1e3));
        assert_eq!(prefix_ratio("mV", "µV"), Some(1e-3 / 1e-6));
        assert_eq!(prefix_ratio("m", "nm"), Some(1.0 / 1e-9));
        assert_eq!(prefix_ratio("V", "Arb"), None);
        assert_eq!(prefix_ratio("m", "n"), None);
        assert_eq!(prefix_ratio("", "V"), None);
    }

    #[test]
    fn quantities() {
        assert_eq!(quantity(" -3.5e-2 nm"), Some((-0.035, "nm")));
        assert_eq!(quantity("600nm"), Some((600.0, "nm")));
        assert_eq!(quantity("5eV"), Some((5.0, "eV")));
        assert_eq!(quantity("8"), Some((8.0, "")));
        assert_eq!(quantity("nm"), None);
        assert_eq!(quantity("inf nm"), None);
        assert_eq!(length_nm("0.5 µm"), Some(500.0));
        assert_eq!(length_nm("2 Å"), Some(0.2));
        assert_eq!(length_nm("2 V"), None);
        assert_eq!(length_nm("2"), None);
    }

    #[test]
    fn plain_units() {
        for (written, plain) in [
            ("~m", "µm"),
            ("um", "µm"),
            ("μm", "µm"),
            ("uV", "µV"),
            ("º", "°"),
            ("degrees", "°"),
            ("angstrom", "Å"),
            ("\u{212b}", "Å"),
            ("nm", "nm"),
            ("mV", "mV"),
            ("u", "u"),
            ("a.u.", ""),
            ("Arb", "Arb"),
            ("", ""),
        ] {
            assert_eq!(plain_unit(written), plain, "{written}");
        }
    }

    #[test]
    fn lengths() {
        assert_eq!(nm_per("nm"), Some(1.0));
        assert_eq!(nm_per("~m"), Some(1e3));
        assert_eq!(nm_per("V"), None);
    }
}
