//! Errors of twist and strain, and what they do to a strain near zero.

use std::f64::consts::PI;

use crate::two_layers::{graphene, lattice, solve};
use heterostrain::lattice::Lattice;
use heterostrain::strain::StrainConvention::RealSpace;
use heterostrain::strain::draws;
use heterostrain::strain::{TwistStrain, moire_lattice};
use moiregauge::numbers::normals;
use moiregauge::numbers::stream;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use rand_distr::{Distribution, StandardNormal};

/// At q → 0 and equal errors v of the harmonics: `σ_θ = σ_p`, `σ_E = 2σ_q/(1+ν)`, `σ_p² = v/(3|G|²)`.
#[test]
fn errors_without_strain_have_their_closed_form() {
    // The limit of small strain, small twist: corrections are of the order of either.
    let (twist, nu, a) = (0.002, 0.16, 0.246);
    let basis = moire_lattice(twist, 1e-9, 0.2, 0.3, &graphene(), RealSpace).unwrap();
    // dM = −M dLᵀ L⁻ᵀ: give three harmonics equal errors, go over to the lattice numerically.
    let mut big = Matrix4::zeros();
    for component in 0..4 {
        let mut change = Matrix2::zeros();
        change[component] = 1.0;
        let moved = -basis * change.transpose() * basis / (2.0 * PI);
        big.set_column(component, &Vector4::from_column_slice(moved.as_slice()));
    }
    let v = 1e-12;
    // Harmonics 120° apart whose third is minus their sum, each with variance v before the fit:
    // the fit takes a third off and correlates them by −1/2.
    let (own, cross) = (v * 2.0 / 3.0, -v / 3.0);
    let i2 = Matrix2::<f64>::identity();
    let mut covariance = Matrix4::zeros();
    covariance
        .fixed_view_mut::<2, 2>(0, 0)
        .copy_from(&(i2 * own));
    covariance
        .fixed_view_mut::<2, 2>(2, 2)
        .copy_from(&(i2 * own));
    covariance
        .fixed_view_mut::<2, 2>(0, 2)
        .copy_from(&(i2 * cross));
    covariance
        .fixed_view_mut::<2, 2>(2, 0)
        .copy_from(&(i2 * cross));
    let lattice = Lattice::new(basis, big * covariance * big.transpose());
    let found = solve(&lattice, RealSpace);
    let g = 4.0 * PI / (3.0_f64.sqrt() * a);
    let sigma_p = (v / 3.0).sqrt() / g;
    assert!((found.twist().sigma / sigma_p - 1.0).abs() < 5e-3);
    let sigma_e = 2.0 * sigma_p / (1.0 + nu);
    for component in 0..2 {
        let found = found.strain().covariance[(component, component)].sqrt();
        assert!((found / sigma_e - 1.0).abs() < 5e-3, "{found} {sigma_e}");
    }
}

/// 4,000 draws against the analytic covariance; a variance scatters by √(2/n) = 2.2 %.
#[test]
fn draws_have_the_analytic_covariance() {
    let count = 4000;
    let mut measured = lattice(0.019, 0.003, 0.5, 1.0, RealSpace);
    measured.covariance *= 0.01;
    let found = solve(&measured, RealSpace);
    let sample = draws(
        &measured,
        &graphene(),
        RealSpace,
        count,
        normals(7, "strain", 3),
    );
    assert_eq!(sample.len(), count);
    let rows: Vec<Vector4<f64>> = sample
        .iter()
        .map(|d| {
            Vector4::new(
                d.twist,
                d.lattice_angle,
                d.strain_vector.x,
                d.strain_vector.y,
            )
        })
        .collect();
    let mean = rows.iter().sum::<Vector4<f64>>() / count as f64;
    let expected = Vector4::new(
        found.twist,
        found.lattice_angle,
        found.strain_vector.x,
        found.strain_vector.y,
    );
    for row in 0..4 {
        let sigma = found.covariance[(row, row)].sqrt();
        assert!((mean[row] - expected[row]).abs() < 5.0 * sigma / (count as f64).sqrt());
        for column in 0..4 {
            let sample: f64 = rows
                .iter()
                .map(|r| (r[row] - mean[row]) * (r[column] - mean[column]))
                .sum::<f64>()
                / count as f64;
            let scale = sigma * found.covariance[(column, column)].sqrt();
            let difference = (sample - found.covariance[(row, column)]).abs();
            assert!(
                difference < 0.1 * scale,
                "{row} {column}: {difference} of {scale}"
            );
        }
    }
    let again = draws(
        &measured,
        &graphene(),
        RealSpace,
        count,
        normals(7, "strain", 3),
    );
    assert!(sample.iter().zip(&again).all(|(a, b)| a.twist == b.twist));
    let other = draws(
        &measured,
        &graphene(),
        RealSpace,
        count,
        normals(7, "strain", 4),
    );
    assert!(sample[0].twist != other[0].twist);
}

/// A lattice known without error along one direction has a covariance without inverse.
#[test]
fn draws_from_a_singular_covariance() {
    let mut measured = lattice(0.019, 0.003, 0.5, 0.001, RealSpace);
    let direction = Vector4::new(1.0, 2.0, -1.0, 0.5) * 1e-3;
    measured.covariance = direction * direction.transpose();
    let sample = draws(
        &measured,
        &graphene(),
        RealSpace,
        200,
        normals(1, "strain", 0),
    );
    assert_eq!(sample.len(), 200);
    assert!(sample.iter().all(|d| d.twist.is_finite()));
    // α lies at the edge of its range and must not jump by 60°.
    assert!(
        sample
            .iter()
            .all(|d| (d.lattice_angle - sample[0].lattice_angle).abs() < 0.1)
    );
    let still = Lattice::new(measured.basis, Matrix4::zeros());
    let exact = draws(&still, &graphene(), RealSpace, 5, normals(1, "strain", 0));
    assert!(exact.iter().all(|d| (d.twist - 0.019).abs() < 1e-12));
}

/// The length of a noisy vector: mean 1.25σ at zero, 2.27σ at 2σ; 95 % below
/// 2.45σ, 99 % below 3.03σ at zero. 20,000 vectors: fractions scatter by 0.15 %, means by 0.007σ.
#[test]
fn small_strain_is_not_overstated() {
    let sigma = 5e-5;
    let count = 20_000_u32;
    let measured = |length: f64, index: u64| -> Vec<TwistStrain> {
        let mut rng = stream(11, "test", index);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        (0..count)
            .map(|_| TwistStrain {
                twist: 0.02,
                lattice_angle: 0.1,
                strain_vector: sigma * Vector2::new(length + normal(), normal()),
                covariance: Matrix4::identity() * sigma * sigma,
            })
            .collect()
    };
    let share = |sample: &[TwistStrain], test: &dyn Fn(&TwistStrain) -> bool| {
        sample.iter().filter(|t| test(t)).count() as f64 / f64::from(count)
    };
    let mean = |sample: &[TwistStrain], value: &dyn Fn(&TwistStrain) -> f64| {
        sample.iter().map(value).sum::<f64>() / f64::from(count) / sigma
    };
    let none = measured(0.0, 0);
    assert!((mean(&none, &|t| t.strain_vector.norm()) - 1.2533).abs() < 0.02);
    assert!((share(&none, &|t| t.strain_vector.norm() < 2.45 * sigma) - 0.95).abs() < 0.006);
    assert!((share(&none, &|t| t.axis_lab().is_some()) - 0.01).abs() < 0.003);

    let weak = measured(2.0, 1);
    assert!((mean(&weak, &|t| t.strain_vector.norm()) - 2.2724).abs() < 0.03);
    let debiased = mean(&weak, &|t| t.heterostrain().value);
    assert!((debiased - 2.0).abs() < 0.1, "{debiased}");

    // One σ covers at least what it says: 68.3 %, four standard errors of the share allowed.
    for (index, length) in [(2, 0.0), (3, 0.7), (4, 1.5), (5, 3.0), (6, 8.0)] {
        let sample = measured(length, index);
        let covered = share(&sample, &|t| {
            let found = t.heterostrain();
            (found.value - length * sigma).abs() <= found.sigma
        });
        assert!(covered > 0.683 - 0.0135, "{length}: {covered}");
        // A subset: each limit is a root by bisection.
        let limited = sample[..2000]
            .iter()
            .filter(|t| t.strain().upper_limit_95() >= length * sigma)
            .count();
        assert!(limited >= 1880, "{length}: {limited} of 2000");
    }
}

/// φ error σ/(2|E|): 5.7° at 5σ.
#[test]
fn axis_error_follows_the_strain() {
    let sigma = 1e-5;
    let found = TwistStrain {
        twist: 0.02,
        lattice_angle: 0.1,
        strain_vector: Vector2::new(0.0, 5.0 * sigma),
        covariance: Matrix4::from_diagonal(&Vector4::new(0.0, 0.0, 1.0, 1.0)) * sigma * sigma,
    };
    let axis = found.axis_lab().unwrap();
    assert!((axis.value - PI / 4.0).abs() < 1e-12);
    assert!((axis.sigma.to_degrees() - 5.73).abs() < 0.01, "{axis:?}");
    let lattice = found.axis_lattice().unwrap();
    assert!((lattice.value - (PI / 4.0 - 0.12)).abs() < 1e-12);
}
