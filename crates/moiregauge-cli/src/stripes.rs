//! What stripes an image without a lattice shows, in words.

use std::path::PathBuf;

use moiregauge::settings::Settings;
use moiregauge_pipeline::Known;
use moiregauge_pipeline::maps::stripes_seen;
use moiregauge_report::two_digits;

/// What stripes the first of some files shows, where it shows any; for an analysis that found no lattice.
pub(crate) fn in_words(inputs: &[PathBuf], settings: &Settings, known: &Known) -> Option<String> {
    let seen = stripes_seen(inputs, settings, known)?;
    let all: Vec<String> = seen
        .patterns
        .iter()
        .map(|[length, along]| {
            format!(
                "about {} nm along {:.0}°",
                two_digits(*length),
                along.to_degrees()
            )
        })
        .collect();
    Some(format!(
        "{} shows stripes in {}: {}. One wave vector does not determine twist and strain. `moiregauge map` maps \
         wavelength and direction",
        seen.file.display(),
        seen.channel,
        all.join(" and ")
    ))
}
