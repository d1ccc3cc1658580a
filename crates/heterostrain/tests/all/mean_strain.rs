//! Mean strain, alignment, and the exchange of layers, against closed forms.

use heterostrain::lattice::Lattice;
use heterostrain::material::Bilayer;
use heterostrain::strain::StrainConvention;
use heterostrain::strain::StrainConvention::{KSpace, RealSpace};
use heterostrain::strain::{Orientation, Stacking, branches, moire_of, strain_tensors};
use heterostrain::strain::{degeneracy, twist_strain};

use crate::two_layers::{exact, named};

/// The error of the mean strain of equal layers is `θ σ_α`: 0.0034, 0.010, 0.034 and 0.10 % for 0.1°, 0.3°, 1° and
/// 3° at 1.126°.
#[test]
fn error_of_the_mean_strain_is_that_of_the_orientation_times_the_twist() {
    let graphene = named("graphene");
    for twist_deg in [0.5_f64, 1.126, 1.95] {
        let made = Stacking {
            twist: twist_deg.to_radians(),
            lattice_angle: 0.3,
            ..Stacking::default()
        };
        let lattice = exact(moire_of(&made, &graphene, RealSpace).unwrap());
        for sigma_deg in [0.1_f64, 0.3, 1.0, 3.0] {
            let orientation = Orientation {
                angle: 0.3,
                sigma: sigma_deg.to_radians(),
                of_reference: true,
            };
            let found = strain_tensors(&lattice, &graphene, &orientation).unwrap()[0];
            let expected = made.twist * sigma_deg.to_radians();
            // η is that of reciprocal vectors; sin θ for θ at second order.
            assert!(
                (found.mean().sigma / expected - 1.0).abs() < 1e-3,
                "{found:?}"
            );
        }
    }
}

/// An ignored isotropic strain η shifts the twist by θη/2 + η²/2θ: at 1.126° by 0.0014°, 0.0069° and
/// 0.0147° for 0.08, 0.2 and 0.3 %.
#[test]
fn the_circle_of_isotropic_strains() {
    let graphene = named("graphene");
    for (eta, degrees) in [(0.0008, 0.0014), (0.002, 0.0069), (0.003, 0.0147)] {
        // The published numbers are for η of the reciprocal lattice, 1 + η = 1/(1 + ε_b).
        let made = Stacking {
            twist: 1.126_f64.to_radians(),
            lattice_angle: 0.3,
            biaxial: 1.0 / (1.0 + eta) - 1.0,
            ..Stacking::default()
        };
        let lattice = exact(moire_of(&made, &graphene, RealSpace).unwrap());
        let found = twist_strain(&lattice, &graphene, RealSpace).unwrap();
        let shift = found.twist.to_degrees() - 1.126;
        assert!((shift - degrees).abs() < 1e-4, "{eta} {shift}");
        // Exactly |(1+η) e^{iθ} − 1|.
        let chord = (1.0 + (1.0 + eta) * (1.0 + eta) - 2.0 * (1.0 + eta) * made.twist.cos()).sqrt();
        assert!((2.0 * (chord / 2.0).asin() - found.twist).abs() < 1e-12);
        let told = degeneracy(
            &lattice,
            (&graphene).into(),
            RealSpace,
            found.twist(),
            0.0005,
        )
        .unwrap();
        assert_eq!(told.shifts.len(), 4);
    }
}

/// Graphene on hBN at 1.1°: 0.1 % of isotropic strain is 0.053°, and it goes to either side.
#[test]
fn different_layers_trade_at_first_order() {
    let (graphene, hbn) = (named("graphene"), named("hBN"));
    let layers = Bilayer {
        stretched: &graphene,
        reference: &hbn,
        waves: None,
    };
    let made = Stacking {
        twist: 1.1_f64.to_radians(),
        lattice_angle: 37_f64.to_radians(),
        ..Stacking::default()
    };
    let lattice = exact(moire_of(&made, layers, RealSpace).unwrap());
    let found = twist_strain(&lattice, layers, RealSpace).unwrap();
    assert!((found.twist - made.twist).abs() < 1e-12);
    let told = degeneracy(&lattice, layers, RealSpace, found.twist(), 0.0005).unwrap();
    let shift = |h: f64| {
        let (_, change) = told.shifts.iter().find(|(x, _)| *x == h).unwrap();
        change.unwrap().to_degrees()
    };
    // dθ/dη = −[κ − cos θ]/sin θ at η = 0, and η of the reciprocal lattice is −h.
    let slope = (0.2504 / 0.246 - made.twist.cos()) / made.twist.sin();
    let expected = (0.001 * slope).to_degrees();
    assert!((expected - 0.053).abs() < 1e-3);
    let central = (shift(0.001) - shift(-0.001)) / 2.0;
    assert!(
        (central / expected - 1.0).abs() < 0.01,
        "{central} {expected}"
    );
}

/// Near alignment `σ_θ = |p| σ_p / (κ sin θ)`; at θ = 0 and beyond it stays finite.
#[test]
fn errors_near_alignment() {
    let (graphene, hbn) = (named("graphene"), named("hBN"));
    let layers = Bilayer {
        stretched: &graphene,
        reference: &hbn,
        waves: None,
    };
    let ratio: f64 = 0.2504 / 0.246;
    for twist_deg in [0.05_f64, 0.2, 1.0] {
        let twist = twist_deg.to_radians();
        let made = Stacking {
            twist,
            lattice_angle: 0.2,
            ..Stacking::default()
        };
        let basis = moire_of(&made, layers, RealSpace).unwrap();
        // A common relative error of the lattice is one of |p|.
        let flat = exact(basis).flat() * 1e-4;
        let lattice = Lattice::new(basis, flat * flat.transpose());
        let found = twist_strain(&lattice, layers, RealSpace).unwrap();
        let p = (1.0 + ratio * ratio - 2.0 * ratio * twist.cos()).sqrt();
        let expected = p * (1e-4 * p) / (ratio * twist.sin());
        assert!((found.twist().sigma / expected - 1.0).abs() < 1e-6);
    }
    // 1 % larger than aligned layers make it: read as aligned, with a σ that the size leaves.
    let aligned = Stacking {
        lattice_angle: 0.2,
        ..Stacking::default()
    };
    let basis = moire_of(&aligned, layers, RealSpace).unwrap() * 1.01;
    let flat = exact(basis).flat() * 1e-3;
    let lattice = Lattice::new(basis, flat * flat.transpose());
    let found = twist_strain(&lattice, layers, RealSpace).unwrap();
    assert_eq!(found.twist, 0.0);
    let p = (ratio - 1.0) / 1.01;
    let expected = (2.0 * p * 1e-3 * p / ratio).sqrt();
    assert!((found.twist().sigma / expected - 1.0).abs() < 1e-3);
    assert!(found.covariance.iter().all(|x| x.is_finite()));
    assert!(branches(&lattice, &hbn, &graphene, RealSpace).is_err());
    // Twice as large is no moiré of these layers.
    let far = exact(basis * 2.0);
    assert!(twist_strain(&far, layers, RealSpace).is_err());
}

/// Calling the other layer the reference turns (θ, ε) into (−θ, −ε): right to second order in twist,
/// strain and mismatch, so that halving all three must quarter the difference. Strain in layer 2 on one side,
/// in layer 1 on the other.
#[test]
fn exchange_of_different_layers() {
    let first = named("WSe2");
    let of = |scale: f64| {
        let mut second = first.clone();
        second.lattice_constant_nm *= 1.0 - 0.01 * scale;
        let made = Stacking {
            twist: 0.02 * scale,
            lattice_angle: 0.4,
            strain: 0.003 * scale,
            axis_lattice: 0.6,
            biaxial: 0.0,
        };
        let plain = Bilayer {
            stretched: &first,
            reference: &second,
            waves: None,
        };
        let swapped = Bilayer {
            stretched: &second,
            reference: &first,
            waves: None,
        };
        let basis = moire_of(&made, plain, RealSpace).unwrap();
        let all = branches(
            &exact(basis),
            swapped.reference,
            swapped.stretched,
            RealSpace,
        )
        .unwrap();
        all.into_iter()
            .map(|b| (b.twist + made.twist).abs() + (b.strain + made.strain).abs())
            .fold(f64::INFINITY, f64::min)
    };
    let (large, small) = (of(1.0), of(0.5));
    assert!(small < 0.01 * 0.01, "{small}");
    assert!((large / small - 4.0).abs() < 0.5, "{large} {small}");
}

/// The two forms of the equation see one biaxial strain with opposite signs.
#[test]
fn biaxial_strain_in_both_forms() {
    let graphene = named("graphene");
    let of = |biaxial: f64, form: StrainConvention| {
        let made = Stacking {
            twist: 0.02,
            lattice_angle: 0.1,
            biaxial,
            ..Stacking::default()
        };
        moire_of(&made, &graphene, form).unwrap()
    };
    let difference = of(0.002, RealSpace) - of(1.0 / 1.002 - 1.0, KSpace);
    assert!(difference.norm() < 1e-12);
}
