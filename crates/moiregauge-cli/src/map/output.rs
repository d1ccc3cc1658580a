//! A finished map → files and words.

use std::fmt::Write as _;

use std::path::PathBuf;

use moiregauge::analysis::{Analysis, Picture};
use moiregauge::caveat::Caveat;
use moiregauge::estimate::Estimate;
use moiregauge::map::{Agreement, DriftChange, TwistStrainMap, UsedHarmonic};
use moiregauge::settings::Settings;
use moiregauge_pipeline::sink::{FolderSink, Target};
use moiregauge_report::results::{
    Conventions, MapDetailsResult, MapResults, MappedImage, TwistStrainResult, mask_counts,
    quantities,
};
use moiregauge_report::screen::try_option;
use moiregauge_report::{
    Provenance, figure_files, layers, map_figures, map_page, map_scan, map_scans, map_tables,
    plus_minus, two_digits,
};
use spmfile::{LineDirection, WritableFormat};

use super::domains::Domains;
use super::{MapArgs, regions, stripes};
use crate::hints;
use crate::outputs::{self, commit, write_all};
use crate::say::say;

/// Quantities whose trend is told on the screen.
const TRENDS: [&str; 3] = ["twist", "strain vector 1", "strain vector 2"];
/// With more nodes than this there is no `.gwy` file: it would not fit into memory beside the map.
const MANY: usize = 1_500_000;

const ERRORS: &str = "one standard deviation by the noise of the images, node by node, neighbouring nodes not \
     independent, enlarged where the window visibly blurs; what all nodes share (drift, calibration, lattice \
     constant, model) is in whole_image and in the budget of `moiregauge analyze`; smoothing by the window adds a \
     bias, about a quarter of the noise where the window was chosen by itself";

/// A map and what came with it.
pub(super) struct Made {
    pub(super) map: TwistStrainMap,
    pub(super) settings: Settings,
    pub(super) provenance: Provenance,
    pub(super) whole: Option<TwistStrainResult>,
    pub(super) images: Vec<MappedImage>,
    /// The first of them, to be shown.
    pub(super) picture: Option<Picture>,
    pub(super) agreement: Option<Agreement>,
    pub(super) drift_change: Option<DriftChange>,
    pub(super) domains: Domains,
    pub(super) caveats: Vec<Caveat>,
}

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
    let (map, out) = (&made.map, args.analyze.out());
    // First, lest a region beyond the map leave half of the files.
    let (mut details, doubts) = args.regions.answer(map)?;
    let log = vec![format!("moiregauge {} map", env!("CARGO_PKG_VERSION"))];
    // One array at a time; the group and its coordinates are the same every time.
    for scan in map_scans(map) {
        let files = spmfile::write(&scan, WritableFormat::Zarr, "map", &log)?;
        write_all(&sink, "", &files)?;
    }
    if map.grid.len() <= MANY {
        let files = spmfile::write(&map_scan(map), WritableFormat::Gwy, "map", &log)?;
        write_all(&sink, "", &files)?;
    }
    details.picture.clone_from(&made.picture);
    details.domains.clone_from(&made.domains.map);
    details.regime = Some(made.domains.regime.clone());
    let mut results = results(made, args.method_name());
    results.details = (&details).into();
    results.caveats.extend(doubts.iter().map(Into::into));
    let mut files = vec![("map.json".to_owned(), serde_json::to_vec_pretty(&results)?)];
    files.extend(map_tables(&details));
    let choice = args.analyze.choice();
    if choice.figures || choice.png || choice.html {
        let figures = map_figures(map, &details, choice.colormap);
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
        say(&summary(&results))?;
        say(&format!(
            "\nWritten to {}\n",
            out.join("map.json").display()
        ))?;
    }
    Ok(())
}

fn results(made: &Made, method: &str) -> MapResults {
    let map = &made.map;
    let [columns, rows] = [0, 1].map(|i| map.grid.step.column(i).into_owned());
    MapResults {
        schema: "moiregauge/map/1".to_owned(),
        provenance: made.provenance.clone(),
        conventions: Conventions::of(&made.settings),
        errors: ERRORS.to_owned(),
        settings: made.settings.clone(),
        method: method.to_owned(),
        window_nm: map.window_nm,
        resolution_nm: 2.355 * map.window_nm,
        nodes: map.grid.size,
        origin_nm: map.grid.origin.into(),
        step_nm: [columns.into(), rows.into()],
        extent_nm: map.grid.extent(),
        masks: mask_counts(map),
        quantities: quantities(map),
        whole_image: made.whole,
        stripes: None,
        images: made.images.clone(),
        agreement: made.agreement.map(Into::into),
        drift_change: made.drift_change.map(Into::into),
        details: MapDetailsResult::default(),
        caveats: made.caveats.iter().map(Into::into).collect(),
    }
}

/// Twist and strain of the whole images.
pub(super) fn whole_image(analysis: &Analysis) -> Option<TwistStrainResult> {
    if let Some(combined) = &analysis.combined {
        let found = &combined.twist_strain;
        return Some(TwistStrainResult::of_mean(found, &combined.budget));
    }
    let set = analysis.sets.first()?;
    let mean = set.mean.as_ref().or(set.uncorrected.as_ref());
    let scan = set.scans.first();
    mean.map(|m| TwistStrainResult::of_mean(&m.twist_strain, &m.budget))
        .or(scan.and_then(|s| s.twist_strain_sensor.as_ref().map(Into::into)))
}

/// One image behind a map.
pub(super) fn image(
    file: &str,
    line: Option<LineDirection>,
    drift_corrected: bool,
    harmonics: &[UsedHarmonic],
) -> MappedImage {
    MappedImage {
        file: file.to_owned(),
        line: match line {
            Some(LineDirection::Retrace) => "retrace",
            Some(LineDirection::Trace) | None => "trace",
        }
        .to_owned(),
        drift_corrected,
        harmonics: harmonics.iter().map(Into::into).collect(),
    }
}

/// What is said on the screen.
pub(super) fn summary(results: &MapResults) -> String {
    let mut text = String::new();
    if results.stripes.is_none() {
        let _ = writeln!(text, "Layers: {}", layers(&results.settings));
    }
    let _ = writeln!(
        text,
        "{} × {} nodes, window {} nm (resolution {} nm)",
        results.nodes[0],
        results.nodes[1],
        two_digits(results.window_nm),
        two_digits(results.resolution_nm)
    );
    let [x, y] = results.extent_nm;
    let _ = writeln!(
        text,
        "x from {:.1} to {:.1} nm, y from {:.1} to {:.1} nm",
        x[0], x[1], y[0], y[1]
    );
    for mask in &results.masks {
        let _ = writeln!(text, "  {:16} {} nodes", mask.name, mask.nodes);
    }
    for q in &results.quantities {
        let _ = writeln!(
            text,
            "  {:16} {} {}, spread {} (noise {}, without it {})",
            q.name,
            plus_minus(Estimate::new(q.mean, q.mean_sigma)),
            q.unit,
            two_digits(q.spread),
            two_digits(q.noise),
            two_digits(q.spread_corrected)
        );
    }
    text.push_str(&trends(results));
    if let Some(found) = &results.stripes {
        text.push_str(&stripes::summary(found));
    }
    if let Some(a) = &results.agreement {
        let _ = writeln!(
            text,
            "  images agree with χ²/dof {:.2} at {} nodes",
            a.chi2_per_dof, a.nodes
        );
    }
    text.push_str(&regions::summary(&results.details));
    let mut caveats = results.caveats.iter().peekable();
    while let Some(caveat) = caveats.next() {
        let _ = writeln!(
            text,
            "caveat {} ({}): {}",
            caveat.code, caveat.place, caveat.message
        );
        if caveats.peek().is_none_or(|next| next.code != caveat.code) {
            try_option(&mut text, &caveat.code, hints::of);
        }
    }
    text
}

/// How much of the spread of twist and strain is a trend across the frame, and what the whole image says where the map
/// has its middle.
fn trends(results: &MapResults) -> String {
    let mut text = String::new();
    for q in &results.quantities {
        let told = results.stripes.is_some() || TRENDS.contains(&q.name.as_str());
        let Some(t) = q.trend.filter(|_| told) else {
            continue;
        };
        let [x, y] =
            [0, 1].map(|i| plus_minus(Estimate::new(t.per_100nm[i], t.per_100nm_sigma[i])));
        let _ = write!(
            text,
            "  {:16} trend ({x}, {y}) {} per 100 nm; spread = {} (trend), {} (noise), {} (rest); at the middle of the {} {}",
            q.name,
            q.unit,
            two_digits(t.of_trend),
            two_digits(t.noise),
            two_digits(t.rest),
            if results.stripes.is_some() {
                "pattern"
            } else {
                "frame"
            },
            plus_minus(Estimate::new(t.middle, t.middle_sigma)),
        );
        let whole = results.whole_image.as_ref().map(|w| w.twist_deg);
        if let (Some(whole), "twist") = (whole, q.name.as_str())
            && let (Some(value), Some(sigma)) = (whole.value, whole.sigma)
        {
            let _ = write!(
                text,
                ", whole image {}",
                plus_minus(Estimate::new(value, sigma))
            );
        }
        text.push('\n');
    }
    text
}
