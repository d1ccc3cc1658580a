//! Analyses the scans of a folder with progress, and stops after ten seconds: `cargo run --example analyse_folder DIR`.

use std::path::PathBuf;
use std::time::Duration;

use moiregauge::Settings;
use moiregauge_pipeline::campaign::{AnalyseError, Campaign};
use moiregauge_pipeline::{Cancel, Event, Events, Job, find};

/// Every event as a line of JSON.
struct Lines;

impl Events for Lines {
    fn tell(&self, event: &Event<'_>) {
        eprintln!("{}", serde_json::to_string(event).unwrap_or_default());
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("expected a folder")?);
    let (scans, _) = find(&[folder]).frames();
    let cancel = Cancel::new();
    let job = Job::new(None, cancel.clone(), &Lines)?;
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs(10));
        cancel.cancel();
    });
    let mut campaign = Campaign::new(Settings::default())?;
    campaign.add(scans);
    match campaign.analyse(&job) {
        Ok(moires) => print!(
            "{}",
            moiregauge_report::screen::summary(&moires[0].analysis, |_| None)
        ),
        Err(AnalyseError::Cancelled(_)) => println!("{} scans are measured", campaign.kept().len()),
        Err(error) => return Err(error.into()),
    }
    Ok(())
}
