//! Lines that a frame was stopped before: samples the instrument never filled become NaN.

use std::ops::Range;

use crate::scan::Samples;

/// Makes the samples of `lines` NaN if they are all the same, as memory never written to is.
///
/// A header that counts the finished lines can be wrong or count otherwise than thought; samples
/// that differ are measured ones and stay. Integers become doubles, as only these know NaN.
pub(crate) fn blank_unfilled(samples: Samples, columns: usize, lines: Range<usize>) -> Samples {
    let (Some(start), Some(end)) = (
        lines.start.checked_mul(columns),
        lines.end.checked_mul(columns),
    ) else {
        return samples;
    };
    let end = end.min(samples.len());
    if start >= end {
        return samples;
    }
    let same = match &samples {
        Samples::I16(v) => v[start..end].iter().all(|x| *x == v[start]),
        Samples::I32(v) => v[start..end].iter().all(|x| *x == v[start]),
        Samples::F32(v) => v[start..end].iter().all(|x| *x == v[start]),
        Samples::F64(v) => v[start..end].iter().all(|x| *x == v[start]),
    };
    if !same {
        return samples;
    }
    let mut values: Vec<f64> = match samples {
        Samples::I16(v) => v.into_iter().map(f64::from).collect(),
        Samples::I32(v) => v.into_iter().map(f64::from).collect(),
        Samples::F32(mut v) => {
            v[start..end].fill(f32::NAN);
            return Samples::F32(v);
        }
        Samples::F64(v) => v,
    };
    values[start..end].fill(f64::NAN);
    Samples::F64(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_constant_lines_are_blanked() {
        let samples = Samples::I16(vec![1, 2, 0, 0, 0, 0]);
        let Samples::F64(blank) = blank_unfilled(samples.clone(), 2, 1..3) else {
            panic!("two lines are missing");
        };
        assert_eq!(blank[..2], [1.0, 2.0]);
        assert!(blank[2..].iter().all(|v| v.is_nan()));
        assert_eq!(blank_unfilled(samples.clone(), 2, 0..2), samples);
        assert_eq!(blank_unfilled(samples.clone(), 2, 3..3), samples);
        assert_eq!(blank_unfilled(samples.clone(), 2, 3..9), samples);
        assert_eq!(blank_unfilled(samples.clone(), usize::MAX, 1..2), samples);
        let Samples::F32(single) = blank_unfilled(Samples::F32(vec![1.0, 5.0]), 1, 0..1) else {
            panic!("single precision stays");
        };
        assert!(single[0].is_nan() && single[1] == 5.0);
    }
}
