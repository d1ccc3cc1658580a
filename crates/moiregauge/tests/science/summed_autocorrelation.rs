//! What the published method does to a perfect image: the bias of the summed autocorrelation.

use moiregauge::frame::Background;
use moiregauge::frame::Geometry;
use moiregauge::frame::Image;
use moiregauge::lattice::measure;
use moiregauge::numbers::stream;
use moiregauge::spectrum::Method;
use nalgebra::{Matrix2, Vector2};
use rand::RngExt;

const ATOMIC_NM: f64 = 0.246;
const POISSON: f64 = 0.16;
const PIXELS: usize = 512;

/// Three equal cosines of an unstrained moiré at `theta` (rad) in a square of `size_nm`, no noise.
fn perfect(theta: f64, size_nm: f64, angle: f64, origin: Vector2<f64>) -> Image {
    let wavelength = ATOMIC_NM / (2.0 * (theta / 2.0).sin());
    let length = 4.0 * std::f64::consts::PI / (3f64.sqrt() * wavelength);
    let waves = [0.0, 1.0, 2.0].map(|i| {
        let (s, c) = (angle + i * std::f64::consts::FRAC_PI_3).sin_cos();
        length * Vector2::new(c, s)
    });
    let pitch = size_nm / (PIXELS as f64 - 1.0);
    let values = (0..PIXELS * PIXELS).map(|i| {
        let at = Vector2::new((i % PIXELS) as f64, (i / PIXELS) as f64) * pitch - origin;
        waves.iter().map(|q| q.dot(&at).cos()).sum()
    });
    Image::new(PIXELS, PIXELS, values.collect())
}

/// Twist (rad) of the undistorted lattice with the same cell, and the strain ε = 2|q|/(1+ν) with
/// Halbertal's `|q| = a √(l₁² + l₂² − 2 l₁l₂ cos(Δφ − 60°)) / (2 l₁l₂ sin Δφ)`.
fn twist_and_strain(vectors: &Matrix2<f64>) -> (f64, f64) {
    let (a, b) = (vectors.column(0), vectors.column(1));
    let cell = vectors.determinant().abs();
    let twist = 2.0 * (ATOMIC_NM / 2.0 / (2.0 * cell / 3f64.sqrt()).sqrt()).asin();
    let (l1, l2) = (a.norm(), b.norm());
    let between = (a.dot(&b) / (l1 * l2)).acos();
    let apart = between - std::f64::consts::FRAC_PI_3;
    let square = l1 * l1 + l2 * l2 - 2.0 * l1 * l2 * apart.cos();
    let deviator = ATOMIC_NM * square.max(0.0).sqrt() / (2.0 * l1 * l2 * between.sin());
    (twist, 2.0 * deviator / (1.0 + POISSON))
}

/// Mean error of the twist, degrees, and mean strain, per cent, over orientations and origins.
fn bias(method: Method, size_nm: f64, count: u64) -> [f64; 2] {
    let theta = 1.126f64.to_radians();
    let mut rng = stream(1, "summed autocorrelation", 0);
    let geometry = Geometry::nominal([PIXELS; 2], size_nm, size_nm, 0.0, Vector2::zeros()).unwrap();
    let mut mean = [0.0; 2];
    for _ in 0..count {
        let angle = rng.random::<f64>() * std::f64::consts::FRAC_PI_3;
        let origin = Vector2::new(rng.random(), rng.random()) * 12.5;
        let image = perfect(theta, size_nm, angle, origin);
        let found = measure(&image, &geometry, Background::Plane, method).unwrap();
        let (twist, strain) = twist_and_strain(&(geometry.pixel_to_nm * found.pixels.basis));
        mean[0] += (twist - theta).to_degrees() / count as f64;
        mean[1] += 100.0 * strain / count as f64;
    }
    mean
}

/// The sum over the overlap falls with the lag by `w = (1 − |dx|/L)(1 − |dy|/L)` and moves the peak of
/// three equal cosines by `2 ∇ ln w / g²`: at 55 nm the twist comes out too large by 0.015° (0.011 to
/// 0.021 by orientation), at 100 nm by 0.007°. The false strain at 55 nm is 0.012 %, to which whole
/// pixels, 0.006 %, add in squares. Orientations scatter by 0.003° and whole pixels by 0.0016° at 55 nm and
/// 0.003° at 100 nm; of means over fifteen images a quarter is left, and twice or three times that is
/// allowed.
#[test]
fn the_published_method_has_its_bias() {
    let [twist, strain] = bias(Method::Paper, 55.0, 15);
    assert!((twist - 0.015).abs() < 0.0015, "{twist}");
    assert!((strain - 0.0134).abs() < 0.002, "{strain}");
    let [twist, _] = bias(Method::Paper, 100.0, 15);
    assert!((twist - 0.007).abs() < 0.0023, "{twist}");
}

/// On the same images the lattice fit is off by less than 10⁻⁵ degrees, and the autocorrelation divided
/// by its overlap by less than the 0.0004° of a windowed spectrum.
#[test]
fn the_other_methods_have_none() {
    let [twist, strain] = bias(Method::Lattice, 55.0, 3);
    assert!(twist.abs() < 1e-5 && strain < 1e-5, "{twist} {strain}");
    let [twist, strain] = bias(Method::Autocorrelation, 55.0, 3);
    assert!(twist.abs() < 4e-4 && strain < 5e-4, "{twist} {strain}");
}
