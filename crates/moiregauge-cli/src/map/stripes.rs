//! Images without a lattice: stripes, if they show any.

use std::path::PathBuf;

use anyhow::{Context as _, ensure};
use moiregauge::caveat::{Caveat, ChannelReason, Doubt, FileDoubt, MapDoubt, Mapped, PatternDoubt};
use moiregauge::settings::Settings;
use moiregauge::stripes::SampledStripes;
use moiregauge::survey::{ScanStripes, stripes_of_scan};
use moiregauge::window::Resolution;
use moiregauge_pipeline::maps::{mapped_image, narrow_margin};
use moiregauge_pipeline::sink::FolderSink;
use moiregauge_pipeline::{Known, Opened};
use moiregauge_report::results::{MapResults, StripesResult};
use moiregauge_report::{FailedInput, Provenance, stripe_figures, stripe_scan};
use spmfile::WritableFormat;

use super::args::{MapArgs, MapMethodArg};
use super::output;
use crate::analyze::with_advice;
use crate::outputs::write_all;
use crate::stripes::best;

/// Patterns beyond this share of the power of local stripes are one wave.
const STRAIGHT: f64 = 0.5;
/// A mean of the map is compared with the fit to this many errors of both.
const APART: f64 = 3.0;

const ERRORS: &str = "one standard deviation by the noise of the images, node by node, neighbouring nodes not \
     independent, enlarged where the window visibly blurs and near boundaries of patterns; calibration and drift, which \
     all nodes share, are not in them";

/// A map of stripes and what came with it.
pub(super) struct Striped {
    found: ScanStripes,
    settings: Settings,
    pub(super) provenance: Provenance,
    caveats: Vec<Caveat>,
}

/// Maps the stripes of a file without a lattice; `None` where it shows none.
///
/// # Errors
/// More than one file, options that ask for a lattice, an image that shows waves but no stripes.
pub(super) fn look(
    args: &MapArgs,
    inputs: &[PathBuf],
    (settings, known, resolution): (&Settings, &Known, &Resolution),
) -> anyhow::Result<Option<Striped>> {
    let Some(path) = inputs.first() else {
        return Ok(None);
    };
    let Ok(opened) = Opened::new(path, known) else {
        return Ok(None);
    };
    let Some((chosen, _)) = best(&opened, settings) else {
        return Ok(None);
    };
    ensure!(
        inputs.len() == 1,
        "no scan shows a lattice, and maps of stripes are made of one file at a time, found {}",
        inputs.len()
    );
    ensure!(
        args.regions.ask_nothing() && matches!(args.map_method, MapMethodArg::Demodulation),
        "{} shows stripes and no lattice: --region, --profile, --device, --wanted and --map-method tiles need twist \
         and strain, and one wave vector has none",
        path.display()
    );
    let reading = opened.reading(&chosen).map_err(with_advice)?;
    let found = stripes_of_scan(&reading.input.file, &reading.scan, &chosen, resolution)
        .with_context(|| path.display().to_string())?;
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
    doubts(&found, &reading.input.file, &mut caveats);
    if args.margin.is_none() {
        caveats.extend(narrow_margin(found.stripes.margin, &reading.input.file));
    }
    Ok(Some(Striped {
        settings: chosen,
        provenance: Provenance {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            seed: settings.seed,
            inputs: vec![reading.input],
            failed: Vec::<FailedInput>::new(),
            run: None,
        },
        found,
        caveats,
    }))
}

/// What has to be said of the stripes beside their numbers.
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

/// Writes everything and says what there is.
pub(super) fn write(striped: &Striped, args: &MapArgs, sink: FolderSink) -> anyhow::Result<()> {
    let stripes = &striped.found.stripes;
    let scan = stripe_scan(stripes);
    for format in [WritableFormat::Zarr, WritableFormat::Gwy] {
        let files = spmfile::write(&scan, format, "map", &output::log())?;
        write_all(&sink, "", &files)?;
    }
    let figures = |colours| stripe_figures(stripes, colours);
    output::finish(&results(striped), Vec::new(), figures, args, sink)
}

fn results(striped: &Striped) -> MapResults {
    let stripes: &SampledStripes = &striped.found.stripes;
    let found = StripesResult::from(stripes);
    let file = &striped.provenance.inputs[0].file;
    let harmonics: Vec<_> = stripes
        .patterns
        .iter()
        .flat_map(|p| &p.harmonics)
        .copied()
        .collect();
    let about = (&striped.settings, &striped.provenance);
    let lines = striped.found.lines.iter();
    MapResults {
        quantities: found.patterns.iter().flat_map(|p| p.map.clone()).collect(),
        images: lines
            .map(|line| mapped_image(file, Some(*line), striped.found.drift_corrected, &harmonics))
            .collect(),
        stripes: Some(found),
        agreement: stripes.agreement.map(Into::into),
        caveats: striped.caveats.iter().map(Into::into).collect(),
        ..output::document(&stripes.map, about, ("stripes", ERRORS))
    }
}
