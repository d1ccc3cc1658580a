//! The mean of every line of a channel of a file of any length, a line in memory at a time:
//! `cargo run --example rows -- survey.sxm 0`

use std::sync::Arc;

use spmfile::{File, OpenOptions, Seekable};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments
        .next()
        .ok_or("expected a file and the number of a channel")?;
    let number: usize = arguments.next().unwrap_or_default().parse()?;
    let source = Seekable::new(std::fs::File::open(path)?);
    let file = File::open_source(Arc::new(source), &OpenOptions::default())?;
    let frame = &file.frames()[0];
    let channel = frame
        .channels()
        .nth(number)
        .ok_or("expected a smaller number")?;
    for row in 0..channel.rows {
        let line = frame.rows(number, row..row + 1)?;
        println!("{row} {}", line.iter().sum::<f64>() / line.len() as f64);
    }
    Ok(())
}
