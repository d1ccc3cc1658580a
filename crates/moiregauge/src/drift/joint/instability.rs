//! How far the positions of frames scatter beyond what noise does to their phases.

use nalgebra::{DMatrix, DVector, Matrix2xX, Vector2};

use crate::drift::joint::evaluate::PhaseMiss;
use crate::drift::joint::shape::Shape;
use crate::numbers::MOST_ROUNDS;
use crate::numbers::chi2::is_significant;

/// Steps smaller than this share are rounding.
const ROUNDING: f64 = 1e-14;

/// The displacements that phases show, each along the axes of its own noise.
pub(crate) struct Displacements {
    all: Vec<Displaced>,
}

/// The displacement that the phases of a sighting show.
struct Displaced {
    scan: usize,
    /// Along both axes of the noise, nm.
    shift: Vector2<f64>,
    /// The variances of the noise along them, nm².
    noise: Vector2<f64>,
    /// What the local parameters of the scan do to `shift`.
    slopes: Matrix2xX<f64>,
    /// How many of the two components the fit leaves free.
    freedom: f64,
}

impl Displaced {
    fn new(phases: &PhaseMiss, locals: &[DMatrix<f64>], scatter: f64) -> Option<Self> {
        let (by_phases, covariance) = phases.displacement()?;
        let lower = phases.factor(scatter)?;
        // What of the two displacements, whitened, is left free by the fit.
        let plane = lower.solve_lower_triangular(&phases.waves)?;
        let rows = phases.whitened(scatter)?;
        let seen = plane.qr().q().tr_mul(&rows.slopes);
        let known = &seen * &locals[phases.scan];
        let noise = covariance.symmetric_eigen();
        (noise.eigenvalues.min() > 0.0).then_some(())?;
        let along = noise.eigenvectors.transpose() * by_phases;
        Some(Self {
            scan: phases.scan,
            shift: along * phases.miss,
            noise: noise.eigenvalues,
            slopes: along * &phases.slopes,
            freedom: 2.0 - known.dot(&seen),
        })
    }

    /// Squares and variances where the parameters are changed.
    fn changed(&self, shape: &Shape, change: &DVector<f64>) -> [[f64; 2]; 2] {
        let mut shift = self.shift;
        for (local, slope) in self.slopes.column_iter().enumerate() {
            shift -= slope * change[shape.place(self.scan, local)];
        }
        self.with(shift)
    }

    fn with(&self, shift: Vector2<f64>) -> [[f64; 2]; 2] {
        [0, 1].map(|i| [shift[i] * shift[i], self.noise[i]])
    }
}

impl Displacements {
    /// What phases show. `scatter` is the variance of positions (nm²) that the fit was made with, `locals` the covariance
    /// that it gives the local parameters of each scan.
    pub(crate) fn new(phases: &[PhaseMiss], locals: &[DMatrix<f64>], scatter: f64) -> Self {
        let of = |phases| Displaced::new(phases, locals, scatter);
        let all = phases.iter().filter_map(of).collect();
        Self { all }
    }

    /// The position scatter, nm.
    pub(crate) fn scatter(&self) -> f64 {
        let squares: Vec<_> = self.all.iter().flat_map(|d| d.with(d.shift)).collect();
        scatter(&squares, self.all.iter().map(|d| d.freedom).sum())
    }

    /// The position scatter of all scans but one where the parameters are changed by so much, nm.
    pub(crate) fn scatter_without(&self, scan: usize, shape: &Shape, change: &DVector<f64>) -> f64 {
        let others = || self.all.iter().filter(|d| d.scan != scan);
        let squares: Vec<_> = others().flat_map(|d| d.changed(shape, change)).collect();
        scatter(&squares, others().map(|d| d.freedom).sum())
    }
}

/// The position scatter s that makes the phases fit: `Σ δᵀ(P + s²)⁻¹ δ` of the displacements
/// δ that they show, with covariance P, becomes the number of components less what the fit has taken up (Paule
/// and Mandel 1982, J. Res. NBS 87, 377). Zero where the noise alone explains them: where chance makes as much in
/// more than 5 % of cases, as with all enlarged errors. `squares` are those of the components of δ along the axes of P,
/// with their variances.
fn scatter(squares: &[[f64; 2]], freedom: f64) -> f64 {
    // Σ c²/(λ + s²) and its slope.
    let chi2 = |variance: f64| {
        squares
            .iter()
            .fold((0.0, 0.0), |(sum, slope), [c2, noise]| {
                let share = 1.0 / (noise + variance);
                let part = c2 * share;
                (sum + part, slope - part * share)
            })
    };
    if !is_significant(chi2(0.0).0, freedom.round() as usize) {
        return 0.0;
    }
    // Newton on 1/χ², which bends one way only: the steps come nearer from below.
    let mut variance = 0.0_f64;
    for _ in 0..MOST_ROUNDS {
        let (sum, slope) = chi2(variance);
        let step = (sum / freedom - 1.0) * sum / -slope;
        if !(step > ROUNDING * variance) {
            break;
        }
        variance += step;
    }
    variance.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where all variances are equal the scatter has a closed form: Σc²/ν − λ.
    #[test]
    fn equal_errors_have_a_closed_form() {
        let squares: Vec<[f64; 2]> = (0..200).map(|i| [f64::from(i), 2.0]).collect();
        let expected = (199.0 * 200.0 / 2.0 / 190.0_f64 - 2.0).sqrt();
        assert!((scatter(&squares, 190.0) / expected - 1.0).abs() < 1e-14);
        assert_eq!(scatter(&squares[..2], 2.0), 0.0);
    }

    /// The definition holds for errors that differ by a million.
    #[test]
    fn the_scatter_makes_the_squares_fit() {
        for most in [1e-6, 1.0, 1e6] {
            let of = |i: i32| [f64::from(i % 7), most * 10_f64.powi(-(i % 12))];
            let squares: Vec<[f64; 2]> = (0..300).map(of).collect();
            let found = scatter(&squares, 250.0);
            let sum = |variance: f64| {
                squares
                    .iter()
                    .map(|[c2, noise]| c2 / (noise + variance))
                    .sum::<f64>()
            };
            assert!(
                found > 0.0 && (sum(found * found) / 250.0 - 1.0).abs() < 1e-12,
                "{most}"
            );
        }
    }
}
