//! Maps beside the plain textbook autocorrelation alone, in the same run.
//!
//! `cargo bench -p moiregauge --bench map`. `textbook` pads N × N pixels to 2N × 2N, transforms, squares and
//! transforms back. `map` starts from an image without background and a lattice, and ends with twist, strain and all
//! errors on every node. `memory` is what the map needs at its peak beside the image, over the image in double
//! precision (where the system tells).

use std::time::Instant;

use heterostrain::material::Material;
use heterostrain::strain::StrainConvention;
use moiregauge::frame::Geometry;
use moiregauge::frame::Image;
use moiregauge::map::{LatticeMap, TwistStrainMap, local_lattices};
use moiregauge::simulate::FieldScene;
use moiregauge::window::{Reference, Resolution};
use nalgebra::Vector2;
use realfft::RealFftPlanner;
use rustfft::num_complex::Complex;

fn main() {
    println!("side  period  map, s  textbook, s  ratio  memory");
    let sizes = [
        (2048, 25.0),
        (2048, 10.0),
        (2048, 6.0),
        (4096, 25.0),
        (4096, 10.0),
    ];
    for (side, period) in sizes {
        let mut scene = FieldScene::hexagonal([side, side], period, 0.3);
        scene.white = 0.6;
        let image = scene.image();
        let best = |f: &dyn Fn()| {
            let time = || {
                let start = Instant::now();
                f();
                start.elapsed().as_secs_f64()
            };
            (0..5).map(|_| time()).fold(f64::INFINITY, f64::min)
        };
        let before = forget_peak();
        let map = best(&|| map(&scene, &image));
        let memory = peak() - before;
        let share = memory / (8.0 * (side * side) as f64);
        let textbook = best(&|| textbook(&image));
        println!(
            "{side:4}  {period:6}  {map:6.2}  {textbook:11.2}  {:5.2}  {share:6.2}",
            map / textbook
        );
    }
}

/// Bytes in memory; the peak starts anew.
fn forget_peak() -> f64 {
    std::fs::write("/proc/self/clear_refs", "5").ok();
    status("VmRSS:")
}

/// The most bytes in memory since then.
fn peak() -> f64 {
    status("VmHWM:")
}

fn status(field: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with(field));
    let kilobytes = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
    kilobytes.map_or(f64::NAN, |k| 1024.0 * k)
}

fn map(scene: &FieldScene, image: &Image) {
    // Pixels for which the lattice is that of graphene at 1.14°.
    let reference = Reference {
        pair: scene.pair,
        pitch: [1.0; 2],
    };
    let pitch = 12.36 / reference.period();
    let reference = Reference {
        pitch: [pitch; 2],
        ..reference
    };
    let geometry =
        Geometry::of_pitch(scene.size, [pitch; 2], 0.0, Vector2::zeros()).expect("pixels");
    let waves = local_lattices(image, &reference, &Resolution::default()).expect("a map");
    let lattices = LatticeMap::new(&waves, &geometry).expect("a geometry");
    let mean = lattices.mean().expect("good nodes");
    let convention = StrainConvention::RealSpace;
    let found = lattices
        .twist_strain(&mean, &Material::graphene(), convention)
        .expect("a moiré");
    std::hint::black_box(TwistStrainMap::new(&lattices, &found));
}

/// Autocorrelation of the padded image, rows in real transforms, columns in complex ones.
fn textbook(image: &Image) {
    let n = 2 * image.columns;
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, backward) = (planner.plan_fft_forward(n), planner.plan_fft_inverse(n));
    let mut complex = rustfft::FftPlanner::<f64>::new();
    let (up, down) = (complex.plan_fft_forward(n), complex.plan_fft_inverse(n));
    let half = n / 2 + 1;
    // Column by column after a transposition.
    let mut columns = vec![Complex::default(); half * n];
    let mut line = vec![0.0; n];
    let mut spectrum = forward.make_output_vec();
    for row in 0..image.rows {
        line.fill(0.0);
        line[..image.columns].copy_from_slice(image.row(row));
        forward
            .process(&mut line, &mut spectrum)
            .expect("lengths fit");
        for (column, value) in spectrum.iter().enumerate() {
            columns[column * n + row] = *value;
        }
    }
    for column in columns.chunks_exact_mut(n) {
        up.process(column);
        for value in column.iter_mut() {
            *value = Complex::new(value.norm_sqr(), 0.0);
        }
        down.process(column);
    }
    for row in 0..n {
        for (column, value) in spectrum.iter_mut().enumerate() {
            *value = columns[column * n + row];
        }
        spectrum[0].im = 0.0;
        spectrum[half - 1].im = 0.0;
        backward
            .process(&mut spectrum, &mut line)
            .expect("lengths fit");
        std::hint::black_box(&line);
    }
}
