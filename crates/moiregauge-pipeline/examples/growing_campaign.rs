//! A campaign that grows scan by scan, as at an instrument, and is kept in a file between two days:
//! `cargo run --example growing_campaign DIR campaign.json`.

use std::path::{Path, PathBuf};

use moiregauge::Settings;
use moiregauge_pipeline::campaign::Campaign;
use moiregauge_pipeline::{Job, find};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (folder, file) = arguments
        .next()
        .zip(arguments.next())
        .ok_or("expected a folder and a file")?;
    let mut campaign: Campaign = if Path::new(&file).exists() {
        serde_json::from_str(&std::fs::read_to_string(&file)?)?
    } else {
        Campaign::new(Settings::default())?
    };
    let job = Job::quiet(None)?;
    let (scans, _) = find(&[PathBuf::from(folder)]).frames();
    for scan in scans {
        if campaign.inputs().contains(&scan) {
            continue;
        }
        campaign.add([scan.clone()]);
        // Only the new scan is measured.
        for outcome in campaign.analyse(&job)? {
            if let Some(all) = &outcome.analysis.combined {
                let twist = all.twist_strain.twist();
                println!("{}: {:.4}°", scan.display(), twist.value.to_degrees());
            }
        }
    }
    std::fs::write(&file, serde_json::to_vec(&campaign)?)?;
    Ok(())
}
