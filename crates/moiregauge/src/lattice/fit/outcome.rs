//! What a fit to the pixels has found.

use heterostrain::lattice::{Lattice, Px, Waves};
use nalgebra::{Matrix2, SMatrix, Vector2};

use crate::lattice::fit::bend::Inhomogeneity;
use crate::lattice::fit::cells::larger_of;
use crate::lattice::fit::closure;
use crate::lattice::fit::fit_pixels::{FinalNoise, Fit};
use crate::lattice::fit::fitted::{FittedHarmonic, LatticeFit};
use crate::lattice::fit::straight::Followed;
use crate::spectrum::shells::FIRST_SHELL;

impl Fit<'_> {
    fn harmonics(&self, noise: &FinalNoise) -> Vec<FittedHarmonic> {
        let pixels = self.frame.pixels() as f64;
        let waves = self.model.waves.iter().zip(&self.model.basis.indices);
        waves
            .zip(&noise.local)
            .map(|((&[alpha, beta], &index), local)| {
                let amplitude = alpha.hypot(beta);
                FittedHarmonic {
                    index,
                    amplitude,
                    phase: (-beta).atan2(alpha),
                    signal_to_noise: 0.5 * amplitude * (pixels / local[2]).sqrt(),
                }
            })
            .collect()
    }

    pub(crate) fn result(&self, followed: &Followed) -> Option<(Lattice<Px>, LatticeFit)> {
        let noise = &followed.noise;
        let scale = self.frame.edge().map(|e| 1.0 / e);
        let harmonics = self.harmonics(noise);
        let strengths: Vec<f64> = harmonics.iter().map(|h| h.signal_to_noise).collect();
        let closure = closure::closure(
            &self.model,
            &self.gram,
            &self.gradient,
            &noise.acting(),
            &strengths,
        );
        let covariance = self.covariance(noise)?;
        let enlargement = closure.map_or(1.0, |closure| closure.enlargement());
        let inhomogeneity = followed.change;
        let mut wave_vectors = Waves::new(
            self.model.pair,
            covariance.fixed_view::<4, 4>(3, 3) * enlargement,
        )
        .mapped(&Matrix2::from_diagonal(&scale));
        let clipped = self.clipped();
        if let Some(change) = inhomogeneity.filter(Inhomogeneity::is_significant) {
            let (mean, covariance) = change.of_the_mean(clipped, followed.mean);
            wave_vectors.basis += mean;
            wave_vectors.covariance += covariance;
        }
        let bends = inhomogeneity.is_some_and(|change| change.is_significant());
        let of_noise = covariance.fixed_view::<4, 4>(3, 3).trace();
        if let Some(cells) = self.of_cells(bends).filter(|cells| cells.exceed(of_noise)) {
            let cells = Waves::<Px>::new(self.model.pair, cells.covariance)
                .mapped(&Matrix2::from_diagonal(&scale));
            wave_vectors.covariance = larger_of(&wave_vectors.covariance, &cells.covariance)?;
        }
        let [columns, rows] = [
            self.frame.image.columns as f64,
            self.frame.image.rows as f64,
        ];
        let off = self.frame.middle();
        let carry = carry(off);
        let fit = LatticeFit {
            wave_vectors,
            centre: Vector2::new(columns - 1.0, rows - 1.0) / 2.0,
            off_centre: off.component_mul(&self.frame.edge()),
            harmonics,
            phase_covariance: carry * covariance * carry.transpose(),
            goodness: noise.rms / noise.residual.level().sqrt(),
            line_offsets: self.line_sigma,
            lines_left_out: self.frame.image.rows - self.frame.lines(),
            clipped,
            residual: noise.places.left.clone(),
            inhomogeneity,
            closure,
        };
        Some((wave_vectors.lattice()?, fit))
    }
}

/// What carries the phases of the first shell, with the pair, from the centre of the frame to (X, Y): 3 × 7.
fn carry(to: Vector2<f64>) -> SMatrix<f64, 3, 7> {
    let mut carry = SMatrix::<f64, 3, 7>::zeros();
    for (i, [h, k]) in FIRST_SHELL.into_iter().enumerate() {
        carry[(i, i)] = 1.0;
        for axis in 0..2 {
            carry[(i, 3 + axis)] = f64::from(h) * to[axis];
            carry[(i, 5 + axis)] = f64::from(k) * to[axis];
        }
    }
    carry
}
