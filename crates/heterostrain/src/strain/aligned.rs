//! Layers of different size whose moiré is a little larger than the largest they can make: θ = 0.
//!
//! `|p|² = κ²(1+η)² + 1 − 2κ(1+η) cos θ` knows θ² and not θ. An error of |p| moves θ² by `2|p|δ/κ`; near
//! alignment the linear `σ_θ = |p|σ/(κ sin θ)` has no meaning, and at θ = 0 the root of `2|p|σ/κ` takes its
//! place. With it goes `σ_α = κσ_θ/|κ − 1|`.

use std::f64::consts::PI;

use nalgebra::{Complex, Matrix4, SMatrix, Vector2, Vector4};

use crate::complex_pair::ComplexPair;
use crate::strain::inversion::{cosine, directions, reduce, solution_at};
use crate::strain::labelling::moire_matrix_jacobian;
use crate::strain::layers::{Layers, Stretch, strain_side};
use crate::strain::names::Labelled;
use crate::strain::twist_strain::TwistStrain;

/// Cosine beyond 1 that is still read as alignment: what a few per cent of calibration and isotropic
/// strain may do.
const WITHIN: f64 = 0.1;

/// The reading with θ = 0; `None` for layers of one size and where the moiré is larger by far.
pub(crate) fn aligned(labelled: &Labelled, layers: &Layers) -> Option<TwistStrain> {
    let ratio = layers.ratio().filter(|ratio| (ratio - 1.0).abs() > 1e-9)?;
    let moire = ComplexPair::from(labelled.moire);
    let (p, q) = (moire.p, moire.q);
    // The branch that comes nearest.
    let (sign, cosine) = [1.0, -1.0]
        .map(|sign| (sign, cosine(&moire, layers, ratio, sign)))
        .into_iter()
        .min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    if !(cosine.abs() - 1.0 < WITHIN) {
        return None;
    }
    let angle = p.arg() + if cosine > 0.0 { 0.0 } else { PI };
    let solution = solution_at(&moire, layers, angle, sign)?;
    let by_lattice = moire_matrix_jacobian(&labelled.lattice.basis, &labelled.moire)?;
    let of_moire = by_lattice * labelled.lattice.covariance * by_lattice.transpose();

    let turn = p.conj() / p.norm();
    let stretch = Stretch::new(sign * q.norm() / ratio, layers);
    let side = Complex::cis(solution.lattice_angle + solution.twist)
        * (strain_side(layers.convention) * stretch.strain_per_deviator / ratio);
    // |p|, arg p, E₁, E₂ by (p, q).
    let mut jacobian = SMatrix::<f64, 4, 4>::zeros();
    for (column, d) in directions().iter().enumerate() {
        let (size, turned) = ((turn * d.p).re, (turn * d.p).im / p.norm());
        let strain = side * (d.q + Complex::<f64>::i() * q * turned);
        jacobian.set_column(column, &Vector4::new(size, turned, strain.re, strain.im));
    }
    let mut covariance: Matrix4<f64> = jacobian * of_moire * jacobian.transpose();
    let twist = 2.0 * p.norm() * covariance[(0, 0)].max(0.0).sqrt() / ratio;
    let angle_variance = (ratio / (ratio - 1.0)).powi(2) * twist;
    for k in 0..4 {
        covariance[(0, k)] = 0.0;
        covariance[(k, 0)] = 0.0;
    }
    covariance[(0, 0)] = twist;
    covariance[(1, 1)] += angle_variance;
    let e = solution.strain_vector;
    let across = Vector2::new(-e.im, e.re);
    let mut strain = covariance.fixed_view_mut::<2, 2>(2, 2);
    strain += across * across.transpose() * angle_variance;
    covariance
        .iter()
        .all(|x| x.is_finite())
        .then_some(TwistStrain {
            twist: 0.0,
            lattice_angle: reduce(angle, layers.period),
            strain_vector: Vector2::new(e.re, e.im),
            covariance,
        })
}
