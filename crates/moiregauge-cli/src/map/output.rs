//! A finished map → files.

use std::path::PathBuf;

use moiregauge::map::TwistStrainMap;
use moiregauge::settings::Settings;
use moiregauge_pipeline::sink::{FolderSink, Target};
use moiregauge_report::results::{
    Conventions, MapDetailsResult, MapResults, mask_counts, quantities,
};
use moiregauge_report::{
    ColorMap, Figure, Provenance, figure_files, map_figures, map_page, map_scan, map_scans,
    map_tables,
};
use spmfile::WritableFormat;

use super::args::MapArgs;
use super::made::Made;
use super::words::summary;
use crate::outputs::{self, commit, write_all};
use crate::say::say;

/// With more nodes than this there is no `.gwy` file: it would not fit into memory beside the map.
const MANY: usize = 1_500_000;

const ERRORS: &str = "one standard deviation by the noise of the images, node by node, neighbouring nodes not \
     independent, enlarged where the window visibly blurs; what all nodes share (drift, calibration, lattice \
     constant, model) is in whole_image and in the budget of `moiregauge analyze`; smoothing by the window adds a \
     bias, about a quarter of the noise where the window was chosen by itself";

/// What may be written at the top of the folder; folders of which others may have files, too, end with a slash.
const NAMES: [&str; 11] = [
    "map.json",
    "map.zarr",
    "map.gwy",
    "report.html",
    "columns.md",
    "regions.csv",
    "profiles.csv",
    "devices.csv",
    "domains.csv",
    "nodes.csv",
    "figures/",
];

/// Makes the folder ready, before the work.
pub(super) fn sink(args: &MapArgs, inputs: &[PathBuf]) -> anyhow::Result<FolderSink> {
    outputs::folder(&Target {
        folder: args.analyze.out(),
        kind: "map",
        names: &NAMES.map(str::to_owned),
        inputs,
        force: args.analyze.force(),
    })
}

/// Writes everything and says what there is.
pub(super) fn write(made: &Made, args: &MapArgs, sink: FolderSink) -> anyhow::Result<()> {
    let map = &made.map;
    // First, lest a region beyond the map leave half of the files.
    let (mut details, doubts) = args.regions.answer(map)?;
    // One array at a time; the group and its coordinates are the same every time.
    for scan in map_scans(map) {
        let files = spmfile::write(&scan, WritableFormat::Zarr, "map", &log())?;
        write_all(&sink, "", &files)?;
    }
    if map.grid.len() <= MANY {
        let files = spmfile::write(&map_scan(map), WritableFormat::Gwy, "map", &log())?;
        write_all(&sink, "", &files)?;
    }
    details.picture.clone_from(&made.picture);
    details.domains.clone_from(&made.domains.map);
    details.regime = Some(made.domains.regime.clone());
    let mut results = results(made, args.method_name());
    results.details = (&details).into();
    results.caveats.extend(doubts.iter().map(Into::into));
    let figures = |colours| map_figures(map, &details, colours);
    finish(&results, map_tables(&details), figures, args, sink)
}

fn results(made: &Made, method: &str) -> MapResults {
    let about = (&made.settings, &made.provenance);
    MapResults {
        quantities: quantities(&made.map),
        whole_image: made.whole,
        images: made.images.clone(),
        agreement: made.agreement.map(Into::into),
        drift_change: made.drift_change.map(Into::into),
        caveats: made.caveats.iter().map(Into::into).collect(),
        ..document(&made.map, about, (method, ERRORS))
    }
}

/// The document of any map, with what the map itself tells; `about` are the words on its errors.
pub(super) fn document(
    map: &TwistStrainMap,
    (settings, provenance): (&Settings, &Provenance),
    (method, about): (&str, &str),
) -> MapResults {
    let [columns, rows] = [0, 1].map(|i| map.grid.step.column(i).into_owned());
    MapResults {
        schema: "moiregauge/map/1".to_owned(),
        provenance: provenance.clone(),
        conventions: Conventions::of(settings),
        errors: about.to_owned(),
        settings: settings.clone(),
        method: method.to_owned(),
        window_nm: map.window_nm,
        resolution_nm: 2.355 * map.window_nm,
        nodes: map.grid.size,
        origin_nm: map.grid.origin.into(),
        step_nm: [columns.into(), rows.into()],
        extent_nm: map.grid.extent(),
        masks: mask_counts(map),
        quantities: Vec::new(),
        whole_image: None,
        stripes: None,
        images: Vec::new(),
        agreement: None,
        drift_change: None,
        details: MapDetailsResult::default(),
        caveats: Vec::new(),
    }
}

/// The first line of the history of what is written.
pub(super) fn log() -> Vec<String> {
    vec![format!("moiregauge {} map", env!("CARGO_PKG_VERSION"))]
}

/// Writes the document, the tables, the page and the figures, puts everything in place and says what there is.
pub(super) fn finish(
    results: &MapResults,
    tables: Vec<(String, Vec<u8>)>,
    figures: impl FnOnce(ColorMap) -> Vec<Figure>,
    args: &MapArgs,
    sink: FolderSink,
) -> anyhow::Result<()> {
    let mut files = vec![("map.json".to_owned(), serde_json::to_vec_pretty(results)?)];
    files.extend(tables);
    let choice = args.analyze.choice();
    if choice.figures || choice.png || choice.html {
        let figures = figures(choice.colormap);
        if choice.html {
            let page = map_page(results, &figures, &files)?;
            files.push(("report.html".to_owned(), page));
        }
        files.extend(figure_files(&figures, choice)?);
    }
    write_all(&sink, "", &files)?;
    commit(sink)?;
    args.analyze.show(&args.analyze.out().join("report.html"));
    if args.analyze.json() {
        say(&format!("{}\n", serde_json::to_string_pretty(results)?))?;
    } else if args.analyze.is_loud() {
        say(&summary(results))?;
        say(&format!(
            "\nWritten to {}\n",
            args.analyze.out().join("map.json").display()
        ))?;
    }
    Ok(())
}
