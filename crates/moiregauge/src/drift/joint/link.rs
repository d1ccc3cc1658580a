//! Which frames may be linked by their phases.
//!
//! A phase tells a position modulo a lattice cell. From one frame to the next the position has to be
//! predicted much better than half a wavelength: within the error of the drift that the wave vectors
//! give, and of a drift that changes in the meantime.

use nalgebra::{Matrix2, Vector2};

use crate::drift::joint::sighting::Detection;

/// Predictions have to be this much better than a wavelength: 8 leaves 3.5 σ to half a period.
const SHARE: f64 = 8.0;
/// A change of drift that has to be reckoned with between frames, nm/s²: 0.008 nm/min², that between
/// the three sets of arXiv 2406.08681.
const ACCELERATION: f64 = 0.008 / 3600.0;

/// Numbers the blocks of frames that can be linked: a new one begins after every pause that is too
/// long for the drift error `sigma` (nm/s, largest principal) and the shortest wavelength.
pub(crate) fn number_blocks(sightings: &mut [Detection], waves: &Matrix2<f64>, sigma: f64) {
    let (a, b): (Vector2<f64>, Vector2<f64>) = (waves.column(0).into(), waves.column(1).into());
    let longest = a.norm().max(b.norm()).max((b - a).norm());
    let limit = std::f64::consts::TAU / longest / SHARE;
    let mut order: Vec<usize> = (0..sightings.len()).collect();
    order.sort_by(|&i, &j| sightings[i].time.total_cmp(&sightings[j].time));
    let (mut block, mut last) = (0, f64::NAN);
    for i in order {
        let pause = sightings[i].time - last;
        if sigma * pause + 0.5 * ACCELERATION * pause * pause > limit {
            block += 1;
        }
        sightings[i].block = block;
        last = sightings[i].time;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use nalgebra::Matrix4;

    fn at(times: &[f64]) -> Vec<Detection> {
        let sighting = |(scan, &time): (usize, &f64)| Detection {
            scan,
            class: 0,
            block: 0,
            waves: heterostrain::lattice::Waves::new(Matrix2::identity(), Matrix4::identity()),
            sensor: Matrix4::zeros(),
            time_gradient: Vector2::zeros(),
            fast_gain: Matrix2::zeros(),
            time,
            position: Vector2::zeros(),
            phases: None,
        };
        times.iter().enumerate().map(sighting).collect()
    }

    /// λ = 12.5 nm: a minute is safe with a drift known to 0.1 nm/min, and neither is half an hour
    /// with a perfect drift (½ · 0.008 · 900 = 3.6 nm) nor a minute with one known to 2 nm/min.
    #[test]
    fn long_pauses_and_poor_drifts_break_the_link() {
        let waves = Matrix2::new(0.58, 0.29, 0.0, 0.502);
        let blocks = |times: &[f64], nm_per_min: f64| {
            let mut all = at(times);
            number_blocks(&mut all, &waves, nm_per_min / 60.0);
            all.iter().map(|s| s.block).collect::<Vec<_>>()
        };
        assert_eq!(blocks(&[120.0, 0.0, 60.0], 0.1), [0, 0, 0]);
        assert_eq!(blocks(&[0.0, 60.0, 1860.0, 1920.0], 0.0), [0, 0, 1, 1]);
        assert_eq!(blocks(&[0.0, 60.0, 120.0], 2.0), [0, 1, 2]);
    }
}
