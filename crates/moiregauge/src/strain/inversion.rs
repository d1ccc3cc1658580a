//! The closed-form solution of the strain equation, one branch at a time, with its derivatives.
//!
//! In: P = M (G⁰)⁻¹ in complex form (p, q), the ratio κ = a₁/a₂ of the lattice constants (layer 1
//! is the reference), the Poisson ratio ν of layer 2. Out: α (orientation of layer 1), β = α + θ
//! (of layer 2), the strain ε and the strain vector `E = ε e^{2iφ_lab}`; rad, no dimension.
//!
//! Layer 2 is layer 1 stretched by S and then rotated by θ. With `S(ε, φ) = R(φ) diag(1+ε, 1−νε)
//! R(−φ)` the moiré obeys `R(α) + P = κ R(β) S⁻¹` when S acts on atoms (real-space form), and
//! `κ R(β) S` when S acts on reciprocal vectors (k-space form, arXiv 2406.08681). The complex form
//! of the left side is `(p + e^{iα}, q)`: |q| alone gives |ε|, the size |p + e^{iα}| then gives α.
//! References: Kerelsky et al. 2019 (1812.08776), Kazmierczak et al. 2021 (2008.09761) for the
//! equation; the closed form is ours.

use nalgebra::{Complex, Matrix4, Vector4};

use super::complex_pair::ComplexPair;
use crate::settings::StrainConvention;

/// What the strain equation needs to know about the layers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layers {
    /// κ = a₁/a₂.
    pub(super) ratio: f64,
    /// ν of layer 2.
    pub(super) poisson_ratio: f64,
    /// Form of the equation.
    pub(super) convention: StrainConvention,
}

/// Which of the four solutions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Signs {
    /// +1 for ε ≥ 0, −1 for ε ≤ 0.
    pub(super) strain: f64,
    /// +1 for θ > 0, −1 for θ < 0.
    pub(super) twist: f64,
}

/// One solution of the strain equation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solution {
    /// θ = β − α in (−π, π].
    pub(super) twist: f64,
    /// α, not reduced.
    pub(super) lattice_angle: f64,
    /// ε with its sign.
    pub(super) strain: f64,
    /// `ε e^{2iφ_lab}`.
    pub(super) strain_vector: Complex<f64>,
    /// `φ_lab` for the signed ε, not reduced.
    pub(super) axis_lab: f64,
    size: f64,
    stretch: Stretch,
}

/// Strain and isotropic size as functions of the deviator k = ±|q|/κ.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    /// ε/k, finite at k = 0.
    strain_per_deviator: f64,
    /// dε/dk.
    strain_slope: f64,
    /// 1 + η, half the sum of the principal stretches.
    size: f64,
    /// dη/dε.
    size_slope: f64,
}

/// The solution with the given signs; `None` if there is none or the numbers are not finite.
pub(super) fn solve(moire: &ComplexPair, layers: &Layers, signs: Signs) -> Option<Solution> {
    let ComplexPair { p, q } = *moire;
    let deviator = signs.strain * q.norm() / layers.ratio;
    let stretch = stretch(deviator, layers);
    let size = layers.ratio * stretch.size;
    // |p + e^{iα}| = size; written so that nothing cancels for equal layers.
    let excess = (size - 1.0) * (size + 1.0) - p.norm_sqr();
    let cosine = excess / (2.0 * p.norm());
    if !cosine.is_finite() || cosine.abs() > 1.0 {
        return None;
    }
    let lattice_angle = p.arg() - signs.twist * cosine.acos();
    let beta = (p + Complex::cis(lattice_angle)).arg();
    let twist = wrap(beta - lattice_angle);
    let side = strain_side(layers.convention);
    let strain_vector =
        q * Complex::cis(beta) * (side * stretch.strain_per_deviator / layers.ratio);
    let solution = Solution {
        twist,
        lattice_angle,
        strain: stretch.strain_per_deviator * deviator,
        strain_vector,
        axis_lab: (strain_vector * signs.strain).arg() / 2.0,
        size,
        stretch,
    };
    (twist.is_finite() && strain_vector.is_finite()).then_some(solution)
}

impl Solution {
    /// Derivative of `(θ, α, E₁, E₂)` by `(Re p, Im p, Re q, Im q)`.
    ///
    /// |q| has no derivative at q = 0. There its gradient is taken along Re q: the variance of |q|
    /// is then that of one component, more than the true 0.43 of it, and never too small.
    pub(super) fn jacobian(
        &self,
        moire: &ComplexPair,
        layers: &Layers,
        signs: Signs,
    ) -> Matrix4<f64> {
        let Stretch {
            strain_per_deviator,
            strain_slope,
            size_slope,
            ..
        } = self.stretch;
        let q_norm = moire.q.norm();
        let along = if q_norm > 0.0 {
            moire.q / q_norm
        } else {
            Complex::new(1.0, 0.0)
        };
        let turn = Complex::cis(self.lattice_angle + self.twist);
        let (sine, cosine) = self.twist.sin_cos();
        let side = strain_side(layers.convention) / layers.ratio;

        let zero = Complex::new(0.0, 0.0);
        let one = Complex::new(1.0, 0.0);
        let i = Complex::i();
        let mut jacobian = Matrix4::zeros();
        for (column, (dp, dq)) in [(one, zero), (i, zero), (zero, one), (zero, i)]
            .into_iter()
            .enumerate()
        {
            let d_norm = (along.conj() * dq).re;
            let d_size = signs.strain * size_slope * strain_slope * d_norm;
            let in_layer_2 = turn.conj() * dp;
            let d_alpha = (d_size - in_layer_2.re) / sine;
            let d_beta = (in_layer_2.im + cosine * d_alpha) / self.size;
            let d_strain = turn
                * side
                * ((dq + i * moire.q * d_beta) * strain_per_deviator
                    + along * (strain_slope - strain_per_deviator) * d_norm);
            jacobian.set_column(
                column,
                &Vector4::new(d_beta - d_alpha, d_alpha, d_strain.re, d_strain.im),
            );
        }
        jacobian
    }
}

/// Stretching atoms shrinks reciprocal vectors: the deviator of S⁻¹ points across the tensile axis.
fn strain_side(convention: StrainConvention) -> f64 {
    match convention {
        StrainConvention::RealSpace => -1.0,
        StrainConvention::KSpace => 1.0,
    }
}

fn stretch(k: f64, layers: &Layers) -> Stretch {
    let nu = layers.poisson_ratio;
    match layers.convention {
        StrainConvention::KSpace => {
            let strain = 2.0 * k / (1.0 + nu);
            Stretch {
                strain_per_deviator: 2.0 / (1.0 + nu),
                strain_slope: 2.0 / (1.0 + nu),
                size: 1.0 + strain * (1.0 - nu) / 2.0,
                size_slope: (1.0 - nu) / 2.0,
            }
        }
        // S⁻¹ has the principal values 1/(1+ε) and 1/(1−νε), hence
        // (1+ν) ε = 2k (1+ε)(1−νε); the root that vanishes with k.
        StrainConvention::RealSpace => {
            let b = (1.0 + nu) - 2.0 * k * (1.0 - nu);
            let strain_per_deviator = 4.0 / (b + (b * b + 16.0 * k * k * nu).sqrt());
            let strain = strain_per_deviator * k;
            let (along, across) = (1.0 + strain, 1.0 - nu * strain);
            Stretch {
                strain_per_deviator,
                strain_slope: 2.0 * along * across
                    / ((1.0 + nu) - 2.0 * k * (1.0 - nu - 2.0 * nu * strain)),
                size: f64::midpoint(1.0 / along, 1.0 / across),
                size_slope: (nu / (across * across) - 1.0 / (along * along)) / 2.0,
            }
        }
    }
}

/// An angle in (−π, π].
pub(super) fn wrap(angle: f64) -> f64 {
    let turns = (angle / std::f64::consts::TAU).round();
    angle - turns * std::f64::consts::TAU
}

/// An angle in [0, period).
pub(super) fn reduce(angle: f64, period: f64) -> f64 {
    let reduced = angle.rem_euclid(period);
    // A tiny negative angle rounds up to the period itself.
    if reduced >= period { 0.0 } else { reduced }
}
