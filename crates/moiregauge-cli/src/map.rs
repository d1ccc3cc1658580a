//! `moiregauge map`: scan files → maps of twist, strain and lattice with their errors.

mod domains;
mod output;
mod regions;
mod source;
mod stripes;
mod survey;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail, ensure};
use clap::ValueEnum;
use moiregauge::campaign::is_nothing_left;
use moiregauge::campaign::{ScanAnalysis, about_repeat, picture, refusal};
use moiregauge::caveat::{Caveat, DriftDoubt, MapDoubt, Mapped, SurveyDrift};
use moiregauge::map::{DriftChange, LatticeMap, TwistStrainMap, register};
use moiregauge::scan::Picture;
use moiregauge::settings::Settings;
use moiregauge::survey::{
    LineMap, MapMethod, SurveyPlan, average_maps, change_of_drift, domains_of_scan, map_scan,
};
use moiregauge::window::Resolution;
use moiregauge_pipeline::sink::FolderSink;
use moiregauge_report::{FailedInput, Provenance};
use output::{Made, write};

use crate::analyze::{
    AnalyzeArgs, Outcome, Task, analyse_files, failures, given_again, read_again,
};
use crate::input::Known;
use crate::numbers;

pub(crate) use stripes::in_words as stripes_in_words;

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
  moiregauge map scan.000 --out maps --device 200nm×100nm --wanted 1.05±0.02
  moiregauge map scan.000 --out maps --region bar=10,20,80,40 --region 'flake=0,0 1um,10nm 600nm,0.8um'
  moiregauge map scan.000 --out maps --profile 'cut=0,0 100,80'
  moiregauge map small_angle.sxm --out maps --domains on --nodes bright

Written: report.html, map.zarr and map.gwy (all quantities, their errors, mask), map.json (summary), figures/,
and what was asked for: regions.csv, profiles.csv, devices.csv, domains.csv, nodes.csv; columns.md explains them.")]
pub(crate) struct MapArgs {
    #[command(flatten)]
    analyze: AnalyzeArgs,
    /// How local lattices are measured
    #[arg(help_heading = "Maps", long, value_enum, default_value_t = MapMethodArg::Demodulation)]
    map_method: MapMethodArg,
    /// Width of the Gaussian window (standard deviation), nm; a point becomes 2.35 of it wide [default: as
    /// wide as the lattice stays straight, at least 0.6 periods]. By tiles: the side of a tile [default: 6
    /// periods]
    #[arg(long, value_name = "NM", value_parser = numbers::number(numbers::LENGTH_NM), help_heading = "Maps")]
    window: Option<f64>,
    /// Distance of the nodes, nm [default: a third of the window, two pixels at least; a quarter of a tile]
    #[arg(long, value_name = "NM", value_parser = numbers::number(numbers::LENGTH_NM), help_heading = "Maps")]
    step: Option<f64>,
    /// Map in bands, as images of more than 20 million pixels are; several files are put side by side
    #[arg(help_heading = "Maps", long)]
    in_bands: bool,
    /// Margin at the edges, in windows [default: 2, or a quarter of the frame where that is less]
    #[arg(long, value_name = "WINDOWS", value_parser = numbers::number([0.0, 10.0]), help_heading = "Maps")]
    margin: Option<f64>,
    #[command(flatten)]
    regions: regions::RegionArgs,
    #[command(flatten)]
    domains: domains::DomainArgs,
}

/// Shifts beyond this share of a period may belong to another one.
const FAR: f64 = 0.3;

/// How local lattices are measured.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum MapMethodArg {
    /// Phases of all harmonics under a Gaussian window
    Demodulation,
    /// The fit of whole images on overlapping tiles: slower and coarser, for comparison
    Tiles,
}

impl MapMethodArg {
    fn name(self) -> &'static str {
        match self {
            Self::Demodulation => "demodulation",
            Self::Tiles => "tiles",
        }
    }
}

impl From<MapMethodArg> for MapMethod {
    fn from(value: MapMethodArg) -> Self {
        match value {
            MapMethodArg::Demodulation => Self::Demodulation,
            MapMethodArg::Tiles => Self::Tiles,
        }
    }
}

/// Makes the maps and writes them.
pub(crate) fn run(args: &MapArgs) -> anyhow::Result<ExitCode> {
    let task = Task::new(&args.analyze, "map")?;
    let as_before;
    let args = if args.analyze.is_replay() {
        as_before = args.again(&task)?;
        &as_before
    } else {
        args
    };
    ensure!(
        task.run.atomic.is_none() && task.run.export.is_empty() && !task.run.parquet,
        "--atomic, --export and --parquet are for `moiregauge analyze`: a map has no use for them"
    );
    let settings = task.run.settings.clone();
    let resolution = args.resolution();
    args.regions.check()?;
    ensure!(
        args.analyze.survey_image().is_none(),
        "--survey-image is for analyze"
    );
    args.analyze.start_threads()?;
    let inputs = &task.inputs;
    let sink = output::sink(args, &task.files())?;
    let known = task.known(inputs);
    let whole = (&settings, &known, &resolution);
    let document = args.analyze.out().join("map.json");
    let mut made = match survey((args, &sink), inputs, whole, &task.failed)? {
        Some(made) => made,
        None => match together(args, inputs, whole, task.failed.clone())? {
            Answer::Lattice(made) => *made,
            Answer::Stripes(mut found) => {
                let provenance = &mut found.provenance;
                provenance.run = Some(task.record(&known, &provenance.inputs));
                stripes::write(&found, args, sink)?;
                return Ok(ended(task.is_same(&written(&document))));
            }
        },
    };
    made.provenance.run = Some(task.record(&known, &made.provenance.inputs));
    let lost = failures(&made.provenance.failed);
    let complete = made.provenance.failed.is_empty();
    write(&made, args, sink)?;
    eprint!("{lost}");
    Ok(ended(task.is_same(&written(&document)) && complete))
}

/// The document of a map, if it can be read.
fn written(document: &Path) -> Vec<Vec<u8>> {
    std::fs::read(document).into_iter().collect()
}

fn ended(well: bool) -> ExitCode {
    if well {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

/// Maps images that are too large for memory, side by side; `None` where the first is not large.
fn survey(
    (args, sink): (&MapArgs, &FolderSink),
    inputs: &[PathBuf],
    (settings, known, resolution): (&Settings, &Known, &Resolution),
    failed: &[FailedInput],
) -> anyhow::Result<Option<Made>> {
    let open = |path: &PathBuf, always: bool| {
        survey::Large::open(path, settings, known, always)
            .with_context(|| path.display().to_string())
    };
    // One large image makes a survey of all.
    let mut any = args.in_bands;
    for path in inputs {
        any = any || open(path, false)?.is_some();
    }
    if !any {
        return Ok(None);
    }
    ensure!(
        args.analyze.sets()?.is_empty(),
        "--set: images that are mapped in bands lie side by side in one map and make no sets"
    );
    let loud = args.analyze.is_loud();
    let (inputs, again) = moiregauge_pipeline::distinct(inputs);
    let (mut maps, mut images, mut caveats) = (Vec::new(), Vec::new(), given_again(&again));
    let (mut read, mut plans) = (Vec::new(), Vec::<(survey::Large, SurveyPlan)>::new());
    for path in &inputs {
        let large = open(path, true)?.context("no image")?;
        let same = |(known, _): &&(survey::Large, _)| known.input.sha256 == large.input.sha256;
        if let Some((known, _)) = plans.iter().find(same) {
            caveats.push(about_repeat(&large.input.file, &known.input.file));
            continue;
        }
        let (map, plan) = large
            .map(
                (settings, resolution),
                plans.first().map(|p| &p.1),
                sink,
                loud,
            )
            .with_context(|| path.display().to_string())?;
        let file = large.input.file.clone();
        caveats.extend(large.caveats.iter().cloned());
        caveats.extend(plan.caveats.iter().cloned());
        let drift = if plan.drift_corrected {
            SurveyDrift::Corrected
        } else if settings.drift.is_some() {
            SurveyDrift::NoTiming
        } else {
            SurveyDrift::Unknown
        };
        caveats.push(Caveat::new(MapDoubt::Survey { drift }, file.as_str()));
        images.push(output::image(
            &file,
            None,
            plan.drift_corrected,
            &plan.harmonics,
        ));
        maps.push(map);
        read.push(large.input.clone());
        plans.push((large, plan));
    }
    let map = TwistStrainMap::side_by_side(maps).context("no image")?;
    let look = |contrast| {
        let found = plans
            .iter()
            .filter_map(|(large, plan)| large.domains(plan, contrast));
        found.collect()
    };
    let domains = args.domains.answer(&map, look);
    caveats.extend(domains.caveats.iter().cloned());
    Ok(Some(Made {
        caveats,
        provenance: Provenance {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            seed: settings.seed,
            inputs: read,
            failed: failed.to_vec(),
            run: None,
        },
        settings: settings.clone(),
        picture: plans.first().and_then(|(large, _)| large.picture(settings)),
        images,
        map,
        whole: None,
        agreement: None,
        drift_change: None,
        domains,
    }))
}

/// What scans show.
enum Answer {
    Lattice(Box<Made>),
    Stripes(Box<stripes::Striped>),
}

/// Analyses all scans, maps them, and averages; stripes, where none of them shows a lattice.
fn together(
    args: &MapArgs,
    inputs: &[PathBuf],
    (settings, known, resolution): (&Settings, &Known, &Resolution),
    failed: Vec<FailedInput>,
) -> anyhow::Result<Answer> {
    ensure!(
        settings.moires == 1,
        "maps are made of one moiré; --moires {} is for analyze",
        settings.moires
    );
    let sets = args.analyze.sets()?;
    let loud = args.analyze.is_loud();
    let outcome = analyse_files(inputs, &sets, (settings, known), failed, false, loud);
    let Outcome {
        analysis,
        mut provenance,
    } = match outcome {
        Ok(mut outcomes) => outcomes.swap_remove(0),
        Err(failed) => {
            let stripes = stripes::look(args, inputs, (settings, known, resolution));
            if let Ok(Some(found)) = stripes {
                return Ok(Answer::Stripes(Box::new(found)));
            }
            eprint!("{}", failures(&failed));
            stripes?;
            bail!("nothing could be analysed");
        }
    };
    if let Some(why) = refusal(&analysis).filter(|why| is_nothing_left(&why.doubt)) {
        bail!("{}", why.message());
    }
    // The maps read the lattice under the name that the analysis found.
    let settings = &analysis.named_settings();
    let used = || {
        analysis
            .sets
            .iter()
            .flat_map(|s| &s.scans)
            .filter(|s| s.excluded.is_none())
    };
    let origin = used()
        .filter_map(|s| s.motion.map(|m| m.middle))
        .min_by(f64::total_cmp);
    let how = (args.map_method.into(), resolution);
    let (mut maps, mut shown) = (Vec::new(), None);
    for scan in used() {
        match mapped(scan, inputs, (settings, known), (origin, how), &mut shown) {
            Ok(lines) => maps.extend(lines),
            Err(error) => provenance.failed.push(FailedInput {
                file: scan.file.clone(),
                error: format!("{error:#}"),
            }),
        }
    }
    let mut caveats = analysis.caveats.clone();
    registered(&mut maps, &mut caveats);
    let Some((lattices, agreement)) = average_maps(&maps) else {
        eprint!("{}", failures(&provenance.failed));
        bail!("no image gave a map");
    };
    let reference = maps[0].whole;
    let (layers, convention) = (settings.bilayer(), settings.strain_convention);
    let found = lattices
        .twist_strain(&reference, layers, convention)
        .unwrap_or_else(|why| {
            caveats.push(no_twist_strain(&why));
            vec![None; lattices.nodes.len()]
        });
    doubts(&maps, &mut caveats);
    if args.margin.is_none() {
        let narrow = maps.iter().find_map(|m| narrow_margin(m.margin, &m.file));
        caveats.extend(narrow);
    }
    let drift_change = change_of_drift(&maps);
    about_change(drift_change, &mut caveats);
    let map = TwistStrainMap::new(&lattices, &found);
    let look = |contrast| {
        let all = used().flat_map(|scan| {
            let reading = read_again(inputs, &scan.file, settings, known).ok();
            reading.map_or_else(Vec::new, |r| {
                domains_of_scan(&r.scan, scan, origin, settings, contrast)
            })
        });
        all.collect()
    };
    let domains = args.domains.answer(&map, look);
    caveats.extend(domains.caveats.iter().cloned());
    Ok(Answer::Lattice(Box::new(Made {
        map,
        picture: shown,
        domains,
        images: maps
            .iter()
            .map(|m| output::image(&m.file, Some(m.line), m.drift_corrected, &m.harmonics))
            .collect(),
        whole: output::whole_image(&analysis),
        settings: analysis.settings.clone(),
        provenance,
        agreement,
        drift_change,
        caveats,
    })))
}

/// The maps of one scan, trace and retrace; `origin` is the time that drift is counted from. Its image is shown if none
/// is yet.
fn mapped(
    scan: &ScanAnalysis,
    inputs: &[PathBuf],
    (settings, known): (&Settings, &Known),
    (origin, how): (Option<f64>, (MapMethod, &Resolution)),
    shown: &mut Option<Picture>,
) -> anyhow::Result<Vec<LineMap>> {
    let reading = read_again(inputs, &scan.file, settings, known)?;
    let (method, resolution) = how;
    let lines = map_scan(&reading.scan, scan, origin, settings, method, resolution)?;
    if shown.is_none() {
        *shown = picture(&scan.file, &reading.scan, settings);
    }
    Ok(lines)
}

fn no_twist_strain(why: &impl std::fmt::Display) -> Caveat {
    let reason = why.to_string();
    Caveat::new(MapDoubt::NoTwistStrain { reason }, "map")
}

/// Says that the drift changes, where it does.
fn about_change(drift_change: Option<DriftChange>, caveats: &mut Vec<Caveat>) {
    if let Some(found) = drift_change.filter(DriftChange::stands_out) {
        let acceleration = found.acceleration;
        caveats.push(Caveat::new(DriftDoubt::Changes { acceleration }, "map"));
    }
}

/// Says that the margin is narrower than two windows where nobody asked for that.
fn narrow_margin(margin: f64, file: &str) -> Option<Caveat> {
    let doubt = MapDoubt::NarrowMargin { margin };
    (margin > 0.0 && margin < 1.99).then(|| Caveat::new(doubt, file))
}

/// What is not as good as it could be.
fn doubts(maps: &[LineMap], caveats: &mut Vec<Caveat>) {
    if maps.iter().any(|m| !m.drift_corrected) {
        let doubt = MapDoubt::NotDriftCorrected {
            of: Mapped::Lattice,
        };
        caveats.push(Caveat::new(doubt, "map"));
    }
    if let Some(guessed) = maps.iter().find(|m| !m.noise_measured) {
        let doubt = MapDoubt::NoiseGuessed {
            of: Mapped::Lattice,
        };
        caveats.push(Caveat::new(doubt, guessed.file.as_str()));
    }
}

/// Puts the maps on each other by the phases of the pattern.
fn registered(maps: &mut [LineMap], caveats: &mut Vec<Caveat>) {
    let mut all: Vec<&mut LatticeMap> = maps.iter_mut().map(|m| &mut m.map).collect();
    let found = register(&mut all);
    for (map, found) in maps.iter().zip(found) {
        if found.is_some_and(|f| f.reversed) {
            let doubt = MapDoubt::ContrastReversed { line: map.line };
            caveats.push(Caveat::new(doubt, map.file.as_str()));
        }
        let Some(found) = found.filter(|f| f.of_period > FAR) else {
            continue;
        };
        let doubt = MapDoubt::Registration {
            shift: found.shift,
            of_period: found.of_period,
        };
        caveats.push(Caveat::new(doubt, map.file.as_str()));
    }
}

impl MapArgs {
    /// The options of the run to be repeated, with the place and the words of this one.
    fn again(&self, task: &Task) -> anyhow::Result<Self> {
        let program = std::iter::once("moiregauge".to_owned());
        let arguments = program.chain(task.run.arguments.iter().cloned());
        let crate::Command::Map(mut args) = crate::command(arguments)
            .context("--replay: the document does not hold the options of a map")?
        else {
            bail!("--replay: expected the options of a map");
        };
        args.analyze = args.analyze.with_place_of(&self.analyze);
        Ok(*args)
    }

    fn resolution(&self) -> Resolution {
        Resolution {
            window_nm: self.window,
            step_nm: self.step,
            margin: self.margin,
        }
    }

    /// How local lattices are measured, for the results.
    fn method_name(&self) -> &'static str {
        self.map_method.name()
    }
}
