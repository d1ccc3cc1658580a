//! Maps the scans of a folder and asks where the twist is that of a magic angle:
//! `cargo run --example map_question DIR`.

use std::path::PathBuf;

use moiregauge::Settings;
use moiregauge::region::WantedTwist;
use moiregauge::survey::MapMethod;
use moiregauge::window::Resolution;
use moiregauge_pipeline::campaign::{Campaign, no_advice};
use moiregauge_pipeline::maps::{Questions, Scans, map_lattices};
use moiregauge_pipeline::{Job, Known, find};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("expected a folder")?);
    let (inputs, _) = find(&[folder]).frames();
    let job = Job::quiet(None)?;
    let mut campaign = Campaign::new(Settings::default())?;
    campaign.add(inputs.clone());
    let scans = Scans {
        analysis: &campaign.analyse(&job)?[0].analysis,
        inputs: &inputs,
        known: &Known::new(campaign.told(), &inputs),
        advice: no_advice,
    };
    let found = map_lattices(
        &scans,
        MapMethod::Demodulation,
        &Resolution::default(),
        &job,
    )?;
    let magic = Questions {
        wanted: Some(WantedTwist {
            twist: 1.08_f64.to_radians(),
            within: 0.02_f64.to_radians(),
        }),
        ..Questions::default()
    };
    let (answers, _) = magic.ask(&found.map)?;
    println!("1.08 ± 0.02°: {:?}", answers.wanted);
    Ok(())
}
