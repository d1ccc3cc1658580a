//! What only all samples of an image together tell of it: a scale, lines never filled, a wrong label.

use std::ops::Range;

use crate::header::Scaling;
use crate::scan::Samples;

/// What is to be found out.
pub(crate) enum Check {
    /// Nothing: the header says it all.
    Nothing,
    /// Whether counts keep to the 16 bits that the header gives them.
    Narrow,
    /// Whether these lines are all the same, as memory never written to is: then they are missing.
    Unfilled(Vec<Range<usize>>),
    /// The scale, from the distance of the largest and the smallest sample.
    Range(Box<dyn Fn(f64) -> Scaling + Send + Sync>),
}

impl Check {
    /// Whether lines were never filled.
    pub(crate) fn unfilled(lines: Range<usize>) -> Self {
        Self::Unfilled(vec![lines])
    }
}

/// What was found out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Verdict {
    /// Rows that are missing.
    pub(crate) blank: Vec<Range<usize>>,
    /// The scale, where the samples tell it.
    pub(crate) scaling: Option<Scaling>,
}

/// Looks at the samples, some rows after the others.
pub(crate) struct Judge<'c> {
    check: &'c Check,
    columns: usize,
    /// Largest count, without sign.
    largest: u32,
    low: f64,
    high: f64,
    /// Of each part of [`Check::Unfilled`] its first sample, and whether all others are like it.
    parts: Vec<(Option<f64>, bool)>,
}

impl<'c> Judge<'c> {
    pub(crate) fn new(check: &'c Check, columns: usize) -> Self {
        let parts = match check {
            Check::Unfilled(parts) => parts.len(),
            _ => 0,
        };
        Self {
            check,
            columns,
            largest: 0,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            parts: vec![(None, true); parts],
        }
    }

    /// Takes in the samples of the rows from `first` on.
    pub(crate) fn look(&mut self, first: usize, samples: &Samples) {
        match self.check {
            Check::Nothing => {}
            Check::Narrow => {
                if let Samples::I32(counts) = samples {
                    let largest = counts.iter().map(|c| c.unsigned_abs()).max();
                    self.largest = self.largest.max(largest.unwrap_or(0));
                }
            }
            Check::Range(_) => samples.each(0..samples.len(), |value| {
                if value.is_finite() {
                    self.low = self.low.min(value);
                    self.high = self.high.max(value);
                }
            }),
            Check::Unfilled(ranges) => {
                let rows = samples.len().checked_div(self.columns).unwrap_or(0);
                for (range, (known, same)) in ranges.iter().zip(&mut self.parts) {
                    let start = range.start.clamp(first, first + rows) - first;
                    let end = range.end.clamp(first, first + rows) - first;
                    let part = start * self.columns..end.max(start) * self.columns;
                    samples.each(part, |value| {
                        let first = *known.get_or_insert(value);
                        *same &= value == first;
                    });
                }
            }
        }
    }

    /// What all of them tell; the error says why they cannot be values.
    pub(crate) fn verdict(self) -> Result<Verdict, String> {
        let mut verdict = Verdict::default();
        match self.check {
            // A 16-bit quantity in 32-bit storage keeps to 16 bits; levelling may double its range. Where it
            // does not, the label is wrong (seen in height maps of force volumes), and with it the divisor.
            Check::Narrow if self.largest > 1 << 16 => {
                return Err(format!(
                    "its scale is ambiguous: labelled 2 bytes wide, but its counts reach {}",
                    self.largest
                ));
            }
            Check::Nothing | Check::Narrow => {}
            Check::Range(scaling) => verdict.scaling = Some(scaling(self.high - self.low)),
            Check::Unfilled(ranges) => {
                let parts = ranges.iter().zip(self.parts);
                let unfilled = parts.filter(|(_, (known, same))| known.is_some() && *same);
                verdict.blank = unfilled.map(|(range, _)| range.clone()).collect();
            }
        }
        Ok(verdict)
    }
}

impl Verdict {
    /// The samples with the missing rows as NaN. Integers become doubles, as only these know NaN.
    pub(crate) fn blank(&self, samples: Samples, columns: usize) -> Samples {
        let mut samples = samples;
        for rows in &self.blank {
            let end = (rows.end * columns).min(samples.len());
            let part = rows.start * columns..end;
            samples = match samples {
                Samples::F32(mut v) => {
                    v[part].fill(f32::NAN);
                    Samples::F32(v)
                }
                other => {
                    let mut v = other.into_doubles();
                    v[part].fill(f64::NAN);
                    Samples::F64(v)
                }
            };
        }
        samples
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of a column, shown in pieces of two.
    fn verdict(check: &Check, samples: &[i32]) -> Result<Verdict, String> {
        let mut judge = Judge::new(check, 1);
        for (n, piece) in samples.chunks(2).enumerate() {
            judge.look(2 * n, &Samples::I32(piece.to_vec()));
        }
        judge.verdict()
    }

    #[test]
    fn only_constant_lines_are_blanked() {
        let blank = |rows| {
            let found = verdict(&Check::unfilled(rows), &[1, 2, 0, 0, 0]);
            found.expect("a verdict").blank
        };
        assert_eq!(blank(2..5).first(), Some(&(2..5)));
        assert_eq!(blank(1..5), []);
        assert_eq!(blank(5..5), []);
        assert_eq!(blank(3..9).first(), Some(&(3..9)));
        let some = Verdict {
            blank: Vec::from([2..4, 2..4]),
            scaling: None,
        };
        let Samples::F64(values) = some.blank(Samples::I16(vec![1, 2, 0]), 1) else {
            panic!("integers know no NaN");
        };
        assert!(values[..2] == [1.0, 2.0] && values[2].is_nan());
        let Samples::F32(single) = some.blank(Samples::F32(vec![1.0; 6]), 2) else {
            panic!("single precision stays");
        };
        assert!(single[3] == 1.0 && single[4].is_nan());
    }

    #[test]
    fn wide_counts_are_found_wherever_they_are() {
        assert!(verdict(&Check::Narrow, &[0, -65_536, 4]).is_ok());
        let error = verdict(&Check::Narrow, &[0, 1, 4, -65_537]);
        assert!(error.expect_err("too wide").contains("65537"));
    }

    #[test]
    fn ranges_go_over_all_pieces() {
        let check = Check::Range(Box::new(|range| Scaling {
            scale: range,
            offset: 0.0,
            words: String::new(),
        }));
        let found = verdict(&check, &[3, 9, -1, 4, 5]).expect("a verdict");
        assert_eq!(found.scaling.expect("a scale").scale, 10.0);
    }
}
