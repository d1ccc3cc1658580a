//! Images without a lattice: stripes, if they show any.

use std::path::PathBuf;

use moiregauge::caveat::{Caveat, ChannelReason, Doubt, FileDoubt, MapDoubt, Mapped, PatternDoubt};
use moiregauge::scan::channels_by_preference;
use moiregauge::settings::Settings;
use moiregauge::stripes::SampledStripes;
use moiregauge::survey::{MapMethod, ScanStripes, stripes_in_short, stripes_of_scan};
use moiregauge_report::Provenance;
use moiregauge_report::results::StripesResult;

use super::doubts::narrow_margin;
use super::error::NoStripes;
use super::found::{MapFound, Shown};
use super::lattices::mapped_image;
use super::request::MapRequest;
use crate::campaign::Campaign;
use crate::known::Known;
use crate::opened::Opened;

/// Patterns beyond this share of the power of local stripes are one wave.
const STRAIGHT: f64 = 0.5;
/// A mean of the map is compared with the fit to this many errors of both.
const APART: f64 = 3.0;

/// What stripes a file shows, in short.
#[derive(Clone, Debug, PartialEq)]
pub struct StripesSeen {
    /// The file.
    pub file: PathBuf,
    /// The channel that shows them best.
    pub channel: String,
    /// The patterns: wavelength, nm, and direction, rad.
    pub patterns: Vec<[f64; 2]>,
}

/// What stripes the first of some files shows, where it shows any; for an analysis that found no lattice.
pub fn stripes_seen(inputs: &[PathBuf], settings: &Settings, known: &Known) -> Option<StripesSeen> {
    let path = inputs.first()?;
    let (settings, found) = best(&Opened::new(path, known).ok()?, settings)?;
    Some(StripesSeen {
        file: path.clone(),
        channel: settings.channel.unwrap_or_default(),
        patterns: found
            .iter()
            .map(|&[length, along, _]| [length, along])
            .collect(),
    })
}

/// The channel in which a file shows stripes best: settings that name it, and its patterns (wavelength in nm, direction
/// in rad, log₁₀ of the chance of noise).
fn best(opened: &Opened, settings: &Settings) -> Option<(Settings, Vec<[f64; 3]>)> {
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

/// Maps the stripes of a file without a lattice; `None` where it shows none.
pub(super) fn look(
    campaign: &Campaign,
    request: &MapRequest,
) -> Result<Option<MapFound>, NoStripes> {
    let (inputs, settings, known) = (campaign.inputs(), campaign.settings(), campaign.known());
    let Some(path) = inputs.first() else {
        return Ok(None);
    };
    let Ok(opened) = Opened::new(path, &known) else {
        return Ok(None);
    };
    let Some((chosen, _)) = best(&opened, settings) else {
        return Ok(None);
    };
    if inputs.len() != 1 {
        return Err(NoStripes::SeveralFiles(inputs.len()));
    }
    if !request.questions.is_empty() || request.method != MapMethod::Demodulation {
        return Err(NoStripes::NoTwist(path.clone()));
    }
    let reading = opened.reading(&chosen)?;
    let file = &reading.input.file;
    let found = stripes_of_scan(file, &reading.scan, &chosen, &request.resolution());
    let found = found.map_err(|source| NoStripes::Stripes {
        file: path.clone(),
        source,
    })?;
    let mut caveats = found.caveats.clone();
    if settings.channel.is_none() {
        caveats.push(Caveat::new(
            FileDoubt::ChannelChosen {
                channel: found.channel.clone(),
                why: ChannelReason::BestStripes,
            },
            "map",
        ));
    }
    doubts(&found, file, &mut caveats);
    if request.margin.is_none() {
        caveats.extend(narrow_margin(found.stripes.margin, file));
    }
    Ok(Some(MapFound {
        refused: None,
        images: images(&found, file),
        shown: Shown::Stripes(Box::new(found)),
        provenance: Provenance {
            version: crate::VERSION.to_owned(),
            seed: settings.seed,
            inputs: vec![reading.input],
            failed: Vec::new(),
            run: None,
        },
        settings: chosen,
        caveats,
    }))
}

/// The lines behind the map.
fn images(found: &ScanStripes, file: &str) -> Vec<moiregauge_report::results::MappedImage> {
    let patterns = found.stripes.patterns.iter();
    let harmonics: Vec<_> = patterns.flat_map(|p| &p.harmonics).copied().collect();
    let lines = found.lines.iter();
    lines
        .map(|line| mapped_image(file, Some(*line), found.drift_corrected, &harmonics))
        .collect()
}

/// Caveats of a map of stripes.
fn doubts(found: &ScanStripes, file: &str, caveats: &mut Vec<Caveat>) {
    let mut doubt = |doubt: Doubt| caveats.push(Caveat::new(doubt, file));
    doubt(PatternDoubt::StripesOnly.into());
    let stripes = &found.stripes;
    let [first, ..] = stripes.patterns.as_slice() else {
        return;
    };
    if stripes.patterns.len() > 1 {
        let shares = stripes.patterns.iter().map(|p| p.share).collect();
        doubt(PatternDoubt::StripeDomains { shares }.into());
    } else if first.share < 0.9 {
        doubt(PatternDoubt::StripesInPart { share: first.share }.into());
    }
    about_patterns(stripes, &mut doubt);
    if !found.drift_corrected {
        doubt(
            MapDoubt::NotDriftCorrected {
                of: Mapped::Stripes,
            }
            .into(),
        );
    }
    if !stripes.noise_measured {
        doubt(
            MapDoubt::NoiseGuessed {
                of: Mapped::Stripes,
            }
            .into(),
        );
    }
}

/// What single waves and the map disagree about.
fn about_patterns(stripes: &SampledStripes, doubt: &mut impl FnMut(Doubt)) {
    for (pattern, number) in stripes.patterns.iter().zip(1..) {
        if pattern.coherence < STRAIGHT {
            doubt(
                PatternDoubt::StripesVary {
                    pattern: number,
                    coherence: pattern.coherence,
                }
                .into(),
            );
        }
    }
    for pattern in StripesResult::from(stripes).patterns {
        let Some([length, along]) = pattern.apart() else {
            continue;
        };
        if [length, along]
            .iter()
            .any(|e| e.value.abs() > APART * e.sigma)
        {
            doubt(
                PatternDoubt::StripesMapAndFit {
                    pattern: pattern.number,
                    wavelength: length,
                    direction: along.scaled(1f64.to_radians()),
                }
                .into(),
            );
        }
    }
}
