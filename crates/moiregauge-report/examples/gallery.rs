//! Writes the whole report of a made-up analysis into the folder given as argument.

#[path = "../tests/common/mod.rs"]
mod common;

use moiregauge_report::{Choice, figures, write_report};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("give a folder to write to")?;
    let folder = std::path::Path::new(&folder);
    std::fs::create_dir_all(folder.join("figures"))?;
    let (analysis, choice) = (common::analysis(), Choice::default());
    for (name, bytes) in write_report(&analysis, &common::provenance(), &choice)? {
        std::fs::write(folder.join(name), bytes)?;
    }
    for figure in figures(&analysis, choice.colormap) {
        if let Err(reason) = figure.drawing {
            println!("{} left out: {reason}", figure.name);
        }
    }
    Ok(())
}
