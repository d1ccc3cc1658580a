//! Small simulated scans and their analysis.

use std::path::{Path, PathBuf};

use moiregauge::settings::Settings;
use moiregauge::simulate::{Simulation, Simulator};
use moiregauge_pipeline::campaign::{Campaign, Outcome};
use moiregauge_report::Results;

/// Frames of one simulated set, as files.
pub(crate) fn scans(folder: &Path, count: usize) -> Vec<PathBuf> {
    scans_of(folder, count, 64)
}

/// The same with a number of pixels along a side.
pub(crate) fn scans_of(folder: &Path, count: usize, pixels: usize) -> Vec<PathBuf> {
    let mut made = Simulation::default();
    made.raster.pixels = [pixels; 2];
    made.raster.scans = count;
    let simulator = Simulator::new(made).unwrap();
    let write = |index: usize| {
        let path = folder.join(Simulator::file_name(index));
        let bytes = spmfile::nanoscope::write(&simulator.frame(index)).unwrap();
        std::fs::write(&path, bytes).unwrap();
        path
    };
    (0..count).map(write).collect()
}

pub(crate) fn settings() -> Settings {
    Settings {
        drift_draws: 10,
        strain_draws: 10,
        ..Settings::default()
    }
}

pub(crate) fn campaign(scans: &[PathBuf]) -> Campaign {
    let mut campaign = Campaign::new(settings()).unwrap();
    campaign.add(scans.iter().cloned());
    campaign
}

/// The document, which has every number.
pub(crate) fn document(outcomes: &[Outcome]) -> String {
    let [
        Outcome {
            analysis,
            provenance,
        },
    ] = outcomes
    else {
        panic!("one moiré");
    };
    String::from_utf8(Results::new(analysis, provenance).to_json().unwrap()).unwrap()
}
