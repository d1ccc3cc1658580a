//! The harmonics that a fit starts with.

use crate::spectrum::harmonics::{Harmonic, Harmonics};
use crate::spectrum::shells::FIRST_SHELL;

/// Indices and harmonics with which the fit starts: the three of first order, and those of higher order whose gain in χ² exceeds the
/// price of the information criterion, ln(pixels). `None` if a first-order harmonic is missing, as beyond the Nyquist frequency.
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
