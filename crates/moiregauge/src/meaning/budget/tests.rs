//! The numbers of the literature and closed forms for every row of the budget.

use heterostrain::material::Material;
use heterostrain::strain::{StrainConvention, moire_lattice};
use nalgebra::{Matrix2, Rotation2, Vector2};

use super::*;
use crate::drift::linear::{Observation, at_known_drift, solve};
use crate::settings::knobs::Calibration;

const ALPHA_DEG: f64 = 37.0;
const AXIS_DEG: f64 = 20.0;

fn exact(basis: Matrix2<f64>) -> Lattice {
    Lattice::new(basis, Matrix4::zeros())
}

fn graphene(twist_deg: f64, strain: f64) -> Lattice {
    let made = moire_lattice(
        twist_deg.to_radians(),
        strain,
        AXIS_DEG.to_radians(),
        ALPHA_DEG.to_radians(),
        &Material::graphene(),
        StrainConvention::RealSpace,
    );
    exact(made.unwrap())
}

/// Lattice of the moiré matrix P, `L = P⁻ᵀ A⁰` with the atomic vectors at 30° and 90°.
fn lattice_of(p: &Matrix2<f64>) -> Lattice {
    let (s, c) = 30_f64.to_radians().sin_cos();
    let atoms = 0.246 * Matrix2::new(c, 0.0, s, 1.0);
    exact(p.transpose().try_inverse().unwrap() * atoms)
}

fn turn(angle: f64) -> Matrix2<f64> {
    Rotation2::new(angle).into_inner()
}

fn inverted(lattice: &Lattice) -> TwistStrain {
    twist_strain(lattice, &Material::graphene(), StrainConvention::RealSpace).unwrap()
}

fn budget(lattice: &Lattice, settings: &Settings) -> Budget {
    let none = Matrix4::zeros();
    let statistical = Statistical::at_known_drift([none, none], 1.0, &none);
    Budget::new(lattice, &inverted(lattice), &statistical, settings)
}

fn twist_deg(contribution: Contribution) -> f64 {
    contribution.covariance[(0, 0)].sqrt().to_degrees()
}

fn strain_percent(contribution: Contribution) -> f64 {
    let c = contribution.covariance;
    100.0 * (c[(2, 2)] + c[(3, 3)]).sqrt()
}

/// 1 % of gain is 0.011° at 1.1°; a mismatch of 10⁻³ or 1 mrad of shear is 0.0017 % of strain at 1.1°,
/// 0.0008 % at 0.5° and 0.0030 % at 2°. The distorted lattice itself, inverted, says the same.
#[test]
fn calibration_errors_have_the_known_size() {
    let settings = Settings {
        calibration: Calibration {
            gain_percent: 1.0,
            mismatch_percent: 0.1,
            orthogonality_mrad: 1.0,
            ..Calibration::default()
        },
        ..Settings::default()
    };
    for (twist, strain) in [(1.1, 0.0017), (0.5, 0.0008), (2.0, 0.0030)] {
        let budget = budget(&graphene(twist, 0.0), &settings);
        assert!((twist_deg(budget.of(Source::Gain)) / (0.01 * twist) - 1.0).abs() < 1e-3);
        for source in [Source::Mismatch, Source::Orthogonality] {
            let found = strain_percent(budget.of(source));
            assert!((found - strain).abs() < 6e-5, "{source:?} {twist}: {found}");
            let closed = 100.0 * 1e-3 * f64::to_radians(twist) / 1.16;
            assert!((found / closed - 1.0).abs() < 0.02, "{found}, {closed}");
            assert!(twist_deg(budget.of(source)) < 0.02 * 1e-3 * twist);
        }
    }
    let lattice = graphene(1.1, 0.003);
    let (before, budget) = (inverted(&lattice), budget(&lattice, &settings));
    for (source, map) in [
        (Source::Gain, Matrix2::new(1.01, 0.0, 0.0, 1.01)),
        (Source::Mismatch, Matrix2::new(1.0005, 0.0, 0.0, 0.9995)),
        (Source::Orthogonality, Matrix2::new(1.0, 5e-4, 5e-4, 1.0)),
    ] {
        let after = inverted(&exact(map * lattice.basis));
        let row = budget.of(source);
        let shift = (after.twist - before.twist).abs().to_degrees();
        assert!((shift - twist_deg(row)).abs() < 2e-4, "{source:?} {shift}");
        let moved = after.strain_vector - before.strain_vector;
        let outer = moved * moved.transpose();
        let c = row.covariance.fixed_view::<2, 2>(2, 2);
        // Second order: 1 % of 1 %.
        assert!((outer - c).norm() < 0.03 * outer.norm(), "{source:?}");
        let length = 100.0 * (after.strain_vector.norm() - before.strain_vector.norm()).abs();
        assert!(
            (length - 100.0 * row.magnitude.sqrt()).abs() < 6e-5,
            "{length}"
        );
    }
    // Wavelengths: 1 % of gain is 1 % of each.
    for i in 0..3 {
        let share = budget.of(Source::Gain).wavelengths[i].sqrt() / lattice.wavelength(i).value;
        assert!((share - 0.01).abs() < 1e-9);
        assert_eq!(budget.of(Source::LatticeConstant).wavelengths[i], 0.0);
    }
}

/// Bends of both sensors that stretch x and y alike are twice half a gain, independent: θ times one over √2 of it.
#[test]
fn bends_of_sensors_are_stretches_of_either_axis() {
    let settings = Settings::default();
    let lattice = graphene(1.1, 0.0);
    let grid = GridErrors {
        shape: Vector2::repeat(0.002),
        ..GridErrors::default()
    };
    let statistical = budget(&lattice, &settings).statistical;
    let found = inverted(&lattice);
    let with = Budget::with_grid(&lattice, &found, &statistical, &grid, &settings);
    let expected = 1.1 * 0.002 / std::f64::consts::SQRT_2;
    assert!((twist_deg(with.of(Source::Shape)) / expected - 1.0).abs() < 0.01);
    // A stretch of x alone is half a gain and a strain of the moiré of the other half: ΔE = θ g/(1 + ν), g the difference.
    let nu = settings.material.poisson_ratio;
    let covariance = with.of(Source::Shape).covariance;
    let strain = (covariance[(2, 2)] + covariance[(3, 3)]).sqrt();
    let of_one = 1.1f64.to_radians() * 0.002 / (1.0 + nu) * std::f64::consts::SQRT_2;
    assert!((strain / of_one - 1.0).abs() < 0.02, "{strain} {of_one}");
}

/// Both sides off by the same share are a gain: θ times that; one side alone is a mismatch and half a gain.
#[test]
fn the_pitch_is_a_gain_of_either_side() {
    let settings = Settings::default();
    let lattice = graphene(1.1, 0.003);
    let share = 1.0 / (std::f64::consts::SQRT_2 * 256.0);
    let with = |sides: [f64; 2]| {
        let grid = GridErrors {
            pitch: Matrix2::from_diagonal(&Vector2::from(sides)),
            ..GridErrors::default()
        };
        let found = inverted(&lattice);
        let statistical = budget(&lattice, &settings).statistical;
        Budget::with_grid(&lattice, &found, &statistical, &grid, &settings)
    };
    let both = with([share; 2]);
    let expected = 1.1 * share;
    assert!((twist_deg(both.of(Source::Pitch)) / expected - 1.0).abs() < 0.01);
    let one = with([share, 0.0]);
    assert!((twist_deg(one.of(Source::Pitch)) / expected - 0.5).abs() < 0.05);
    let (with, without) = (both.total(), budget(&lattice, &settings).total());
    let more = with.wavelengths[0] - without.wavelengths[0];
    let length = lattice.wavelength(0).value;
    assert!((more.sqrt() / length / share - 1.0).abs() < 1e-6);
    assert_eq!(
        budget(&lattice, &settings).of(Source::Pitch).wavelengths,
        [0.0; 3]
    );
}

/// A turn of the sensors' frame changes the orientation and the axis in the laboratory, nothing else:
/// it needs no row of its own.
#[test]
fn a_turned_frame_changes_no_twist_and_no_magnitude() {
    let lattice = graphene(1.1, 0.003);
    let (before, after) = (
        inverted(&lattice),
        inverted(&exact(turn(0.005) * lattice.basis)),
    );
    assert!((after.twist - before.twist).abs() < 1e-12);
    assert!((after.strain_vector.norm() - before.strain_vector.norm()).abs() < 1e-12);
    assert!((after.lattice_angle - before.lattice_angle - 0.005).abs() < 1e-9);
}

/// 0.2461 in place of 0.2460 nm is 0.0005° at 1.126°, 0.247 nm 0.0046°.
#[test]
fn lattice_constants_have_the_known_effect() {
    for (sigma, degrees) in [(0.0001, 0.0005), (0.001, 0.0046)] {
        let mut settings = Settings::default();
        settings.material.lattice_constant_sigma_nm = sigma;
        let found = twist_deg(budget(&graphene(1.126, 0.0), &settings).of(Source::LatticeConstant));
        assert!((found - degrees).abs() < 5e-5, "{found}");
    }
}

/// Which layer is strained: θ ε (1−ν)/4, 0.0007° at 0.3 % and 1.1°; against a moiré that was made by
/// strain in equal parts, `M = R(α')[2 sin(θ/2) 𝒥 − cos(θ/2) E] G`.
#[test]
fn the_strained_layer_has_the_known_effect() {
    let settings = Settings::default();
    for (degrees, strain, effect) in [(1.1, 0.003, 0.0007), (2.2, 0.003, 0.0014)] {
        let lattice = graphene(degrees, strain);
        let row = budget(&lattice, &settings).of(Source::StrainedLayer);
        assert!((twist_deg(row) - effect).abs() < 5e-5, "{}", twist_deg(row));

        let (twist, axis) = (f64::to_radians(degrees), 0.4);
        let quarter = Matrix2::new(0.0, -1.0, 1.0, 0.0);
        let e = turn(axis) * Matrix2::new(strain, 0.0, 0.0, -0.16 * strain) * turn(-axis);
        let p = turn(0.7) * (2.0 * (twist / 2.0).sin() * quarter - (twist / 2.0).cos() * e);
        let shared = lattice_of(&p);
        let change = Reference::new(&shared, settings.bilayer(), settings.strain_convention)
            .unwrap()
            .with_shared_strain()
            .unwrap();
        let found = inverted(&shared);
        // The twist that was put in comes back exactly, the orientation of layer 1 is α' − θ/2.
        assert!((found.twist + change[0] - twist).abs() < 1e-12);
        let alpha = found.lattice_angle + change[1];
        let miss = (alpha - (0.7 - twist / 2.0)).rem_euclid(std::f64::consts::FRAC_PI_3);
        assert!(
            miss.min(std::f64::consts::FRAC_PI_3 - miss) < 1e-9,
            "{miss}"
        );
        // The axis in the laboratory is that of E, turned to the mean orientation; the size of a strain
        // that is not small depends on its definition at second order.
        let vector = found.strain_vector + Vector2::new(change[2], change[3]);
        let expected =
            strain * Vector2::new((2.0 * (axis + 0.7)).cos(), (2.0 * (axis + 0.7)).sin());
        assert!(
            (vector - expected).norm() < 2.0 * strain * strain,
            "{vector} {expected}"
        );
        assert!(vector.perp(&expected).abs() < 1e-9);
    }
}

/// An ignored isotropic strain shifts the twist by θη/2 + η²/2θ: 0.0014° for 0.08 %, 0.0069° for 0.2 %,
/// 0.0147° for 0.3 % at 1.126°; here from moirés that were made with it.
#[test]
fn isotropic_strain_has_the_known_effect() {
    let settings = Settings::default();
    let twist = 1.126_f64.to_radians();
    for (eta, degrees) in [(0.0008, 0.0014), (0.002, 0.0069), (0.003, 0.0147)] {
        // η stretches reciprocal vectors, the strain of atoms is 1/(1+η) − 1.
        let lattice = lattice_of(&(turn(0.3) * (turn(twist) * (1.0 + eta) - Matrix2::identity())));
        let found = inverted(&lattice);
        let shift = (found.twist - twist).to_degrees();
        assert!((shift - degrees).abs() < 5e-5, "{shift}");
        let reference =
            Reference::new(&lattice, settings.bilayer(), settings.strain_convention).unwrap();
        let change = reference
            .with_isotropic_strain(1.0 / (1.0 + eta) - 1.0)
            .unwrap();
        assert!((found.twist + change[0] - twist).abs() < 1e-12);
    }
    // Mean square over a Gaussian prior, by summation over it.
    let lattice = graphene(1.126, 0.001);
    let reference =
        Reference::new(&lattice, settings.bilayer(), settings.strain_convention).unwrap();
    let sigma = settings.isotropic_strain_percent / 100.0;
    let (mut square, mut weights) = (0.0, 0.0);
    for step in -500..=500 {
        let z = f64::from(step) / 100.0;
        let weight = (-z * z / 2.0).exp();
        let change = reference.with_isotropic_strain(z * sigma).unwrap();
        square += weight * change[0] * change[0];
        weights += weight;
    }
    let row = budget(&lattice, &settings).of(Source::IsotropicStrain);
    assert!((row.covariance[(0, 0)] / (square / weights) - 1.0).abs() < 0.03);
    // α turns by η/θ: 0.05 % is 1.5°.
    let alpha = row.covariance[(1, 1)].sqrt().to_degrees();
    assert!(
        (alpha - (sigma / twist).to_degrees()).abs() < 0.1,
        "{alpha}"
    );
}

/// ε = 2|q|/(1+ν): the strain changes by `σ_ν/(1+ν)` of itself.
#[test]
fn the_poisson_ratio_scales_the_strain() {
    let settings = Settings::default();
    let row = budget(&graphene(1.1, 0.003), &settings).of(Source::PoissonRatio);
    let share = row.magnitude.sqrt() / 0.003;
    assert!((share - 0.03 / 1.16).abs() < 0.01 * share, "{share}");
    // Across it changes little: the axis follows α, which turns as the isotropic part changes.
    let c = row.covariance;
    assert!((c[(2, 2)] + c[(3, 3)] - row.magnitude).abs() < 0.05 * row.magnitude);
}

/// Three scans, two up and one down, every time gradient along the first lattice vector: the drift
/// shows in the first vector only, whose variance grows from C/3 to 3C/8 (n = 3, Σt = t, Σt² = 3t²);
/// the sensors have their share of C/3. A fourth scan, down, balances them, and the drift adds nothing.
#[test]
fn statistical_parts_follow_the_closed_form() {
    let basis = Matrix2::new(12.5, 0.0, 0.0, 10.8);
    let (image, sensor) = (4e-6, 1e-6);
    let seen = |signs: &[f64]| -> Vec<Observation> {
        let one = |&sign: &f64| Observation {
            lattice: Lattice::new(basis, Matrix4::identity() * (image + sensor)),
            time_gradient: Vector2::new(sign, 0.0),
            speed_error: [0.0; 2],
            sensor: Matrix4::identity() * sensor,
        };
        signs.iter().map(one).collect()
    };
    let parts = |signs: &[f64]| {
        let all = seen(signs);
        let known = at_known_drift(&all).unwrap();
        Statistical::at_known_drift(known, 1.0, &solve(&all).unwrap().lattice.covariance)
    };
    let three = parts(&[1.0, 1.0, -1.0]);
    let drift = (image + sensor) * (3.0 / 8.0 - 1.0 / 3.0);
    for i in 0..4 {
        let expected = [
            (three.image, image / 3.0),
            (three.sensor, sensor / 3.0),
            (three.drift, if i < 2 { drift } else { 0.0 }),
        ];
        for (part, variance) in expected {
            assert!(
                (part[(i, i)] - variance).abs() < 1e-5 * image,
                "{i}: {part}"
            );
        }
    }
    assert!(parts(&[1.0, 1.0, -1.0, -1.0]).drift.norm() < 1e-5 * image);

    // The mean of two lattices splits with the weights of the mean.
    let mean = Statistical::of_mean(&[three, three], 2.0).unwrap();
    assert!((mean.whole() - three.whole()).norm() < 1e-9 * three.whole().norm());
    assert!((mean.drift - three.drift).norm() < 1e-9 * three.whole().norm());
}

/// The three statistical rows add up to σ, whatever the covariance of the lattice, and a drift that
/// nobody knows leaves the total unknown.
#[test]
fn statistical_rows_add_up_to_sigma() {
    let mut lattice = graphene(1.1, 0.001);
    let part = |k: f64| {
        let m = Matrix4::from_fn(|i, j| ((i * 4 + j) as f64 * k).sin());
        m * m.transpose() * 1e-6
    };
    lattice.covariance = part(1.3) + part(2.1) + part(0.7);
    let split = Statistical::at_known_drift([part(1.3), part(0.7)], 1.0, &lattice.covariance);
    let found = inverted(&lattice);
    let settings = Settings::default();
    let budget = Budget::new(&lattice, &found, &split, &settings);
    let sum = budget.sum(Source::is_statistical);
    let difference = (sum.covariance - found.covariance).norm();
    assert!(difference < 1e-9 * found.covariance.norm());
    assert!((sum.magnitude.sqrt() / found.heterostrain().sigma - 1.0).abs() < 1e-9);
    assert!((sum.wavelengths[2].sqrt() / lattice.wavelength(2).sigma - 1.0).abs() < 1e-9);
    if let Some(axis) = found.axis_lab() {
        assert!((sum.axis_lab.sqrt() / axis.sigma - 1.0).abs() < 1e-9);
    }
    assert!(budget.total().covariance[(0, 0)] > sum.covariance[(0, 0)]);

    let left_in = Statistical::without_drift(&part(1.3), &part(0.7));
    let budget = Budget::new(&lattice, &found, &left_in, &settings);
    assert!(!budget.drift_known() && budget.total().covariance[(0, 0)].is_nan());
    assert!(budget.total().wavelengths.iter().all(|v| v.is_nan()));
    assert!(budget.total().magnitude.is_nan() && budget.total().axis_lab.is_nan());
    assert!(budget.known().covariance[(0, 0)] > 0.0 && budget.known().wavelengths[0] > 0.0);
}

/// Nothing is uncertain but the scanner: 1 % of gain is 1 % of every wavelength and of the drift, 4 mrad of shear
/// half of it times the other component. What the user gave as drift keeps its own error.
#[test]
fn totals_hold_what_the_scanner_adds() {
    let lattice = graphene(1.1, 0.001);
    let scanner = |gain_percent: f64, orthogonality_mrad: f64| Settings {
        calibration: Calibration {
            gain_percent,
            mismatch_percent: 0.0,
            orthogonality_mrad,
            ..Calibration::default()
        },
        ..Settings::default()
    };
    let gain = scanner(1.0, 0.0);
    let budget = budget(&lattice, &gain);
    for index in 0..3 {
        let found = budget.wavelength(&lattice, index);
        assert_eq!(found.statistical, 0.0);
        assert!((found.total / found.value - 0.01).abs() < 1e-12);
    }
    let found = inverted(&lattice);
    let twist = budget.twist(&found);
    assert_eq!(twist.value, found.twist);
    assert!(twist.statistical == 0.0 && twist.total > 0.00999 * twist.value);

    let drift = |given: bool| crate::campaign::motion::Drift {
        velocity: Vector2::new(0.5, -0.15),
        covariance: Matrix2::new(9e-6, 0.0, 0.0, 1e-6),
        given,
        fit: None,
        monte_carlo: None,
        joint: None,
    };
    let totals = |settings: &Settings| drift(false).velocities(settings).map(|v| v.total);
    let expected = [9e-6 + 0.005_f64.powi(2), 1e-6 + 0.0015_f64.powi(2)].map(f64::sqrt);
    for (found, expected) in totals(&gain).into_iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-12);
    }
    let [x, _] = totals(&scanner(0.0, 4.0));
    assert!((x - (9e-6 + (0.002_f64 * 0.15).powi(2)).sqrt()).abs() < 1e-12);
    let [x, y] = drift(true).velocities(&gain);
    assert!(x.total == x.statistical && y.total == y.statistical);
}
