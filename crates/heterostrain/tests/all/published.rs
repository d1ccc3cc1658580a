//! Numbers and formulas of the literature, each with its source and its convention.

use heterostrain::Estimate;
use heterostrain::lattice::{MoireCell, WavelengthMeaning, from_wavelengths};
use heterostrain::material::Bilayer;
use heterostrain::strain::StrainConvention::{KSpace, RealSpace};
use heterostrain::strain::twist_strain;
use heterostrain::strain::{Stacking, branches, moire_of, naive_twist};
use nalgebra::{Matrix2, Rotation2, Vector2};

use crate::two_layers::{exact, named};

fn cell(stacking: &Stacking, layers: Bilayer<'_>) -> MoireCell {
    MoireCell::new(&moire_of(stacking, layers, RealSpace).unwrap()).unwrap()
}

fn twisted(degrees: f64) -> Stacking {
    Stacking {
        twist: degrees.to_radians(),
        ..Stacking::default()
    }
}

/// Cao et al. 2018, arXiv 1803.02342 and 1802.00553: a full band holds `n_s = 4/A`, `A ≈ √3a²/2θ²`, a = 0.246 nm;
/// 2.7·10¹² per cm² at 1.08°.
#[test]
fn carrier_density_of_magic_angle_graphene() {
    let graphene = named("graphene");
    let found = cell(&twisted(1.08), (&graphene).into());
    let density = 1e14 * found.density(4.0);
    assert!((density / 1e12 - 2.7).abs() < 0.05, "{density}");
    for degrees in [1.05_f64, 1.08, 1.16] {
        let found = cell(&twisted(degrees), (&graphene).into());
        let theta = degrees.to_radians();
        let published = 3.0_f64.sqrt() * 0.246 * 0.246 / (2.0 * theta * theta);
        assert!((found.area / published - 1.0).abs() < 1e-4);
    }
}

/// The period of the magic angle, 1.1°, lies between 12.8 and 13.4 nm (1.05°); Kerelsky et al. 2019, arXiv
/// 1812.08776, λ = a/(2 sin(θ/2)), also for their 0.79°.
#[test]
fn periods_of_twisted_graphene() {
    let graphene = named("graphene");
    for (degrees, period) in [(1.1_f64, 12.8), (1.05, 13.4), (0.79, 17.8)] {
        let found = cell(&twisted(degrees), (&graphene).into());
        for length in found.wavelengths() {
            assert!((length - period).abs() < 0.05, "{degrees}° {length}");
        }
    }
}

/// Yankowitz et al. 2012, Nature Physics 8, 382: with the mismatch δ = 1.8 % and the twist φ of graphene on hBN
/// `λ = (1+δ)a/√(2(1+δ)(1−cos φ)+δ²)`, 13.9 nm at most, and the moiré lies at ϑ against graphene, `tan ϑ =
/// sin φ/((1+δ) − cos φ)`.
#[test]
fn graphene_on_boron_nitride() {
    let graphene = named("graphene");
    let mut hbn = named("hBN");
    hbn.lattice_constant_nm = 1.018 * graphene.lattice_constant_nm;
    let layers = Bilayer {
        stretched: &graphene,
        reference: &hbn,
        waves: None,
    };
    let aligned = cell(&twisted(0.0), layers);
    assert!((aligned.wavelengths()[0] - 13.9).abs() < 0.05);
    // The constants of the table: "about 14 nm".
    let table = Bilayer {
        stretched: &graphene,
        reference: &named("hBN"),
        waves: None,
    };
    assert!((cell(&twisted(0.0), table).wavelengths()[0] - 14.0).abs() < 0.05);
    for degrees in [0.0_f64, 0.3, 1.0, 2.5, 10.0] {
        let phi = degrees.to_radians();
        let found = cell(&twisted(degrees), layers);
        let (delta, a) = (0.018_f64, 0.246);
        let root = (2.0 * (1.0 + delta) * (1.0 - phi.cos()) + delta * delta).sqrt();
        let published = (1.0 + delta) * a / root;
        for length in found.wavelengths() {
            assert!((length - published).abs() < 1e-9, "{degrees}: {length}");
        }
        // Directions are those of graphene's own lattice, modulo 60°. Graphene is turned by +φ against hBN,
        // that is hBN by −φ against graphene.
        let turn = phi.sin().atan2(1.0 + delta - phi.cos());
        let direction = found.vectors[0].y.atan2(found.vectors[0].x);
        let of_graphene = 30_f64.to_radians() + phi;
        let off = direction - of_graphene;
        let near = |expected: f64| {
            let d = (off - expected) / 60_f64.to_radians();
            (d - d.round()).abs() < 1e-9
        };
        assert!(near(turn) || near(-turn), "{degrees}: {off} {turn}");
        // One wavelength gives the twist back.
        let back = naive_twist(Estimate::new(published, 0.0), layers);
        if degrees > 0.0 {
            assert!((back.value - phi).abs() < 1e-9);
        }
    }
}

/// Aligned WS₂/WSe₂ has a moiré of about 8 nm (Regan et al. 2020, Nature 579, 359; Tang et al. 2020, Nature
/// 579, 353); MoSe₂/WSe₂, with a mismatch of 0.2 %, one of 19 nm at 1° (Tran et al. 2019, Nature 567, 71).
#[test]
fn dichalcogenide_heterobilayers() {
    let [ws2, wse2, mose2] = ["WS2", "WSe2", "MoSe2"].map(named);
    for (upper, lower, degrees, period, within) in [
        (&wse2, &ws2, 0.0, 8.0, 0.1),
        (&ws2, &wse2, 0.0, 8.0, 0.1),
        (&mose2, &wse2, 1.0, 19.0, 0.5),
    ] {
        let layers = Bilayer {
            stretched: upper,
            reference: lower,
            waves: None,
        };
        let found = cell(&twisted(degrees), layers).wavelengths()[0];
        assert!((found - period).abs() < within, "{} {found}", layers.name());
    }
}

/// Halbertal et al. 2022, ACS Nano 16, 1471: for vectors of lengths l₁, l₂ at Δφ the shear part is
/// `a √(l₁² + l₂² − 2 l₁ l₂ cos(Δφ − 60°)) / (2 l₁ l₂ sin Δφ)`, whatever the orientation of the lattice; it is
/// the deviator of the stretch of reciprocal vectors, ε(1+ν)/2 in the k-space form. Their figure 3 has
/// graphene, l₁ = l₂ = 10 nm and Δφ around 60°, where θ = 2 arcsin(a/2λ).
#[test]
fn shear_by_two_lengths_and_an_angle() {
    let graphene = named("graphene");
    let (a, nu) = (graphene.lattice_constant_nm, graphene.poisson_ratio);
    for (l1, l2, degrees) in [
        (10.0, 10.0, 60.0_f64),
        (10.0, 10.0, 57.0),
        (10.0, 10.0, 64.0),
        (12.3, 11.1, 58.0),
        (14.0, 13.0, 66.0),
    ] {
        let angle = degrees.to_radians();
        let basis = Matrix2::new(l1, l2 * angle.cos(), 0.0, l2 * angle.sin());
        let found = twist_strain(&exact(basis), &graphene, KSpace).unwrap();
        let about = (degrees - 60.0).to_radians().cos();
        let root = (l1 * l1 + l2 * l2 - 2.0 * l1 * l2 * about).max(0.0).sqrt();
        let published = a * root / (2.0 * l1 * l2 * angle.sin());
        let shear = found.strain_vector.norm() * (1.0 + nu) / 2.0;
        assert!((shear - published).abs() < 1e-12, "{shear} {published}");
        if degrees == 60.0 && l1 == l2 {
            assert!((found.twist - 2.0 * (a / (2.0 * l1)).asin()).abs() < 1e-12);
        }
    }
}

/// The fit of Kerelsky et al. 2019 and Kazmierczak et al. 2021 (arXiv 2008.09761): layer 1 strained, layer 2
/// turned, `M = R(θ) − R(−φ) diag(1/(1+ε), 1/(1−νε)) R(φ)`, and three wavelengths `4π/(√3|M k_j|)`: the k-space
/// meaning. Their twist and strain come back.
#[test]
fn three_wavelengths_of_the_published_fit() {
    let graphene = named("graphene");
    let k = 4.0 * std::f64::consts::PI / (3.0_f64.sqrt() * 0.246);
    let turn = |angle: f64| Rotation2::new(angle).into_inner();
    for (theta_deg, axis_deg, strain) in [
        (1.1_f64, 25.0_f64, 0.002),
        (0.79, 70.0, 0.006),
        (2.0, 5.0, 0.004),
    ] {
        let principal = Matrix2::new(1.0 / (1.0 + strain), 0.0, 0.0, 1.0 / (1.0 - 0.16 * strain));
        let axis = axis_deg.to_radians();
        let m = turn(theta_deg.to_radians()) - turn(-axis) * principal * turn(axis);
        let lengths = [0.0_f64, 60.0, 120.0].map(|degrees| {
            let wave = k * Vector2::new(degrees.to_radians().cos(), degrees.to_radians().sin());
            4.0 * std::f64::consts::PI / (3.0_f64.sqrt() * (m * wave).norm())
        });
        let lattice = from_wavelengths(lengths, [0.0; 3], WavelengthMeaning::KSpace).unwrap();
        let found = branches(&lattice, &graphene, &graphene, RealSpace).unwrap();
        let hit = found.iter().any(|b| {
            (b.twist.abs().to_degrees() - theta_deg).abs() < 1e-8
                && (b.strain - strain).abs() < 1e-10
        });
        assert!(hit, "{theta_deg} {found:#?}");
        // Taken for lengths of real-space vectors they mean something else.
        let mistaken = from_wavelengths(lengths, [0.0; 3], WavelengthMeaning::RealSpace).unwrap();
        let other = twist_strain(&mistaken, &graphene, RealSpace).unwrap();
        assert!((other.twist.to_degrees() - theta_deg).abs() > 1e-3);
    }
}
