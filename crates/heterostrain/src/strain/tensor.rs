//! The whole relative strain, where the orientation of one of the layers is known.
//!
//! In: the moiré lattice (nm) and α, the orientation of layer 1, or β, that of layer 2, in the same frame
//! (rad). Then `N = (R(α) + P) K⁻¹ = R(β) S⁻¹` has no unknown left: θ = β − α, and the principal
//! stretches of S are `1/(|N_p| ∓ |N_q|)`. If β is known, α is what turns N by β.
//! Out: θ, the mean strain `½(ε₁ + ε₂)`, the shear part `γ = ½(ε₁ − ε₂)` and its axis: of the atoms of layer
//! 2 against those of layer 1, tension positive, in either form of the equation.
//!
//! Without an orientation P leaves a circle of solutions, `|κ(1+η) e^{iθ} − 1| = |p|`; with it
//! `σ_η = θ σ_α` for equal layers. What is left open: orientations are known modulo the symmetry of the layer. For equal
//! layers (θ, η) and about (−θ, −η) go with one orientation modulo 60°; that with θ > 0 comes first. For different
//! layers the solution with the least mean strain is the best, and its sign is that of the twist.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Complex, Matrix2, Matrix5, SMatrix, Vector2, Vector5};

use crate::complex_pair::ComplexPair;
use crate::estimate::Estimate;
use crate::lattice::vectors::Lattice;
use crate::material::Bilayer;
use crate::strain::closed_form::labelled;
use crate::strain::convention::StrainConvention;
use crate::strain::error::StrainError;
use crate::strain::inversion::{by_angle, directions, reduce, wrap};
use crate::strain::known::{KnownOrientation, LatticeDirection};
use crate::strain::labelling::{moire_matrix, moire_matrix_jacobian, names};
use crate::strain::layers::Layers;
use crate::strain::names::{Labelled, change_to};
use crate::strain::vector::StrainVector;

/// Solutions with more mean strain than this are no alternatives: layers on each other stay far below one per cent.
const LARGEST_MEAN_STRAIN: f64 = 0.01;

/// The orientation of one layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orientation {
    /// Of its reciprocal vectors, rad counter-clockwise from x.
    pub angle: f64,
    /// One standard deviation, rad.
    pub sigma: f64,
    /// Whether it is that of layer 1, the reference.
    pub of_reference: bool,
}

impl Orientation {
    /// The orientation of a layer as the user gives it.
    pub fn of(known: &KnownOrientation, bilayer: Bilayer<'_>) -> Self {
        let of_reference = known.layer == 1;
        let material = if of_reference {
            bilayer.reference
        } else {
            bilayer.stretched
        };
        let row = match known.of {
            LatticeDirection::Atomic => material.atomic_row_angle(),
            LatticeDirection::Reciprocal => 0.0,
        };
        Self {
            angle: known.angle_deg.to_radians() - row,
            sigma: known.sigma_deg.to_radians(),
            of_reference,
        }
    }
}

/// Twist and the whole relative strain of two layers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrainTensor {
    /// θ, rad.
    pub twist: f64,
    /// α, rad.
    pub lattice_angle: f64,
    /// `½(ε₁ + ε₂)`.
    pub mean: f64,
    /// `γ (cos 2φ₁, sin 2φ₁)` with `γ = ½(ε₁ − ε₂)` and φ₁ the axis of ε₁ in the laboratory.
    pub shear: Vector2<f64>,
    /// Covariance of `(θ, α, mean, shear)`.
    pub covariance: Matrix5<f64>,
}

/// Uniaxial strain and what is the same in all directions: `S = (1 + ε_b) diag(1 + ε_u, 1 − νε_u)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// `ε_u`.
    pub uniaxial: Estimate,
    /// `ε_b`.
    pub biaxial: Estimate,
    /// Axis of `ε_u` in the laboratory, rad in [0, π); `None` unless the shear part is significant.
    pub axis_lab: Option<Estimate>,
}

/// Every solution of a moiré lattice for one orientation, the best one first: see the module.
///
/// With [`Bilayer::waves`] these are the solutions of that name of the lattice. Without, they are for layers of different shapes those of
/// all names near the shortest pair, and for layers of one shape those of the least strained one, which strain can make another than that of the atoms (from 0.46 of the twist on for hexagonal layers,
/// from 0.23 for the 1T′ phase of `WTe₂`).
///
/// The covariance holds that of the lattice and of the orientation, taken as independent.
///
/// # Errors
/// As [`crate::strain::twist_strain`]; [`StrainError::NoMoire`] where the orientation fits no solution.
pub fn strain_tensors<'a>(
    lattice: &Lattice,
    bilayer: impl Into<Bilayer<'a>>,
    orientation: &Orientation,
) -> Result<Vec<StrainTensor>, StrainError> {
    let bilayer = bilayer.into();
    let layers = Layers::new(bilayer, StrainConvention::RealSpace)?;
    let all = names_to_try(lattice, &layers)?;
    let similar = layers.ratio().is_some();
    let period = if orientation.of_reference {
        bilayer.reference.rotation_period()
    } else {
        bilayer.stretched.rotation_period()
    };
    let equal = layers.ratio() == Some(1.0);
    let turns = (TAU / period).round() as usize;
    let mut found: Vec<StrainTensor> = Vec::new();
    for (k, named) in (0..turns).flat_map(|k| all.iter().map(move |named| (k, named))) {
        let angle = orientation.angle + k as f64 * period;
        let turned = Orientation {
            angle,
            ..*orientation
        };
        found.extend(tensor(named, &layers, &turned));
    }
    // The best by its strain, of which similar layers leave only the mean open; of the pair that equal
    // layers leave open, the one with θ > 0.
    let size = |t: &StrainTensor| {
        if similar {
            t.mean.abs()
        } else {
            t.mean.hypot(t.shear.norm())
        }
    };
    let rank = |t: &StrainTensor| (equal && t.twist < 0.0, size(t));
    found.sort_by(|a, b| {
        let ((a_back, a_mean), (b_back, b_mean)) = (rank(a), rank(b));
        a_back.cmp(&b_back).then(a_mean.total_cmp(&b_mean))
    });
    let Some(best) = found.first().copied() else {
        return Err(StrainError::NoMoire);
    };
    // Equal layers: the other sense of the twist is as good as the first.
    let opposite = found.iter().find(|t| equal && t.twist * best.twist < 0.0);
    let opposite = opposite.copied();
    found.retain(|t| *t == best || Some(*t) == opposite || size(t) < LARGEST_MEAN_STRAIN);
    found.dedup_by(|a, b| (a.twist - b.twist).abs() + (a.mean - b.mean).abs() < 1e-12);
    Ok(found)
}

/// The name that is given; without one, for similar layers the least strained one, for different ones all near the
/// shortest pair.
fn names_to_try(lattice: &Lattice, layers: &Layers) -> Result<Vec<Labelled>, StrainError> {
    let named = labelled(lattice, layers)?;
    let is_pair = |waves: Matrix2<f64>| change_to(&lattice.basis, &waves).is_some();
    if layers.ratio().is_some() || layers.waves.is_some_and(is_pair) {
        return Ok(vec![named]);
    }
    let labelled = |lattice: Lattice| {
        let moire = moire_matrix(&lattice.basis, &layers.atoms)?;
        Some(Labelled {
            name: named.name,
            lattice,
            moire,
        })
    };
    let names = names(lattice).ok_or(StrainError::NoMoire)?;
    Ok(names.into_iter().filter_map(labelled).collect())
}

/// The solution for one orientation, taken as it is.
fn tensor(labelled: &Labelled, layers: &Layers, orientation: &Orientation) -> Option<StrainTensor> {
    let moire = ComplexPair::from(labelled.moire);
    let alpha = if orientation.of_reference {
        orientation.angle
    } else {
        reference_angle(&moire, layers, orientation.angle)?
    };
    let n = layers.stretched(&moire, alpha);
    let beta = n.p.arg();
    let size = n.p.norm();
    let area = size * size - n.q.norm_sqr();
    let turn = Complex::cis(beta);
    let shear = -n.q * turn / area;
    let twist = wrap(beta - alpha);
    if !(area > 0.0 && twist.abs() < FRAC_PI_2) {
        return None;
    }
    // Derivatives by (Re p, Im p, Re q, Im q) and the orientation.
    let angle_of = |d: &ComplexPair| (n.p.conj() * d.p).im / (size * size);
    let turned = by_angle(layers, alpha);
    let mut jacobian = SMatrix::<f64, 5, 5>::zeros();
    for column in 0..5 {
        let d = directions().get(column).map(|d| d.times(&layers.inverse));
        let given = if column == 4 { 1.0 } else { 0.0 };
        let d_alpha = if orientation.of_reference {
            given
        } else {
            (given - d.as_ref().map_or(0.0, angle_of)) / angle_of(&turned)
        };
        let zero = Complex::new(0.0, 0.0);
        let d = d.unwrap_or(ComplexPair { p: zero, q: zero });
        let whole = ComplexPair {
            p: d.p + turned.p * d_alpha,
            q: d.q + turned.q * d_alpha,
        };
        let d_beta = angle_of(&whole);
        let d_size = (n.p.conj() * whole.p).re / size;
        let d_area = 2.0 * (size * d_size - (n.q.conj() * whole.q).re);
        let d_mean = (d_size - size * d_area / area) / area;
        let d_shear =
            -turn * (whole.q + Complex::<f64>::i() * n.q * d_beta - n.q * (d_area / area)) / area;
        jacobian.set_column(
            column,
            &Vector5::new(d_beta - d_alpha, d_alpha, d_mean, d_shear.re, d_shear.im),
        );
    }
    let covariance = jacobian * inputs(labelled, orientation)? * jacobian.transpose();
    let finite = covariance.iter().all(|x| x.is_finite()) && shear.is_finite();
    finite.then_some(StrainTensor {
        twist,
        lattice_angle: reduce(alpha, layers.period),
        mean: size / area - 1.0,
        shear: Vector2::new(shear.re, shear.im),
        covariance,
    })
}

/// Covariance of `(Re p, Im p, Re q, Im q)` of the moiré and the orientation.
fn inputs(labelled: &Labelled, orientation: &Orientation) -> Option<Matrix5<f64>> {
    let by_lattice = moire_matrix_jacobian(&labelled.lattice.basis, &labelled.moire)?;
    let of_moire = by_lattice * labelled.lattice.covariance * by_lattice.transpose();
    let mut inputs = Matrix5::zeros();
    inputs.fixed_view_mut::<4, 4>(0, 0).copy_from(&of_moire);
    inputs[(4, 4)] = orientation.sigma * orientation.sigma;
    Some(inputs)
}

/// α for a known β: what turns N by β. The angle of N follows α nearly one to one.
fn reference_angle(moire: &ComplexPair, layers: &Layers, beta: f64) -> Option<f64> {
    let mut alpha = beta;
    for _ in 0..100 {
        let n = layers.stretched(moire, alpha);
        let miss = wrap(beta - n.p.arg());
        let slope = (n.p.conj() * by_angle(layers, alpha).p).im / n.p.norm_sqr();
        alpha += miss / slope;
        if miss.abs() < 1e-15 {
            break;
        }
    }
    let n = layers.stretched(moire, alpha);
    (wrap(beta - n.p.arg()).abs() < 1e-12).then_some(alpha)
}

impl StrainTensor {
    /// θ, rad.
    pub fn twist(&self) -> Estimate {
        Estimate::from_variance(self.twist, self.covariance[(0, 0)])
    }

    /// α, rad.
    pub fn lattice_angle(&self) -> Estimate {
        Estimate::from_variance(self.lattice_angle, self.covariance[(1, 1)])
    }

    /// `½(ε₁ + ε₂)`.
    pub fn mean(&self) -> Estimate {
        Estimate::from_variance(self.mean, self.covariance[(2, 2)])
    }

    /// The shear part with its noise.
    pub fn shear_vector(&self) -> StrainVector {
        StrainVector {
            value: self.shear,
            covariance: self.covariance.fixed_view::<2, 2>(3, 3).into_owned(),
        }
    }

    /// `γ = ½(ε₁ − ε₂)`, noise bias removed as in [`StrainVector::magnitude`].
    pub fn shear(&self) -> Estimate {
        self.shear_vector().magnitude()
    }

    /// Axis of ε₁ in the laboratory, rad in [0, π); `None` unless γ is significant.
    pub fn axis_lab(&self) -> Option<Estimate> {
        self.shear_vector().axis()
    }

    /// The same strain in two ways as uniaxial strain of a layer with the Poisson ratio ν and a rest that is
    /// the same in all directions: tension along ε₁, and compression across it.
    pub fn splits(&self, poisson_ratio: f64) -> [Split; 2] {
        let length = self.shear.norm();
        let unit = if length > 0.0 {
            self.shear / length
        } else {
            Vector2::x()
        };
        let axis = self.axis_lab();
        [1.0, -1.0].map(|side| {
            // Mean strain and γ → (ε_u, ε_b), with slopes by central differences of a smooth function.
            let of =
                |mean: f64, gamma: f64| uniaxial_and_biaxial(mean, side * gamma, poisson_ratio);
            let step = 1e-6;
            let [u, b] = of(self.mean, length);
            let difference = |plus: [f64; 2], minus: [f64; 2]| {
                [0, 1].map(|i| (plus[i] - minus[i]) / (2.0 * step))
            };
            let by_mean = difference(of(self.mean + step, length), of(self.mean - step, length));
            let by_gamma = difference(of(self.mean, length + step), of(self.mean, length - step));
            let variance = |i: usize| {
                let slopes = Vector5::new(
                    0.0,
                    0.0,
                    by_mean[i],
                    by_gamma[i] * unit.x,
                    by_gamma[i] * unit.y,
                );
                (slopes.transpose() * self.covariance * slopes)[0]
            };
            Split {
                uniaxial: Estimate::from_variance(u, variance(0)),
                biaxial: Estimate::from_variance(b, variance(1)),
                axis_lab: axis.map(|a| {
                    let turned = if side > 0.0 {
                        a.value
                    } else {
                        a.value + FRAC_PI_2
                    };
                    Estimate::new(reduce(turned, PI), a.sigma)
                }),
            }
        })
    }
}

/// `(ε_u, ε_b)` of a layer stretched by `mean + gamma` along and `mean − gamma` across the axis of `ε_u`.
pub(crate) fn uniaxial_and_biaxial(mean: f64, gamma: f64, poisson_ratio: f64) -> [f64; 2] {
    let (along, across) = (1.0 + mean + gamma, 1.0 + mean - gamma);
    let ratio = along / across;
    // r = (1 + ε_u)/(1 − νε_u).
    let uniaxial = (ratio - 1.0) / (1.0 + poisson_ratio * ratio);
    [uniaxial, along / (1.0 + uniaxial) - 1.0]
}
