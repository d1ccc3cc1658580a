//! The harmonics that a fit starts with.

use crate::spectrum::harmonics::{Harmonic, Harmonics};
use crate::spectrum::shells::FIRST_SHELL;

/// What the fit starts with: the first shell, and of the others what the spectrum shows clearly.
/// `None` where the first shell is not complete (one of it beyond the Nyquist frequency).
pub(crate) fn at_first(start: &Harmonics, pixels: usize) -> Option<Vec<([i32; 2], &Harmonic)>> {
    let inverse = start.pair.try_inverse()?;
    let price = (pixels as f64).ln();
    let found = start.list.iter().map(|harmonic| {
        let index = (inverse * harmonic.q).map(|n| n.round() as i32);
        ([index.x, index.y], harmonic)
    });
    let chosen: Vec<_> = found
        .filter(|(index, harmonic)| {
            FIRST_SHELL.contains(index) || harmonic.significance(start.window_sums) > price
        })
        .collect();
    let first = chosen.iter().map(|(index, _)| *index).take(3);
    first.eq(FIRST_SHELL).then_some(chosen)
}
