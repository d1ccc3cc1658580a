//! Twist and strain of one lattice in closed form, and a thousand draws of it.
//!
//! `cargo bench -p moiregauge --bench strain`. The published way needs a minimisation for each draw.

use divan::Bencher;
use heterostrain::lattice::Lattice;
use heterostrain::material::Material;
use heterostrain::strain::StrainConvention;
use heterostrain::strain::{draws, twist_strain};
use moiregauge::numbers::normals;
use nalgebra::{Matrix2, Matrix4};

fn main() {
    divan::main();
}

/// 1.10° and 0.3 % in graphene: the pair of shortest vectors about 60° apart.
fn lattice() -> Lattice {
    Lattice::new(
        Matrix2::new(-2.887_907_7, 8.552_447_4, 13.756_443_9, 8.752_641_8),
        Matrix4::identity() * 0.01_f64.powi(2),
    )
}

#[divan::bench]
fn closed_form(bencher: Bencher<'_, '_>) {
    let (lattice, graphene) = (lattice(), Material::graphene());
    bencher.bench(|| {
        let lattice = divan::black_box(&lattice);
        twist_strain(lattice, &graphene, StrainConvention::RealSpace).expect("a solution")
    });
}

#[divan::bench(sample_count = 100)]
fn a_thousand_draws(bencher: Bencher<'_, '_>) {
    let (lattice, graphene) = (lattice(), Material::graphene());
    let convention = StrainConvention::RealSpace;
    bencher.bench(|| {
        draws(
            divan::black_box(&lattice),
            &graphene,
            convention,
            1000,
            normals(1, "strain", 0),
        )
    });
}
