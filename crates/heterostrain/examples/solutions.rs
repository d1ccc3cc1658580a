//! All solutions of a moiré of twisted bilayer graphene.
//!
//! ```text
//! cargo run -p heterostrain --example solutions -- 12.9,0.4 6.1,11.5
//! ```

use std::error::Error;

use heterostrain::strain::{StrainConvention, solutions};
use heterostrain::{Lattice, Material};
use nalgebra::Matrix2;

fn main() -> Result<(), Box<dyn Error>> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let [first, second] = match given.as_slice() {
        [] => [[12.9, 0.4], [6.1, 11.5]],
        [first, second] => [vector(first)?, vector(second)?],
        _ => return Err("give two vectors in nm, as in 12.9,0.4 6.1,11.5".into()),
    };
    let lattice = Lattice::exact(Matrix2::new(first[0], second[0], first[1], second[1]));
    let found = solutions(&lattice, &Material::graphene(), StrainConvention::RealSpace)?;
    println!("twist (°)  strain (%)  axis to x (°)");
    for reading in &found.branches {
        println!(
            "{:9.4} {:11.4} {:14.1}",
            reading.twist.to_degrees(),
            100.0 * reading.strain,
            reading.axis_lab.to_degrees()
        );
    }
    println!("all with strains up to {:.2} %", 100.0 * found.complete_to);
    Ok(())
}

fn vector(text: &str) -> Result<[f64; 2], Box<dyn Error>> {
    let parts: Vec<f64> = text.split(',').map(str::parse).collect::<Result<_, _>>()?;
    let [x, y] = parts.as_slice() else {
        return Err(format!("expected two numbers as in 12.9,0.4, found {text:?}").into());
    };
    Ok([*x, *y])
}
