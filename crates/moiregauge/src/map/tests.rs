//! Maps against images whose phases are known.

use nalgebra::{Matrix2, Vector2};

use super::*;
use crate::simulate::{FieldScene, Ripple};

fn rippled(size: usize, periods: f64, share: f64) -> FieldScene {
    let period = size as f64 / periods;
    let mut scene = FieldScene::hexagonal([size, size], period, 0.3);
    let length = scene.pair.column(0).norm();
    let wave = std::f64::consts::TAU / size as f64;
    for (direction, phase, factors) in [
        ([0.6, 0.8], 0.3, [0.5, -0.4]),
        ([-0.7, 0.5], 1.9, [0.3, 0.6]),
    ] {
        let wave = Vector2::from(direction) * wave;
        scene.ripples.push(Ripple {
            wave,
            phase,
            amplitude: factors.map(|f: f64| f * share * length / wave.norm()),
        });
    }
    scene
}

/// Pulls of all four components of good nodes, and the largest error relative to |q|.
fn compare(scene: &FieldScene, map: &WaveMap) -> (Vec<f64>, f64, usize) {
    let mut pulls = Vec::new();
    let mut worst = 0.0f64;
    let mut good = 0;
    for (i, node) in map.nodes.iter().enumerate() {
        if node.mask != Mask::Good {
            continue;
        }
        good += 1;
        let at = map.first
            + Vector2::new(
                (i % map.size[0]) as f64 * map.step[0],
                (i / map.size[0]) as f64 * map.step[1],
            );
        let error = node.pair - scene.waves(at);
        worst = worst.max(error.amax() / scene.pair.column(0).norm());
        for wave in 0..2 {
            for axis in 0..2 {
                let sigma = (node.indices[(wave, wave)] * node.slope[(axis, axis)]).sqrt();
                pulls.push(error[(axis, wave)] / sigma);
            }
        }
    }
    (pulls, worst, good)
}

fn reference(scene: &FieldScene) -> Reference {
    Reference {
        pair: scene.pair,
        pitch: [1.0; 2],
    }
}

#[test]
fn trial() {
    for (periods, share, white) in [
        (20.0, 0.0, 1.2),
        (20.0, 0.1, 1.2),
        (60.0, 0.1, 1.2),
        (100.0, 0.1, 1.2),
        (20.0, 0.1, 0.0),
    ] {
        let mut scene = rippled(1024, periods, share);
        scene.white = white;
        let image = scene.image();
        let start = std::time::Instant::now();
        let map = local_lattices(&image, &reference(&scene), &Resolution::default()).unwrap();
        let time = start.elapsed();
        let (pulls, worst, good) = compare(&scene, &map);
        let rms = (pulls.iter().map(|p| p * p).sum::<f64>() / pulls.len() as f64).sqrt();
        let inside = pulls.iter().filter(|p| p.abs() < 1.0).count() as f64 / pulls.len() as f64;
        let mut counts = [0; 8];
        for n in &map.nodes {
            counts[n.mask as usize] += 1;
        }
        println!(
            "{periods} {share} {white}: window {:.2} periods, {good} good, pulls rms {rms:.3}, inside {inside:.3}, worst {worst:.5}, harmonics {:?} {time:?} masks {counts:?} size {:?} chi2 {:.3}",
            map.window_nm / map.reference.period(),
            map.harmonics
                .iter()
                .map(|h| (
                    h.index,
                    (h.amplitude * 1e3).round() / 1e3,
                    (h.noise * 1e3).round() / 1e3
                ))
                .collect::<Vec<_>>(),
            map.size,
            map.nodes
                .iter()
                .filter(|n| n.mask == Mask::Good)
                .map(|n| n.chi2 / n.freedom as f64)
                .sum::<f64>()
                / good as f64,
        );
    }
    for (seed, white, window) in [
        (1, 1.2, 17.4),
        (2, 1.2, 17.4),
        (3, 1.2, 17.4),
        (4, 1.2, 17.4),
        (5, 1.2, 17.4),
        (6, 1.2, 17.4),
    ] {
        let mut scene = rippled(1024, 100.0, 0.1);
        scene.white = white;
        scene.seed = seed;
        let image = scene.image();
        let r = Resolution {
            window_nm: Some(window),
            ..Resolution::default()
        };
        let start = std::time::Instant::now();
        let map = local_lattices(&image, &reference(&scene), &r).unwrap();
        let time = start.elapsed();
        let (mut e, mut b, mut d, mut n) = (0.0, 0.0, 0.0, 0.0);
        for (i, node) in map.nodes.iter().enumerate() {
            if node.mask != Mask::Good {
                continue;
            }
            let at = map.first
                + Vector2::new(
                    (i % map.size[0]) as f64 * map.step[0],
                    (i / map.size[0]) as f64 * map.step[1],
                );
            let error = node.pair - scene.waves(at);
            let mut mean = Matrix2::zeros();
            for (x, u) in [(-1.732, 1.0 / 6.0), (0.0, 2.0 / 3.0), (1.732, 1.0 / 6.0)] {
                for (y, v) in [(-1.732, 1.0 / 6.0), (0.0, 2.0 / 3.0), (1.732, 1.0 / 6.0)] {
                    mean += scene.waves(at + Vector2::new(x, y) * window) * (u * v);
                }
            }
            let bias = mean - scene.waves(at);
            e += error.norm_squared();
            b += bias.norm_squared();
            d += (error - bias).norm_squared();
            n += node.indices.trace() * node.slope.trace();
        }
        println!(
            "{white} {window}: error {:.3e} bias {:.3e} error-bias {:.3e} sigma {:.3e} {time:?}",
            e.sqrt(),
            b.sqrt(),
            d.sqrt(),
            n.sqrt()
        );
    }
}
