//! Two layers of any kind: forward and back, the circle of isotropic strains, the strain tensor.

use std::f64::consts::{PI, TAU};

use heterostrain::lattice::Lattice;
use heterostrain::material::{Bilayer, Material};
use heterostrain::strain::StrainConvention::{KSpace, RealSpace};
use heterostrain::strain::{
    Orientation, Stacking, StrainTensor, branches, moire_of, moire_pair_of, strain_tensors,
};
use heterostrain::strain::{degeneracy, twist_strain};
use nalgebra::{Matrix2, Matrix5, Vector2, Vector5};
use proptest::prelude::*;

use crate::two_layers::{exact, modulo, named, some_covariance};

/// An oblique layer, and one of another shape that is a little different.
fn oblique(a: f64, b: f64, angle: f64) -> Material {
    Material {
        name: "oblique".to_owned(),
        lattice_constant_nm: a,
        lattice_constant_b_nm: Some(b),
        cell_angle_deg: Some(angle),
        poisson_ratio: 0.2,
        lattice_constant_sigma_nm: 0.0005,
        poisson_ratio_sigma: 0.03,
        source: "a test".to_owned(),
    }
}

/// Layer 2 on layer 1.
fn pairs() -> Vec<[Material; 2]> {
    let (tungsten, graphene) = (named("WTe2 1T'"), named("graphene"));
    vec![
        [graphene.clone(), graphene.clone()],
        [graphene.clone(), named("hBN")],
        [named("WSe2"), named("WS2")],
        [tungsten.clone(), tungsten],
        [oblique(0.35, 0.62, 89.3), named("WTe2 1T'")],
        [oblique(0.33, 0.335, 61.0), named("WSe2")],
        [oblique(0.31, 0.42, 75.0), oblique(0.312, 0.417, 74.6)],
    ]
}

/// The waves (rad/nm) of the moiré that belong to the reciprocal vectors of the atoms.
fn true_waves(made: &Stacking, layers: Bilayer<'_>) -> Matrix2<f64> {
    let pair = moire_pair_of(made, layers, RealSpace).unwrap();
    pair.try_inverse().unwrap().transpose() * TAU
}

/// Whether the least strained pair of the moiré has the name of the atoms, but for a turn of layer 1 onto itself. Strain
/// that is not small against the twist makes another pair the less strained one: for `WTe₂` from 0.23 of the twist on.
fn has_true_name(basis: &Matrix2<f64>, made: &Stacking, layers: Bilayer<'_>) -> bool {
    let atoms = layers.reference.atomic_pair();
    let change = (true_waves(made, layers).transpose() * basis / TAU).map(f64::round);
    let turn = atoms * change * atoms.try_inverse().unwrap();
    (turn.transpose() * turn - Matrix2::identity()).norm() < 1e-9
}

/// Whether the moiré of different lattices is so much longer one way than the other that its vectors may
/// have names beyond those that are tried.
fn elongated(basis: &Matrix2<f64>, layers: Bilayer<'_>) -> bool {
    let both = layers.reference.is_hexagonal() && layers.stretched.is_hexagonal();
    let singular = basis.singular_values();
    !both && !layers.is_equal() && singular.max() > 4.0 * singular.min()
}

fn bilayer(pair: &[Material; 2]) -> Bilayer<'_> {
    Bilayer {
        stretched: &pair[0],
        reference: &pair[1],
        waves: None,
    }
}

/// Who names the waves of layers of different shapes has the solutions of that name and no others.
#[test]
fn waves_that_are_given_name_layers_of_different_shapes() {
    let made = Stacking {
        twist: 0.02,
        lattice_angle: 0.3,
        strain: 0.002,
        axis_lattice: 0.5,
        biaxial: 0.0,
    };
    let pair = [oblique(0.31, 0.42, 75.0), oblique(0.312, 0.417, 74.6)];
    let layers = bilayer(&pair);
    let basis = moire_of(&made, layers, RealSpace).unwrap();
    let orientation = Orientation {
        angle: made.lattice_angle,
        sigma: 0.0,
        of_reference: true,
    };
    let of = |waves: Option<Matrix2<f64>>| {
        let layers = Bilayer { waves, ..layers };
        strain_tensors(&exact(basis), layers, &orientation).unwrap()
    };
    let (all, given) = (of(None), of(Some(true_waves(&made, layers))));
    assert!(given.len() < all.len(), "{} of {}", given.len(), all.len());
    assert!(
        given
            .iter()
            .all(|t| all.iter().any(|of_all| same(t, of_all)))
    );
    assert!((given[0].twist - made.twist).abs() < 1e-10, "{given:#?}");
    // Waves outside this lattice give no indexing.
    assert_eq!(of(Some(Matrix2::new(1.0, 2.0, 2.0, 4.0))).len(), all.len());
}

/// Whether two solutions are one, but for rounding.
fn same(a: &StrainTensor, b: &StrainTensor) -> bool {
    (a.twist - b.twist).abs() < 1e-9 && (a.mean - b.mean).abs() < 1e-9
}

prop_compose! {
    fn stacking()(
        twist in 0.6_f64..3.0,
        back: bool,
        strain in 0.0_f64..0.003,
        axis in 0.0..PI,
        angle in 0.0..PI,
        biaxial in -0.002_f64..0.002,
    ) -> Stacking {
        Stacking {
            twist: twist.to_radians() * if back { -1.0 } else { 1.0 },
            lattice_angle: angle,
            strain,
            axis_lattice: axis,
            biaxial,
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Without biaxial strain one of the branches is what was put in, for layers of any kind.
    #[test]
    fn branches_hold_the_truth(made in stacking(), k_space: bool) {
        let form = if k_space { KSpace } else { RealSpace };
        let made = Stacking { biaxial: 0.0, ..made };
        for pair in pairs() {
            let layers = bilayer(&pair);
            let basis = moire_of(&made, layers, form).unwrap();
            if elongated(&basis, layers) {
                continue;
            }
            let found = branches(&exact(basis), layers.reference, layers.stretched, form).unwrap();
            let lab = made.axis_lattice + made.lattice_angle + made.twist;
            let hit = found.iter().find(|b| {
                (b.twist - made.twist).abs() < 1e-9
                    && (b.strain - made.strain).abs() < 1e-9
                    && modulo(b.axis_lab - lab, PI) * made.strain < 1e-9
                    && modulo(b.lattice_angle - made.lattice_angle, layers.reference.rotation_period()) < 1e-7
            });
            prop_assert!(hit.is_some(), "{} {made:?} {found:#?}", layers.name());
        }
    }

    /// With the orientation of either layer and the name of the moiré the tensor is exactly what was put in. Layers of
    /// one shape need no name where the least strained pair has it; for others names are tried.
    #[test]
    fn tensors_are_exact(made in stacking(), turns in -3_i32..=3, told: bool) {
        for pair in pairs() {
            let layers = bilayer(&pair);
            let basis = moire_of(&made, layers, RealSpace).unwrap();
            if elongated(&basis, layers) {
                continue;
            }
            let named = Bilayer { waves: Some(true_waves(&made, layers)), ..layers };
            let one_shape = layers.is_equal() || pair.iter().all(Material::is_hexagonal);
            let needs_name = one_shape && !has_true_name(&basis, &made, layers);
            let layers = if told || needs_name { named } else { layers };
            let nu = layers.stretched.poisson_ratio;
            let [first, second] = [1.0 + made.strain, 1.0 - nu * made.strain]
                .map(|s| (1.0 + made.biaxial) * s - 1.0);
            let (mean, gamma) = (f64::midpoint(first, second), (first - second) / 2.0);
            let lab = made.axis_lattice + made.lattice_angle + made.twist;
            let shear = gamma * Vector2::new((2.0 * lab).cos(), (2.0 * lab).sin());
            for of_reference in [true, false] {
                let (angle, layer) = if of_reference {
                    (made.lattice_angle, layers.reference)
                } else {
                    (made.lattice_angle + made.twist, layers.stretched)
                };
                let orientation = Orientation {
                    angle: angle + f64::from(turns) * layer.rotation_period(),
                    sigma: 0.0,
                    of_reference,
                };
                let found = strain_tensors(&exact(basis), layers, &orientation).unwrap();
                let hit = found.iter().find(|t| {
                    (t.twist - made.twist).abs() < 1e-10
                        && (t.mean - mean).abs() < 1e-10
                        && (t.shear - shear).norm() < 1e-10
                });
                prop_assert!(hit.is_some(), "{} {made:?} {found:#?}", layers.name());
                let [along, across] = hit.unwrap().splits(nu);
                prop_assert!((along.uniaxial.value - made.strain).abs() < 1e-10);
                prop_assert!((along.biaxial.value - made.biaxial).abs() < 1e-10);
                // The other split makes the same stretches: (1 + ε_b)(1 + ε_u) across is (1 + ε₂).
                let product = (1.0 + across.biaxial.value) * (1.0 + across.uniaxial.value);
                prop_assert!((product - 1.0 - second).abs() < 1e-12);
                let product = (1.0 + across.biaxial.value) * (1.0 - nu * across.uniaxial.value);
                prop_assert!((product - 1.0 - first).abs() < 1e-12);
            }
        }
    }

    /// J C Jᵀ with J by central differences of the solution itself, for the branches of different layers
    /// and for the tensor.
    #[test]
    fn covariances_are_those_of_numerical_derivatives(made in stacking()) {
        prop_assume!(made.strain > 2e-4);
        let made = Stacking { twist: made.twist.abs(), biaxial: 0.0, ..made };
        for pair in pairs() {
            let layers = bilayer(&pair);
            let basis = moire_of(&made, layers, RealSpace).unwrap();
            if elongated(&basis, layers) {
                continue;
            }
            let lattice = Lattice::new(basis, some_covariance(0.001));
            let values = |basis: Matrix2<f64>| {
                let found = twist_strain(&exact(basis), layers, RealSpace).ok()?;
                Some(nalgebra::Vector3::new(found.twist, found.strain_vector.x, found.strain_vector.y))
            };
            let step = 1e-6;
            let columns = [0, 1, 2, 3].map(|i| {
                let side = |sign: f64| {
                    let mut moved = basis;
                    moved[i] += sign * step;
                    values(moved)
                };
                Some((side(1.0)? - side(-1.0)?) / (2.0 * step))
            });
            // At a fold, where two solutions meet, there is no derivative.
            let [Some(a), Some(b), Some(c), Some(d)] = columns else { continue };
            let jacobian = nalgebra::Matrix3x4::from_columns(&[a, b, c, d]);
            prop_assume!(jacobian.norm() < 0.1);
            let expected = jacobian * lattice.covariance * jacobian.transpose();
            let found = twist_strain(&lattice, layers, RealSpace).unwrap();
            for (i, row) in [0, 2, 3].into_iter().enumerate() {
                for (j, column) in [0, 2, 3].into_iter().enumerate() {
                    let scale = (expected[(i, i)] * expected[(j, j)]).sqrt();
                    let difference = found.covariance[(row, column)] - expected[(i, j)];
                    prop_assert!(difference.abs() < 1e-4 * scale, "{} {row} {column}", layers.name());
                }
            }
            for of_reference in [true, false] {
                let angle = made.lattice_angle + if of_reference { 0.0 } else { made.twist };
                let orientation = Orientation { angle, sigma: 0.003, of_reference };
                let truth = |t: &StrainTensor| (t.twist - made.twist).abs();
                let nearest = |lattice: &Lattice, orientation: &Orientation| {
                    let all = strain_tensors(lattice, layers, orientation).unwrap();
                    all.into_iter().min_by(|a, b| truth(a).total_cmp(&truth(b))).unwrap()
                };
                let vector = |t: StrainTensor| {
                    let alpha = t.lattice_angle - made.lattice_angle;
                    let period = layers.reference.rotation_period();
                    let alpha = alpha - period * (alpha / period).round();
                    Vector5::new(t.twist, alpha, t.mean, t.shear.x, t.shear.y)
                };
                let columns = [0, 1, 2, 3, 4].map(|i| {
                    let side = |sign: f64| {
                        let (mut moved, mut turned) = (basis, orientation);
                        match i {
                            4 => turned.angle += sign * step,
                            _ => moved[i] += sign * step,
                        }
                        vector(nearest(&exact(moved), &turned))
                    };
                    (side(1.0) - side(-1.0)) / (2.0 * step)
                });
                let jacobian = Matrix5::from_columns(&columns);
                let mut inputs = Matrix5::zeros();
                inputs.fixed_view_mut::<4, 4>(0, 0).copy_from(&lattice.covariance);
                inputs[(4, 4)] = 0.003_f64.powi(2);
                let expected = jacobian * inputs * jacobian.transpose();
                let found = nearest(&lattice, &orientation).covariance;
                for row in 0..5 {
                    for column in 0..5 {
                        let scale = (expected[(row, row)] * expected[(column, column)]).sqrt();
                        let difference = found[(row, column)] - expected[(row, column)];
                        prop_assert!(difference.abs() < 1e-5 * scale + 1e-16, "{row} {column}");
                    }
                }
            }
        }
    }

    /// The interval that isotropic strain leaves open contains what was put in, if it is not larger than
    /// the interval says.
    #[test]
    fn degeneracy_contains_the_truth(made in stacking(), compressed: bool) {
        let made = Stacking { strain: made.strain * if compressed { -1.0 } else { 1.0 }, ..made };
        for pair in &pairs()[..3] {
            let layers = bilayer(pair);
            let basis = moire_of(&made, layers, RealSpace).unwrap();
            let found = twist_strain(&exact(basis), layers, RealSpace);
            let Ok(found) = found else { continue };
            let Some(told) = degeneracy(&exact(basis), layers, RealSpace, found.twist(), 0.0011) else {
                continue;
            };
            let [low, high] = told.interval;
            let twist = made.twist.abs();
            // Between two of the strains that are tried θ may reach (step/2)²/2θ further.
            prop_assert!(low - 5e-8 <= twist && twist <= high + 5e-8, "{} {told:?} {made:?}", layers.name());
        }
    }
}

/// Any primitive pair of a moiré of different lattices is the same moiré.
#[test]
fn relabelling_of_different_layers() {
    let pair = [oblique(0.31, 0.42, 75.0), oblique(0.312, 0.417, 74.6)];
    let layers = bilayer(&pair);
    let made = Stacking {
        twist: 0.03,
        lattice_angle: 0.4,
        strain: 0.001,
        axis_lattice: 0.6,
        biaxial: 0.0,
    };
    let basis = moire_of(&made, layers, RealSpace).unwrap();
    let plain = twist_strain(&exact(basis), layers, RealSpace).unwrap();
    for u in [
        [1.0, 1.0, 0.0, 1.0],
        [0.0, 1.0, -1.0, 0.0],
        [2.0, 1.0, 1.0, 1.0],
        [0.0, 1.0, 1.0, 0.0],
    ] {
        let change = Matrix2::new(u[0], u[1], u[2], u[3]);
        let found = twist_strain(&exact(basis * change), layers, RealSpace).unwrap();
        assert!((found.twist - plain.twist).abs() < 1e-10, "{change}");
        assert!((found.strain_vector - plain.strain_vector).norm() < 1e-10);
    }
}
