//! The solutions of the strain equation, one branch at a time, with their derivatives.
//!
//! In: P = M (G⁰)⁻¹ in complex form (p, q), and the layers. Out: α (orientation of layer 1),
//! β = α + θ (of layer 2), the strain ε and the strain vector `E = ε e^{2iφ_lab}`; rad, no dimension.
//!
//! Layer 2 is stretched by S and then rotated by θ. With `S(ε, φ) = R(φ) diag(1+ε, 1−νε) R(−φ)` the
//! moiré obeys `N ≡ (R(α) + P) K⁻¹ = R(β) S⁻¹` when S acts on atoms (real-space form), and `R(β) S`
//! when S acts on reciprocal vectors (k-space form, arXiv 2406.08681). For similar lattices, K = κ, the
//! complex form of N is `(p + e^{iα}, q)/κ`: |q| alone gives |ε|, the size |p + e^{iα}| then gives α in
//! closed form. For other lattices both parts depend on α, and α is a root of
//! `f(α) = |N_p| − 1 − η(|N_q|)`.
//! References: Kerelsky et al. 2019 (1812.08776), Kazmierczak et al. 2021 (2008.09761) for the
//! equation; the solution is ours.

use std::f64::consts::TAU;

use nalgebra::{Complex, Matrix4, Vector4};

use crate::complex_pair::ComplexPair;
use crate::strain::layers::{Layers, Stretch, strain_side};

/// Steps of the grid on which roots of f are looked for: fine against its few turns.
const GRID: usize = 720;
/// An f that comes this near to zero touches it, as it does without strain, where `|N_q|` has a corner. Any small
/// number above rounding.
const TOUCHING: f64 = 1e-10;

/// Which of the four solutions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Signs {
    /// +1 for ε ≥ 0, −1 for ε ≤ 0.
    pub(crate) strain: f64,
    /// +1 for θ > 0, −1 for θ < 0.
    pub(crate) twist: f64,
}

/// All of them, the default first.
pub(crate) const ALL_SIGNS: [Signs; 4] = [
    Signs {
        strain: 1.0,
        twist: 1.0,
    },
    Signs {
        strain: -1.0,
        twist: 1.0,
    },
    Signs {
        strain: 1.0,
        twist: -1.0,
    },
    Signs {
        strain: -1.0,
        twist: -1.0,
    },
];

/// One solution of the strain equation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solution {
    /// θ = β − α in (−π, π].
    pub(crate) twist: f64,
    /// α, not reduced.
    pub(crate) lattice_angle: f64,
    /// ε with its sign.
    pub(crate) strain: f64,
    /// `ε e^{2iφ_lab}`.
    pub(crate) strain_vector: Complex<f64>,
    /// `φ_lab` for the signed ε, not reduced.
    pub(crate) axis_lab: f64,
    /// +1 or −1: the branch of the strain.
    pub(crate) sign: f64,
}

/// The solution with the given signs; `None` if there is none or the numbers are not finite. Where
/// layers of different lattices have several, the one of the least strain.
pub(crate) fn solve(moire: &ComplexPair, layers: &Layers, signs: Signs) -> Option<Solution> {
    let Some(ratio) = layers.ratio() else {
        let all = solve_all(moire, layers, signs).into_iter();
        return all.min_by(|a, b| a.strain.abs().total_cmp(&b.strain.abs()));
    };
    let cosine = cosine(moire, layers, ratio, signs.strain);
    if !cosine.is_finite() || cosine.abs() > 1.0 {
        return None;
    }
    let lattice_angle = moire.p.arg() - signs.twist * cosine.acos();
    solution_at(moire, layers, lattice_angle, signs.strain)
}

/// All solutions with the given signs: one at most for similar lattices.
pub(crate) fn solve_all(moire: &ComplexPair, layers: &Layers, signs: Signs) -> Vec<Solution> {
    if layers.ratio().is_some() {
        return solve(moire, layers, signs).into_iter().collect();
    }
    let all = roots(moire, layers, signs.strain).into_iter();
    all.filter_map(|alpha| solution_at(moire, layers, alpha, signs.strain))
        .filter(|s| s.twist * signs.twist >= 0.0)
        .collect()
}

/// `cos(α − arg p)` for similar lattices: |p + e^{iα}| is the size that the strain leaves. Written so that
/// nothing cancels for equal layers.
pub(crate) fn cosine(moire: &ComplexPair, layers: &Layers, ratio: f64, sign: f64) -> f64 {
    let stretch = Stretch::new(sign * moire.q.norm() / ratio, layers);
    let size = ratio * stretch.size;
    let excess = (size - 1.0) * (size + 1.0) - moire.p.norm_sqr();
    excess / (2.0 * moire.p.norm())
}

/// Twist and strain of a layer 1 of orientation α, of which only the deviator has to fit.
pub(crate) fn solution_at(
    moire: &ComplexPair,
    layers: &Layers,
    lattice_angle: f64,
    sign: f64,
) -> Option<Solution> {
    let n = layers.stretched(moire, lattice_angle);
    let deviator = sign * n.q.norm();
    let stretch = Stretch::new(deviator, layers);
    let beta = n.p.arg();
    let twist = wrap(beta - lattice_angle);
    let side = strain_side(layers.convention);
    let strain_vector = n.q * Complex::cis(beta) * (side * stretch.strain_per_deviator);
    let solution = Solution {
        twist,
        lattice_angle,
        strain: stretch.strain_per_deviator * deviator,
        strain_vector,
        axis_lab: (strain_vector * sign).arg() / 2.0,
        sign,
    };
    (twist.is_finite() && strain_vector.is_finite()).then_some(solution)
}

/// The orientations α at which size and deviator belong to one uniaxial strain: sign changes of f on a
/// grid, refined by bisection, and those on both sides of a local extremum between grid points.
fn roots(moire: &ComplexPair, layers: &Layers, sign: f64) -> Vec<f64> {
    let f = |alpha: f64| {
        let n = layers.stretched(moire, alpha);
        n.p.norm() - Stretch::new(sign * n.q.norm(), layers).size
    };
    let at = |k: usize| TAU * k as f64 / GRID as f64;
    let values: Vec<f64> = (0..GRID).map(|k| f(at(k))).collect();
    let mut found = Vec::new();
    for k in 0..GRID {
        let (before, here, after) = (
            values[(k + GRID - 1) % GRID],
            values[k],
            values[(k + 1) % GRID],
        );
        if here == 0.0 {
            found.push(at(k));
        } else if here * after < 0.0 {
            found.push(bisect(&f, at(k), at(k + 1)));
        }
        // f comes near zero and turns back: it may have crossed twice on the way.
        let same = here * before > 0.0 && here * after > 0.0;
        if same && here.abs() <= before.abs() && here.abs() <= after.abs() {
            let lowest = extremum(&|x| f(x) * here.signum(), at(k) - at(1), at(k + 1));
            if f(lowest) * here <= 0.0 {
                found.push(bisect(&f, at(k) - at(1), lowest));
                found.push(bisect(&f, lowest, at(k + 1)));
            } else if f(lowest).abs() < TOUCHING {
                found.push(lowest);
            }
        }
    }
    found
}

/// Where f changes its sign between a and b.
fn bisect(f: &dyn Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    let below = f(a) < 0.0;
    for _ in 0..60 {
        let middle = f64::midpoint(a, b);
        if (f(middle) < 0.0) == below {
            a = middle;
        } else {
            b = middle;
        }
    }
    f64::midpoint(a, b)
}

/// The lowest point of f between a and b, by golden section; stops at the first value below zero.
fn extremum(f: &dyn Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    /// Share of an interval that a golden section keeps.
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let mut best = f64::midpoint(a, b);
    for _ in 0..60 {
        let (x, y) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
        let (fx, fy) = (f(x), f(y));
        best = if fx < fy { x } else { y };
        if fx.min(fy) < 0.0 {
            return best;
        }
        if fx < fy {
            b = y;
        } else {
            a = x;
        }
    }
    best
}

/// The four directions in which (Re p, Im p, Re q, Im q) change.
pub(crate) fn directions() -> [ComplexPair; 4] {
    let (zero, one, i) = (
        Complex::new(0.0, 0.0),
        Complex::new(1.0, 0.0),
        Complex::<f64>::i(),
    );
    [(one, zero), (i, zero), (zero, one), (zero, i)].map(|(p, q)| ComplexPair { p, q })
}

/// How N changes with α.
pub(crate) fn by_angle(layers: &Layers, lattice_angle: f64) -> ComplexPair {
    let turn = ComplexPair {
        p: Complex::<f64>::i() * Complex::cis(lattice_angle),
        q: Complex::new(0.0, 0.0),
    };
    turn.times(&layers.inverse)
}

impl Solution {
    /// Derivative of `(θ, α, E₁, E₂)` by `(Re p, Im p, Re q, Im q)`.
    ///
    /// |q| has no derivative at q = 0. There its gradient is taken along Re q: the variance of |q|
    /// is then that of one component, more than the true 0.43 of it, and never too small.
    pub(crate) fn jacobian(&self, moire: &ComplexPair, layers: &Layers) -> Matrix4<f64> {
        let n = layers.stretched(moire, self.lattice_angle);
        let stretch = Stretch::new(self.sign * n.q.norm(), layers);
        let unit = |z: Complex<f64>| {
            let norm = z.norm();
            if norm > 0.0 {
                z / norm
            } else {
                Complex::new(1.0, 0.0)
            }
        };
        let (u, v) = (unit(n.p), unit(n.q));
        let length = |d: &ComplexPair| (v.conj() * d.q).re;
        let size_slope = self.sign * stretch.size_slope * stretch.strain_slope;
        let f = |d: &ComplexPair| (u.conj() * d.p).re - size_slope * length(d);
        let turned = by_angle(layers, self.lattice_angle);
        let per_angle = f(&turned);
        let side = strain_side(layers.convention) * u;
        let mut jacobian = Matrix4::zeros();
        for (column, direction) in directions().iter().enumerate() {
            let d = direction.times(&layers.inverse);
            let d_alpha = -f(&d) / per_angle;
            let whole = ComplexPair {
                p: d.p + turned.p * d_alpha,
                q: d.q + turned.q * d_alpha,
            };
            let d_beta = (n.p.conj() * whole.p).im / n.p.norm_sqr();
            let d_strain = side
                * ((whole.q + Complex::<f64>::i() * n.q * d_beta) * stretch.strain_per_deviator
                    + v * (stretch.strain_slope - stretch.strain_per_deviator) * length(&whole));
            jacobian.set_column(
                column,
                &Vector4::new(d_beta - d_alpha, d_alpha, d_strain.re, d_strain.im),
            );
        }
        jacobian
    }
}

/// An angle in (−π, π].
pub(crate) fn wrap(angle: f64) -> f64 {
    let turns = (angle / TAU).round();
    angle - turns * TAU
}

/// An angle in [0, period).
pub(crate) fn reduce(angle: f64, period: f64) -> f64 {
    let reduced = angle.rem_euclid(period);
    // A tiny negative angle rounds up to the period itself.
    if reduced >= period { 0.0 } else { reduced }
}
