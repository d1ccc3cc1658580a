//! Grains of one frame drift together: sets of the same scans whose drifts contradict each other do not all show a lattice.

use crate::campaign::analysis::{Drift, SetAnalysis};
use crate::caveat::Caveat;
use crate::caveat::sets::SetDoubt;
use crate::numbers::chi2;

/// Drifts contradict each other where chance separates them as far less often than this.
const CONTRADICTED: f64 = 1e-6;
/// The drift of one set is believed against that of another whose variance is so many times as large; else neither is.
const BETTER_KNOWN: f64 = 9.0;
/// nm/s → nm/min.
const PER_MINUTE: f64 = 60.0;

/// Takes the twist and strain from grains whose drift contradicts that of another grain of the same scans.
pub(crate) fn agree_on_drift(sets: &mut [SetAnalysis], caveats: &mut Vec<Caveat>) {
    let mut contradicted = vec![None; sets.len()];
    for (i, one) in sets.iter().enumerate() {
        for (j, other) in sets.iter().enumerate().skip(i + 1) {
            let (Some(a), Some(b)) = (&one.drift, &other.drift) else {
                continue;
            };
            let Some(apart) = contradiction(a, b).filter(|_| share_a_scan(one, other)) else {
                continue;
            };
            let [a, b] = [a, b].map(|drift| drift.covariance.trace());
            if a > b / BETTER_KNOWN {
                contradicted[i] = Some((apart, other.name.clone()));
            }
            if b > a / BETTER_KNOWN {
                contradicted[j] = Some((apart, one.name.clone()));
            }
        }
    }
    for (set, doubt) in sets.iter_mut().zip(contradicted) {
        let Some((nm_per_min, other)) = doubt else {
            continue;
        };
        (set.mean, set.uncorrected) = (None, None);
        let doubt = SetDoubt::GrainsContradict { nm_per_min, other };
        caveats.push(Caveat::new(doubt, &set.name));
    }
}

/// By how much two drifts differ, nm/min, where that is no chance. What the user gave is no measurement.
fn contradiction(one: &Drift, other: &Drift) -> Option<f64> {
    if one.given || other.given {
        return None;
    }
    let apart = one.velocity - other.velocity;
    let information = (one.covariance + other.covariance).try_inverse()?;
    let chance = chi2::tail(apart.dot(&(information * apart)), 2);
    (chance < CONTRADICTED).then(|| PER_MINUTE * apart.norm())
}

fn share_a_scan(one: &SetAnalysis, other: &SetAnalysis) -> bool {
    let of_other = |file: &String| other.scans.iter().any(|scan| scan.file == *file);
    one.scans.iter().any(|scan| of_other(&scan.file))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    fn drift(x: f64, sigma: f64) -> Drift {
        Drift {
            velocity: Vector2::new(x, 0.0) / PER_MINUTE,
            covariance: Matrix2::identity() * (sigma / PER_MINUTE).powi(2),
            given: false,
            fit: None,
            monte_carlo: None,
            joint: None,
        }
    }

    /// χ² of two degrees of freedom has a tail of e^(−χ²/2): one in a million at 5.26 σ.
    #[test]
    fn drifts_contradict_beyond_one_in_a_million() {
        let apart = |sigmas: f64| contradiction(&drift(sigmas * 5.0, 3.0), &drift(0.0, 4.0));
        assert_eq!(apart(5.2), None);
        let told = apart(5.3).expect("a contradiction");
        assert!((told - 26.5).abs() < 1e-9, "{told}");
        let given = Drift {
            given: true,
            ..drift(100.0, 1.0)
        };
        assert_eq!(contradiction(&given, &drift(0.0, 1.0)), None);
    }
}
