//! The median.

/// Number of values from which only the middle ones are sorted.
const MANY: usize = 1 << 16;
/// Values that tell where the middle ones are.
const SAMPLED: usize = 1 << 12;
/// Values that are looked at between two checks whether there is room for more.
const AT_ONCE: usize = 1 << 10;

/// The middle one of some values (the upper of two); they are reordered. 0 of none.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let half = values.len() / 2;
    let quick = (values.len() >= MANY).then(|| ranked(values, half));
    if let Some(found) = quick.flatten() {
        return found;
    }
    *values.select_nth_unstable_by(half, f64::total_cmp).1
}

/// The value of a rank near the middle, if it lies where a sample says; the same as by sorting all.
fn ranked(values: &[f64], rank: usize) -> Option<f64> {
    // An odd step meets every column of an image in turn.
    let step = (values.len() / SAMPLED) | 1;
    let mut sample: Vec<f64> = values.iter().step_by(step).copied().collect();
    sample.sort_unstable_by(f64::total_cmp);
    // Four standard deviations of a rank on either side.
    let (middle, reach) = (sample.len() / 2, 2 * sample.len().isqrt());
    let (low, high) = (sample[middle - reach], sample[middle + reach]);
    let mut kept = vec![0.0; values.len() / 4 + AT_ONCE];
    let (mut count, mut below, mut above) = (0, 0, 0);
    for some in values.chunks(AT_ONCE) {
        if count + some.len() > kept.len() {
            return None;
        }
        // Without branches: where a value lies is a matter of chance.
        for value in some {
            kept[count] = *value;
            count += usize::from(*value >= low && *value <= high);
            below += usize::from(*value < low);
            above += usize::from(*value > high);
        }
    }
    let rank = rank.checked_sub(below)?;
    // What is no number lies nowhere.
    let found = rank < count && count + below + above == values.len();
    found.then(|| *kept[..count].select_nth_unstable_by(rank, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::rng::normals;

    /// Of many values it is the one that sorting finds: noise, few different values, most of them alike, slopes, no numbers.
    #[test]
    fn the_median_of_many_values_is_that_of_all() {
        let count = 3 * MANY + 1;
        let mut noise = normals(1, "median", 0);
        let shapes: [Vec<f64>; 6] = [
            (0..count).map(|_| noise()).collect(),
            (0..count).map(|i| (i % 5) as f64).collect(),
            (0..count)
                .map(|i| f64::from(u8::from(i % 9 == 0)))
                .collect(),
            (0..count).map(|i| i as f64).collect(),
            (0..count)
                .map(|i| 1.0 / ((i % 512) as f64 - 100.5))
                .collect(),
            (0..count)
                .map(|i| if i % 7 == 0 { -f64::NAN } else { i as f64 })
                .collect(),
        ];
        for (n, values) in shapes.into_iter().enumerate() {
            let mut sorted = values.clone();
            sorted.sort_unstable_by(f64::total_cmp);
            let (found, wanted) = (median(&mut values.clone()), sorted[count / 2]);
            assert_eq!(found.to_bits(), wanted.to_bits(), "{n}: {found} {wanted}");
        }
        let noise = normals(2, "median", 0);
        let values: Vec<f64> = std::iter::repeat_with(noise).take(count).collect();
        assert!(ranked(&values, count / 2).is_some());
    }
}
