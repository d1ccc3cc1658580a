//! Images for trying out maps, as NumPy arrays on the standard output: `field`, a lattice that changes smoothly, or
//! `domains`, a relaxed lattice at a small angle with a missing node.
//!
//! `cargo run --release -p moiregauge --example map_images field > field.npy`

use std::io::{Error, Write as _};

use moiregauge::image::Image;
use moiregauge::simulate::{DomainScene, FieldScene, Ripple};
use nalgebra::Vector2;

fn main() -> Result<(), Error> {
    let image = match std::env::args().nth(1).as_deref() {
        Some("field") => field(),
        Some("domains") => domains(),
        _ => return Err(Error::other("say which: field or domains")),
    };
    std::io::stdout().write_all(&array(&image))
}

/// 24 pixels per period; wave vectors that change by some per cent.
fn field() -> Image {
    let mut scene = FieldScene::hexagonal([640, 560], 24.0, 0.3);
    scene.white = 0.6;
    let ripple = |x: f64, y: f64, phase: f64, amplitude: [f64; 2]| Ripple {
        wave: Vector2::new(x, y),
        phase,
        amplitude,
    };
    scene.ripples = vec![
        ripple(0.007, 0.003, 0.4, [1.6, -0.8]),
        ripple(-0.002, 0.006, 1.1, [-0.7, 1.5]),
    ];
    scene.image()
}

/// 48 pixels per period.
fn domains() -> Image {
    let mut scene = DomainScene::hexagonal([560, 480], 48.0, 0.2);
    scene.ripples = vec![
        (Vector2::new(0.008, 0.003), 0.4, Vector2::new(10.0, 4.0)),
        (Vector2::new(-0.004, 0.009), 1.3, Vector2::new(-3.0, 8.0)),
    ];
    scene.missing = vec![[1, -1]];
    (scene.white, scene.seed) = (0.3, 2);
    scene.image()
}

/// Top line first.
fn array(image: &Image) -> Vec<u8> {
    let header = format!(
        "{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}\n",
        image.rows, image.columns
    );
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for row in (0..image.rows).rev() {
        let line = image.row(row).iter();
        bytes.extend(line.flat_map(|v| (*v as f32).to_le_bytes()));
    }
    bytes
}
