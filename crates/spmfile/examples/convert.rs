//! A file as one of another format: `cargo run --example convert -- scan.spm scan.gwy`

use std::path::Path;

use spmfile::{WritableFormat, read, write};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (from, to) = arguments
        .next()
        .zip(arguments.next())
        .ok_or("expected two files")?;
    let to = Path::new(&to);
    let extension = to.extension().unwrap_or_default().to_string_lossy();
    let format =
        WritableFormat::from_extension(&extension).ok_or("expected a format that is written")?;
    let scan = read(&std::fs::read(from)?)?;
    let stem = to.with_extension("");
    for (name, bytes) in write(&scan, format, &stem.to_string_lossy(), &[])? {
        if let Some(folder) = Path::new(&name).parent() {
            std::fs::create_dir_all(folder)?;
        }
        std::fs::write(name, bytes)?;
    }
    Ok(())
}
