//! The algebra against matrices written out by hand, square roots and numerical derivatives.

use nalgebra::{Matrix4, Rotation2};

use super::*;

fn calibration(values: [f64; 3], covariance: [[f64; 3]; 3]) -> Calibration {
    Calibration {
        gain_percent: values[0],
        mismatch_percent: values[1],
        orthogonality_mrad: values[2],
        covariance,
        coordinates: Coordinates::Nominal,
        curvature: None,
        sizes_nm: Vec::new(),
        line_rates_hz: Vec::new(),
    }
}

/// A lattice through a known F comes back as that F, whatever its orientation and the names of its vectors;
/// an F with a turn in it gives the symmetric `√(F Fᵀ)` and the turn to the orientation.
#[test]
fn a_distortion_that_was_put_in_is_found() {
    let known = KnownLattice::named("graphite").unwrap();
    let cell = known.cell().unwrap();
    let truth = calibration([3.0, -2.0, 15.0], [[0.0; 3]; 3]);
    let f = truth.distortion();
    assert!((f - Matrix2::new(1.02, 0.0075, 0.0075, 1.04)).norm() < 1e-12);
    for (degrees, name) in [
        (0.0, [1.0, 0.0, 0.0, 1.0]),
        (17.0, [0.0, -1.0, 1.0, 1.0]),
        (-50.0, [1.0, 0.0, -1.0, 1.0]),
    ] {
        let turn = Rotation2::new(f64::to_radians(degrees)).into_inner();
        let lattice = Lattice::new(
            f * turn * cell * Matrix2::from_row_slice(&name),
            Matrix4::identity() * 1e-10,
        );
        let found = shown(&lattice, &cell).unwrap();
        let expected = Vector3::new(0.03, -0.02, 0.015);
        assert!((found.values - expected).norm() < 1e-12, "{found:?}");
        let sheared = Lattice::new(
            Rotation2::new(0.1).into_inner() * lattice.basis,
            lattice.covariance,
        );
        let again = shown(&sheared, &cell).unwrap().values;
        let turned = Rotation2::new(0.1).into_inner() * f * Rotation2::new(-0.1).into_inner();
        let f = Matrix2::new(
            1.0 + again[0] + again[1] / 2.0,
            again[2] / 2.0,
            again[2] / 2.0,
            1.0 + again[0] - again[1] / 2.0,
        );
        assert!((f - turned).norm() < 1e-12);
    }
}

/// Oblique cells, either face up.
#[test]
fn oblique_cells_and_their_mirror_images() {
    let known = KnownLattice {
        name: "oblique".to_owned(),
        a_nm: 0.5,
        b_nm: 0.62,
        angle_deg: 103.0,
        sigma_percent: 0.0,
        source: String::new(),
    };
    let cell = known.cell().unwrap();
    assert!((cell.determinant() - 0.5 * 0.62 * 103f64.to_radians().sin()).abs() < 1e-12);
    let f = calibration([1.0, 3.0, -8.0], [[0.0; 3]; 3]).distortion();
    let turn = Rotation2::new(0.4).into_inner();
    for face in [1.0, -1.0] {
        let mirror = Matrix2::new(1.0, 0.0, 0.0, face);
        let lattice = Lattice::new(f * turn * mirror * cell, Matrix4::zeros());
        let values = shown(&lattice, &cell).unwrap().values;
        assert!(
            (values - Vector3::new(0.01, 0.03, -0.008)).norm() < 1e-12,
            "{values}"
        );
    }
}

/// The analytic Jacobian against finite differences.
#[test]
fn errors_follow_the_lattice() {
    let cell = KnownLattice::hexagonal("h", 1.0, 0.0, "").cell().unwrap();
    let f = Matrix2::new(1.1, 0.04, -0.02, 0.93);
    let covariance = Matrix4::from_diagonal(&[1.0, 2.0, 3.0, 4.0].into()) * 1e-8;
    let lattice = Lattice::new(f * cell, covariance);
    let found = shown(&lattice, &cell).unwrap();
    let mut jacobian = Matrix3x4::zeros();
    let mut of_turn = nalgebra::Vector4::zeros();
    for i in 0..4 {
        let mut moved = lattice;
        moved.basis[i] += 1e-6;
        let moved = shown(&moved, &cell).unwrap();
        jacobian.set_column(i, &((moved.values - found.values) / 1e-6));
        of_turn[i] = (moved.orientation.value - found.orientation.value) / 1e-6;
    }
    let expected = jacobian * covariance * jacobian.transpose();
    assert!((found.covariance - expected).norm() < 1e-5 * expected.norm());
    let variance = (of_turn.transpose() * covariance * of_turn)[0];
    assert!((found.orientation.sigma.powi(2) / variance - 1.0).abs() < 1e-4);
}

/// The independent errors add up to the covariance, singular ones included, and are those of a diagonal one.
#[test]
fn errors_are_split_without_loss() {
    for covariance in [
        [[4.0, 1.0, 0.3], [1.0, 9.0, -2.0], [0.3, -2.0, 1.0]],
        [[1.0, -2.0, 0.0], [-2.0, 4.0, 0.0], [0.0, 0.0, 0.0]],
    ] {
        let one = calibration([0.0; 3], covariance);
        let parts = distortions();
        let mut sum = Matrix3::zeros();
        for error in one.independent_errors() {
            // (s, g, γ) of a symmetric change.
            let v = Vector3::new(
                f64::midpoint(error.m11, error.m22),
                error.m11 - error.m22,
                2.0 * error.m12,
            );
            sum += v * v.transpose();
        }
        assert!((sum - one.parameter_covariance()).norm() < 1e-15, "{sum}");
        assert!((parts[1].m11, parts[2].m12) == (0.5, 0.5));
    }
    let plain = calibration(
        [0.0; 3],
        [[1.0, 0.0, 0.0], [0.0, 0.25, 0.0], [0.0, 0.0, 25.0]],
    );
    let errors = plain.independent_errors();
    assert!((errors[0] - Matrix2::identity() * 0.01).norm() < 1e-15);
    assert!((errors[1] - Matrix2::new(0.0025, 0.0, 0.0, -0.0025)).norm() < 1e-15);
    assert!((errors[2] - Matrix2::new(0.0, 0.0025, 0.0025, 0.0)).norm() < 1e-15);
}

#[test]
fn nonsense_is_named() {
    let none = [[0.0; 3]; 3];
    assert!(calibration([1.0, 0.5, 5.0], none).map().is_some());
    assert!(calibration([-100.0, 0.0, 0.0], none).map().is_none());
    assert!(calibration([f64::NAN, 0.0, 0.0], none).problem().is_some());
    let negative = [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    assert!(calibration([0.0; 3], negative).problem().is_some());
}
