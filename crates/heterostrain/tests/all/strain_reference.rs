//! The strain equation against numbers found by other means.

use std::f64::consts::PI;

use heterostrain::Estimate;
use heterostrain::lattice::Lattice;
use heterostrain::material::Material;
use heterostrain::strain::StrainConvention;
use heterostrain::strain::StrainConvention::{KSpace, RealSpace};
use heterostrain::strain::twist_strain;
use heterostrain::strain::{Branch, branches, moire_lattice, naive_twist};
use nalgebra::{Matrix2, Matrix4, Vector2};

fn exact(basis: Matrix2<f64>) -> Lattice {
    Lattice::new(basis, Matrix4::zeros())
}

/// Computed by an independent program: α 37°, θ 1.10°, ε 0.30 %, φ 20°, a 0.246 nm, ν 0.16;
/// columns dual to the harmonics of the atomic vectors at 0° and 60°.
fn reference_lattice() -> Lattice {
    exact(Matrix2::new(
        -2.887_907_7,
        -8.552_447_4,
        13.756_443_9,
        -8.752_641_8,
    ))
}

/// α, θ, ε %, φ, `φ_lab` in degrees; α is given modulo 360° there, and modulo 60° here.
fn assert_branch(found: &Branch, expected: [f64; 5]) {
    let modulo =
        |difference: f64, period: f64| (difference - period * (difference / period).round()).abs();
    let [alpha, theta, strain, axis, axis_lab] = expected;
    let turned = found.lattice_angle.to_degrees();
    assert!(
        modulo(turned - alpha, 60.0) < 6e-4,
        "{found:?} {expected:?}"
    );
    assert!(
        (found.twist.to_degrees() - theta).abs() < 6e-6,
        "{found:?} {expected:?}"
    );
    assert!(
        (found.strain * 100.0 - strain).abs() < 6e-6,
        "{found:?} {expected:?}"
    );
    assert!(
        modulo(found.axis_lab.to_degrees() - axis_lab, 180.0) < 6e-4,
        "{found:?} {expected:?}"
    );
    // Naming layer 1 by a vector 60° further takes 60° off φ.
    let renamed = axis + alpha - turned;
    assert!(
        modulo(found.axis_lattice.to_degrees() - renamed, 180.0) < 1.2e-3,
        "{found:?} {expected:?}"
    );
}

#[test]
fn all_real_space_branches_of_the_reference() {
    let graphene = Material::graphene();
    let found = branches(&reference_lattice(), &graphene, &graphene, RealSpace).unwrap();
    assert_eq!(found.len(), 4);
    assert_branch(&found[0], [37.0, 1.1, 0.3, 20.0, 58.1]);
    assert_branch(&found[1], [44.496, 1.098_61, -0.2985, 106.253, 151.847]);
    assert_branch(&found[2], [-134.413, -1.1, 0.3, 106.807, 151.293]);
    assert_branch(&found[3], [-141.909, -1.098_61, -0.2985, 20.554, 57.546]);
}

#[test]
fn k_space_branches_of_the_reference() {
    let graphene = Material::graphene();
    let found = branches(&reference_lattice(), &graphene, &graphene, KSpace).unwrap();
    assert_eq!(found.len(), 4);
    assert_branch(&found[0], [44.492, 1.098_61, 0.299_25, 106.255, 151.845]);
    assert_branch(&found[1], [36.996, 1.1, -0.299_25, 20.002, 58.098]);
    assert!(found[2].twist < 0.0 && found[3].twist < 0.0);
}

/// Graphene on hBN, hBN being the reference: harmonics computed by an independent program.
#[test]
fn different_layers() {
    let harmonics = Matrix2::new(0.029_116_126, -0.667_897_489, 0.687_855_312, 0.387_425_186);
    let basis = 2.0 * PI * harmonics.transpose().try_inverse().unwrap();
    let mut hbn = Material::graphene();
    hbn.lattice_constant_nm = 0.2504;
    let found = branches(&exact(basis), &hbn, &Material::graphene(), RealSpace).unwrap();
    let expected = [[37.0, 1.1, 0.3], [45.162, 0.955_042, -0.2985]];
    for [alpha, theta, strain] in expected {
        let matches = |b: &&Branch| (b.strain * 100.0 - strain).abs() < 6e-5 && b.twist > 0.0;
        let branch = found.iter().find(matches).expect("the branch");
        assert!(
            (branch.twist.to_degrees() - theta).abs() < 6e-6,
            "{branch:?}"
        );
        assert!(
            (branch.lattice_angle.to_degrees() - alpha).abs() < 6e-4,
            "{branch:?}"
        );
    }
}

#[test]
fn default_is_positive_twist_and_tension() {
    let found = twist_strain(&reference_lattice(), &Material::graphene(), RealSpace).unwrap();
    assert!((found.twist.to_degrees() - 1.1).abs() < 6e-6);
    assert!((found.strain_vector.norm() - 0.003).abs() < 6e-8);
    let axis = found
        .strain_vector
        .y
        .atan2(found.strain_vector.x)
        .to_degrees()
        / 2.0;
    assert!((axis - 58.1).abs() < 6e-4, "{axis}");
    // Without noise the same comes back from the accessors.
    assert!((found.heterostrain().value - 0.003).abs() < 6e-8);
    assert!((found.axis_lattice().unwrap().value.to_degrees() - 20.0).abs() < 6e-4);
}

/// The lattice is the one above, named by a pair 60° apart: sum and second vector.
#[test]
fn forward_model_gives_the_reference_lattice() {
    let degrees = f64::to_radians;
    let lattice = |strain, axis, angle, twist, convention: StrainConvention| {
        let graphene = Material::graphene();
        moire_lattice(
            degrees(twist),
            strain,
            degrees(axis),
            degrees(angle),
            &graphene,
            convention,
        )
    };
    let reference = reference_lattice().basis;
    let named = Matrix2::from_columns(&[
        reference.column(0) + reference.column(1),
        reference.column(1).into(),
    ]);
    let real = lattice(0.003, 20.0, 37.0, 1.1, RealSpace).unwrap();
    assert!(
        same_up_to_sixty_degrees(&real, &named, 2e-7),
        "{real} {named}"
    );
    // The digits of the k-space branch are few: 1e-5 in the angles is 1e-3 nm here.
    let k_space = lattice(0.002_992_5, 106.255, 44.492, 1.098_61, KSpace).unwrap();
    assert!(
        same_up_to_sixty_degrees(&k_space, &named, 1e-3),
        "{k_space} {named}"
    );
}

fn same_up_to_sixty_degrees(found: &Matrix2<f64>, expected: &Matrix2<f64>, tolerance: f64) -> bool {
    let mut named = *expected;
    (0..6).any(|_| {
        named *= Matrix2::new(0.0, -1.0, 1.0, 1.0);
        (found - named).norm() < tolerance
    })
}

/// Written by an independent simulator beside its images: θ 1.083°, ε 0.2 %, φ 35°, α 17°. Its x
/// axis of the layer is an atomic vector, ours a reciprocal one, 30° further: α 47° and φ 5° here.
#[test]
fn truth_record_of_an_independent_simulator() {
    let lattice = exact(Matrix2::new(
        -4.456_104_433_937_484,
        -12.155_847_621_843_764,
        13.061_696_327_043_341,
        2.625_426_573_254_714_4,
    ));
    let found = twist_strain(&lattice, &Material::graphene(), RealSpace).unwrap();
    assert!((found.twist.to_degrees() - 1.083).abs() < 1e-9, "{found:?}");
    assert!(
        (found.lattice_angle.to_degrees() - 47.0).abs() < 1e-7,
        "{found:?}"
    );
    assert!(
        (found.heterostrain().value - 0.002).abs() < 1e-11,
        "{found:?}"
    );
    let axis = found.axis_lattice().unwrap().value.to_degrees();
    assert!((axis - 5.0).abs() < 1e-6, "{axis}");
    let axis_lab = found.axis_lab().unwrap().value.to_degrees();
    assert!(
        (axis_lab - (35.0 + 17.0 + 1.083)).abs() < 1e-6,
        "{axis_lab}"
    );

    let made = moire_lattice(
        1.083_f64.to_radians(),
        0.002,
        5.0_f64.to_radians(),
        47.0_f64.to_radians(),
        &Material::graphene(),
        RealSpace,
    )
    .unwrap();
    let mut lengths: Vec<f64> = (0..3).map(|k| exact(made).wavelength(k).value).collect();
    lengths.sort_by(f64::total_cmp);
    let expected = [
        12.436_136_703_053_593,
        12.969_262_567_068_048,
        13.800_897_712_324_906,
    ];
    for (length, expected) in lengths.iter().zip(expected) {
        assert!((length - expected).abs() < 1e-9, "{length} {expected}");
    }
}

/// Lopes dos Santos et al. 2007, 2012: cos θ = (m² + 4mn + n²) / 2(m² + mn + n²); for |m − n| = 1
/// the moiré cell is the commensurate one, `a √(m² + mn + n²)` wide.
#[test]
fn published_commensurate_cells() {
    let graphene = Material::graphene();
    // (31, 30) is 1.08°, the published magic-angle cell of 11,164 atoms; (7, 6) is 5.09°.
    for (m, n, published_degrees) in [(31.0, 30.0, 1.08), (17.0, 16.0, 2.00), (7.0, 6.0, 5.09)] {
        let norm: f64 = m * m + m * n + n * n;
        let twist = ((m * m + 4.0 * m * n + n * n) / (2.0 * norm)).acos();
        assert!((twist.to_degrees() - published_degrees).abs() < 6e-3);
        let basis = moire_lattice(twist, 0.0, 0.0, 0.1, &graphene, RealSpace).unwrap();
        let length = exact(basis).wavelength(0);
        assert!((length.value - 0.246 * norm.sqrt()).abs() < 1e-9);
        let back = twist_strain(&exact(basis), &graphene, RealSpace).unwrap();
        assert!((back.twist - twist).abs() < 1e-13);
        assert!((naive_twist(length, &graphene).value - twist).abs() < 1e-13);
    }
}

/// The slope of arcsin against a finite difference.
#[test]
fn naive_twist_carries_its_uncertainty() {
    let graphene = Material::graphene();
    let at = |length| naive_twist(Estimate::new(length, 0.0), &graphene).value;
    let slope = (at(12.5 + 1e-4) - at(12.5 - 1e-4)) / 2e-4;
    let found = naive_twist(Estimate::new(12.5, 0.1), &graphene);
    assert!((found.sigma - 0.1 * slope.abs()).abs() < 1e-10);
}

#[test]
fn what_is_no_moire_is_refused() {
    let graphene = Material::graphene();
    let solve = |basis| twist_strain(&exact(basis), &graphene, RealSpace);
    let parallel = Matrix2::from_columns(&[Vector2::new(1.0, 2.0), Vector2::new(2.0, 4.0)]);
    assert!(solve(parallel).is_err());
    assert!(solve(Matrix2::new(f64::NAN, 1.0, 0.0, 1.0)).is_err());
    assert!(solve(Matrix2::zeros()).is_err());
    // A lattice finer than half the atomic one.
    assert!(solve(Matrix2::new(0.1, 0.05, 0.0, 0.0866)).is_err());
    assert!(moire_lattice(0.0, 0.0, 0.0, 0.0, &graphene, RealSpace).is_err());
    let mut nonsense = graphene.clone();
    nonsense.lattice_constant_nm = 0.0;
    assert!(twist_strain(&reference_lattice(), &nonsense, RealSpace).is_err());
}
