//! The published formulation of the strain problem, solved numerically, as an oracle.
//!
//! arXiv 2406.08681: for twelve pairs out of the six moiré vectors, `2π B⁻ᵀ = R(α) [R(θ) S − I] G`
//! with `S = R(φ)ᵀ diag(1+ε, 1−νε) R(φ)` (axis at −φ): 48 equations for α, θ, ε, φ. Only four of
//! them are independent, so for an exact lattice the minimum is zero and is the closed form's.

use std::f64::consts::{FRAC_PI_3, PI};

use heterostrain::lattice::Lattice;
use heterostrain::material::Material;
use heterostrain::strain::StrainConvention::KSpace;
use heterostrain::strain::twist_strain;
use heterostrain::strain::{moire_lattice, published_draws};
use nalgebra::{Matrix2, Matrix4, Rotation2, SMatrix, SVector, Vector2, Vector4};

type Equations = SVector<f64, 48>;

fn turn(angle: f64) -> Matrix2<f64> {
    Rotation2::new(angle).into_inner()
}

/// The 48 residuals in rad/nm for parameters α, θ, ε, φ.
fn residuals(six: &[Vector2<f64>; 6], parameters: &Vector4<f64>) -> Equations {
    let [alpha, theta, strain, phi]: [f64; 4] = (*parameters).into();
    let principal = Matrix2::new(1.0 + strain, 0.0, 0.0, 1.0 - 0.16 * strain);
    let stretch = turn(phi).transpose() * principal * turn(phi);
    let operator = turn(alpha) * (turn(theta) * stretch - Matrix2::identity());
    let atomic = |k: usize| {
        let angle = PI / 6.0 + FRAC_PI_3 * k as f64;
        0.246 * Vector2::new(angle.cos(), angle.sin())
    };
    let dual = |pair: Matrix2<f64>| 2.0 * PI * pair.try_inverse().unwrap().transpose();
    // Each vector with the next and with the next but one.
    let pairs = (0..6).flat_map(|k| [(k, (k + 1) % 6), (k, (k + 2) % 6)]);
    let values = pairs.flat_map(|(first, second)| {
        let measured = dual(Matrix2::from_columns(&[six[first], six[second]]));
        let reciprocal = dual(Matrix2::from_columns(&[atomic(first), atomic(second)]));
        let difference: [f64; 4] = (measured - operator * reciprocal)
            .as_slice()
            .try_into()
            .unwrap();
        difference
    });
    Equations::from_iterator(values)
}

/// Levenberg–Marquardt with numerical derivatives.
fn fit(six: &[Vector2<f64>; 6], start: Vector4<f64>) -> Vector4<f64> {
    let (mut parameters, mut damping) = (start, 1e-3);
    for _ in 0..500 {
        let here = residuals(six, &parameters);
        let jacobian = SMatrix::<f64, 48, 4>::from_columns(&[0, 1, 2, 3].map(|k| {
            let mut step = Vector4::zeros();
            step[k] = 1e-7;
            (residuals(six, &(parameters + step)) - residuals(six, &(parameters - step))) / 2e-7
        }));
        let normal: Matrix4<f64> = jacobian.transpose() * jacobian;
        let damped = normal + Matrix4::from_diagonal(&normal.diagonal()) * damping;
        let Some(inverse) = damped.try_inverse() else {
            break;
        };
        let moved = parameters - inverse * jacobian.transpose() * here;
        if residuals(six, &moved).norm() < here.norm() {
            parameters = moved;
            damping = (damping * 0.2_f64).max(1e-15);
        } else {
            damping *= 5.0;
        }
    }
    parameters
}

#[test]
fn closed_form_solves_the_published_equations() {
    let graphene = Material::graphene();
    let cases = [
        (1.126, 0.12, 40.0, 12.0),
        (1.1, 0.3, 20.0, 37.0),
        (0.5, 0.05, 150.0, 55.0),
        (2.5, 0.6, 95.0, 3.0),
    ];
    for (twist, strain, axis, angle) in cases {
        let basis = moire_lattice(
            f64::to_radians(twist),
            strain / 100.0,
            f64::to_radians(axis),
            f64::to_radians(angle),
            &graphene,
            KSpace,
        )
        .unwrap();
        let (first, second): (Vector2<f64>, Vector2<f64>) =
            (basis.column(0).into(), basis.column(1).into());
        let third = second - first;
        let six = [first, second, third, -first, -second, -third];
        let lattice = Lattice::new(basis, Matrix4::zeros());
        let found = twist_strain(&lattice, &graphene, KSpace).unwrap();

        // A start within the basin: wrong by a few per cent of each, as a user would guess.
        let start = Vector4::new(
            found.lattice_angle + 0.02 + naming(&six, found.lattice_angle),
            found.twist * 1.05,
            found.strain_vector.norm() * 0.8,
            -found.axis_lattice().unwrap().value + naming(&six, found.lattice_angle) + 0.1,
        );
        let solved = fit(&six, start);
        let rest = residuals(&six, &solved).norm();
        assert!(rest < 1e-9, "{rest} for {twist}° {strain} %");
        assert!((solved[1] - found.twist).abs() < 1e-9, "{solved} {found:?}");
        assert!(
            (solved[2] - found.strain_vector.norm()).abs() < 1e-8,
            "{solved} {found:?}"
        );
        // Published φ runs clockwise: the laboratory axis is −φ + α + θ.
        let axis_lab = -solved[3] + solved[0] + solved[1];
        let difference = axis_lab - found.axis_lab().unwrap().value;
        assert!(
            (difference - PI * (difference / PI).round()).abs() < 1e-6,
            "{solved} {found:?}"
        );
    }
}

/// By how many steps of 60° the names of the six vectors are ahead of the reduced α: the moiré of a
/// positive twist is turned by 90° against layer 1, and the first atomic vector lies at 30°.
fn naming(six: &[Vector2<f64>; 6], angle: f64) -> f64 {
    let first = six[0].y.atan2(six[0].x) - PI / 6.0 - PI / 2.0;
    FRAC_PI_3 * ((first - angle) / FRAC_PI_3).round()
}

/// Six vectors that no lattice has: the least squares over α, θ, ε and φ, iterated, end where the linear problem and
/// the closed form are at once.
#[test]
fn twelve_pairs_of_drawn_peaks_are_solved_at_once() {
    let graphene = Material::graphene();
    let basis = moire_lattice(
        f64::to_radians(1.1),
        0.003,
        f64::to_radians(20.0),
        f64::to_radians(37.0),
        &graphene,
        KSpace,
    )
    .unwrap();
    let lattice = Lattice::new(basis, Matrix4::zeros());
    let found = twist_strain(&lattice, &graphene, KSpace).unwrap();
    let (first, second): (Vector2<f64>, Vector2<f64>) =
        (basis.column(0).into(), basis.column(1).into());
    let third = second - first;
    let exact = [first, second, third, -first, -second, -third];
    // Up to 1 % off, each in a direction of its own.
    for seed in 0..5 {
        let six: [Vector2<f64>; 6] = std::array::from_fn(|k| {
            let angle = 2.399 * (6 * seed + k) as f64;
            exact[k] + 0.1 * Vector2::new(angle.cos(), angle.sin())
        });
        let ahead = naming(&six, found.lattice_angle);
        let start = Vector4::new(
            found.lattice_angle + ahead,
            found.twist,
            found.strain_vector.norm(),
            -found.axis_lattice().unwrap().value + ahead,
        );
        let solved = fit(&six, start);
        let drawn = published_draws(&lattice, &graphene, KSpace, [six]);
        let drawn = drawn[0];
        assert!((solved[1] - drawn.twist).abs() < 1e-8, "{solved} {drawn:?}");
        let strain = drawn.strain_vector.norm();
        assert!((solved[2] - strain).abs() < 1e-7, "{solved} {drawn:?}");
        let axis_lab = -solved[3] + solved[0] + solved[1];
        let axis = drawn.strain_vector.y.atan2(drawn.strain_vector.x) / 2.0;
        let difference = axis_lab - axis;
        assert!(
            (difference - PI * (difference / PI).round()).abs() < 1e-5,
            "{solved} {drawn:?}"
        );
        // It is not the lattice of two of the six.
        let two = Lattice::new(Matrix2::from_columns(&[six[0], six[1]]), Matrix4::zeros());
        let of_two = twist_strain(&two, &graphene, KSpace).unwrap();
        assert!((of_two.twist - drawn.twist).abs() > 1e-6);
    }
}
