//! What stripes an image without a lattice shows, in short.

use std::path::{Path, PathBuf};

use moiregauge::scan::channels_by_preference;
use moiregauge::settings::Settings;
use moiregauge::survey::stripes_in_short;
use moiregauge_pipeline::{Known, Opened};

/// The channel in which a file shows stripes best: settings that name it, and its patterns (wavelength in nm, direction
/// in rad, log₁₀ of the chance of noise).
pub(crate) fn best(opened: &Opened, settings: &Settings) -> Option<(Settings, Vec<[f64; 3]>)> {
    let names: Vec<String> = if let Some(name) = &settings.channel {
        vec![name.clone()]
    } else {
        let all = opened.names();
        let all = channels_by_preference(&all);
        all.into_iter().map(str::to_owned).collect()
    };
    let mut best: Option<(Settings, Vec<[f64; 3]>)> = None;
    let total = |found: &[[f64; 3]]| found.iter().map(|f| f[2]).sum::<f64>();
    for name in names {
        let settings = Settings {
            channel: Some(name),
            ..settings.clone()
        };
        let Ok(image) = opened.image(&settings) else {
            continue;
        };
        let found = stripes_in_short(&image, &settings);
        if total(&found) < best.as_ref().map_or(0.0, |b| total(&b.1)) {
            best = Some((settings, found));
        }
    }
    best
}

/// What stripes the first of some files shows, where it shows any; for an analysis that found no lattice.
pub(crate) fn in_words(inputs: &[PathBuf], settings: &Settings, known: &Known) -> Option<String> {
    let path: &Path = inputs.first()?;
    let (settings, found) = best(&Opened::new(path, known).ok()?, settings)?;
    let channel = settings.channel.unwrap_or_default();
    let all: Vec<String> = found
        .iter()
        .map(|[length, along, _]| format!("about {length:.1} nm along {:.0}°", along.to_degrees()))
        .collect();
    Some(format!(
        "{} shows stripes in {channel}: {}. One wave vector says nothing of twist and strain; `moiregauge map` maps \
         wavelength and direction",
        path.display(),
        all.join(" and ")
    ))
}
