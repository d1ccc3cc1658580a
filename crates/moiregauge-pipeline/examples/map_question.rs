//! Maps the scans of a folder and asks where the twist is that of a magic angle:
//! `cargo run --example map_question DIR`.

use std::path::PathBuf;

use moiregauge::Settings;
use moiregauge::region::WantedTwist;
use moiregauge_pipeline::campaign::Campaign;
use moiregauge_pipeline::maps::{MapRequest, Questions};
use moiregauge_pipeline::sink::{Forget, MemorySink};
use moiregauge_pipeline::{Job, find, map};
use moiregauge_report::Choice;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("expected a folder")?);
    let mut campaign = Campaign::new(Settings::default())?;
    campaign.add(find(&[folder]).frames().0);
    let wanted = WantedTwist {
        twist: 1.08_f64.to_radians(),
        within: 0.02_f64.to_radians(),
    };
    let request = MapRequest {
        questions: Questions {
            wanted: Some(wanted),
            ..Questions::default()
        },
        ..MapRequest::default()
    };
    let found = map(&mut campaign, &request, &Forget, &Job::quiet(None)?)?;
    // Documents, tables, arrays and figures, in memory.
    let files = MemorySink::new();
    let results = found.write(&request, Choice::default(), &files)?;
    println!("1.08 ± 0.02°: {:?}", results.details.wanted);
    println!("{} files", files.commit("map")?.len());
    Ok(())
}
