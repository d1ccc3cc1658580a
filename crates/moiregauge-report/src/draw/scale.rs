//! Ranges, the map from data to page, and ticks at round numbers.

pub use moiregauge::words::fixed;

/// A closed interval of data values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Range {
    pub(crate) fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    /// The smallest range that holds all finite `values`; `None` if there are none.
    pub(crate) fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        values
            .into_iter()
            .filter(|v| v.is_finite())
            .fold(None, |range: Option<Self>, v| {
                Some(range.map_or(Self::new(v, v), |r| Self::new(r.low.min(v), r.high.max(v))))
            })
    }

    pub(crate) fn width(&self) -> f64 {
        self.high - self.low
    }

    pub(crate) fn centre(&self) -> f64 {
        f64::midpoint(self.low, self.high)
    }

    /// Wider by `share` of the width at both ends, and never narrower than `minimum`.
    pub(crate) fn padded(&self, share: f64, minimum: f64) -> Self {
        let half = (self.width() * (0.5 + share)).max(minimum / 2.0);
        Self::new(self.centre() - half, self.centre() + half)
    }

    pub(crate) fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// A linear map from a data range to a stretch of the page.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    pub(crate) range: Range,
    from: f64,
    to: f64,
}

impl Scale {
    /// `range.low` goes to `from`, `range.high` to `to` (pt).
    pub(crate) fn new(range: Range, from: f64, to: f64) -> Self {
        Self { range, from, to }
    }

    pub(crate) fn at(&self, value: f64) -> f64 {
        self.from + (value - self.range.low) * self.per_unit()
    }

    /// Points of the page per data unit, signed.
    pub(crate) fn per_unit(&self) -> f64 {
        (self.to - self.from) / self.range.width()
    }
}

/// A labelled place on an axis.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    pub(crate) value: f64,
    pub(crate) label: String,
}

/// About `wanted` ticks at multiples of 1, 2 or 5 times a power of ten.
pub(crate) fn ticks(range: Range, wanted: usize) -> Vec<Tick> {
    let step = nearest_step(range.width() / wanted.max(1) as f64);
    multiples(range, step)
}

/// Ticks at whole numbers, for counting scans.
pub(crate) fn whole_ticks(range: Range, wanted: usize) -> Vec<Tick> {
    let step = nearest_step(range.width() / wanted.max(1) as f64).max(1.0);
    multiples(range, step)
        .into_iter()
        .filter(|tick| tick.value >= 1.0 || range.low > 0.6)
        .collect()
}

/// The largest of 1, 2, 5, 10 … that is not above `rough`.
pub(crate) fn round_step(rough: f64) -> f64 {
    // 1e-9: 0.1 / 0.1 may come out just below 1.
    step_by(rough, [1.0, 2.0, 5.0, 10.0].map(|f| f * (1.0 - 1e-9)))
}

/// The one of 1, 2, 5, 10 … that is nearest to `rough` by ratio.
fn nearest_step(rough: f64) -> f64 {
    step_by(rough, [0.0, 2_f64.sqrt(), 10_f64.sqrt(), 50_f64.sqrt()])
}

/// 1, 2, 5 or 10 times a power of ten, the last one whose threshold is not above the leading digits.
fn step_by(rough: f64, thresholds: [f64; 4]) -> f64 {
    if !(rough.is_finite() && rough > 0.0) {
        return 1.0;
    }
    let power = 10_f64.powf(rough.log10().floor());
    let leading = rough / power;
    let steps = [1.0, 2.0, 5.0, 10.0].into_iter().zip(thresholds);
    steps
        .rev()
        .find(|&(_, from)| leading >= from)
        .map_or(power, |(step, _)| step * power)
}

fn multiples(range: Range, step: f64) -> Vec<Tick> {
    let decimals = (-(step.log10() + 1e-9).floor()).max(0.0) as usize;
    let (first, last) = (
        (range.low / step - 1e-9).ceil(),
        (range.high / step + 1e-9).floor(),
    );
    let count = (last - first).clamp(-1.0, 100.0) as i32;
    (0..=count)
        .map(|i| {
            let value = (first + f64::from(i)) * step;
            Tick {
                value,
                label: fixed(value, decimals),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64, wanted: usize) -> Vec<String> {
        ticks(Range::new(low, high), wanted)
            .into_iter()
            .map(|t| t.label)
            .collect()
    }

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        assert_eq!(labels(-0.52, 1.04, 4), ["−0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(labels(0.0, 0.3, 3), ["0.0", "0.1", "0.2", "0.3"]);
        assert_eq!(
            labels(1.1259, 1.1266, 4),
            ["1.1260", "1.1262", "1.1264", "1.1266"]
        );
        assert_eq!(
            labels(0.0, 1000.0, 5),
            ["0", "200", "400", "600", "800", "1000"]
        );
    }

    #[test]
    fn scans_are_counted_in_whole_numbers() {
        let found = whole_ticks(Range::new(0.5, 3.5), 8);
        let values: Vec<f64> = found.iter().map(|t| t.value).collect();
        assert_eq!(values, [1.0, 2.0, 3.0]);
    }

    #[test]
    fn a_single_value_still_gives_a_range() {
        let range = Range::of([f64::NAN, 2.0]).map(|r| r.padded(0.1, 0.5));
        assert_eq!(range, Some(Range::new(1.75, 2.25)));
        assert_eq!(Range::of([f64::NAN]), None);
    }
}
