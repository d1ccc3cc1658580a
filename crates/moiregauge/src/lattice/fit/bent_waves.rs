//! The waves of a fit on a scanner that its sensors say is bent.
//!
//! A pixel that is U off a straight grid sees a wave of the phase `p·(X + U)`: the turn `e^{ip·U}` comes to those of the straight grid, pixel
//! by pixel. It is known, whatever the pair: the sums of products of two waves, which are those of a straight grid but for what
//! oscillates, are not changed.

use nalgebra::{Matrix2, Vector2};
use rustfft::num_complex::Complex64;

use crate::frame::departure::Departure;
use crate::lattice::fit::frame::{Frame, turns, wave};

/// The waves of some harmonics along the lines of a bent scanner.
pub(crate) struct BentWaves {
    /// In units of X and Y.
    displacement: Departure,
    pair: Matrix2<f64>,
    indices: Vec<[i32; 2]>,
    /// `e^{ip_x X}` of each harmonic.
    along: Vec<Vec<Complex64>>,
    x: Vec<f64>,
}

impl BentWaves {
    pub(crate) fn new(frame: &Frame, pair: &Matrix2<f64>, indices: &[[i32; 2]]) -> Option<Self> {
        let to_edge = Matrix2::from_diagonal(&frame.edge().map(|e| 1.0 / e));
        let along = indices.iter().map(|i| turns(wave(pair, *i).x, &frame.x));
        Some(Self {
            displacement: frame.displacement.as_ref()?.mapped(&to_edge),
            pair: *pair,
            indices: indices.to_vec(),
            along: along.collect(),
            x: frame.x.clone(),
        })
    }

    /// Hands out `e^{i(p_x X + p·U)}` of every harmonic on a line.
    pub(crate) fn each(&self, row: usize, mut take: impl FnMut(usize, &[Complex64])) {
        let off = self.displacement.line(row, self.x.len());
        let largest = self.indices.iter().flatten().map(|i| i.abs()).max();
        let powers = [0, 1].map(|vector| {
            let p: Vector2<f64> = self.pair.column(vector).into_owned();
            let turn: Vec<_> = off.iter().map(|u| Complex64::cis(p.dot(u))).collect();
            let mut powers = vec![vec![Complex64::ONE; turn.len()]];
            for n in 0..largest.unwrap_or(0) as usize {
                let next = powers[n].iter().zip(&turn).map(|(a, b)| a * b).collect();
                powers.push(next);
            }
            powers
        });
        let mut line = vec![Complex64::ZERO; off.len()];
        for (i, (along, index)) in self.along.iter().zip(&self.indices).enumerate() {
            let [a, b] = [0, 1].map(|v| &powers[v][index[v].unsigned_abs() as usize]);
            let signed = |turn: Complex64, index: i32| if index < 0 { turn.conj() } else { turn };
            for (c, out) in line.iter_mut().enumerate() {
                *out = along[c] * signed(a[c], index[0]) * signed(b[c], index[1]);
            }
            take(i, &line);
        }
    }

    /// Takes waves with such factors of cosine and sine, `e^{ip_y Y}` in them, off a line.
    pub(crate) fn take_off(&self, row: usize, factors: &[[f64; 2]], line: &mut [f64]) {
        self.each(row, |i, turns| {
            let [p, q] = factors[i];
            for (value, turn) in line.iter_mut().zip(turns) {
                *value -= p * turn.re + q * turn.im;
            }
        });
    }

    /// Sums of a line times `Xᵃ cos` and `Xᵃ sin` of every harmonic, for a up to 3.
    pub(crate) fn products(&self, row: usize, line: &[f64]) -> Vec<[Complex64; 4]> {
        let mut all = vec![[Complex64::ZERO; 4]; self.indices.len()];
        self.each(row, |i, turns| {
            for ((value, x), turn) in line.iter().zip(&self.x).zip(turns) {
                let mut term = turn * value;
                for sum in &mut all[i] {
                    *sum += term;
                    term *= x;
                }
            }
        });
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::background::Background;
    use crate::frame::departure::{Across, Term};
    use crate::frame::image::Image;
    use crate::lattice::fit::measure::measure;
    use crate::numbers::rng::normals;
    use crate::spectrum::harmonics::Windowed;
    use crate::spectrum::shells::shells;

    /// (columns, rows), not square: exchanged axes would show.
    const SIZE: [usize; 2] = [150, 121];

    fn pair() -> Matrix2<f64> {
        Matrix2::new(0.45, -0.02, 0.21, 0.52)
    }

    /// Bows of up to 2 % of the frame, and creep.
    fn bent() -> Departure {
        let term = |along, across, x, y| Term {
            along,
            across,
            size: Vector2::new(x, y),
        };
        let log = Across::Log {
            tau: 0.02,
            from_last: false,
        };
        let terms = vec![
            term(2, Across::Power(0), 1.9, 0.4),
            term(3, Across::Power(0), -0.5, 0.2),
            term(1, Across::Power(2), 0.3, -0.4),
            term(0, Across::Power(2), 0.7, -1.5),
            term(0, log, 0.3, 0.5),
        ];
        Departure::new(terms, [0, SIZE[0] - 1], [0, SIZE[1] - 1])
    }

    fn image(seed: u64) -> Image {
        let (bent, mut normal) = (bent(), normals(seed, "bent waves", 0));
        let value = |i: usize| {
            let at = Vector2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
            let at = at + bent.at(at);
            let [a, b] = [0, 1].map(|j| pair().column(j).dot(&at));
            a.cos() + b.cos() + (b - a).cos() + 0.3 * (a + b).cos() + 0.3 * normal()
        };
        let values = (0..SIZE[0] * SIZE[1]).map(value);
        Image::new(SIZE[1], SIZE[0], values.collect())
    }

    /// A uniform lattice under a known bend comes out within its errors and is not said to change; without the bend it is.
    #[test]
    fn known_bends_are_no_change_of_the_lattice() {
        const SEEDS: u64 = 24;
        let (mut pulls, bent) = (0.0, bent());
        for seed in 0..SEEDS {
            let image = image(seed);
            let start = Windowed::new(&image).fit(&image, &pair(), Background::Plane, shells(3));
            let start = start.unwrap();
            let found = measure(&image, &start, Background::Plane, Some(&bent)).unwrap();
            let waves = found.fit.wave_vectors;
            for i in 0..4 {
                pulls += (waves.basis[i] - pair()[i]).powi(2) / waves.covariance[(i, i)];
            }
            assert!(found.fit.change().is_none(), "{seed}");
            let plain = measure(&image, &start, Background::Plane, None).unwrap();
            assert!(plain.fit.change().is_some(), "{seed}");
        }
        let rms = (pulls / (4.0 * SEEDS as f64)).sqrt();
        assert!((0.8..1.25).contains(&rms), "{rms}");
    }
}
