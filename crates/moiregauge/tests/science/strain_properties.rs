//! Symmetries of the strain equation and its derivatives.

use std::f64::consts::{FRAC_PI_3, PI};

use crate::two_layers::{graphene, lattice, modulo, solve};
use heterostrain::lattice::Lattice;
use heterostrain::lattice::three_vectors;
use heterostrain::strain::StrainConvention;
use heterostrain::strain::StrainConvention::{KSpace, RealSpace};
use heterostrain::strain::{Branch, TwistStrain, branches, moire_lattice};
use moiregauge::numbers::stream;
use nalgebra::{
    Complex, DMatrix, DVector, Matrix2, Matrix4, Matrix6, Rotation2, SMatrix, Vector2, Vector4,
};
use proptest::prelude::*;
use rand_distr::{Distribution, StandardNormal};

prop_compose! {
    fn sample()(
        twist in 0.3_f64..4.0,
        // Uniaxial strain up to a quarter of the twist: the twist makes the moiré.
        share in 0.0_f64..0.25,
        axis in 0.0..PI,
        angle in 0.0..FRAC_PI_3,
        k_space: bool,
    ) -> (Lattice, [f64; 4], StrainConvention) {
        let twist = twist.to_radians();
        let form = if k_space { KSpace } else { RealSpace };
        (lattice(twist, share * twist, axis, angle, form), [twist, share * twist, axis, angle], form)
    }
}

proptest! {
    #[test]
    fn solving_undoes_the_forward_model((lattice, [twist, strain, axis, angle], form) in sample()) {
        let found = solve(&lattice, form);
        prop_assert!((found.twist - twist).abs() < 1e-12);
        prop_assert!((found.strain_vector.norm() - strain).abs() < 1e-12);
        prop_assert!(modulo(found.lattice_angle - angle, FRAC_PI_3) < 1e-9);
        let lab = axis + angle + twist;
        let expected = strain * Vector2::new((2.0 * lab).cos(), (2.0 * lab).sin());
        prop_assert!((found.strain_vector - expected).norm() < 1e-11);
        let again = found.moire_lattice(&graphene(), form).unwrap();
        let again = solve(&Lattice::new(again, lattice.covariance), form);
        prop_assert!((again.twist - twist).abs() < 1e-12);
    }

    /// Turning the sample turns α and the laboratory axis and leaves the rest.
    #[test]
    fn rotation_of_the_sample((lattice, _, form) in sample(), turn in -PI..PI) {
        let plain = solve(&lattice, form);
        let turned = solve(&lattice.mapped(&Rotation2::new(turn).into_inner()), form);
        prop_assert!((turned.twist - plain.twist).abs() < 1e-12);
        prop_assert!(modulo(turned.lattice_angle - plain.lattice_angle - turn, FRAC_PI_3) < 1e-9);
        let expected = Rotation2::new(2.0 * turn) * plain.strain_vector;
        prop_assert!((turned.strain_vector - expected).norm() < 1e-11);
        prop_assert!((turned.covariance[(0, 0)] / plain.covariance[(0, 0)] - 1.0).abs() < 1e-8);
    }

    /// Any primitive pair describes the same lattice: the 24 pairs of the hexagon and longer ones.
    #[test]
    fn relabelling((lattice, _, form) in sample()) {
        let plain = solve(&lattice, form);
        let entries: [f64; 5] = [-2.0, -1.0, 0.0, 1.0, 2.0];
        let mut tried = 0;
        for (a, b) in entries.into_iter().flat_map(|a| entries.map(|b| (a, b))) {
            for (c, d) in entries.into_iter().flat_map(|c| entries.map(|d| (c, d))) {
                let change = Matrix2::new(a, b, c, d);
                if change.determinant().abs() != 1.0 {
                    continue;
                }
                tried += 1;
                let renamed = solve(&lattice.relabelled(&change), form);
                prop_assert!((renamed.twist - plain.twist).abs() < 1e-11, "{change}");
                prop_assert!((renamed.strain_vector - plain.strain_vector).norm() < 1e-11, "{change}");
                prop_assert!(modulo(renamed.lattice_angle - plain.lattice_angle, FRAC_PI_3) < 1e-8);
                let difference = renamed.covariance - plain.covariance;
                prop_assert!(difference.norm() < 1e-7 * plain.covariance.norm(), "{change}");
            }
        }
        prop_assert!(tried > 24);
    }

    /// A mirror turns θ, φ and α round: each branch has its mirror image among the others.
    #[test]
    fn mirror((lattice, _, form) in sample()) {
        let reflected = lattice.mapped(&Matrix2::new(1.0, 0.0, 0.0, -1.0));
        let plain = branches(&lattice, &graphene(), &graphene(), form).unwrap();
        let mirrored = branches(&reflected, &graphene(), &graphene(), form).unwrap();
        prop_assert_eq!(plain.len(), mirrored.len());
        for branch in plain.iter().filter(|b| !b.strain_dominated && b.strain.abs() > 1e-9) {
            let image = mirrored.iter().find(|image| {
                (image.twist + branch.twist).abs() < 1e-11
                    && (image.strain - branch.strain).abs() < 1e-11
            });
            let image = image.expect("the mirror image");
            prop_assert!(modulo(image.lattice_angle + branch.lattice_angle, FRAC_PI_3) < 1e-8);
            prop_assert!(modulo(image.axis_lab + branch.axis_lab, PI) < 1e-6);
        }
    }

    /// Every branch, put into the forward model, makes the lattice that was solved.
    #[test]
    fn every_branch_is_exact((lattice, _, form) in sample()) {
        for branch in branches(&lattice, &graphene(), &graphene(), form).unwrap() {
            prop_assert!(makes(&branch, &lattice, form), "{branch:?}");
        }
    }

    /// J C Jᵀ with J by central differences of the solution itself.
    #[test]
    fn covariance_is_that_of_numerical_derivatives((lattice, [_, strain, ..], form) in sample()) {
        // At zero strain |q| has a corner and no derivative.
        prop_assume!(strain > 1e-4);
        let found = solve(&lattice, form);
        let jacobian = numerical_jacobian(&lattice, form);
        let expected = jacobian * lattice.covariance * jacobian.transpose();
        for row in 0..4 {
            for column in 0..4 {
                let scale = (expected[(row, row)] * expected[(column, column)]).sqrt();
                let difference = found.covariance[(row, column)] - expected[(row, column)];
                prop_assert!(difference.abs() < 1e-5 * scale, "{row} {column} {difference} {scale}");
            }
        }
    }
}

fn numerical_jacobian(lattice: &Lattice, form: StrainConvention) -> Matrix4<f64> {
    let step = 1e-5;
    let centre = solve(lattice, form).lattice_angle;
    Matrix4::from_columns(&[0, 1, 2, 3].map(|component| {
        let side = |sign: f64| {
            let mut moved = *lattice;
            moved.basis[component] += sign * step;
            let found = solve(&moved, form);
            let angle = found.lattice_angle - centre;
            let near = angle - FRAC_PI_3 * (angle / FRAC_PI_3).round();
            Vector4::new(
                found.twist,
                near,
                found.strain_vector.x,
                found.strain_vector.y,
            )
        };
        (side(1.0) - side(-1.0)) / (2.0 * step)
    }))
}

/// Which layer is called the reference: (θ, ε) → (−θ, −ε), right to second order in both. Halving
/// both must quarter the difference of the dimensionless moiré matrices.
#[test]
fn exchange_of_the_layers_to_second_order() {
    let inverse = |twist: f64, strain, axis, angle| {
        let basis = moire_lattice(twist, strain, axis, angle, &graphene(), RealSpace).unwrap();
        basis.try_inverse().unwrap()
    };
    let difference = |scale: f64| {
        let (twist, strain, axis, angle) = (0.02 * scale, 0.003 * scale, 0.6, 0.4);
        let plain = inverse(twist, strain, axis, angle);
        // The same axis in the laboratory, counted from the other layer.
        let swapped = inverse(-twist, -strain, axis + twist, angle + twist);
        // Both name the same vectors up to a turn of 60°.
        let mut named = swapped;
        let mut smallest = f64::INFINITY;
        for _ in 0..6 {
            named = Matrix2::new(0.0, -1.0, 1.0, 1.0) * named;
            smallest = smallest.min((named - plain).norm());
        }
        smallest
    };
    let (large, small) = (difference(1.0), difference(0.5));
    assert!((large / small - 4.0).abs() < 0.2, "{large} {small}");
    assert!(small < 0.01 * inverse(0.01, 0.0015, 0.6, 0.4).norm());
}

/// The mirrored labelling is listed where strain could have made the moiré.
#[test]
fn strain_dominated_readings_are_listed() {
    let read = |strain, axis| {
        let sample = lattice(0.02, strain, axis, 0.2, RealSpace);
        let found = branches(&sample, &graphene(), &graphene(), RealSpace).unwrap();
        let dominated: Vec<Branch> = found.into_iter().filter(|b| b.strain_dominated).collect();
        (sample, dominated)
    };
    let axes = || (0..60).map(|k| PI * f64::from(k) / 60.0);
    assert!(axes().all(|axis| read(0.002, axis).1.is_empty()));
    let mut listed = 0;
    for axis in axes() {
        let (sample, dominated) = read(0.033, axis);
        listed += dominated.len();
        assert!(
            dominated
                .iter()
                .all(|branch| makes(branch, &sample, RealSpace))
        );
        // Mostly strain: ε(1+ν)/2 is larger than the twist.
        assert!(
            dominated
                .iter()
                .all(|b| 0.58 * b.strain.abs() > b.twist.abs())
        );
    }
    assert!(listed > 0);
}

/// Whether the branch, put into the forward model, makes this lattice: each basis in whole numbers
/// of the other.
fn makes(branch: &Branch, lattice: &Lattice, form: StrainConvention) -> bool {
    let Branch {
        twist,
        strain,
        axis_lattice,
        lattice_angle,
        ..
    } = *branch;
    let made = moire_lattice(
        twist,
        strain,
        axis_lattice,
        lattice_angle,
        &graphene(),
        form,
    )
    .unwrap();
    let numbers = lattice.basis.try_inverse().unwrap() * made;
    let whole = numbers.map(f64::round);
    (numbers - whole).norm() < 1e-9 && whole.determinant().abs() == 1.0
}

/// No strain at all: no NaN, no infinite covariance, no axis, and the limit is that of noise.
#[test]
fn zero_strain() {
    for form in [RealSpace, KSpace] {
        let found = solve(&lattice(0.019, 0.0, 0.0, 0.3, form), form);
        assert!((found.twist - 0.019).abs() < 1e-13);
        assert!(found.strain_vector.norm() < 1e-13);
        assert!(found.covariance.iter().all(|x| x.is_finite()));
        assert!(found.twist().sigma > 0.0 && found.lattice_angle().sigma > 0.0);
        assert!(found.strain().p_value() > 0.999);
        assert!(found.axis_lab().is_none() && found.axis_lattice().is_none());
        let strain = found.heterostrain();
        assert!(strain.value == 0.0 && strain.sigma > 0.0);
        assert!(found.strain().upper_limit_95() > 1.7 * strain.sigma);
    }
    // Bit for bit zero, with and without noise.
    let exactly = |covariance| TwistStrain {
        twist: 0.02,
        lattice_angle: 0.0,
        strain_vector: Vector2::zeros(),
        covariance,
    };
    for covariance in [Matrix4::zeros(), Matrix4::identity() * 1e-10] {
        let found = exactly(covariance);
        assert_eq!(found.strain().p_value(), 1.0);
        assert!(found.strain().upper_limit_95().is_finite());
        assert!(found.heterostrain().sigma.is_finite());
    }
}

/// The constrained fit against generalised least squares written out.
#[test]
fn three_vectors_are_fitted_by_least_squares() {
    let mut rng = stream(3, "test", 0);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let root = Matrix6::from_fn(|_, _| normal());
    let covariance = root * root.transpose() * 1e-4;
    let vectors = [
        Vector2::new(12.0, 1.0),
        Vector2::new(5.0, 11.0),
        Vector2::new(-7.02, 10.01),
    ];
    let (found, chi2) = three_vectors(&vectors, &covariance);

    let design = DMatrix::from_row_slice(
        6,
        4,
        &[
            1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, //
            0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0,
        ],
    );
    let y = DVector::from_iterator(6, vectors.iter().flat_map(|v| [v.x, v.y]));
    let weight = DMatrix::from_column_slice(6, 6, covariance.as_slice())
        .try_inverse()
        .unwrap();
    let normal_matrix = (design.transpose() * &weight * &design)
        .try_inverse()
        .unwrap();
    let best = &normal_matrix * design.transpose() * &weight * &y;
    let residual = &y - &design * &best;
    let expected_chi2 = (residual.transpose() * &weight * &residual)[0];

    for component in 0..4 {
        assert!((found.flat()[component] - best[component]).abs() < 1e-9);
        for other in 0..4 {
            let expected = normal_matrix[(component, other)];
            assert!((found.covariance[(component, other)] - expected).abs() < 1e-9);
        }
    }
    assert!(
        (chi2 / expected_chi2 - 1.0).abs() < 1e-8,
        "{chi2} {expected_chi2}"
    );
}

#[test]
fn three_vectors_without_uncertainty() {
    let (first, second) = (Vector2::new(12.0, 1.0), Vector2::new(5.0, 11.0));
    let closed = [first, second, second - first];
    let (found, chi2) = three_vectors(&closed, &Matrix6::zeros());
    assert_eq!(
        (found.basis, chi2),
        (Matrix2::from_columns(&[first, second]), 0.0)
    );
    let open = [first, second, first];
    assert_eq!(three_vectors(&open, &Matrix6::zeros()).1, f64::INFINITY);
}

/// The complex regression `M_j = p G_j + q Ḡ_j` over three harmonics gives the same twist, strain and
/// χ² as fitting two vectors first: four of six numbers either way.
#[test]
fn regression_over_three_harmonics_agrees() {
    let mut rng = stream(5, "test", 0);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let root = Matrix6::from_fn(|_, _| normal());
    let covariance = root * root.transpose() * 1e-10;
    // Harmonics as a pair 60° apart and their difference: the same closure as lattice vectors.
    let basis = moire_lattice(0.019, 0.002, 0.4, 0.3, &graphene(), RealSpace).unwrap();
    let exact = 2.0 * PI * basis.try_inverse().unwrap().transpose();
    let (m0, m120): (Vector2<f64>, Vector2<f64>) = (exact.column(0).into(), exact.column(1).into());
    let noisy = [m0, m0 + m120, m120].map(|m| m + Vector2::new(normal(), normal()) * 1e-5);
    let (fitted, chi2) = three_vectors(&noisy, &covariance);

    let g = 4.0 * PI / (3.0_f64.sqrt() * 0.246);
    let mut design = SMatrix::<f64, 6, 4>::zeros();
    for j in 0..3 {
        let atomic = g * Complex::cis(j as f64 * FRAC_PI_3);
        for (k, factor) in [Complex::new(1.0, 0.0), Complex::i()]
            .into_iter()
            .enumerate()
        {
            let (by_p, by_q) = (factor * atomic, factor * atomic.conj());
            design[(2 * j, k)] = by_p.re;
            design[(2 * j + 1, k)] = by_p.im;
            design[(2 * j, 2 + k)] = by_q.re;
            design[(2 * j + 1, 2 + k)] = by_q.im;
        }
    }
    let y = nalgebra::Vector6::from_iterator(noisy.iter().flat_map(|v| [v.x, v.y]));
    let weight = covariance.try_inverse().unwrap();
    let normal_matrix = (design.transpose() * weight * design)
        .try_inverse()
        .unwrap();
    let pq = normal_matrix * design.transpose() * weight * y;
    let residual = y - design * pq;
    let expected = (residual.transpose() * weight * residual)[0];
    assert!((chi2 / expected - 1.0).abs() < 1e-6, "{chi2} {expected}");

    // Back from (p, q): M at 0° and 120°, then the lattice.
    let (p, q) = (Complex::new(pq[0], pq[1]), Complex::new(pq[2], pq[3]));
    let column = |angle: f64| {
        let m = p * g * Complex::cis(angle) + q * g * Complex::cis(-angle);
        Vector2::new(m.re, m.im)
    };
    let by_regression = Matrix2::from_columns(&[column(0.0), column(2.0 * FRAC_PI_3)]);
    let by_vectors = Matrix2::from_columns(&[fitted.vector(0), fitted.vector(2)]);
    assert!((by_regression - by_vectors).norm() < 1e-10);
}
