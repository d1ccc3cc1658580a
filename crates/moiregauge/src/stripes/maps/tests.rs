//! Stripes whose phases are known, and images that have none.

use nalgebra::Vector2;
use rand_distr::{Distribution, StandardNormal};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

use super::*;
use crate::frame::background::{Background, remove_background};
use crate::numbers::rng;
use crate::simulate::field::{Feature, FieldScene};
use crate::window::mask::Mask;

/// One wave of amplitude 1 with an overtone, its wave vector changing by ± `share` across the frame.
fn scene(size: usize, periods: f64, share: f64, seed: u64) -> FieldScene {
    let mut scene = FieldScene::rippled(size, periods, share);
    // Stripes `size / periods` pixels apart.
    let factor = std::f64::consts::TAU * periods / size as f64 / scene.pair.column(0).norm();
    scene.pair *= factor;
    for ripple in &mut scene.ripples {
        ripple.amplitude = ripple.amplitude.map(|a| a * factor);
    }
    scene.harmonics = vec![([1, 0], 1.0)];
    (scene.white, scene.seed) = (0.7, seed);
    scene
}

fn map_of(scene: &FieldScene, window: Option<f64>) -> Result<StripeMap, NoStripes> {
    let image = remove_background(&scene.image(), Background::Plane);
    let resolution = Resolution {
        window_nm: window,
        ..Resolution::default()
    };
    let maps = stripe_maps(&[&image], [1.0; 2], &resolution)?;
    Ok(maps.into_iter().next().expect("a map"))
}

fn place(map: &StripeMap, node: usize) -> Vector2<f64> {
    let (column, row) = (node % map.size[0], node / map.size[0]);
    map.first + Vector2::new(column as f64 * map.step[0], row as f64 * map.step[1])
}

/// Errors of both components at the good nodes, over the stated ones and over `sigma`.
fn pulls(scene: &FieldScene, map: &StripeMap, sigma: f64) -> [Vec<f64>; 2] {
    let mut out = [Vec::new(), Vec::new()];
    for (n, node) in map.nodes.iter().enumerate() {
        if node.mask == Mask::Good {
            let truth = scene.waves(place(map, n)).column(0).into_owned();
            // A wave and its mirror image are one.
            let error = node.wave * node.wave.dot(&truth).signum() - truth;
            for i in 0..2 {
                out[0].push(error[i] / node.covariance[(i, i)].sqrt());
                out[1].push(error[i] / sigma);
            }
        }
    }
    out
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// Smooth changes of ± 10 %, noise of 0.7 of the signal: errors within 1.3 of the formula of one wave, as stated, in
/// the window that is chosen and in one that is given.
#[test]
fn errors_follow_the_formula() {
    for (size, periods, overtone, window) in [
        (320, 20.0, None, None),
        (320, 20.0, Some(0.8), None),
        (512, 40.0, None, None),
        (512, 60.0, None, None),
    ] {
        let (mut stated, mut formula) = (Vec::new(), Vec::new());
        for seed in 0..6 {
            let mut scene = scene(size, periods, 0.1, seed);
            if let Some(second) = overtone {
                scene.harmonics.push(([2, 0], second));
            }
            let map = map_of(&scene, window).expect("a map");
            assert_eq!(map.patterns.len(), 1, "{periods} {seed}");
            // Σ n² A_n² in the place of A².
            let signal = (1.0 + 4.0 * overtone.unwrap_or(0.0f64).powi(2)).sqrt();
            let w = map.window_nm;
            let sigma = scene.white / signal / (2.0 * std::f64::consts::PI.sqrt() * w * w);
            let [a, b] = pulls(&scene, &map, sigma);
            let inner = map.nodes.iter().filter(|n| n.mask != Mask::Margin).count();
            assert!(
                a.len() as f64 > 1.8 * inner as f64,
                "{periods} {seed}: {} of {inner}",
                a.len() / 2
            );
            stated.extend(a);
            formula.extend(b);
        }
        let covered = stated.iter().filter(|p| p.abs() < 1.0).count() as f64 / stated.len() as f64;
        println!(
            "{size} {periods} {overtone:?}: {:.2} of the formula, {:.2} of stated, {covered:.3}",
            rms(&formula),
            rms(&stated)
        );
        assert!(rms(&formula) < 1.3, "{size} {periods}: {}", rms(&formula));
        assert!(
            (covered - 0.683).abs() < 0.04,
            "{size} {periods}: {covered}"
        );
    }
}

/// The fit of one wave to the pixels of straight stripes: errors as stated over seeds, and χ² of two numbers.
#[test]
fn fits_of_straight_stripes_have_honest_errors() {
    let mut chi2 = Vec::new();
    for seed in 0..60 {
        let mut scene = scene(160, 9.0, 0.0, 100 + seed);
        scene.harmonics.push(([2, 0], 0.8));
        scene.white = 1.0;
        let map = map_of(&scene, None).expect("a map");
        let fit = map.patterns[0].fit.as_ref().expect("a fit");
        let truth = scene.pair.column(0).into_owned();
        let error = fit.wave * fit.wave.dot(&truth).signum() - truth;
        chi2.push(error.dot(&(fit.covariance.try_inverse().expect("errors") * error)));
        assert!(
            map.patterns[0].coherence > 0.9,
            "{}",
            map.patterns[0].coherence
        );
    }
    // χ² of 120 numbers: 120 ± 15.5.
    let sum: f64 = chi2.iter().sum();
    println!("{sum}");
    assert!((60.0..190.0).contains(&sum), "{sum}");
}

/// Noise whose power falls with the wave vector to the power −2a.
fn terrain(size: usize, a: f64, seed: u64) -> Image {
    let mut rng = rng::stream(seed, "terrain", 0);
    let mut planner = FftPlanner::new();
    let (forward, back) = (
        planner.plan_fft_forward(size),
        planner.plan_fft_inverse(size),
    );
    let mut values: Vec<Complex64> = (0..size * size)
        .map(|_| Complex64::new(StandardNormal.sample(&mut rng), 0.0))
        .collect();
    let transposed = |v: &[Complex64]| -> Vec<Complex64> {
        (0..size * size)
            .map(|i| v[(i % size) * size + i / size])
            .collect()
    };
    for _ in 0..2 {
        values.chunks_mut(size).for_each(|row| forward.process(row));
        values = transposed(&values);
    }
    let k = |i: usize| (i as f64).min((size - i) as f64);
    for (i, v) in values.iter_mut().enumerate() {
        *v *= k(i % size).hypot(k(i / size)).max(1.0).powf(-a);
    }
    for _ in 0..2 {
        values.chunks_mut(size).for_each(|row| back.process(row));
        values = transposed(&values);
    }
    let scale = (size * size) as f64;
    Image::new(size, size, values.iter().map(|v| v.re / scale).collect())
}

/// Noise in time, line after line: white, 1/f, and a walk.
fn noise_of_lines(size: usize, kind: usize, seed: u64) -> Image {
    let mut rng = rng::stream(seed, "lines", kind as u64);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let mut values = Vec::with_capacity(size * size);
    // A sum of ever slower relaxations is 1/f.
    let mut slow = [0.0; 14];
    let (mut offset, mut walk) = (0.0, 0.0);
    for _ in 0..size {
        match kind {
            0 => offset = normal(),
            1 => offset += normal(),
            _ => {}
        }
        for _ in 0..size {
            for (i, s) in slow.iter_mut().enumerate() {
                let keep = 1.0 - 0.5f64.powi(i as i32 + 1);
                *s = keep * *s + (1.0 - keep * keep).sqrt() * normal();
            }
            walk += 0.05 * normal();
            values.push(match kind {
                0 | 1 => offset + 0.3 * normal(),
                2 => slow.iter().sum::<f64>(),
                _ => walk,
            });
        }
    }
    Image::new(size, size, values)
}

/// White noise, terrain, offsets of lines, walks, 1/f noise and tilts have no stripes, alone and as trace and retrace.
#[test]
fn noise_has_no_stripes() {
    for seed in 0..4 {
        for size in [128, 180] {
            let mut images = vec![terrain(size, 0.0, seed)];
            images.extend([0.7, 1.0, 1.5, 2.0].map(|a| terrain(size, a, 50 + seed)));
            images.extend([0, 1, 2, 3].map(|kind| noise_of_lines(size, kind, seed)));
            let mut tilted = noise_of_lines(size, 0, 70 + seed);
            for (i, v) in tilted.values.iter_mut().enumerate() {
                *v += 0.3 * (i % size) as f64 - 0.2 * (i / size) as f64;
            }
            images.push(tilted);
            for (kind, image) in images.iter().enumerate() {
                let background = [Background::Mean, Background::Plane][seed as usize % 2];
                let flat = remove_background(image, background);
                let found = find_stripes(&[&flat], [1.0; 2]);
                assert!(found.is_empty(), "{kind} {seed} {size}: {found:?}");
            }
        }
    }
}

/// Offsets of lines that repeat, as mains make them, are no stripes; nor is a wave that runs the other way in the
/// retrace.
#[test]
fn pick_up_is_no_pattern() {
    let size = 192;
    let wave = |x: f64, y: f64, seed: u64| {
        let mut image = terrain(size, 0.0, seed);
        for (i, v) in image.values.iter_mut().enumerate() {
            *v = 0.5 * *v + (x * (i % size) as f64 + y * (i / size) as f64).sin();
        }
        image
    };
    assert!(find_stripes(&[&wave(0.0, 0.5, 1)], [1.0; 2]).is_empty());
    let (trace, retrace) = (wave(0.4, 0.5, 2), wave(-0.4, 0.5, 3));
    assert_eq!(find_stripes(&[&trace], [1.0; 2]).len(), 1);
    assert!(find_stripes(&[&trace, &retrace], [1.0; 2]).is_empty());
    assert_eq!(
        find_stripes(&[&trace, &wave(0.4, 0.5, 4)], [1.0; 2]).len(),
        1
    );
}

/// Two domains of a herringbone: every good node has the wave of its domain, and the boundary is masked.
#[test]
fn domains_have_waves_of_their_own() {
    for seed in 0..4 {
        let mut scene = scene(256, 11.0, 0.0, seed);
        scene.white = 0.5;
        scene.harmonics.push(([2, 0], 1.2));
        let (at, turn) = (Vector2::new(120.0, 130.0), 1.05);
        scene.features.push(Feature::Boundary {
            at,
            normal: 1.2,
            turn,
        });
        let map = map_of(&scene, None).expect("a map");
        assert_eq!(map.patterns.len(), 2);
        let [a, _] = pulls(&scene, &map, 1.0);
        let worst = a.iter().fold(0.0f64, |m, p| m.max(p.abs()));
        println!("worst {worst}");
        let good = map.nodes.iter().filter(|n| n.mask == Mask::Good);
        let of = |p: usize| good.clone().filter(|n| n.pattern == Some(p)).count();
        assert!(of(0) > 20 && of(1) > 20, "{} {}", of(0), of(1));
        let covered = a.iter().filter(|p| p.abs() < 1.0).count() as f64 / a.len() as f64;
        println!("{} {} {worst} {covered}", of(0), of(1));
        assert!(worst < 6.0, "{worst}");
    }
}

/// A dislocation of the stripes is masked.
#[test]
fn dislocations_are_masked() {
    let mut scene = scene(256, 14.0, 0.0, 3);
    scene.white = 0.3;
    let at = Vector2::new(140.0, 110.0);
    scene
        .features
        .push(Feature::Dislocation { at, turns: [1, 0] });
    let map = map_of(&scene, None).expect("a map");
    for (n, node) in map.nodes.iter().enumerate() {
        if (place(&map, n) - at).norm() < 1.5 * map.window_nm {
            assert_ne!(node.mask, Mask::Good);
        }
    }
    let [a, _] = pulls(&scene, &map, 1.0);
    let worst = a.iter().fold(0.0f64, |m, p| m.max(p.abs()));
    println!("{worst} {}", a.len());
    assert!(worst < 6.5, "{worst}");
    assert!(map.nodes.iter().filter(|n| n.mask == Mask::Good).count() > 100);
}

/// Three waves that close are a lattice and not stripes.
#[test]
fn lattices_are_no_stripes() {
    for (white, seed) in [(0.3, 1), (1.0, 2), (2.0, 3)] {
        let mut scene = FieldScene::rippled(256, 12.0, 0.02);
        (scene.white, scene.seed) = (white, seed);
        let found = map_of(&scene, None);
        assert!(
            matches!(found, Err(NoStripes::Crossing(_))),
            "{white}: {:?}",
            found.map(|m| m.patterns)
        );
    }
}
