//! Ranges of numeric options: checked as soon as they are read, and told in the error, which names the option.
//!
//! They are wide: what lies outside of them no instrument does, and arithmetic may fail there.

/// Lengths, nm: from a thousandth of an atom to a centimetre.
pub(crate) const LENGTH_NM: [f64; 2] = [1e-3, 1e7];
/// Lines per second.
pub(crate) const LINE_RATE_HZ: [f64; 2] = [1e-4, 1e5];
/// Directions and twists, degrees: ten turns.
pub(crate) const ANGLE_DEG: [f64; 2] = [-3600.0, 3600.0];
/// Strains, per cent.
pub(crate) const STRAIN_PERCENT: [f64; 2] = [-50.0, 50.0];
/// Velocities, nm/min, and their changes, nm/min².
pub(crate) const DRIFT: [f64; 2] = [-1e6, 1e6];
/// Anything that cannot be negative: noise, uncertainties.
pub(crate) const NOT_NEGATIVE: [f64; 2] = [0.0, 1e6];
/// Uncertainties that are wished for.
pub(crate) const WISH: [f64; 2] = [1e-9, 1e6];
/// Times, s: up to a day.
pub(crate) const TIME_S: [f64; 2] = [0.0, 86_400.0];
/// Largest ratio of the sides of an image.
const LONGEST: f64 = 1e4;

/// Reads a number within a range.
pub(crate) fn number(
    range: [f64; 2],
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| {
        let number = text.trim().parse().ok();
        within(range, number).ok_or_else(|| {
            let [low, high] = range.map(typed);
            format!("expected a number from {low} to {high}")
        })
    }
}

/// Reads a whole number within a range.
pub(crate) fn count(
    low: usize,
    high: usize,
) -> impl Fn(&str) -> Result<usize, String> + Clone + Send + Sync + 'static {
    move |text| {
        let number: Option<usize> = text.trim().parse().ok();
        number
            .filter(|n| (low..=high).contains(n))
            .ok_or_else(|| format!("expected a whole number from {low} to {high}"))
    }
}

/// The number, if it lies in the range.
pub(crate) fn within([low, high]: [f64; 2], number: Option<f64>) -> Option<f64> {
    number.filter(|n| (low..=high).contains(n))
}

/// Width and height, if an image can have them.
pub(crate) fn sides(size_nm: [f64; 2]) -> Result<[f64; 2], String> {
    let [a, b] = size_nm;
    let [low, high] = LENGTH_NM;
    if ![a, b].iter().all(|&n| within(LENGTH_NM, Some(n)).is_some()) {
        return Err(format!(
            "expected sides from {} to {} nm, found {a} nm and {b} nm",
            typed(low),
            typed(high)
        ));
    }
    if a.max(b) > LONGEST * a.min(b) {
        return Err(format!(
            "expected a longer side of at most {LONGEST} times the shorter one, found {a} nm and {b} nm"
        ));
    }
    Ok(size_nm)
}

/// As people type it.
fn typed(value: f64) -> String {
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

#[cfg(test)]
mod tests;
