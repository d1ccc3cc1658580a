//! The lattice of one image by each method, beside the plain textbook autocorrelation alone.
//!
//! `cargo bench -p moiregauge --bench lattice`. Compare times within one run. `textbook` pads N × N
//! pixels to 2N × 2N, transforms, squares, transforms back and divides by the overlap; it ends where
//! the search for a lattice would begin. Methods end with lattice vectors and their covariance.
//! `fit_after_start` is the fit to the pixels alone, `start` what comes before it, on images that are hard:
//! domain walls, line offsets, noise of twice the signal.

use std::f64::consts::TAU;

use divan::Bencher;
use moiregauge::frame::Background;
use moiregauge::frame::Geometry;
use moiregauge::frame::Image;
use moiregauge::lattice::{Start, measure};
use moiregauge::spectrum::Method;
use nalgebra::Vector2;
use rand_distr::{Distribution, StandardNormal};
use realfft::RealFftPlanner;
use rustfft::num_complex::Complex;

fn main() {
    divan::main();
}

/// Few large periods, as in the paper, or many small ones.
#[derive(Clone, Copy, Debug)]
enum Period {
    FrameOver4,
    Pixels25,
}

const CASES: [(usize, Period); 6] = [
    (512, Period::FrameOver4),
    (512, Period::Pixels25),
    (2048, Period::FrameOver4),
    (2048, Period::Pixels25),
    (4096, Period::FrameOver4),
    (4096, Period::Pixels25),
];

/// Three cosines of amplitude 1 (rms 1.2) on a plane, with white noise of 0.5.
fn image(side: usize, period: Period) -> Image {
    let wavelength = match period {
        Period::FrameOver4 => side as f64 / 4.4,
        Period::Pixels25 => 25.0,
    };
    let size = 2.0 * TAU / (3f64.sqrt() * wavelength);
    let waves = [10.0, 70.0, 130.0_f64].map(|degrees| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        [size * cos, size * sin]
    });
    let mut rng = moiregauge::numbers::stream(1, "bench", 0);
    let mut values = Vec::with_capacity(side * side);
    for row in 0..side {
        for column in 0..side {
            let (x, y) = (column as f64, row as f64);
            let moire: f64 = waves.iter().map(|k| (k[0] * x + k[1] * y).cos()).sum();
            let noise: f64 = StandardNormal.sample(&mut rng);
            values.push(moire + 0.5 * noise + 2.0 * (x - y) / side as f64);
        }
    }
    Image::new(side, side, values)
}

fn run(bencher: Bencher<'_, '_>, (side, period): (usize, Period), method: Method) {
    let image = image(side, period);
    let geometry = Geometry::nominal([side; 2], 55.0, 55.0, 0.0, Vector2::zeros());
    let geometry = geometry.expect("a frame of positive size");
    bencher.bench(|| {
        measure(
            divan::black_box(&image),
            &geometry,
            Background::Plane,
            method,
        )
        .expect("a lattice")
    });
}

#[divan::bench(args = CASES, sample_count = 10, sample_size = 1)]
fn autocorrelation(bencher: Bencher<'_, '_>, case: (usize, Period)) {
    run(bencher, case, Method::Autocorrelation);
}

#[divan::bench(args = CASES, sample_count = 10, sample_size = 1)]
fn fourier(bencher: Bencher<'_, '_>, case: (usize, Period)) {
    run(bencher, case, Method::Fourier);
}

#[divan::bench(args = CASES, sample_count = 10, sample_size = 1)]
fn lattice(bencher: Bencher<'_, '_>, case: (usize, Period)) {
    run(bencher, case, Method::Lattice);
}

/// Pixels along a side and periods across it.
const HARD: [(usize, f64); 6] = [
    (512, 2.5),
    (512, 5.0),
    (512, 20.0),
    (512, 100.0),
    (4096, 20.0),
    (4096, 160.0),
];

/// Three families of walls a fifth of a period wide, white noise of twice their amplitude, and line
/// offsets of half of it.
fn hard_image((side, periods): (usize, f64)) -> Image {
    let size = 2.0 * TAU * periods / (3f64.sqrt() * side as f64);
    let mut rng = moiregauge::numbers::stream(1, "hard bench", 0);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let mut values: Vec<f64> = Vec::with_capacity(side * side);
    for _ in 0..side {
        let offset = 0.5 * normal();
        values.extend((0..side).map(|_| offset + 2.0 * normal()));
    }
    for degrees in [10.0, 70.0, 130.0_f64] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        for order in [1.0, 2.0, 3.0_f64] {
            let q = [size * order * cos, size * order * sin];
            if q[0].abs().max(q[1].abs()) > 3.0 {
                continue;
            }
            let amplitude = 1.2 * (-0.5 * (0.1 * TAU * order).powi(2)).exp();
            let along: Vec<(f64, f64)> = (0..side).map(|c| (q[0] * c as f64).sin_cos()).collect();
            for (row, line) in values.chunks_exact_mut(side).enumerate() {
                let (s, c) = (q[1] * row as f64).sin_cos();
                for (value, (sin, cos)) in line.iter_mut().zip(&along) {
                    *value += amplitude * (c * cos - s * sin);
                }
            }
        }
    }
    Image::new(side, side, values)
}

fn unit_pixels(side: usize) -> Geometry {
    let extent = side as f64 - 1.0;
    let geometry = Geometry::nominal([side; 2], extent, extent, 0.0, Vector2::zeros());
    geometry.expect("a frame of positive size")
}

#[divan::bench(args = HARD, sample_count = 10, sample_size = 1)]
fn start(bencher: Bencher<'_, '_>, case: (usize, f64)) {
    let (image, geometry) = (hard_image(case), unit_pixels(case.0));
    bencher.bench(|| {
        Start::find(divan::black_box(&image), &geometry, Background::Plane).expect("a lattice")
    });
}

#[divan::bench(args = HARD, sample_count = 10, sample_size = 1)]
fn fit_after_start(bencher: Bencher<'_, '_>, case: (usize, f64)) {
    let (image, geometry) = (hard_image(case), unit_pixels(case.0));
    let start = Start::find(&image, &geometry, Background::Plane).expect("a lattice");
    bencher.bench(|| {
        divan::black_box(&start)
            .measure(Method::Lattice)
            .expect("a lattice")
    });
}

/// What missing pixels cost: none, one, and a tenth of the image in places of their own.
#[divan::bench(args = [0, 1, 58_982], sample_count = 10, sample_size = 1)]
fn missing_pixels_of_768(bencher: Bencher<'_, '_>, missing: usize) {
    let side = 768;
    let mut image = image(side, Period::Pixels25);
    for i in 0..missing {
        // Steps that share no divisor with the number of pixels meet no pixel twice.
        image.values[(i * 1_000_003 + 295_000) % (side * side)] = f64::NAN;
    }
    let geometry = unit_pixels(side);
    bencher.bench(|| {
        measure(
            divan::black_box(&image),
            &geometry,
            Background::Plane,
            Method::Lattice,
        )
        .expect("a lattice")
    });
}

#[divan::bench(args = CASES, sample_count = 10, sample_size = 1)]
fn paper(bencher: Bencher<'_, '_>, case: (usize, Period)) {
    run(bencher, case, Method::Paper);
}

#[divan::bench(args = [512, 2048, 4096], sample_count = 10, sample_size = 1)]
fn textbook(bencher: Bencher<'_, '_>, side: usize) {
    let image = image(side, Period::Pixels25);
    let mut planner = RealFftPlanner::new();
    // Plans are made once, as by anybody who analyses more than one image.
    textbook_autocorrelation(&mut planner, &image);
    bencher.bench_local(|| textbook_autocorrelation(&mut planner, divan::black_box(&image)));
}

/// Lags ≥ 0 along rows, all along columns, divided by the overlap.
fn textbook_autocorrelation(planner: &mut RealFftPlanner<f64>, image: &Image) -> Vec<f64> {
    let side = image.rows;
    let (padded, half) = (2 * side, side + 1);
    let forward = planner.plan_fft_forward(padded);
    let backward = planner.plan_fft_inverse(padded);
    let mut complex = rustfft::FftPlanner::new();
    let down = complex.plan_fft_forward(padded);
    let up = complex.plan_fft_inverse(padded);

    let zero = Complex::new(0.0, 0.0);
    let mut spectrum = vec![zero; padded * half];
    let mut line = forward.make_input_vec();
    for (row, out) in spectrum.chunks_exact_mut(half).take(side).enumerate() {
        line[..side].copy_from_slice(image.row(row));
        line[side..].fill(0.0);
        forward.process(&mut line, out).expect("matching lengths");
    }
    let mut column = vec![zero; padded];
    for index in 0..half {
        for (row, value) in column.iter_mut().enumerate() {
            *value = spectrum[row * half + index];
        }
        down.process(&mut column);
        for value in &mut column {
            *value = Complex::new(value.norm_sqr(), 0.0);
        }
        up.process(&mut column);
        for (row, value) in column.iter().enumerate() {
            spectrum[row * half + index] = *value;
        }
    }
    let mut result = Vec::with_capacity(padded * side);
    let mut lags = backward.make_output_vec();
    for (row, values) in spectrum.chunks_exact_mut(half).enumerate() {
        // Of a real column power these vanish but for rounding, and the inverse insists on it.
        values[0].im = 0.0;
        values[half - 1].im = 0.0;
        backward
            .process(values, &mut lags)
            .expect("matching lengths");
        let dy = row.min(padded - row);
        result.extend(lags[..side].iter().enumerate().map(|(dx, sum)| {
            let overlap = ((side - dx) * side.saturating_sub(dy)).max(1);
            sum / (overlap * padded * padded) as f64
        }));
    }
    result
}
