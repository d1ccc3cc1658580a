//! What the harmonics of a proposed lattice are, and whether they can be chance.

use nalgebra::{Matrix2, Vector2};

use crate::frame::background::Background;
use crate::frame::image::Image;
use crate::numbers::three::three;
use crate::spectrum::error::{SECOND, THIRD};
use crate::spectrum::harmonics::{Harmonic, Harmonics, Windowed};
use crate::spectrum::shells::shells;

/// The harmonics and the three first wave vectors, starting from a pair found in the spectrum.
///
/// Neighbouring harmonics shift each peak of the transform a little. The shift is measured on the
/// model image, whose wave vectors are known, and taken off.
pub(crate) fn refine(
    image: &Image,
    pair: &Matrix2<f64>,
    background: Background,
) -> Option<(Harmonics, [Vector2<f64>; 3])> {
    let windowed = Windowed::new(image);
    let seen = windowed.refined_peaks(three(pair));
    let first = windowed.amplitudes(&common_pair(&seen), shells(3))?;
    let model = Windowed::new(&first.model(image, background));
    let known = [0, 1, 2].map(|i| first.waves[i].0);
    let again = model.refined_peaks(known);
    let peaks = [0, 1, 2].map(|i| seen[i] - (again[i] - known[i]));
    let second = windowed.fit(image, &common_pair(&peaks), background, shells(3))?;
    Some((second, peaks))
}

/// K₁, K₂ by least squares with K₃ = K₂ − K₁, equal weights.
pub(crate) fn common_pair(peaks: &[Vector2<f64>; 3]) -> Matrix2<f64> {
    let k1 = (2.0 * peaks[0] + peaks[1] - peaks[2]) / 3.0;
    let k2 = (peaks[0] + 2.0 * peaks[1] + peaks[2]) / 3.0;
    Matrix2::from_columns(&[k1, k2])
}

/// Signal-to-noise ratios (amplitude) of the first three harmonics, best first.
pub(crate) fn signal_to_noise(harmonics: &Harmonics) -> [f64; 3] {
    let mut best = [0.0; 3];
    for (b, h) in best.iter_mut().zip(&harmonics.list) {
        *b = h.significance(harmonics.window_sums).sqrt();
    }
    best.sort_by(|a, b| b.total_cmp(a));
    best
}

/// Whether the harmonics of a proposed lattice are more than chance.
///
/// Under noise alone the significance is exponentially distributed. Two members of a shell were
/// searched among all frequencies, so they have to exceed the expected maximum of that search; the
/// third was not searched: the sum rule says where it has to be. The second shell may be the strong
/// one, as long as the first, which makes the lattice, is there at all.
pub(crate) fn is_lattice(harmonics: &Harmonics) -> bool {
    let shell = |members: &[Harmonic]| {
        let mut s = [0.0; 3];
        for (s, h) in s.iter_mut().zip(members) {
            *s = h.significance(harmonics.window_sums);
        }
        s.sort_by(|a, b| b.total_cmp(a));
        s
    };
    let is_significant = |s: [f64; 3]| s[1] > SECOND && s[2] > THIRD;
    let first = shell(&harmonics.list[..3]);
    let second = is_significant(shell(&harmonics.list[3..harmonics.list.len().min(6)]));
    is_significant(first) || (second && first[1] > THIRD)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::error::LatticeError;

    /// The reason is named with what was found and what is needed, and nothing that was met.
    #[test]
    fn the_wave_vector_that_falls_short_is_named() {
        let words = |best| LatticeError::NoLattice { best }.to_string();
        let second = words([4.7, 4.4, 4.1]);
        assert!(
            second.ends_with(": the second has 4.40 but needs 4.48"),
            "{second}"
        );
        let third = words([9.0, 8.0, 3.0]);
        assert!(
            third.ends_with(": the third has 3.00 but needs 3.47"),
            "{third}"
        );
        let both = words([4.0, 4.0, 2.0]);
        assert!(
            both.contains("second has 4.00") && both.contains("third has 2.00"),
            "{both}"
        );
        let barely = words([4.472, 4.472, 4.1]);
        assert!(barely.ends_with("4.47 but needs 4.48"), "{barely}");
        assert!(!words([0.0; 3]).contains("signal-to-noise"));
    }

    /// What the message asks for is what the verdict asks for.
    #[test]
    fn the_limits_of_the_message_are_those_of_the_verdict() {
        let with = |ratios: [f64; 3]| {
            let list = ratios.iter().map(|ratio| Harmonic {
                q: Vector2::x(),
                amplitude: rustfft::num_complex::Complex64::new(*ratio, 0.0),
                noise: [1.0; 2],
            });
            is_lattice(&Harmonics {
                list: list.collect(),
                window_sums: [1.0; 2],
                constant: 0.0,
                pair: Matrix2::identity(),
            })
        };
        assert!(with([9.0, 4.48, 3.47]));
        assert!(!with([9.0, 4.47, 3.47]));
        assert!(!with([9.0, 4.48, 3.46]));
    }
}
