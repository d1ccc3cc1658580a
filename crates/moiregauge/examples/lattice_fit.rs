//! How good the lattice fit is on simulated images: share of right lattices, error over the
//! Cramér–Rao bound, and pulls.
//!
//! `cargo run --release -p moiregauge --example lattice_fit [IMAGES [CASE]]`. Error over bound is
//! meant for white noise; `pull` is the standard deviation of error over stated error, 1 where error
//! bars are true; `fast` and `slow` are the same for the wave vectors along either axis, `< 1σ` and `< 2σ`
//! the shares (%) within one and two of them, 68.3 and 95.4; `bias` is the largest mean pull; `bent` counts images
//! whose lattice is said to change across the frame (none of them does); `phase` is the pull of the phases of the
//! first harmonics, `ridge` that of those with fewer than three cycles along the fast axis.

#[path = "../tests/science/fit_scene/mod.rs"]
mod fit_scene;

use fit_scene::{Contrast, Scene};
use moiregauge::frame::Background;
use moiregauge::lattice::{MeasuredLattice, measure};
use moiregauge::spectrum::LatticeError;
use moiregauge::spectrum::Method;
use nalgebra::Vector4;

/// Name, pixels, periods, contrast, noise: white, line, 1/f, 1/f from line to line.
type Case = (&'static str, [usize; 2], f64, Contrast, [f64; 4]);

const CASES: [Case; 24] = [
    (
        "paper, σ = A",
        [512, 512],
        4.4,
        Contrast::Cosines,
        [1.0, 0.0, 0.0, 0.0],
    ),
    (
        "paper, σ = 2A",
        [512, 512],
        4.4,
        Contrast::Cosines,
        [2.0, 0.0, 0.0, 0.0],
    ),
    (
        "128 px, σ = 2A",
        [128, 128],
        4.4,
        Contrast::Cosines,
        [2.0, 0.0, 0.0, 0.0],
    ),
    (
        "paper, lines",
        [512, 512],
        4.4,
        Contrast::Cosines,
        [1.0, 0.5, 0.0, 0.0],
    ),
    (
        "paper, 1/f",
        [512, 512],
        4.4,
        Contrast::Cosines,
        [1.0, 0.0, 1.0, 0.0],
    ),
    (
        "spots, lines",
        [256, 256],
        6.0,
        Contrast::Spots,
        [1.0, 1.0, 0.0, 0.0],
    ),
    (
        "spots, 1/f",
        [256, 256],
        6.0,
        Contrast::Spots,
        [0.5, 0.0, 1.0, 0.0],
    ),
    (
        "2.5 periods",
        [256, 256],
        2.5,
        Contrast::Cosines,
        [2.0, 0.5, 0.0, 0.0],
    ),
    (
        "2.5, spots",
        [256, 256],
        2.5,
        Contrast::Spots,
        [2.0, 0.5, 0.0, 0.0],
    ),
    (
        "2.5, walls",
        [256, 256],
        2.5,
        Contrast::Walls,
        [2.0, 0.5, 0.0, 0.0],
    ),
    (
        "5, walls",
        [256, 256],
        5.0,
        Contrast::Walls,
        [2.0, 0.5, 0.0, 0.0],
    ),
    (
        "20, walls",
        [256, 256],
        20.0,
        Contrast::Walls,
        [2.0, 0.5, 0.0, 0.0],
    ),
    (
        "20, 512 px",
        [512, 512],
        20.0,
        Contrast::Walls,
        [2.0, 0.5, 0.0, 0.0],
    ),
    (
        "100, cosines",
        [512, 512],
        100.0,
        Contrast::Cosines,
        [2.0, 0.5, 0.0, 0.0],
    ),
    (
        "100, walls",
        [512, 512],
        100.0,
        Contrast::Walls,
        [2.0, 0.5, 0.0, 0.0],
    ),
    (
        "128 × 512",
        [128, 512],
        4.0,
        Contrast::Spots,
        [2.0, 0.5, 0.0, 0.0],
    ),
    (
        "σ: white",
        [128, 128],
        6.0,
        Contrast::Cosines,
        [1.0, 0.0, 0.0, 0.0],
    ),
    (
        "σ: lines",
        [128, 128],
        6.0,
        Contrast::Cosines,
        [1.0, 0.5, 0.0, 0.0],
    ),
    (
        "σ: 1/f",
        [128, 128],
        6.0,
        Contrast::Cosines,
        [0.5, 0.0, 1.0, 0.0],
    ),
    (
        "σ: 1/f lines",
        [128, 128],
        6.0,
        Contrast::Cosines,
        [1.0, 0.0, 0.0, 0.5],
    ),
    (
        "σ: strong",
        [128, 128],
        6.0,
        Contrast::Cosines,
        [0.5, 0.0, 0.0, 1.5],
    ),
    (
        "σ: strong, few",
        [96, 96],
        4.4,
        Contrast::Cosines,
        [0.5, 0.0, 0.0, 1.5],
    ),
    (
        "σ: few, 1/f",
        [128, 128],
        4.4,
        Contrast::Cosines,
        [0.5, 0.0, 1.0, 0.0],
    ),
    (
        "σ: 20, 1/f lines",
        [256, 256],
        20.0,
        Contrast::Cosines,
        [0.5, 0.0, 0.0, 1.0],
    ),
];

/// Waves of fewer cycles along the fast axis lie on the ridge of line noise.
const RIDGE: f64 = 3.0;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let count = arguments
        .next()
        .map_or(50, |n| n.parse().expect("a number"));
    let wanted = arguments.next().unwrap_or_default();
    println!(
        "case               right     error/bound  pull   fast   slow   < 1σ  < 2σ  bias  lines  bent  waves  goodness  phase  ridge"
    );
    for case in CASES.iter().filter(|c| c.0.contains(&wanted)) {
        run(case, count);
    }
}

fn fit(scene: &Scene) -> Result<MeasuredLattice, LatticeError> {
    measure(
        &scene.image(),
        &scene.geometry(),
        Background::Plane,
        Method::Lattice,
    )
}

fn run(&(name, size, periods, contrast, noise): &Case, count: u64) {
    let [white, line, flicker, line_flicker] = noise;
    let mut pulls: Vec<Vector4<f64>> = Vec::new();
    let (mut error, mut bound) = (0.0, 0.0);
    let mut waves: Vec<Vector4<f64>> = Vec::new();
    let mut phases: Vec<(f64, f64)> = Vec::new();
    let (mut lines, mut bent, mut shown, mut goodness) = (0, 0, 0, 0.0);
    for seed in 0..count {
        let mut scene = Scene::new(size, periods, 0.61803 * seed as f64, contrast, seed);
        (scene.white, scene.line) = (white, line);
        (scene.flicker, scene.line_flicker) = (flicker, line_flicker);
        let measured = match fit(&scene) {
            Ok(measured) => measured,
            Err(error) => {
                println!("  image {seed}: {error}");
                continue;
            }
        };
        let off = scene.error(&measured.pixels.basis);
        if off.norm() > 0.02 * scene.basis.norm() {
            println!("  image {seed}: a wrong lattice");
            continue;
        }
        let (_, change) = scene.change(&measured.pixels.basis);
        let covariance = change * measured.pixels.covariance * change.transpose();
        let factor = covariance.cholesky().expect("a covariance");
        pulls.push(
            factor
                .l()
                .solve_lower_triangular(&off)
                .expect("errors above zero"),
        );
        waves.push(scene.wave_pulls(&measured.pixels.basis, &measured.pixels.covariance));
        phases.extend(scene.phase_pulls(&measured));
        error += off.norm_squared();
        // The bound takes longer than the fit, and changes little from image to image.
        if seed < 3 {
            bound += scene.bound().trace() / 3.0f64.min(count as f64);
        }
        let fit = measured.fit.expect("the method is the fit");
        lines += i32::from(fit.line_offsets.is_some());
        shown += fit.harmonics.len();
        goodness += fit.goodness;
        bent += i32::from(
            fit.inhomogeneity
                .is_some_and(|i| i.chi_squared > i.threshold),
        );
    }
    let n = pulls.len() as f64;
    let mean = pulls.iter().sum::<Vector4<f64>>() / n;
    let square = pulls.iter().map(Vector4::norm_squared).sum::<f64>() / (4.0 * n);
    // Pulls along the fast axis (x of q₁ and q₂) and along the slow one.
    let along = |axis: usize| {
        let squares = waves.iter().map(|w| w[axis].powi(2) + w[axis + 2].powi(2));
        (squares.sum::<f64>() / (2.0 * n)).sqrt()
    };
    let within = |limit: f64| {
        let small = waves
            .iter()
            .flat_map(|w| w.iter())
            .filter(|p| p.abs() < limit);
        100.0 * small.count() as f64 / (4.0 * n)
    };
    let rms = |cycles: std::ops::Range<f64>| {
        let chosen: Vec<f64> = phases
            .iter()
            .filter(|(c, _)| cycles.contains(c))
            .map(|(_, pull)| pull * pull)
            .collect();
        (chosen.iter().sum::<f64>() / chosen.len() as f64).sqrt()
    };
    println!(
        "{name:18} {:3}/{count:<3}   {:6.3}       {:.3}  {:.3}  {:.3}  {:4.1}  {:4.1}  {:.3}  {lines:5}  {bent:4}  {:5.1}  {:.3}     {:.3}  {:.3}",
        pulls.len(),
        (error / n / bound).sqrt(),
        square.sqrt(),
        along(0),
        along(1),
        within(1.0),
        within(2.0),
        mean.amax(),
        shown as f64 / n,
        goodness / n,
        rms(0.0..f64::INFINITY),
        rms(0.0..RIDGE),
    );
}
