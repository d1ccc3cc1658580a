//! Images without a lattice: stripes, if they show any.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use moiregauge::caveat::{Caveat, ChannelReason, Doubt, FileDoubt, MapDoubt, Mapped, PatternDoubt};
use moiregauge::scan::channels_by_preference;
use moiregauge::settings::Settings;
use moiregauge::stripes::SampledStripes;
use moiregauge::survey::{ScanStripes, stripes_in_short, stripes_of_scan};
use moiregauge::window::Resolution;
use moiregauge_pipeline::sink::FolderSink;
use moiregauge_report::results::{
    Conventions, MapDetailsResult, MapResults, StripesResult, mask_counts,
};
use moiregauge_report::{
    FailedInput, Provenance, figure_files, map_page, plus_minus, stripe_figures, stripe_scan,
    two_digits,
};
use spmfile::{LineDirection, WritableFormat};

use super::{MapArgs, MapMethodArg, output};
use crate::analyze::read;
use crate::input::Known;
use crate::outputs::{commit, write_all};
use crate::say::say;

/// Patterns beyond this share of the power of local stripes are one wave.
const STRAIGHT: f64 = 0.5;
/// A mean of the map is compared with the fit to this many errors of both.
const APART: f64 = 3.0;

const ERRORS: &str = "one standard deviation by the noise of the images, node by node, neighbouring nodes not \
     independent, enlarged where the window visibly blurs and near boundaries of patterns; calibration and drift, which \
     all nodes share, are not in them";

/// The channel in which a file shows stripes best: settings that name it, and its patterns (wavelength in nm, direction
/// in rad, log₁₀ of the chance of noise).
fn best(path: &Path, settings: &Settings, known: &Known) -> Option<(Settings, Vec<[f64; 3]>)> {
    let names = if let Some(name) = &settings.channel {
        vec![name.clone()]
    } else {
        let names = crate::analyze::channel_names(path, known)?;
        let names: Vec<_> = names
            .iter()
            .map(|(a, b)| (a.as_str(), b.as_str()))
            .collect();
        let all = channels_by_preference(&names);
        all.into_iter().map(str::to_owned).collect()
    };
    let mut best: Option<(Settings, Vec<[f64; 3]>)> = None;
    let total = |found: &[[f64; 3]]| found.iter().map(|f| f[2]).sum::<f64>();
    for name in names {
        let settings = Settings {
            channel: Some(name),
            ..settings.clone()
        };
        let Ok(reading) = read(path, &settings, known) else {
            continue;
        };
        let found = stripes_in_short(&reading.scan, &settings);
        if total(&found) < best.as_ref().map_or(0.0, |b| total(&b.1)) {
            best = Some((settings, found));
        }
    }
    best
}

/// What stripes the first of some files shows, where it shows any; for an analysis that found no lattice.
pub(crate) fn in_words(inputs: &[PathBuf], settings: &Settings, known: &Known) -> Option<String> {
    let path = inputs.first()?;
    let (settings, found) = best(path, settings, known)?;
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
    let Some((chosen, _)) = best(path, settings, known) else {
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
    let reading = read(path, &chosen, known)?;
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
        caveats.extend(super::narrow_margin(
            found.stripes.margin,
            &reading.input.file,
        ));
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

/// Writes everything and says what there is.
pub(super) fn write(striped: &Striped, args: &MapArgs, sink: FolderSink) -> anyhow::Result<()> {
    let (stripes, out) = (&striped.found.stripes, args.analyze.out());
    let log = vec![format!("moiregauge {} map", env!("CARGO_PKG_VERSION"))];
    let scan = stripe_scan(stripes);
    for format in [WritableFormat::Zarr, WritableFormat::Gwy] {
        write_all(&sink, "", &spmfile::write(&scan, format, "map", &log)?)?;
    }
    let results = results(striped);
    let mut files = vec![("map.json".to_owned(), serde_json::to_vec_pretty(&results)?)];
    let choice = args.analyze.choice();
    if choice.figures || choice.png || choice.html {
        let figures = stripe_figures(stripes, choice.colormap);
        if choice.html {
            let page = map_page(&results, &figures, &files)?;
            files.push(("report.html".to_owned(), page));
        }
        files.extend(figure_files(&figures, choice)?);
    }
    write_all(&sink, "", &files)?;
    commit(sink)?;
    if args.analyze.json() {
        say(&format!("{}\n", serde_json::to_string_pretty(&results)?))?;
    } else if args.analyze.is_loud() {
        say(&output::summary(&results))?;
        say(&format!(
            "\nWritten to {}\n",
            out.join("map.json").display()
        ))?;
    }
    Ok(())
}

fn results(striped: &Striped) -> MapResults {
    let stripes: &SampledStripes = &striped.found.stripes;
    let map = &stripes.map;
    let [columns, rows] = [0, 1].map(|i| map.grid.step.column(i).into_owned());
    let found = StripesResult::from(stripes);
    let file = &striped.provenance.inputs[0].file;
    let harmonics: Vec<_> = stripes
        .patterns
        .iter()
        .flat_map(|p| &p.harmonics)
        .copied()
        .collect();
    MapResults {
        schema: "moiregauge/map/1".to_owned(),
        provenance: striped.provenance.clone(),
        conventions: Conventions::of(&striped.settings),
        errors: ERRORS.to_owned(),
        settings: striped.settings.clone(),
        method: "stripes".to_owned(),
        window_nm: map.window_nm,
        resolution_nm: 2.355 * map.window_nm,
        nodes: map.grid.size,
        origin_nm: map.grid.origin.into(),
        step_nm: [columns.into(), rows.into()],
        extent_nm: map.grid.extent(),
        masks: mask_counts(map),
        quantities: found.patterns.iter().flat_map(|p| p.map.clone()).collect(),
        whole_image: None,
        images: striped
            .found
            .lines
            .iter()
            .map(|line: &LineDirection| {
                output::image(file, Some(*line), striped.found.drift_corrected, &harmonics)
            })
            .collect(),
        stripes: Some(found),
        agreement: stripes.agreement.map(Into::into),
        drift_change: None,
        details: MapDetailsResult::default(),
        caveats: striped.caveats.iter().map(Into::into).collect(),
    }
}

/// The patterns, for the screen.
pub(super) fn summary(found: &StripesResult) -> String {
    let mut text = String::new();
    for p in &found.patterns {
        let shown = |v: Option<moiregauge_report::results::ResultEstimate>| {
            v.map_or_else(
                || "–".to_owned(),
                |e| {
                    let known = |v: Option<f64>| v.unwrap_or(f64::NAN);
                    plus_minus(heterostrain::Estimate::new(known(e.value), known(e.sigma)))
                },
            )
        };
        let strongest = p.harmonics.iter().map(|h| h.local_amplitude);
        let strongest = strongest.fold(0.0, f64::max);
        let harmonics: Vec<String> = p
            .harmonics
            .iter()
            .map(|h| two_digits(h.local_amplitude / strongest))
            .collect();
        let _ = writeln!(
            text,
            "pattern {}: {} % of the nodes, {} good; one wave fitted to its pixels: {} nm along {}° ({:.0} % of the \
             local power); chance of noise 10^{:.0}; its harmonics are as strong as {}",
            p.number,
            p.share_percent.round(),
            p.good_nodes,
            shown(p.wavelength_nm),
            shown(p.direction_deg),
            p.coherence_percent.unwrap_or(f64::NAN),
            p.log10_chance,
            harmonics.join(" : ")
        );
    }
    text
}
