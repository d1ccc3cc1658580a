//! Cosines and sines of the harmonics of a fit, in blocks that the compiler keeps in registers.

use nalgebra::Matrix2;
use rustfft::num_complex::Complex64;

use crate::lattice::fit::bent_waves::BentWaves;
use crate::lattice::fit::frame::{Frame, turns, wave};

/// Values handled together: as many as the compiler keeps in registers.
pub(crate) const LANES: usize = 8;
pub(crate) type Block = [f64; LANES];

/// `cos θ_x` and `sin θ_x` on the right half of a line, in blocks filled up with zeros; the left half is
/// their mirror image, which saves half of all products.
pub(crate) struct Tables {
    /// The first block of every harmonic, then the second, and so on: for adding them up.
    pub(crate) along: Vec<[Block; 2]>,
    /// The blocks of each harmonic one after the other: for products with one of them.
    each: Vec<[Block; 2]>,
    /// `e^{iθ_y}` of each line.
    pub(crate) up: Vec<Vec<Complex64>>,
    /// The same waves on a bent scanner.
    pub(crate) bent: Option<BentWaves>,
}

impl Tables {
    pub(crate) fn new(frame: &Frame, pair: &Matrix2<f64>, indices: &[[i32; 2]]) -> Self {
        let waves: Vec<_> = indices.iter().map(|&i| wave(pair, i)).collect();
        let mut each = Vec::with_capacity(waves.len() * frame.right().len().div_ceil(LANES));
        for p in &waves {
            each.extend(turns(p.x, frame.right()).chunks(LANES).map(|turns| {
                let mut block = [[0.0; LANES]; 2];
                for (i, turn) in turns.iter().enumerate() {
                    (block[0][i], block[1][i]) = (turn.re, turn.im);
                }
                block
            }));
        }
        let blocks = each.len() / waves.len().max(1);
        let along = (0..each.len()).map(|i| each[i % waves.len() * blocks + i / waves.len()]);
        Self {
            along: along.collect(),
            each,
            bent: BentWaves::new(frame, pair, indices),
            up: waves.iter().map(|p| turns(p.y, &frame.y)).collect(),
        }
    }

    /// The blocks of one harmonic.
    pub(crate) fn of(&self, harmonic: usize) -> &[[Block; 2]] {
        let blocks = self.each.len() / self.up.len();
        &self.each[harmonic * blocks..][..blocks]
    }
}

/// Sum in eight independent partial sums.
pub(crate) fn sum(values: &[f64]) -> f64 {
    let blocks = values.chunks_exact(8);
    let rest: f64 = blocks.remainder().iter().sum();
    let mut sums = [0.0; 8];
    for block in blocks {
        for (sum, value) in sums.iter_mut().zip(block) {
            *sum += value;
        }
    }
    sums.iter().sum::<f64>() + rest
}
