//! `moiregauge map`: scan files → maps of twist, strain and lattice with their errors.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context as _, bail, ensure};
use moiregauge::analysis::{Analysis, ScanAnalysis, SetAnalysis};
use moiregauge::caveat::Caveat;
use moiregauge::map::{LatticeMap, Resolution, TwistStrainMap, combine};
use moiregauge::series::{LineMap, map_scan};
use moiregauge_report::results::{
    Conventions, MapResults, MappedImage, TwistStrainResult, mask_counts, quantities,
};
use moiregauge_report::{
    FailedInput, Provenance, figure_files, map_figures, map_scan as as_scan, two_digits,
};
use spmfile::{LineDirection, WritableFormat};

use crate::analyze::{AnalyzeArgs, Outcome, analyse_files, read, write_all};
use crate::info::expand;
use crate::say::say;

/// Maps of twist, strain, wavelength and orientation across an image, with the error of every node
///
/// The scans are analysed first as `moiregauge analyze` does; their drift and sensors correct the maps. Local
/// wave vectors of all harmonics come from the phases under a Gaussian window; maps of scans of one place are
/// compared and averaged. Nodes that are not to be believed (edges, weak signal, defects, boundaries) are
/// marked with the reason.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge map scan.000 --out maps
  moiregauge map scans/ --out maps --window 12
  moiregauge map survey.npy --out maps --size 1.5um×1.5um --step 5

Written: map.zarr and map.gwy (all quantities, their errors, mask), map.json (summary), figures/.")]
pub(crate) struct MapArgs {
    #[command(flatten)]
    analyze: AnalyzeArgs,
    /// Width of the Gaussian window (standard deviation), nm; a point becomes 2.35 of it wide [default: as
    /// wide as noise needs and the lattice stays straight, at least 0.6 periods]
    #[arg(long, value_name = "NM")]
    window: Option<f64>,
    /// Distance of the nodes, nm [default: a third of the window]
    #[arg(long, value_name = "NM")]
    step: Option<f64>,
    /// Margin at the edges, in windows
    #[arg(long, value_name = "WINDOWS", default_value_t = 2.0)]
    margin: f64,
}

/// Makes the maps and writes them.
pub(crate) fn run(args: &MapArgs) -> anyhow::Result<ExitCode> {
    let settings = args.analyze.settings()?;
    let resolution = args.resolution()?;
    let out = args.analyze.out();
    ensure!(
        args.analyze.force() || !out.join("map.json").exists(),
        "{} already holds a map; give another --out, or --force to write over it",
        out.display()
    );
    args.analyze.start_threads()?;
    let (mut inputs, mut failed) = (Vec::new(), Vec::new());
    for path in expand(args.analyze.paths()) {
        match path {
            Ok(path) => inputs.push(path),
            Err((path, error)) => failed.push(FailedInput {
                file: path.display().to_string(),
                error,
            }),
        }
    }
    let known = args.analyze.known().of(&inputs);
    let loud = args.analyze.is_loud();
    let sets = args.analyze.sets()?;
    let outcome = analyse_files(&inputs, &sets, (&settings, &known), failed, false, loud);
    let Outcome {
        analysis,
        mut provenance,
    } = match outcome {
        Ok(outcome) => outcome,
        Err(failed) => {
            eprint!("{}", crate::analyze::failures(&failed));
            bail!("nothing could be analysed");
        }
    };
    let mut maps = Vec::new();
    for scan in analysis.sets.iter().flat_map(|s| &s.scans) {
        if scan.excluded.is_some() {
            continue;
        }
        let path = Path::new(&scan.file);
        let mapped = read(path, &settings, &known)
            .and_then(|reading| Ok(map_scan(&reading.scan, scan, &settings, &resolution)?));
        match mapped {
            Ok(lines) => maps.extend(lines),
            Err(error) => provenance.failed.push(FailedInput {
                file: scan.file.clone(),
                error: format!("{error:#}"),
            }),
        }
    }
    let results = assemble(&maps, &analysis, &provenance, args, out)?;
    if args.analyze.json() {
        say(&format!("{}\n", serde_json::to_string_pretty(&results)?))?;
    } else if loud {
        say(&summary(&results))?;
        say(&format!(
            "\nWritten to {}\n",
            out.join("map.json").display()
        ))?;
    }
    eprint!("{}", crate::analyze::failures(&provenance.failed));
    Ok(if provenance.failed.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

impl MapArgs {
    fn resolution(&self) -> anyhow::Result<Resolution> {
        for (name, value) in [("--window", self.window), ("--step", self.step)] {
            ensure!(
                value.is_none_or(|v| v > 0.0 && v.is_finite()),
                "{name} must be a positive length in nm"
            );
        }
        ensure!(
            (0.0..=10.0).contains(&self.margin),
            "--margin lies between 0 and 10 windows, found {}",
            self.margin
        );
        Ok(Resolution {
            window_nm: self.window,
            step_nm: self.step,
            margin: self.margin,
        })
    }
}

/// Averages, writes, summarises.
fn assemble(
    maps: &[LineMap],
    analysis: &Analysis,
    provenance: &Provenance,
    args: &MapArgs,
    out: &Path,
) -> anyhow::Result<MapResults> {
    let settings = &analysis.settings;
    let all: Vec<&LatticeMap> = maps.iter().map(|m| &m.map).collect();
    let (lattices, agreement) = combine(&all).context("no image gave a map")?;
    let reference = lattices
        .mean()
        .or(maps.first().map(|m| m.whole))
        .context("no image gave a map")?;
    let found =
        lattices.twist_strain(&reference, settings.bilayer(), settings.strain_convention)?;
    let map = TwistStrainMap::new(&lattices, &found);
    let mut caveats = analysis.caveats.clone();
    if maps.iter().any(|m| !m.drift_corrected) {
        caveats.push(Caveat::new(
            "map-not-drift-corrected",
            "map",
            "the drift of some images is not known: it stretches and shears their maps, the same everywhere",
        ));
    }
    let [columns, rows] = [0, 1].map(|i| map.grid.step.column(i).into_owned());
    let results = MapResults {
        schema: "moiregauge/map/1".to_owned(),
        provenance: provenance.clone(),
        conventions: Conventions::of(settings),
        errors: ERRORS.to_owned(),
        settings: settings.clone(),
        method: "demodulation".to_owned(),
        window_nm: map.window_nm,
        resolution_nm: 2.355 * map.window_nm,
        nodes: map.grid.size,
        origin_nm: map.grid.origin.into(),
        step_nm: [columns.into(), rows.into()],
        masks: mask_counts(&map),
        quantities: quantities(&map),
        whole_image: whole_image(analysis),
        images: maps.iter().map(mapped_image).collect(),
        agreement: agreement.map(Into::into),
        caveats,
    };
    let log = vec![format!("moiregauge {} map", env!("CARGO_PKG_VERSION"))];
    let scan = as_scan(&map);
    let group = out.join("map.zarr");
    if group.join("zarr.json").is_file() {
        std::fs::remove_dir_all(&group)
            .with_context(|| format!("cannot replace {}", group.display()))?;
    }
    for format in [WritableFormat::Zarr, WritableFormat::Gwy] {
        write_all(out, &spmfile::write(&scan, format, "map", &log)?)?;
    }
    let choice = args.analyze.choice();
    if choice.figures {
        write_all(
            out,
            &figure_files(&map_figures(&map, choice.colormap), choice)?,
        )?;
    }
    let json = serde_json::to_vec_pretty(&results)?;
    write_all(out, &[("map.json".to_owned(), json)])?;
    Ok(results)
}

const ERRORS: &str = "one standard deviation by the noise of the images, node by node, neighbouring nodes not \
     independent; what all nodes share (drift, calibration, lattice constant, model) is in whole_image and its \
     budget in the results of `moiregauge analyze`; smoothing by the window adds a bias, on average at most a quarter of the \
     noise where the window was chosen by itself";

/// Twist and strain of the whole images.
fn whole_image(analysis: &Analysis) -> Option<TwistStrainResult> {
    if let Some(combined) = &analysis.combined {
        return Some((&combined.twist_strain).into());
    }
    let set: &SetAnalysis = analysis.sets.first()?;
    let mean = set.mean.as_ref().or(set.uncorrected.as_ref());
    let scan: Option<&ScanAnalysis> = set.scans.first();
    mean.map(|m| &m.twist_strain)
        .or(scan.and_then(|s| s.twist_strain_sensor.as_ref()))
        .map(Into::into)
}

fn mapped_image(map: &LineMap) -> MappedImage {
    MappedImage {
        file: map.file.clone(),
        line: match map.line {
            LineDirection::Trace => "trace",
            LineDirection::Retrace => "retrace",
        }
        .to_owned(),
        drift_corrected: map.drift_corrected,
        harmonics: map.harmonics.iter().map(Into::into).collect(),
    }
}

/// What is said on the screen.
fn summary(results: &MapResults) -> String {
    let mut text = format!(
        "{} × {} nodes, window {} nm (resolution {} nm)\n",
        results.nodes[0],
        results.nodes[1],
        two_digits(results.window_nm),
        two_digits(results.resolution_nm)
    );
    for mask in &results.masks {
        text.push_str(&format!("  {:16} {} nodes\n", mask.name, mask.nodes));
    }
    for q in &results.quantities {
        text.push_str(&format!(
            "  {:16} mean {:.5} {}, spread {} (noise {}, without it {})\n",
            q.name,
            q.mean,
            q.unit,
            two_digits(q.spread),
            two_digits(q.noise),
            two_digits(q.spread_corrected)
        ));
    }
    if let Some(a) = &results.agreement {
        text.push_str(&format!(
            "  images agree with χ²/dof {:.2} at {} nodes\n",
            a.chi2_per_dof, a.nodes
        ));
    }
    for caveat in &results.caveats {
        text.push_str(&format!(
            "caveat {} ({}): {}\n",
            caveat.code, caveat.place, caveat.message
        ));
    }
    text
}
