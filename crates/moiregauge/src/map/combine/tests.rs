//! Averages of maps against lattices that are known.

use super::*;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::map::tests::{map_of, map_of_image, rms};
use crate::simulate::field::FieldScene;

/// Two halves of the noise average to less, and what they share is found.
#[test]
fn maps_of_one_place_are_averaged() {
    let scene = FieldScene::rippled(400, 25.0, 0.03);
    let geometry = Geometry {
        size: [400, 400],
        pixel_to_nm: Matrix2::identity(),
        origin: Vector2::zeros(),
        covariance: Matrix4::zeros(),
        from_sensors: false,
        departure: None,
    };
    let one = |seed: u64, white: f64| {
        let scene = FieldScene {
            white,
            seed,
            ..scene.clone()
        };
        LatticeMap::new(&map_of(&scene, Some(14.0)), &geometry).unwrap()
    };
    let (a, b) = (one(1, 1.0), one(2, 1.0));
    let (both, agreement) = combine(&[&a, &b]).unwrap();
    let agreement = agreement.unwrap();
    assert!((agreement.chi2_per_dof - 1.0).abs() < 0.15, "{agreement:?}");
    let mut found = Vec::new();
    for (i, node) in both.nodes.iter().enumerate() {
        if node.mask == Mask::Good {
            let error = node.waves.basis - scene.waves(both.grid.place(i));
            found.push(error.m11 / node.waves.covariance[(0, 0)].sqrt());
        }
    }
    assert!((0.8..1.2).contains(&rms(&found)), "{}", rms(&found));
    // The same image twice says nothing new: χ² is 0, and the errors stay those of one.
    let (same, agreement) = combine(&[&a, &a]).unwrap();
    assert!(agreement.unwrap().chi2_per_dof < 1e-9);
    let node = same
        .nodes
        .iter()
        .position(|n| n.mask == Mask::Good)
        .unwrap();
    let near = (0..a.grid.len()).min_by(|&i, &j| {
        let away = |n: usize| (a.grid.place(n) - same.grid.place(node)).norm();
        away(i).total_cmp(&away(j))
    });
    let ratio =
        same.nodes[node].waves.covariance[(0, 0)] / a.nodes[near.unwrap()].waves.covariance[(0, 0)];
    assert!((0.9..1.1).contains(&ratio), "{ratio}");
}

/// Noise of an image without a lattice.
fn noise_alone(size: usize, white: f64, seed: u64) -> Vec<f64> {
    let mut scene = FieldScene::hexagonal([size, size], 20.0, 0.0);
    scene.harmonics.clear();
    (scene.white, scene.seed) = (white, seed);
    scene.image().values
}

/// Root mean square of errors over stated errors, of averages of four frames with two lines each, whose noise has a part
/// that is the sample's (in all images), one of the frame's and one of the line's own.
fn pulls_of_averages([sample, frame, own]: [f64; 3], campaigns: u64) -> f64 {
    let size = 240;
    let scene = FieldScene::rippled(size, 15.0, 0.02);
    let clean = scene.image().values;
    let mut pulls = Vec::new();
    for campaign in 0..campaigns {
        let seed = 100 * (campaign + 1);
        let common = noise_alone(size, sample, seed);
        let frames: Vec<Vec<LatticeMap>> = (0..4)
            .map(|f| {
                let of_frame = noise_alone(size, frame, seed + 10 * (f + 1));
                let line = |l: u64| {
                    let of_line = noise_alone(size, own, seed + 10 * (f + 1) + l);
                    let sum = |i: usize| clean[i] + common[i] + of_frame[i] + of_line[i];
                    let image = Image::new(size, size, (0..size * size).map(sum).collect());
                    let map = map_of_image(&image, &scene.pair, Some(14.0));
                    let still = Geometry::of_pitch([size, size], [1.0; 2], 0.0, Vector2::zeros());
                    let still = Geometry {
                        origin: Vector2::zeros(),
                        ..still.unwrap()
                    };
                    LatticeMap::new(&map, &still).unwrap()
                };
                vec![line(1), line(2)]
            })
            .collect();
        let frames: Vec<Vec<&LatticeMap>> = frames.iter().map(|f| f.iter().collect()).collect();
        let (average, _) = combine_frames(&frames).unwrap();
        for (n, node) in average.nodes.iter().enumerate() {
            if node.mask == Mask::Good {
                let error = node.waves.basis - scene.waves(average.grid.place(n));
                for (i, e) in error.iter().enumerate() {
                    pulls.push(e / node.waves.covariance[(i, i)].sqrt());
                }
            }
        }
    }
    assert!(pulls.len() > 400, "{}", pulls.len());
    rms(&pulls)
}

/// What the frames of one place have in common does not average out, however many there are.
#[test]
fn averages_know_the_noise_that_frames_share() {
    // Two thirds of the noise in all eight images: 1 + 7 ρ with ρ = 0.64 is what two maps of it would not tell.
    let shared = pulls_of_averages([0.8, 0.4, 0.44], 5);
    assert!((0.85..1.2).contains(&shared), "{shared}");
    // Trace and retrace alone share.
    let paired = pulls_of_averages([0.0, 0.8, 0.6], 4);
    assert!((0.8..1.2).contains(&paired), "{paired}");
}

/// Where nothing is shared, averages are as good as independent maps make them.
#[test]
fn averages_of_independent_maps_keep_their_errors() {
    let alone = pulls_of_averages([0.0, 0.0, 1.0], 4);
    assert!((0.8..1.1).contains(&alone), "{alone}");
}

/// A map of a single column of nodes has no next column to look into.
#[test]
fn maps_of_a_single_node_are_averaged() {
    let scene = FieldScene {
        white: 0.3,
        ..FieldScene::hexagonal([160, 160], 16.0, 0.2)
    };
    let geometry = Geometry::of_pitch([160, 160], [1.0; 2], 0.0, Vector2::zeros()).unwrap();
    let mut map = LatticeMap::new(&map_of(&scene, Some(20.0)), &geometry).unwrap();
    let good = map.nodes.iter().position(|n| n.mask == Mask::Good).unwrap();
    map.nodes = vec![map.nodes[good]];
    map.grid.size = [1, 1];
    let mut beside = map.clone();
    beside.grid.origin -= Vector2::new(4e-7, 4e-7) * map.grid.step.m11;
    let (average, _) = combine(&[&map, &beside]).unwrap();
    assert_eq!(average.nodes.len(), 1);
    assert_eq!(average.nodes[0].mask, Mask::Good);
}
