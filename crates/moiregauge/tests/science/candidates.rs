//! The lattices that were compared, against known ones.

use moiregauge::frame::{Background, Geometry};
use moiregauge::lattice::measure;
use moiregauge::spectrum::Method;
use nalgebra::{Matrix2, Vector2};

use crate::fit_scene::{Contrast, Scene, Wave};

/// (columns, rows) and the distance of pixels along columns and rows, nm: exchanged axes would show.
const SIZE: [usize; 2] = [170, 130];
const PITCH: [f64; 2] = [0.31, 0.40];

/// Lengths of the three vectors of a lattice (pixels), nm, shortest first.
fn wavelengths(basis: &Matrix2<f64>) -> [f64; 3] {
    let basis = Matrix2::new(PITCH[0], 0.0, 0.0, PITCH[1]) * basis;
    let [a, b] = [0, 1].map(|i| basis.column(i).into_owned());
    sorted([a.norm(), b.norm(), (b - a).norm()])
}

fn sorted(mut lengths: [f64; 3]) -> [f64; 3] {
    lengths.sort_by(f64::total_cmp);
    lengths
}

/// Of two moirés in one frame that is turned each is listed with its own wavelengths and with its share of the variance: ½ Σ A² over all, noise included.
#[test]
fn candidates_are_the_lattices_of_the_image() {
    for seed in 0..4 {
        let mut both = Scene::new(SIZE, 8.0, 0.4, Contrast::Cosines, seed);
        both.white = 0.5;
        let other = Scene::new(SIZE, 10.3, 0.9, Contrast::Cosines, seed + 100);
        both.waves.extend(other.waves.iter().map(|wave| Wave {
            amplitude: 0.6,
            ..*wave
        }));
        let geometry = Geometry::of_pitch(SIZE, PITCH, 0.7, Vector2::new(5.0, -3.0)).unwrap();
        let found = measure(&both.image(), &geometry, Background::Plane, Method::Lattice).unwrap();
        let candidates = &found.evidence.as_ref().unwrap().candidates;
        let all = 1.5 * (1.0 + 0.36) + 0.25;
        for (candidate, (scene, share, room)) in candidates
            .iter()
            .zip([(&both, 1.5, 0.003), (&other, 0.54, 0.01)])
        {
            let pairs = sorted(candidate.wavelengths)
                .into_iter()
                .zip(wavelengths(&scene.basis));
            for (length, wanted) in pairs {
                assert!(
                    (length / wanted - 1.0).abs() < room,
                    "{seed}: {length} {wanted}"
                );
            }
            let off = candidate.share - share / all;
            assert!(
                off.abs() < 0.03,
                "{seed}: {} {}",
                candidate.share,
                share / all
            );
        }
        assert!(candidates[0].behind == 0.0 && candidates[1].behind > 4.0);
    }
}
