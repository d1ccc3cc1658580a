//! Every name of a lattice: the truth is among the solutions up to the strain that is stated, and what decides among them.
//! The forward equation is written out here once more, without the names of the library.
use std::f64::consts::{PI, TAU};

use heterostrain::lattice::Lattice;
use heterostrain::material::{Bilayer, Material};
use heterostrain::strain::twist_strain;
use heterostrain::strain::{KnownOrientation, LatticeDirection, StrainConvention};
use heterostrain::strain::{LatticeName, solutions};
use moiregauge::caveat::ChosenBy;
use moiregauge::drift::Statistical;
use moiregauge::meaning::Budget;
use moiregauge::meaning::{NameReading, Readings, Standing, WaveStrengths, caveats};
use moiregauge::settings::Settings;
use nalgebra::{Matrix2, Matrix4, Rotation2};

/// Numbers between 0 and 1 that look random.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// θ, ε, φ, α; rad.
#[derive(Clone, Copy, Debug)]
struct Truth([f64; 4]);

fn turn(angle: f64) -> Matrix2<f64> {
    Rotation2::new(angle).into_inner()
}

/// The moiré of `R(α)[R(θ)S⁻¹K − 1]`, without any choice of its vectors.
fn basis(Truth([twist, strain, axis, angle]): Truth, layers: Bilayer<'_>) -> Matrix2<f64> {
    let ratio = layers.stretched.poisson_ratio;
    let atoms = layers.reference.atomic_pair();
    let other = layers.stretched.atomic_pair();
    let stretch =
        turn(axis) * Matrix2::new(1.0 + strain, 0.0, 0.0, 1.0 - ratio * strain) * turn(-axis);
    let first = turn(angle) * atoms;
    let second = turn(angle + twist) * stretch * other;
    let dual = |m: Matrix2<f64>| m.try_inverse().unwrap().transpose();
    dual(dual(second) - dual(first))
}

fn exact(basis: Matrix2<f64>) -> Lattice {
    Lattice::new(basis, Matrix4::identity() * 1e-8)
}

fn modulo(a: f64, period: f64) -> f64 {
    let r = a.rem_euclid(period);
    r.min(period - r)
}

fn layers(pair: &[Material; 2]) -> Bilayer<'_> {
    Bilayer {
        stretched: &pair[0],
        reference: &pair[1],
        waves: None,
    }
}

/// 0.1 to 2°, strains up to the bound, equal layers of two kinds and graphene on hBN: what was put in is one of the
/// solutions to 10⁻⁹, whatever pair of vectors the lattice comes with.
#[test]
fn the_truth_is_always_listed() {
    let mut numbers = Numbers(3);
    let graphene = Material::graphene();
    let named = |name: &str| Material::named(name).unwrap();
    let pairs = [
        [graphene.clone(), graphene.clone()],
        [named("WTe2 1T'"), named("WTe2 1T'")],
        [graphene, named("hBN")],
    ];
    let changes = [
        [1.0, 0.0, 0.0, 1.0],
        [2.0, 1.0, 1.0, 1.0],
        [1.0, -3.0, 0.0, 1.0],
    ];
    let (mut strongest, mut others) = (0.0_f64, 0);
    for trial in 0..240 {
        let pair = &pairs[trial % 3];
        let layers = layers(pair);
        let sense = if numbers.next() < 0.5 { -1.0 } else { 1.0 };
        let truth = Truth([
            sense * numbers.between(0.1, 2.0).to_radians(),
            numbers.between(-0.01, 0.01),
            numbers.between(0.0, PI),
            numbers.between(0.0, TAU),
        ]);
        let [a, b, c, d] = changes[trial % changes.len()];
        let lattice = exact(basis(truth, layers) * Matrix2::new(a, b, c, d));
        let found = solutions(&lattice, layers, StrainConvention::RealSpace).unwrap();
        if truth.0[1].abs() > found.complete_to {
            continue;
        }
        let [twist, strain, axis, angle] = truth.0;
        let lab = axis + angle + twist;
        let hit = found.branches.iter().find(|b| {
            (b.twist - twist).abs() < 1e-9
                && (b.strain - strain).abs() < 1e-9
                && modulo(b.axis_lab - lab, PI) * strain.abs() < 1e-9
                && modulo(b.lattice_angle - angle, layers.reference.rotation_period()) < 1e-6
        });
        assert!(hit.is_some(), "{} {truth:?}", layers.name());
        strongest = strongest.max(strain.abs() / twist.abs());
        // The name says which waves are meant: the same solution comes back from them alone.
        let hit = hit.unwrap();
        let waves = hit.name.waves(&lattice.basis);
        let again = twist_strain(
            &lattice,
            Bilayer { waves, ..layers },
            StrainConvention::RealSpace,
        );
        if strain > 0.0 {
            let again = again.unwrap();
            assert!(
                (again.twist - twist.abs()).abs() < 1e-9,
                "{truth:?} {again:?}"
            );
        }
        others += usize::from(hit.name != found.branches[0].name);
    }
    assert!(strongest > 2.0 && others > 20, "{strongest} {others}");
}

/// The bound is 1 % for all but the smallest twists, and said.
#[test]
fn the_bound_is_one_per_cent() {
    let graphene = Material::graphene();
    for (twist, bound) in [(0.1_f64, 0.005), (0.3, 0.01), (1.1, 0.01)] {
        let truth = Truth([twist.to_radians(), 0.001, 0.3, 0.2]);
        let lattice = exact(basis(truth, (&graphene).into()));
        let found = solutions(&lattice, &graphene, StrainConvention::RealSpace).unwrap();
        assert!(found.complete_to >= bound && found.complete_to <= 0.01);
    }
}

fn read(truth: Truth, settings: &Settings) -> (Readings, Vec<String>) {
    let lattice = exact(basis(truth, settings.bilayer()));
    let found = twist_strain(&lattice, settings.bilayer(), settings.strain_convention).unwrap();
    let statistical = Statistical {
        image: lattice.covariance,
        drift: Matrix4::zeros(),
        sensor: Matrix4::zeros(),
    };
    let budget = Budget::new(&lattice, &found, &statistical, settings);
    let none = WaveStrengths::default();
    let readings = Readings::new(&lattice, &found, &budget, &none, settings);
    let said = caveats("here", &lattice, &found, &readings, settings);
    (
        readings,
        said.into_iter().map(|c| c.code().to_owned()).collect(),
    )
}

/// Without an image names compete at 0.3° and 0.35 %; they do not in ordinary samples.
#[test]
fn ordinary_samples_have_one_name() {
    let settings = Settings::default();
    let mut numbers = Numbers(11);
    let mut alarms = 0;
    for _ in 0..100 {
        let truth = Truth([
            numbers.between(0.9, 1.5).to_radians(),
            numbers.between(0.0, 0.003),
            numbers.between(0.0, PI),
            numbers.between(0.0, TAU),
        ]);
        let (readings, said) = read(truth, &settings);
        alarms += usize::from(!said.is_empty());
        assert_eq!(readings.naming.unwrap().chosen_by, ChosenBy::LeastStrain);
    }
    assert_eq!(alarms, 0);
    // At 0.3° and 0.35 % the reported pair is right or wrong by the axis of the strain; the truth is among those that
    // are open either way.
    let mut wrong = 0;
    for k in 0..12 {
        let small = Truth([0.3_f64.to_radians(), 0.0035, 0.26 * f64::from(k), 0.17]);
        let (readings, said) = read(small, &settings);
        assert!(said.iter().any(|c| c == "names-compete"), "{said:?}");
        let naming = readings.naming.unwrap();
        let is_true = |n: &NameReading| (n.strain - 0.0035).abs() < 1e-9;
        assert!(
            is_true(&naming.names[0]) || naming.open().any(is_true),
            "{naming:?}"
        );
        wrong += usize::from(!is_true(&naming.names[0]));
    }
    assert!(wrong > 2, "{wrong}");
}

/// An orientation tells names apart where the wrong one needs isotropic strain, and the waves that the user names are taken.
#[test]
fn an_orientation_and_the_user_decide() {
    let mut numbers = Numbers(5);
    let (mut settled, mut wrong) = (0, 0);
    for _ in 0..40 {
        let truth = Truth([
            0.4_f64.to_radians(),
            0.0055,
            numbers.between(0.0, PI),
            numbers.between(0.0, TAU),
        ]);
        let known = KnownOrientation {
            angle_deg: truth.0[3].to_degrees(),
            sigma_deg: 0.1,
            layer: 1,
            of: LatticeDirection::Reciprocal,
        };
        let settings = Settings {
            lattice_angle: Some(known),
            isotropic_strain_percent: 0.02,
            ..Settings::default()
        };
        let (readings, _) = read(truth, &settings);
        let naming = readings.naming.unwrap();
        let right = naming
            .names
            .iter()
            .find(|n| (n.strain - 0.0055).abs() < 1e-6);
        let right = right.expect("the truth is listed");
        wrong += usize::from(right.standing == Standing::AgainstOrientation);
        settled += usize::from(
            naming
                .names
                .iter()
                .any(|n| n.standing == Standing::AgainstOrientation),
        );
        let lattice = basis(truth, settings.bilayer());
        let waves = right.name.waves(&lattice).unwrap();
        let named = Settings {
            moire_waves: Some([0, 1].map(|i| [waves[(0, i)], waves[(1, i)]])),
            ..settings
        };
        let (readings, _) = read(truth, &named);
        assert!((readings.solutions[0].strain - 0.0055).abs() < 1e-9);
    }
    assert!(wrong == 0 && settled > 10, "{wrong} {settled}");
}

/// The third wave of a first shell is the sum of the two.
#[test]
fn the_first_shell_of_a_name() {
    let shell = LatticeName([[1, 0], [-1, 1]]).first_shell();
    assert_eq!(shell, [[1, 0], [-1, 1], [0, 1]]);
}
