//! Noise that trace and retrace of a scan have in common.
//!
//! What a line does slowly, and what the sample shows beside its lattice, is in both images. Their errors
//! are then correlated, and the mean of the two is less accurate than if they were independent. The
//! coherence of what the fits leave around each harmonic,
//! `ρ = Re Σ a b* e^{−iΔφ} / √(Σ|a|² Σ|b|²)` with Δφ the phase of the harmonic in one against the other,
//! is the correlation of the errors; enlarging both variances by 1 + ρ gives their mean the error that it
//! has: `v(1 + ρ)/2`.

use rustfft::num_complex::Complex64;

use crate::lattice::fit::fit_pixels::LatticeFit;

/// A harmonic of the other image is the same one if it is nearer than this share of it: below half, where the next is as near.
const SAME: f64 = 0.2;
/// Neighbouring frequencies are correlated by the window: this many count as one.
const CORRELATED: f64 = 2.0;
/// Coherence that chance exceeds in one case of two hundred counts, in units of its scatter.
const SIGNIFICANT: f64 = 2.6;

/// The correlation of the errors that two images of one scan have at the three first harmonics of the
/// first one; 0 where chance would do.
pub(crate) fn correlation(first: &LatticeFit, second: &LatticeFit) -> [f64; 3] {
    [0, 1, 2].map(|h| {
        let samples = &first.residual[h];
        let Some((other, turn)) = partner(first, second, h) else {
            return 0.0;
        };
        let (mut common, mut a2, mut b2, mut n) = (Complex64::ZERO, 0.0, 0.0, 0.0);
        for (bin, a) in samples {
            let Some(b) = other(bin) else { continue };
            common += a * b.conj();
            a2 += a.norm_sqr();
            b2 += b.norm_sqr();
            n += 1.0;
        }
        let scatter = (CORRELATED / (2.0 * n)).sqrt();
        let coherence = (common * turn.conj()).re / (a2 * b2).sqrt();
        if coherence > SIGNIFICANT * scatter {
            coherence.min(1.0)
        } else {
            0.0
        }
    })
}

type Lookup<'a> = Box<dyn Fn(&[i64; 2]) -> Option<Complex64> + 'a>;

/// The residual of the second image around the harmonic `h` of the first one, as a function of the
/// frequency, and the phase factor of that harmonic in the first against the second image. The harmonic
/// may have another name and the opposite sign there.
fn partner<'a>(
    first: &LatticeFit,
    second: &'a LatticeFit,
    h: usize,
) -> Option<(Lookup<'a>, Complex64)> {
    let wave = |fit: &LatticeFit, h: usize| {
        let [a, b] = fit.harmonics[h].index.map(f64::from);
        fit.wave_vectors.basis * nalgebra::Vector2::new(a, b)
    };
    let wanted = wave(first, h);
    let (k, sign) = (0..3).flat_map(|k| [(k, 1.0), (k, -1.0)]).min_by(|a, b| {
        let miss = |(k, sign): &(usize, f64)| (wave(second, *k) * *sign - wanted).norm();
        miss(a).total_cmp(&miss(b))
    })?;
    if (wave(second, k) * sign - wanted).norm() > SAME * wanted.norm() {
        return None;
    }
    let samples = &second.residual[k];
    let lookup = move |bin: &[i64; 2]| {
        let at = if sign > 0.0 { *bin } else { [-bin[0], -bin[1]] };
        let (_, value) = samples.iter().find(|(b, _)| *b == at)?;
        Some(if sign > 0.0 { *value } else { value.conj() })
    };
    let turn = first.harmonics[h].phase - sign * second.harmonics[k].phase;
    Some((Box::new(lookup), Complex64::cis(turn)))
}
