//! Two equal layers and the orientation of one of them: which sense the twist has is open, and both solutions are there.
//! In: stackings that are put in. Nothing is simulated.
use heterostrain::lattice::Lattice;
use heterostrain::material::Material;
use heterostrain::strain::twist_strain;
use heterostrain::strain::{KnownOrientation, LatticeDirection, StrainConvention, TwistSense};
use heterostrain::strain::{Stacking, StrainTensor, moire_of};
use moiregauge::drift::Statistical;
use moiregauge::meaning::Budget;
use moiregauge::meaning::{Readings, WaveStrengths, caveats};
use moiregauge::settings::{Calibration, Settings};
use nalgebra::{Matrix2, Matrix4};

/// Homobilayers, half of them turned clockwise, with isotropic strain.
fn stackings() -> impl Iterator<Item = Stacking> {
    (0..36).map(|k| {
        let k = f64::from(k);
        let share = |step: f64| (step * k).fract();
        let sense = if k < 18.0 { -1.0 } else { 1.0 };
        Stacking {
            twist: sense * (0.6 + 1.4 * share(0.618_034)).to_radians(),
            lattice_angle: 6.0 * share(0.414_214),
            strain: 0.003 * share(0.732_051),
            axis_lattice: 3.0 * share(0.236_068),
            biaxial: 0.005 * (share(0.645_751) - 0.5),
        }
    })
}

fn known(layer: u8, angle: f64) -> KnownOrientation {
    KnownOrientation {
        angle_deg: angle.to_degrees() + 60.0 * f64::from(layer),
        sigma_deg: 0.05,
        layer,
        of: LatticeDirection::Reciprocal,
    }
}

/// The settings for a sample of which the orientation of layer 1 is known.
fn settings(made: &Stacking) -> Settings {
    Settings {
        lattice_angle: Some(known(1, made.lattice_angle)),
        calibration: Calibration {
            gain_percent: 0.0,
            mismatch_percent: 0.0,
            orthogonality_mrad: 0.0,
            ..moiregauge::settings::Calibration::default()
        },
        ..Settings::default()
    }
}

fn read(basis: Matrix2<f64>, sigma: f64, settings: &Settings) -> (Readings, Vec<String>) {
    let lattice = Lattice::new(basis, Matrix4::identity() * (sigma * sigma));
    let found = twist_strain(&lattice, settings.bilayer(), settings.strain_convention).unwrap();
    let statistical = Statistical {
        image: lattice.covariance,
        drift: Matrix4::zeros(),
        sensor: Matrix4::zeros(),
    };
    let budget = Budget::new(&lattice, &found, &statistical, settings);
    let readings = Readings::new(
        &lattice,
        &found,
        &budget,
        &WaveStrengths::default(),
        settings,
    );
    let said = caveats("here", &lattice, &found, &readings, settings);
    assert!(said.iter().all(|c| !c.message().contains("is wrong")));
    (
        readings,
        said.into_iter().map(|c| c.code().to_owned()).collect(),
    )
}

fn basis(made: &Stacking) -> Matrix2<f64> {
    moire_of(made, &Material::graphene(), StrainConvention::RealSpace).unwrap()
}

/// Mean strain that was put in.
fn mean(made: &Stacking) -> f64 {
    let ratio = Material::graphene().poisson_ratio;
    let sum = 2.0 + made.strain * (1.0 - ratio);
    (1.0 + made.biaxial) * sum / 2.0 - 1.0
}

fn is(found: &StrainTensor, made: &Stacking) -> bool {
    (found.twist - made.twist).abs() < 1e-10 && (found.mean - mean(made)).abs() < 1e-10
}

/// 18 negative and 18 positive twists: the truth is one of two solutions of equal rank, and that the sense is open is said.
#[test]
fn both_senses_are_there() {
    for made in stackings() {
        let (readings, said) = read(basis(&made), 0.002, &settings(&made));
        let tensor = readings.tensor.as_ref().expect("a tensor");
        let opposite = tensor.opposite.as_ref().expect("another sense");
        assert!(tensor.best.twist > 0.0 && opposite.found.twist < 0.0);
        let right = if made.twist > 0.0 {
            &tensor.best
        } else {
            &opposite.found
        };
        assert!(is(right, &made), "{made:?} {tensor:#?}");
        assert!(said.iter().any(|c| c == "twist-sense-open"), "{said:?}");
        let [low, high] = tensor.magnitudes().unwrap();
        assert!(low < made.twist.abs() && made.twist.abs() < high);
    }
}

/// The sense of the twist, or the orientation of the other layer, leaves the right one.
#[test]
fn the_sense_and_the_other_layer_settle_it() {
    for made in stackings() {
        let sense = if made.twist > 0.0 {
            TwistSense::Positive
        } else {
            TwistSense::Negative
        };
        let given = Settings {
            twist_sense: Some(sense),
            ..settings(&made)
        };
        let both = Settings {
            lattice_angle_2: Some(known(2, made.lattice_angle + made.twist)),
            ..settings(&made)
        };
        for settings in [given, both] {
            let (readings, said) = read(basis(&made), 0.002, &settings);
            let tensor = readings.tensor.as_ref().expect("a tensor");
            assert!(is(&tensor.best, &made), "{made:?} {tensor:#?}");
            assert!(tensor.opposite.is_none() && tensor.disagreement.is_none());
            assert!(said.iter().all(|c| c != "twist-sense-open"), "{said:?}");
        }
    }
}

/// A sense without an orientation tells nothing; an orientation of the other layer that is off by degrees is a
/// contradiction.
#[test]
fn what_settles_nothing_is_said() {
    let made = stackings().next().unwrap();
    let without = Settings {
        lattice_angle: None,
        twist_sense: Some(TwistSense::Negative),
        ..settings(&made)
    };
    let (_, said) = read(basis(&made), 0.002, &without);
    assert!(said.iter().any(|c| c == "twist-sense-unused"), "{said:?}");
    let wrong = Settings {
        lattice_angle_2: Some(known(2, made.lattice_angle + made.twist + 0.15)),
        ..settings(&made)
    };
    let (_, said) = read(basis(&made), 0.002, &wrong);
    assert!(
        said.iter().any(|c| c == "orientations-disagree"),
        "{said:?}"
    );
}

/// Noise on the lattice and on the orientation: the solution of the right sense is off by its σ, whichever sense that is.
#[test]
fn the_right_reading_has_honest_errors() {
    let mut pulls = [0.0; 2];
    let mut count = 0.0;
    for (k, made) in stackings().enumerate() {
        for trial in 0..6 {
            // Even quantiles of a normal distribution in irregular order.
            let normal = |n: usize| {
                let u = (0.618_034 * (7 * k + 41 * trial + 13 * n + 1) as f64
                    + 0.414_214 * ((trial + 1) * (n + 1)) as f64)
                    .fract();
                1.702_f64.recip() * (u / (1.0 - u)).ln() * 0.9386
            };
            let moved = basis(&made) + Matrix2::from_fn(|i, j| 0.01 * normal(2 * i + j));
            let mut settings = settings(&made);
            if let Some(given) = &mut settings.lattice_angle {
                given.angle_deg += given.sigma_deg * normal(5);
            }
            let (readings, _) = read(moved, 0.01, &settings);
            let tensor = readings.tensor.as_ref().expect("a tensor");
            let right = if made.twist > 0.0 {
                tensor.best
            } else {
                tensor.opposite.as_ref().expect("another sense").found
            };
            pulls[0] += ((right.twist - made.twist) / right.twist().sigma).powi(2);
            pulls[1] += ((right.mean - mean(&made)) / right.mean().sigma).powi(2);
            count += 1.0;
        }
    }
    for sum in pulls {
        let rms = (sum / count).sqrt();
        assert!((0.75..1.3).contains(&rms), "{rms}");
    }
}
