//! A finished map → files, of a lattice or of stripes.

use moiregauge::map::TwistStrainMap;
use moiregauge::numbers::interrupt;
use moiregauge::settings::Settings;
use moiregauge::survey::MappedPattern;
use moiregauge_report::results::{
    Conventions, MapDetailsResult, MapResults, StripesResult, mask_counts, quantities,
};
use moiregauge_report::{
    Choice, ColorMap, Figure, Provenance, cell_scan, figure_files, map_figures, map_page, map_scan,
    map_scans, map_tables, stripe_figures, stripe_scan, undistorted_scan,
};
use spmfile::{Scan, WritableFormat};

use super::error::NotMapped;
use super::found::{LatticeShown, MapFound, Shown};
use super::request::MapRequest;
use crate::sink::{Sink, SinkError};

/// With more nodes than this there is no `.gwy` file: it would not fit into memory beside the map.
const MANY: usize = 1_500_000;

/// Tables of whole fields.
const FIELDS: [&str; 2] = ["displacement.csv", "cell.csv"];

const ERRORS: &str = "one standard deviation from the noise of the images, for each node; neighbouring nodes are not \
                      independent; enlarged where the window visibly blurs. Errors that all nodes share (drift, \
                      calibration, lattice constant, model) are in whole_image and in the budget of `moiregauge \
                      analyze`. Smoothing by the window adds a bias, about a quarter of the noise with the default \
                      window";

const ERRORS_OF_STRIPES: &str = "one standard deviation from the noise of the images, for each node; neighbouring \
                                 nodes are not independent; enlarged where the window visibly blurs and near \
                                 boundaries of patterns. Errors that all nodes share (calibration, drift) are not \
                                 included";

/// What may be written at the top of the folder; folders of which others may have files, too, end with a slash.
pub const MAP_FILES: [&str; 14] = [
    "map.json",
    "map.zarr",
    "map.gwy",
    "undistorted.gwy",
    "displacement.csv",
    "cell.csv",
    "report.html",
    "columns.md",
    "regions.csv",
    "profiles.csv",
    "devices.csv",
    "domains.csv",
    "nodes.csv",
    "figures/",
];

impl MapFound {
    /// Asks the questions, and writes everything: the document, all quantities with their errors and the mask, tables,
    /// page and figures as `choice` wants them.
    ///
    /// # Errors
    /// Regions and lines beyond the map; a sink that cannot be written.
    pub fn write(
        &self,
        request: &MapRequest,
        choice: Choice,
        sink: &dyn Sink,
    ) -> Result<MapResults, NotMapped> {
        match &self.shown {
            Shown::Lattice(found) => self.write_lattice(found, request, choice, sink),
            Shown::Stripes(found) => {
                let stripes = &found.stripes;
                let scan = stripe_scan(stripes);
                for format in [WritableFormat::Zarr, WritableFormat::Gwy] {
                    write_scan(&scan, format, sink)?;
                }
                let found = StripesResult::from(stripes);
                let results = MapResults {
                    quantities: found.patterns.iter().flat_map(|p| p.map.clone()).collect(),
                    stripes: Some(found),
                    agreement: stripes.agreement.map(Into::into),
                    ..self.document(&stripes.map, "stripes", ERRORS_OF_STRIPES)
                };
                let figures = |colours| stripe_figures(stripes, colours);
                finish(&results, Vec::new(), figures, choice, sink)?;
                Ok(results)
            }
        }
    }

    fn write_lattice(
        &self,
        found: &LatticeShown,
        request: &MapRequest,
        choice: Choice,
        sink: &dyn Sink,
    ) -> Result<MapResults, NotMapped> {
        let map = &found.map;
        // First, lest a region beyond the map leave half of the files.
        let (mut details, doubts) = request.questions.ask(map)?;
        // One array at a time; the group and its coordinates are the same every time.
        let registry = found.registry.as_ref();
        for scan in map_scans(map, registry) {
            write_scan(&scan, WritableFormat::Zarr, sink)?;
        }
        if map.grid.len() <= MANY {
            write_scan(&map_scan(map, registry), WritableFormat::Gwy, sink)?;
        }
        if let Some(pattern) = &found.pattern {
            write_pattern(pattern, sink)?;
        }
        details.pattern.clone_from(&found.pattern);
        details.registry.clone_from(&found.registry);
        details.picture.clone_from(&found.picture);
        details.domains.clone_from(&found.domains.map);
        details.regime = Some(found.domains.regime.clone());
        let mut results = MapResults {
            // Of grains there is no mean of all.
            quantities: if map.grain.is_empty() {
                quantities(map)
            } else {
                Vec::new()
            },
            whole_image: found.whole,
            agreement: found.agreement.map(Into::into),
            drift_change: found.drift_change.map(Into::into),
            details: (&details).into(),
            ..self.document(map, request.method_name(), ERRORS)
        };
        results.caveats.extend(doubts.iter().map(Into::into));
        let figures = |colours| map_figures(map, &details, colours);
        finish(&results, map_tables(map, &details), figures, choice, sink)?;
        Ok(results)
    }

    /// The document of any map, with what the map itself tells; `errors` are the words on its errors.
    fn document(&self, map: &TwistStrainMap, method: &str, errors: &str) -> MapResults {
        let (settings, provenance): (&Settings, &Provenance) = (&self.settings, &self.provenance);
        let [columns, rows] = [0, 1].map(|i| map.grid.step.column(i).into_owned());
        MapResults {
            schema: "moiregauge/map/1".to_owned(),
            provenance: provenance.clone(),
            conventions: Conventions::of(settings),
            errors: errors.to_owned(),
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
            images: self.images.clone(),
            agreement: None,
            drift_change: None,
            details: MapDetailsResult::default(),
            caveats: self.caveats.iter().map(Into::into).collect(),
        }
    }
}

/// The undistorted image for Gwyddion, and it and the averaged cell as groups of their own within the map.
fn write_pattern(pattern: &MappedPattern, sink: &dyn Sink) -> Result<(), SinkError> {
    let named = undistorted_scan(pattern, &format!("{} undistorted", pattern.channel));
    write_all(&files_of(&named, WritableFormat::Gwy, "undistorted")?, sink)?;
    drop(named);
    let image = Some(undistorted_scan(pattern, "image"));
    for (scan, name) in [(image, "undistorted"), (cell_scan(pattern), "cell")] {
        let Some(scan) = scan else { continue };
        for (file, bytes) in files_of(&scan, WritableFormat::Zarr, name)? {
            let within = file.replacen(".zarr", "", 1);
            sink.write(&format!("map.zarr/{within}"), &bytes)?;
        }
    }
    Ok(())
}

fn write_scan(scan: &Scan, format: WritableFormat, sink: &dyn Sink) -> Result<(), SinkError> {
    write_all(&files_of(scan, format, "map")?, sink)
}

fn files_of(
    scan: &Scan,
    format: WritableFormat,
    stem: &'static str,
) -> Result<Vec<(String, Vec<u8>)>, SinkError> {
    // The first line of the history of what is written.
    let log = [format!("moiregauge {} map", env!("CARGO_PKG_VERSION"))];
    let files = spmfile::write_between(scan, format, stem, &log, &interrupt::check);
    files.map_err(|why| SinkError::made(stem, why))
}

fn write_all(files: &[(String, Vec<u8>)], sink: &dyn Sink) -> Result<(), SinkError> {
    files
        .iter()
        .try_for_each(|(name, bytes)| sink.write(name, bytes))
}

/// Writes the document, the tables, the page and the figures.
fn finish(
    results: &MapResults,
    tables: Vec<(String, Vec<u8>)>,
    figures: impl FnOnce(ColorMap) -> Vec<Figure>,
    choice: Choice,
    sink: &dyn Sink,
) -> Result<(), SinkError> {
    let document = serde_json::to_vec_pretty(results);
    let document = document.map_err(|why| SinkError::made("map", why))?;
    let mut files = vec![("map.json".to_owned(), document)];
    // The page carries what was asked for, not whole fields.
    let (fields, tables) = tables
        .into_iter()
        .partition::<Vec<_>, _>(|(name, _)| FIELDS.contains(&name.as_str()));
    write_all(&fields, sink)?;
    files.extend(tables);
    if choice.figures || choice.png || choice.html {
        let figures = figures(choice.colormap);
        if choice.html {
            let page = map_page(results, &figures, &files);
            let page = page.map_err(|why| SinkError::made("map", why))?;
            files.push(("report.html".to_owned(), page));
        }
        let drawn = figure_files(&figures, choice);
        files.extend(drawn.map_err(|why| SinkError::made("map", why))?);
    }
    write_all(&files, sink)
}
