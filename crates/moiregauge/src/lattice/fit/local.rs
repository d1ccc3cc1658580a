//! The noise spectrum around a harmonic, and what of it moves the wave vector.
//!
//! In: powers of a residual's transform around the harmonic, each with the power that white noise of
//! unit variance would have there. Out: the noise power as it acts on the x and on the y component of
//! the wave vector and on the phase, `Σ S(k) |D(k)|² / Σ |D(k)|²` with D the transform of X (or Y, or 1)
//! on the frame: its power is 1/m² at m cycles, along one axis. What line offsets take up of D, which is
//! what it has at kx = 0, does not count.
//!
//! The fit has emptied the spectrum where D is large, so S is a smooth function fitted to what lies
//! around. Noise of scanning probes is a function of time, which runs along the lines: S depends on
//! |kx|, in places like a power of it, and on ky only in the ridge at kx = 0, which holds what whole
//! lines do. Powers of noise are exponentially distributed about S; the maximum of their likelihood
//! (a gamma regression with logarithmic link, solved by scoring) has none of the bias that logarithms
//! of single powers have.
//!
//! # References
//! Whittle, J. R. Stat. Soc. B 15, 125 (1953), likelihood of a periodogram; Nelder and Wedderburn,
//! J. R. Stat. Soc. A 135, 370 (1972), regression with such powers.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::numbers::MOST_ROUNDS;

/// One frequency, in whole cycles per frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bin {
    pub(crate) k: Vector2<i64>,
    /// Power found, per pixel.
    pub(crate) power: f64,
    /// Power that white noise of unit variance would have: 1 but where the fit has taken it.
    pub(crate) white: f64,
}

/// Whole lines do what is found at |kx| up to this: the window spreads it by one bin.
const RIDGE: i64 = 1;
/// Bins on either side at which D is looked at, along the lines and across. Along the lines the noise may rise
/// steeply towards kx = 0. Chosen by eye.
const LEVER: [i64; 2] = [8, 3];
/// Bins beside each other are correlated by the window: four count as one.
const CORRELATED: f64 = 4.0;
/// Standard deviation of what is known beforehand about exponents: those of noise are 0 to 2, ...
const EXPONENT: f64 = 1.5;
/// ... and about the logarithm by which kx = 0 differs from its neighbours: a factor of seven.
const STEP: f64 = 2.0;
/// Least number of bins for a fit: hardly more than its parameters.
const FEWEST: f64 = 6.0;

/// Noise power on the x and on the y component of the wave vector at `k` (cycles per frame), and on the
/// phase. Line offsets take up the share `lambda` of what whole lines do. `None` where the fit has left
/// nothing.
pub(crate) fn acting_on(k: Vector2<f64>, lambda: f64, bins: &[Bin]) -> Option<[f64; 3]> {
    let ridge = |k: Vector2<i64>| k.x.abs() <= RIDGE;
    // ln S = a + b ln|kx| off the ridge, and a + b ln|ky| + c [kx = 0] on it.
    let features = |at: Vector2<i64>, on_ridge: bool| {
        let along = |i: usize| (at[i].abs().max(1) as f64 / k[i].abs().max(1.0)).ln();
        if on_ridge {
            Vector3::new(1.0, along(1), f64::from(at.x == 0))
        } else {
            Vector3::new(1.0, along(0), 0.0)
        }
    };
    let fitted = |on_ridge: bool| {
        let chosen = bins.iter().filter(|bin| ridge(bin.k) == on_ridge);
        let rows: Vec<_> = chosen
            .map(|bin| (features(bin.k, on_ridge), bin.power, bin.white))
            .collect();
        regression(&rows)
    };
    let (on, off) = (fitted(true), fitted(false));
    let level = on.or(off)?.x;
    let power = |at: Vector2<i64>| {
        let ln = match (on, off) {
            (Some(b), _) if ridge(at) => b.dot(&features(at, true)),
            (_, Some(b)) => b.dot(&features(at, false)),
            _ => level,
        };
        ln.exp()
    };
    let centre = k.map(|k| k.round() as i64);
    Some([0, 1, 2].map(|component| {
        let (mut sum, mut weight) = (0.0, 0.0);
        for dy in -LEVER[1]..=LEVER[1] {
            for dx in -LEVER[0]..=LEVER[0] {
                let at = centre + Vector2::new(dx, dy);
                let d = [0, 1].map(|axis| {
                    let angle = std::f64::consts::PI * (k[axis] - at[axis] as f64);
                    if axis == component {
                        tilted(angle)
                    } else {
                        plain(angle)
                    }
                });
                let left = if at.x == 0 { 1.0 - lambda } else { 1.0 };
                let share = left * (d[0] * d[1]).powi(2);
                sum += share * power(at);
                weight += share;
            }
        }
        sum / weight
    }))
}

/// `½ ∫ e^{iaX} dX` over −1 … 1.
fn plain(a: f64) -> f64 {
    if a.abs() < 1e-4 { 1.0 } else { a.sin() / a }
}

/// `½ ∫ X e^{iaX} dX / i` over −1 … 1.
fn tilted(a: f64) -> f64 {
    if a.abs() < 1e-3 {
        a / 3.0
    } else {
        (a.sin() / a - a.cos()) / a
    }
}

/// Coefficients of ln S from (features, power, power of white noise).
fn regression(rows: &[(Vector3<f64>, f64, f64)]) -> Option<Vector3<f64>> {
    let (found, white) = rows.iter().fold((0.0, 0.0), |(found, white), row| {
        (found + row.1, white + row.2)
    });
    if white < FEWEST || !(found > 0.0) {
        return None;
    }
    let prior = Vector3::new(0.0, EXPONENT.powi(-2), STEP.powi(-2)) * CORRELATED;
    let mut b = Vector3::new((found / white).ln(), 0.0, 0.0);
    for _ in 0..MOST_ROUNDS {
        let mut score = -prior.component_mul(&b);
        let mut information = Matrix3::from_diagonal(&prior);
        for (x, power, white) in rows {
            score += x * (power / b.dot(x).exp() - white);
            information += *white * x * x.transpose();
        }
        let step = information.cholesky()?.solve(&score);
        let largest = step.amax();
        b += step * (1.0 / largest).min(1.0);
        if largest < 1e-6 {
            break;
        }
    }
    b.iter().all(|v| v.is_finite()).then_some(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bins(power: impl Fn(Vector2<i64>) -> f64) -> Vec<Bin> {
        let at = (-1_i64..=9).flat_map(|x| (-12_i64..=20).map(move |y| Vector2::new(x, y)));
        at.filter(|k| k.x.abs() > 1 || k.y.abs() > 1)
            .map(|k| Bin {
                k,
                power: power(k),
                white: 1.0,
            })
            .collect()
    }

    /// White noise of variance 2.5 is that everywhere.
    #[test]
    fn white_noise_is_the_same_everywhere() {
        for k in [Vector2::new(4.3, 4.1), Vector2::new(0.2, 5.0)] {
            let found = acting_on(k, 0.0, &bins(|_| 2.5)).unwrap();
            assert!(found.iter().all(|s| (s - 2.5).abs() < 1e-9), "{found:?}");
        }
    }

    /// Of noise like 1/|kx| the harmonic at kx = 5 gets 1/5 along y. Along x, D of a whole number of
    /// cycles is 1/m at 5 ± m: the sum is done by hand.
    #[test]
    fn power_laws_are_followed() {
        let spectrum = |x: f64| 1.0 / x.abs().max(1.0);
        let law = bins(|k| spectrum(k.x as f64));
        let [x, y, _] = acting_on(Vector2::new(5.0, 4.0), 0.0, &law).unwrap();
        let (mut sum, mut weight) = (0.0, 0.0);
        for m in 1..=8 {
            let share = f64::from(m).powi(-2);
            sum += share * (spectrum(5.0 - f64::from(m)) + spectrum(5.0 + f64::from(m)));
            weight += 2.0 * share;
        }
        // What is known beforehand bends the exponent a little.
        assert!((y / 0.2 - 1.0).abs() < 0.03, "{y}");
        assert!(
            (x / (sum / weight) - 1.0).abs() < 0.03,
            "{x} {}",
            sum / weight
        );
    }

    /// A ridge ten times the noise beside it acts on harmonics that lie on it and on no others; of one
    /// half a cycle beside it, which lies on it with sinc²(½) = 4/π², it moves the phase by
    /// 1 + 9·4/π², and where line offsets take it all up by nothing.
    #[test]
    fn ridges_act_where_they_are() {
        let law = bins(|k| if k.x == 0 { 10.0 } else { 1.0 });
        let [_, y, on] = acting_on(Vector2::new(0.0, 5.0), 0.0, &law).unwrap();
        let [_, _, off] = acting_on(Vector2::new(4.0, 5.0), 0.0, &law).unwrap();
        assert!(
            (8.0..10.5).contains(&on) && (8.0..10.5).contains(&y),
            "{on} {y}"
        );
        assert!((off - 1.0).abs() < 1e-6, "{off}");
        let beside = Vector2::new(0.5, 5.0);
        let [_, _, half] = acting_on(beside, 0.0, &law).unwrap();
        let expected = 1.0 + 9.0 * 4.0 / std::f64::consts::PI.powi(2);
        assert!((half / expected - 1.0).abs() < 0.15, "{half} {expected}");
        let [x, y, free] = acting_on(beside, 1.0, &law).unwrap();
        assert!(
            [x, y, free].iter().all(|s| (s - 1.0).abs() < 0.2),
            "{x} {y} {free}"
        );
    }
}
