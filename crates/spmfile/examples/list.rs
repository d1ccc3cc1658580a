//! Lists the channels of a file without decoding them: `cargo run --example list -- scan.spm`

use spmfile::{File, OpenOptions};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("expected a file")?;
    let bytes = std::fs::read(path)?;
    let mut options = OpenOptions::default();
    options.damaged = true;
    let file = File::open_with(&bytes, &options)?;
    for frame in file.frames() {
        println!("{}, {:?} nm", frame.header().format, frame.header().size_nm);
        for (number, channel) in frame.channels().enumerate() {
            let (name, unit) = (&channel.info.name, &channel.unit);
            println!(
                "{number}: {name} in {unit}, {} x {}",
                channel.columns, channel.rows
            );
        }
        for lost in frame.unreadable() {
            println!("not read: {}: {}", lost.name, lost.error);
        }
        if let Some(damage) = frame.damage() {
            println!("damaged: {damage}");
        }
    }
    Ok(())
}
