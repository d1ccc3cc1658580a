//! Positions along a side of a table.

/// Evenly spaced numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) first: f64,
    pub(super) last: f64,
    pub(super) count: usize,
}

impl Axis {
    /// The numbers, if they are at least two and evenly spaced, as far as their digits tell.
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        /// Positions are rounded when they are written; the share of a step that is forgiven.
        const ROUNDED: f64 = 0.05;
        let [first, .., last] = *values else {
            return None;
        };
        let axis = Self {
            first,
            last,
            count: values.len(),
        };
        let step = axis.step();
        let near = |(n, value): (usize, &f64)| {
            (value - (first + n as f64 * step)).abs() <= ROUNDED * step.abs()
        };
        (step != 0.0 && step.is_finite() && values.iter().enumerate().all(near)).then_some(axis)
    }

    pub(super) fn step(&self) -> f64 {
        (self.last - self.first) / (self.count - 1) as f64
    }

    /// From edge to edge of the pixels at these positions.
    pub(super) fn length(&self) -> f64 {
        self.step().abs() * self.count as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_spacing() {
        let axis = Axis::of(&[0.0, 4.1667, 8.3333, 12.5]).expect("rounded positions");
        assert!((axis.length() - 16.6667).abs() < 1e-3);
        assert!(Axis::of(&[3.0, 2.0, 1.0]).is_some());
        for uneven in [
            &[1.0][..],
            &[1.0, 1.0],
            &[0.0, 1.0, 2.2],
            &[0.0, f64::NAN, 2.0],
        ] {
            assert_eq!(Axis::of(uneven), None, "{uneven:?}");
        }
    }
}
