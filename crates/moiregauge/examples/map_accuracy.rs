//! How accurate maps are, on simulated lattices whose local twist and strain are known.
//!
//! `cargo run --release -p moiregauge --example map_accuracy` prints the tables of `docs/maps.md`: maps that start from
//! the true mean lattice. What the program makes of the same images, which has to find it, `docs/maps_accuracy.sh` tells,
//! by `map_accuracy images DIR` and `map_accuracy compare NAME MAP.gwy`.

use std::f64::consts::{PI, TAU};
use std::time::Instant;

use heterostrain::lattice::Lattice;
use heterostrain::material::Material;
use heterostrain::strain::StrainConvention;
use heterostrain::strain::TwistStrain;
use heterostrain::strain::twist_strain;
use moiregauge::frame::Geometry;
use moiregauge::frame::Image;
use moiregauge::map::{LatticeMap, TwistStrainMap, local_lattices};
use moiregauge::simulate::{FieldScene, Ripple};
use moiregauge::window::{Mask, Reference, Resolution, WaveMap};
use nalgebra::{Matrix2, Matrix4, Rotation2, Vector2};

/// Angle between the displacements and the waves in which they come, rad: strain to 0.38 % for twists of 1.06° to 1.22°.
const OBLIQUE: f64 = 0.9;
/// Twist without ripples, degrees.
const TWIST: f64 = 1.14;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["images", folder] => images(folder),
        ["compare", name, map] => compare(name, map),
        _ => {
            formula();
            offsets();
            published();
        }
    }
}

/// The images for the program, with their names.
fn programs() -> Vec<(String, FieldScene)> {
    let mut all = Vec::new();
    for (size, periods) in [(512, 20.0), (1024, 40.0), (1024, 80.0), (2048, 200.0)] {
        let mut scene = scene(size, periods, 0.1, 1);
        scene.white = scene.signal_rms();
        all.push((format!("varied-{size}-{periods}"), scene));
    }
    for size in [1024, 2048] {
        let mut scene = stretched(size, size as f64 / 25.0, 0.07, 1);
        scene.white = 0.5 * scene.signal_rms();
        all.push((format!("stretched-{size}"), scene));
    }
    all
}

/// Writes them as arrays; prints their names and sides in nm.
fn images(folder: &str) {
    for (name, scene) in programs() {
        let image = scene.image();
        let mut header = format!(
            "{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}",
            image.rows, image.columns
        );
        let padding = (64 - (header.len() + 11) % 64) % 64;
        header.push_str(&" ".repeat(padding));
        header.push('\n');
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        // The first line of an array is the top one.
        for row in (0..image.rows).rev() {
            let line = image.row(row).iter();
            bytes.extend(line.flat_map(|v| (*v as f32).to_le_bytes()));
        }
        let path = std::path::Path::new(folder).join(format!("{name}.npy"));
        std::fs::write(path, bytes).expect("the image is written");
        println!("{name} {}", pitch(&scene) * scene.size[0] as f64);
    }
}

/// A map of the program against the truth.
fn compare(name: &str, map: &str) {
    let (_, scene) = programs()
        .into_iter()
        .find(|(known, _)| known == name)
        .expect("an image of this name");
    let bytes = std::fs::read(map).expect("a map");
    let found = spmfile::read(&bytes).expect("a map");
    let plane = |name: &str| -> Vec<f64> {
        let channel = found.channels.iter().find(|c| c.name == name);
        channel.expect("a channel").values()
    };
    let [x, y] = ["x", "y"].map(plane);
    let (twist, sigma) = (plane("twist"), plane("twist sigma"));
    let (strain, mask) = (plane("strain"), plane("mask"));
    let pitch = pitch(&scene);
    let middle = Vector2::from(scene.size.map(|n| (n as f64 - 1.0) / 2.0));
    let (mut squares, mut inside, mut count) = ([0.0; 2], 0.0, 0.0);
    for node in (0..mask.len()).filter(|&n| mask[n] == 0.0) {
        let at = middle + Vector2::new(x[node], y[node]) / pitch;
        let truth = truth(&(scene.waves(at) / pitch));
        let off = twist[node] - truth.twist.to_degrees();
        squares[0] += off * off;
        squares[1] += (strain[node] - 100.0 * truth.strain_vector.norm()).powi(2);
        inside += f64::from(u8::from(off.abs() < sigma[node]));
        count += 1.0;
    }
    let [theta, strain] = squares.map(|s| (s / count).sqrt());
    println!(
        "| {name} | {count} of {} | {theta:.5} | {strain:.5} | {:.1} % |",
        mask.len(),
        100.0 * inside / count
    );
}

/// A lattice of `periods` periods that is displaced along two waves, at an angle to each: what is along a wave changes the
/// twist, by ± `share` in all, and both parts strain.
fn stretched(size: usize, periods: f64, share: f64, seed: u64) -> FieldScene {
    let mut scene = FieldScene::hexagonal([size, size], size as f64 / periods, 0.3);
    let across = TAU / size as f64;
    for (direction, phase) in [([0.6, 0.8], 0.3), ([-0.8, 0.6], 1.9)] {
        let direction = Vector2::from(direction);
        let wave = direction * across;
        let displaced = Rotation2::new(OBLIQUE) * direction;
        let amplitude = scene.pair.tr_mul(&displaced) * (share / OBLIQUE.cos() / across);
        scene.ripples.push(Ripple {
            wave,
            phase,
            amplitude: amplitude.into(),
        });
    }
    scene.seed = seed;
    scene
}

/// A lattice of `periods` periods whose wave vectors change by ± `share`, with the waves that make it so.
fn scene(size: usize, periods: f64, share: f64, seed: u64) -> FieldScene {
    let mut scene = FieldScene::rippled(size, periods, share);
    scene.seed = seed;
    scene
}

/// Pixels so large that the lattice is that of `TWIST`.
fn pitch(scene: &FieldScene) -> f64 {
    let period = 2.0 * TAU / (3f64.sqrt() * scene.pair.column(0).norm());
    let material = Material::graphene();
    material.lattice_constant_nm / (2.0 * (TWIST.to_radians() / 2.0).sin()) / period
}

fn geometry(scene: &FieldScene) -> Geometry {
    Geometry::of_pitch(scene.size, [pitch(scene); 2], 0.0, Vector2::zeros()).expect("pixels")
}

fn map_of(scene: &FieldScene, image: &Image, window_px: Option<f64>) -> WaveMap {
    let pitch = pitch(scene);
    let reference = Reference {
        pair: scene.pair,
        pitch: [pitch; 2],
    };
    let resolution = Resolution {
        window_nm: window_px.map(|w| w * pitch),
        ..Resolution::default()
    };
    local_lattices(image, &reference, &resolution).expect("a map")
}

fn truth(waves: &Matrix2<f64>) -> TwistStrain {
    let basis = waves.try_inverse().expect("a lattice").transpose() * TAU;
    let lattice = Lattice::new(basis, Matrix4::identity() * 1e-12);
    twist_strain(&lattice, &Material::graphene(), StrainConvention::RealSpace).expect("a moiré")
}

/// What the errors of a map come to.
#[derive(Default)]
struct Errors {
    /// Squares: θ, both components of E, |E|.
    squares: [f64; 3],
    count: f64,
    /// Within one σ: θ, both components of E.
    inside: [f64; 2],
    /// Range of the true θ (°) and the largest |E| (%).
    range: [f64; 3],
}

fn errors(scene: &FieldScene, waves: &WaveMap) -> Errors {
    let geometry = geometry(scene);
    let lattices = LatticeMap::new(waves, &geometry).expect("a geometry");
    let convention = StrainConvention::RealSpace;
    let mean = lattices.mean().expect("good nodes");
    let found = lattices
        .twist_strain(&mean, &Material::graphene(), convention)
        .expect("a moiré");
    let map = TwistStrainMap::new(&lattices, &found);
    let pitch = pitch(scene);
    let back = geometry.pixel_to_nm.try_inverse().expect("a geometry");
    let mut out = Errors {
        range: [f64::INFINITY, 0.0, 0.0],
        ..Errors::default()
    };
    for (node, here) in found.iter().enumerate() {
        let Some(here) = here.filter(|_| map.mask[node] == Mask::Good) else {
            continue;
        };
        let at = back * (map.grid.place(node) - geometry.origin);
        let truth = truth(&(scene.waves(at) / pitch));
        let twist = here.twist - truth.twist;
        let strain = here.strain_vector - truth.strain_vector;
        out.squares[0] += twist * twist;
        out.squares[1] += strain.norm_squared() / 2.0;
        out.squares[2] += (here.strain_vector.norm() - truth.strain_vector.norm()).powi(2);
        out.count += 1.0;
        out.inside[0] += f64::from(u8::from(twist.abs() < here.twist().sigma));
        for i in 0..2 {
            let sigma = here.strain().covariance[(i, i)].sqrt();
            out.inside[1] += 0.5 * f64::from(u8::from(strain[i].abs() < sigma));
        }
        out.range[0] = out.range[0].min(truth.twist);
        out.range[1] = out.range[1].max(truth.twist);
        out.range[2] = out.range[2].max(truth.strain_vector.norm());
    }
    out
}

impl Errors {
    fn add(&mut self, other: &Self) {
        for (a, b) in self.squares.iter_mut().zip(other.squares) {
            *a += b;
        }
        for (a, b) in self.inside.iter_mut().zip(other.inside) {
            *a += b;
        }
        self.count += other.count;
    }

    /// Root mean squares: θ in degrees, a component of E and |E| in per cent.
    fn rms(&self) -> [f64; 3] {
        let [a, b, c] = self.squares.map(|s| (s / self.count).sqrt());
        [a.to_degrees(), 100.0 * b, 100.0 * c]
    }

    fn covered(&self) -> [f64; 2] {
        self.inside.map(|n| 100.0 * n / self.count)
    }
}

/// `σ_g = (σ/A)/(2√π w²)`, `σ_θ = σ_g/(√3|G|)`, `σ_E = 2σ_θ/(1+ν)`: degrees and per cent.
fn expected(scene: &FieldScene, window_px: f64) -> [f64; 2] {
    let slope = scene.white / (2.0 * PI.sqrt() * window_px * window_px) / pitch(scene);
    let material = Material::graphene();
    let length = 2.0 * TAU / (3f64.sqrt() * material.lattice_constant_nm);
    let twist = slope / (3f64.sqrt() * length);
    [
        twist.to_degrees(),
        200.0 * twist / (1.0 + material.poisson_ratio),
    ]
}

/// Fields of ± 10 %, noise as strong as the signal: errors against the formula and the stated errors.
fn formula() {
    println!(
        "Wave vectors ± 10 % over the frame, white noise as strong as the signal, windows chosen by themselves.\n\n\
         | image | periods | window, periods | θ rms, ° | over formula | E rms, % | over formula | σ of θ covers | σ of E covers |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    for (size, periods) in [(512, 20.0), (1024, 40.0), (1024, 80.0), (2048, 200.0)] {
        let mut all = Errors::default();
        let (mut window, mut of_formula) = (0.0, [0.0; 2]);
        let seeds = if size < 2048 { 8 } else { 2 };
        for seed in 1..=seeds {
            let mut scene = scene(size, periods, 0.1, seed);
            scene.white = scene.signal_rms();
            let map = map_of(&scene, &scene.image(), None);
            all.add(&errors(&scene, &map));
            let expected = expected(&scene, map.window_nm / pitch(&scene));
            for (sum, e) in of_formula.iter_mut().zip(expected) {
                *sum += e * e / f64::from(seeds as u32);
            }
            window += map.window_nm / map.reference.period() / seeds as f64;
        }
        let ([twist, strain, _], [a, b]) = (all.rms(), all.covered());
        let [theta, e] = of_formula.map(f64::sqrt);
        println!(
            "| {size}² | {periods} | {window:.2} | {twist:.4} | {:.2} | {strain:.4} | {:.2} | {a:.1} % | {b:.1} % |",
            twist / theta,
            strain / e
        );
    }
}

/// Lines with offsets: errors against the stated ones, wave vectors in several directions to the lines.
fn offsets() {
    println!(
        "\nOffsets of lines as large as the signal, white noise half of it, 512² pixels, 20 periods.\n\n\
         | nearest wave to the slow axis, ° | window, periods | θ rms, ° | E rms, % | σ of θ covers | σ of E covers |\n\
         | --- | --- | --- | --- | --- | --- |"
    );
    for aside in [0.0f64, 4.0, 10.0, 20.0, 30.0] {
        let mut all = Errors::default();
        let mut window = 0.0;
        for seed in 1..=8 {
            let angle = (30.0 - aside).to_radians();
            let mut scene = FieldScene::hexagonal([512, 512], 25.6, angle);
            scene.line = scene.signal_rms();
            scene.white = 0.5 * scene.line;
            scene.seed = seed;
            let map = map_of(&scene, &scene.image(), None);
            all.add(&errors(&scene, &map));
            window += map.window_nm / map.reference.period() / 8.0;
        }
        let ([twist, strain, _], [a, b]) = (all.rms(), all.covered());
        println!("| {aside} | {window:.2} | {twist:.4} | {strain:.4} | {a:.1} % | {b:.1} % |");
    }
}

/// The conditions in which published tools were measured: 25 pixels per period, noise half the signal.
fn published() {
    println!(
        "\n25 pixels per period, noise 0.5 of the signal, errors against the true local values, blur included.\n\n\
         | image | window, px | θ, ° | largest |E|, % | θ rms, ° | |E| rms, % | σ of θ covers | seconds |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    for size in [2048, 4096] {
        for window in [Some(23.0), None] {
            let mut scene = stretched(size, size as f64 / 25.0, 0.07, 1);
            scene.white = 0.5 * scene.signal_rms();
            let image = scene.image();
            let start = Instant::now();
            let map = map_of(&scene, &image, window);
            let seconds = start.elapsed().as_secs_f64();
            let found = errors(&scene, &map);
            let ([twist, _, strain], [covered, _]) = (found.rms(), found.covered());
            println!(
                "| {size}² | {:.1}{} | {:.2} to {:.2} | {:.2} | {twist:.5} | {strain:.5} | {covered:.1} % | {seconds:.2} |",
                map.window_nm / pitch(&scene),
                if window.is_none() { " (chosen)" } else { "" },
                found.range[0].to_degrees(),
                found.range[1].to_degrees(),
                100.0 * found.range[2],
            );
        }
    }
}
