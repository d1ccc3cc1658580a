//! Lattices and small helpers for tests of the strain equation.

#![allow(dead_code, reason = "each user takes what it needs")]

use heterostrain::lattice::Lattice;
use heterostrain::material::Material;
use heterostrain::strain::StrainConvention;
use heterostrain::strain::twist_strain;
use heterostrain::strain::{TwistStrain, moire_lattice};
use nalgebra::{Matrix2, Matrix4};

/// A layer of the table.
pub(crate) fn named(name: &str) -> Material {
    Material::named(name).unwrap()
}

pub(crate) fn graphene() -> Material {
    Material::graphene()
}

/// Vectors without error.
pub(crate) fn exact(basis: Matrix2<f64>) -> Lattice {
    Lattice::new(basis, Matrix4::zeros())
}

/// A covariance without any symmetry, nm²; standard errors are about `size`.
pub(crate) fn some_covariance(size: f64) -> Matrix4<f64> {
    let root = Matrix4::new(
        0.9, 0.2, 0.4, 0.0, //
        0.1, 1.1, 0.0, 0.5, //
        -0.3, 0.0, 0.8, 0.1, //
        0.2, -0.1, 0.3, 1.0,
    ) * size;
    root * root.transpose()
}

/// How far a difference is from the nearest multiple of a period.
pub(crate) fn modulo(difference: f64, period: f64) -> f64 {
    (difference - period * (difference / period).round()).abs()
}

/// The moiré of twisted graphene, with errors of 10 pm.
pub(crate) fn lattice(
    twist: f64,
    strain: f64,
    axis: f64,
    angle: f64,
    form: StrainConvention,
) -> Lattice {
    Lattice::new(
        moire_lattice(twist, strain, axis, angle, &graphene(), form).unwrap(),
        some_covariance(0.01),
    )
}

/// What a moiré of twisted graphene means.
pub(crate) fn solve(lattice: &Lattice, form: StrainConvention) -> TwistStrain {
    twist_strain(lattice, &graphene(), form).unwrap()
}
