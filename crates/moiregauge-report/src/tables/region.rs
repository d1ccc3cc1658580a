//! `regions.csv`, `devices.csv`, `profiles.csv` and the other tables of a map.

use moiregauge::map::TwistStrainMap;
use moiregauge::region::ProfilePoint;

use super::columns::columns;
use super::csv::{APOSTROPHE, Column, explanation, number, text};
use super::domains::{CELL, CellRow, NODE, NodeRow};
use super::pattern::{BIN_ABOUT, Bin, FIELD_ABOUT, NodeOfField};
use crate::map_details::MapDetails;
use crate::results::{DeviceResult, MapDetailsResult, RegionMeanResult, RegionResult};

/// With more nodes than this there is no `displacement.csv`: text of that size helps nobody, and `map.zarr` has it all.
const MANY: usize = 250_000;

/// The tables of a map; those without rows are left out.
pub fn map_tables(map: &TwistStrainMap, details: &MapDetails) -> Vec<(String, Vec<u8>)> {
    let found = MapDetailsResult::from(details);
    let mut files = Vec::new();
    let mut about = format!("{ABOUT}{COMMON}\n\n{APOSTROPHE}\n");
    if !found.regions.is_empty() {
        add(
            &mut files,
            &mut about,
            "regions.csv",
            "One row per region.",
            REGION,
            &found.regions,
        );
    }
    if !found.devices.is_empty() {
        let rows: Vec<DeviceRow> = found.devices.iter().cloned().map(DeviceRow).collect();
        add(
            &mut files,
            &mut about,
            "devices.csv",
            "One row per area, best first.",
            DEVICE,
            &rows,
        );
    }
    let rows: Vec<PointRow> = details
        .profiles
        .iter()
        .flat_map(|p| {
            p.points
                .iter()
                .map(|point| PointRow(p.name.clone(), *point))
        })
        .collect();
    if !rows.is_empty() {
        add(
            &mut files,
            &mut about,
            "profiles.csv",
            "One row per point of a line.",
            POINT,
            &rows,
        );
    }
    if let Some(map) = &details.domains {
        let rows: Vec<CellRow> = (0..map.cells.len()).map(|n| CellRow::new(map, n)).collect();
        let what = "One row per triangle of neighbouring nodes.";
        add(&mut files, &mut about, "domains.csv", what, CELL, &rows);
        let rows: Vec<NodeRow> = (0..map.nodes.len()).map(|n| NodeRow::new(map, n)).collect();
        let what = "One row per node.";
        add(&mut files, &mut about, "nodes.csv", what, NODE, &rows);
    }
    if let Some(registry) = details.registry.as_ref().filter(|_| map.grid.len() <= MANY) {
        let rows = NodeOfField::all(map, registry);
        let (what, columns) = (FIELD_ABOUT, NodeOfField::COLUMNS);
        add(
            &mut files,
            &mut about,
            "displacement.csv",
            what,
            columns,
            &rows,
        );
    }
    if let Some(cell) = details.pattern.as_ref().and_then(|p| p.cell.as_ref()) {
        let rows = Bin::all(cell);
        let columns = Bin::COLUMNS;
        add(
            &mut files, &mut about, "cell.csv", BIN_ABOUT, columns, &rows,
        );
    }
    if !files.is_empty() {
        files.push(("columns.md".to_owned(), about.into_bytes()));
    }
    files
}

fn add<R>(
    files: &mut Vec<(String, Vec<u8>)>,
    about: &mut String,
    name: &str,
    what: &str,
    columns: &[Column<R>],
    rows: &[R],
) {
    about.push_str(&explanation(name, what, columns));
    files.push((name.to_owned(), text(columns, rows).into_bytes()));
}

const ABOUT: &str = "# Columns of the tables of a map

Comma-separated, UTF-8, RFC 4180; the unit is the end of the name (`_nm`, `_deg`, `_percent`); `_sigma` is one
standard deviation by image noise. An empty field means: not known. Places are those of the map: x to the right, y up.
Twist, strain ε and its axis φ (from x, counter-clockwise) are defined under `conventions` in `map.json`.

";

/// What the errors of tables leave out.
pub(crate) const COMMON: &str = "Errors are those of image noise; means of regions take into account that neighbouring \
                                 nodes are correlated, and how far smoothing by the window moved them. Errors that all \
                                 places share are not included: drift, calibration of the scanner, lattice constant \
                                 and model (see the budget of `moiregauge analyze`).";

fn of(mean: Option<RegionMeanResult>, value: fn(&RegionMeanResult) -> Option<f64>) -> String {
    number(mean.as_ref().and_then(value))
}

fn component(r: &RegionResult, i: usize) -> Option<RegionMeanResult> {
    r.strain_vector_percent.map(|e| e[i])
}

const REGION: &[Column<RegionResult>] = columns! {
    "region", "name of the region", |r| r.name.clone();
    "area_nm2", "its area", |r| number(Some(r.area_nm2));
    "covered_percent", "share of the area that the map covers", |r| number(Some(r.covered_percent));
    "nodes", "nodes of the map whose cells the region covers at least in part", |r| r.nodes.to_string();
    "good_nodes", "good nodes", |r| r.good_nodes.to_string();
    "masked_percent", "share of bad nodes", |r| number(Some(r.masked_percent));
    "masked_by", "reasons, in % of the nodes", masked_by;
    "twist_deg", "mean twist", |r| of(r.twist_deg, |t| t.mean);
    "twist_sigma_deg", "standard error of the mean: noise (neighbouring nodes are correlated) and blur", |r| of(r.twist_deg, |t| t.sigma);
    "twist_blur_deg", "shift of the mean by smoothing with the window, from the curvature of the map", |r| of(r.twist_deg, |t| t.blur);
    "twist_spread_deg", "standard deviation over the nodes", |r| of(r.twist_deg, |t| t.spread);
    "twist_spread_corrected_deg", "the same without noise", |r| of(r.twist_deg, |t| t.spread_corrected);
    "twist_spread_below_deg", "upper limit of the spread (95 %), noise and smoothing taken into account", |r| of(r.twist_deg, |t| t.spread_below_95);
    "twist_noise_deg", "rms error of the nodes", |r| of(r.twist_deg, |t| t.noise);
    "strain_percent", "magnitude of the mean strain vector, bias of noise removed", |r| number(r.mean.as_ref().and_then(|m| m.heterostrain_percent.value));
    "strain_sigma_percent", "its σ", |r| number(r.mean.as_ref().and_then(|m| m.heterostrain_percent.sigma));
    "strain_axis_lab_deg", "axis of the mean strain from x, where it is significant", |r| number(r.mean.as_ref().and_then(|m| m.strain_axis_lab_deg).and_then(|a| a.value));
    "strain_axis_lab_sigma_deg", "its σ", |r| number(r.mean.as_ref().and_then(|m| m.strain_axis_lab_deg).and_then(|a| a.sigma));
    "strain_1_percent", "mean of ε cos 2φ", |r| of(component(r, 0), |e| e.mean);
    "strain_1_sigma_percent", "its σ", |r| of(component(r, 0), |e| e.sigma);
    "strain_1_spread_corrected_percent", "its spread without noise", |r| of(component(r, 0), |e| e.spread_corrected);
    "strain_2_percent", "mean of ε sin 2φ", |r| of(component(r, 1), |e| e.mean);
    "strain_2_sigma_percent", "its σ", |r| of(component(r, 1), |e| e.sigma);
    "strain_2_spread_corrected_percent", "its spread without noise", |r| of(component(r, 1), |e| e.spread_corrected);
    "strain_rms_percent", "root mean square of the local strain without noise", |r| number(r.strain_rms_percent);
    "wavelength_nm", "mean of the three wavelengths", |r| of(r.wavelength_nm, |w| w.mean);
    "wavelength_sigma_nm", "an upper limit of its σ", |r| of(r.wavelength_nm, |w| w.sigma);
    "wavelength_spread_corrected_nm", "its spread without noise, a lower limit", |r| of(r.wavelength_nm, |w| w.spread_corrected);
};

fn masked_by(r: &RegionResult) -> String {
    let parts = r.masked_by_percent.iter();
    let parts: Vec<String> = parts
        .map(|m| format!("{} {:.1}", m.reason, m.percent))
        .collect();
    parts.join("; ")
}

/// An area with its number.
struct DeviceRow(DeviceResult);

const DEVICE: &[Column<DeviceRow>] = columns! {
    "rank", "1 is the best: the smallest limit of the twist spread", |r| r.0.rank.to_string();
    "centre_x_nm", "centre", |r| number(Some(r.0.centre_nm[0]));
    "centre_y_nm", "centre", |r| number(Some(r.0.centre_nm[1]));
    "angle_deg", "direction of the first side from x, counter-clockwise", |r| number(Some(r.0.angle_deg));
    "masked_percent", "share of bad nodes to be believed", |r| number(Some(r.0.area.masked_percent));
    "twist_deg", "mean twist", |r| of(r.0.area.twist_deg, |t| t.mean);
    "twist_sigma_deg", "standard error of the mean: noise (neighbouring nodes are correlated) and blur", |r| of(r.0.area.twist_deg, |t| t.sigma);
    "twist_spread_deg", "standard deviation over the nodes", |r| of(r.0.area.twist_deg, |t| t.spread);
    "twist_spread_corrected_deg", "the same without noise", |r| of(r.0.area.twist_deg, |t| t.spread_corrected);
    "twist_spread_below_deg", "upper limit of the spread (95 %), noise and smoothing taken into account", |r| of(r.0.area.twist_deg, |t| t.spread_below_95);
    "strain_percent", "magnitude of the mean strain vector", |r| number(r.0.area.mean.as_ref().and_then(|m| m.heterostrain_percent.value));
    "strain_sigma_percent", "its σ", |r| number(r.0.area.mean.as_ref().and_then(|m| m.heterostrain_percent.sigma));
    "strain_rms_percent", "root mean square of the local strain without noise", |r| number(r.0.area.strain_rms_percent);
    "wavelength_nm", "mean of the three wavelengths", |r| of(r.0.area.wavelength_nm, |w| w.mean);
};

/// A point with its line.
struct PointRow(String, ProfilePoint);

fn at(row: &PointRow, value: fn(&moiregauge::region::ProfileValues) -> f64, factor: f64) -> String {
    let found = row.1.values.as_ref().map(value);
    number(found.filter(|v| v.is_finite()).map(|v| factor * v))
}

const DEGREE: f64 = 180.0 / std::f64::consts::PI;

const POINT: &[Column<PointRow>] = columns! {
    "profile", "name of the line", |r| r.0.clone();
    "distance_nm", "from its start", |r| number(Some(r.1.distance));
    "x_nm", "place", |r| number(Some(r.1.place.x));
    "y_nm", "place", |r| number(Some(r.1.place.y));
    "mask", "`good`, or why there are no values", |r| r.1.mask.map_or("beyond the map", moiregauge::window::Mask::name).to_owned();
    "twist_deg", "twist", |r| at(r, |v| v.twist.value, DEGREE);
    "twist_sigma_deg", "its σ; neighbouring points are correlated", |r| at(r, |v| v.twist.sigma, DEGREE);
    "strain_percent", "magnitude of the strain, bias of noise removed", |r| at(r, |v| v.magnitude.value, 100.0);
    "strain_sigma_percent", "its σ", |r| at(r, |v| v.magnitude.sigma, 100.0);
    "strain_1_percent", "ε cos 2φ", |r| at(r, |v| v.strain[0].value, 100.0);
    "strain_1_sigma_percent", "its σ", |r| at(r, |v| v.strain[0].sigma, 100.0);
    "strain_2_percent", "ε sin 2φ", |r| at(r, |v| v.strain[1].value, 100.0);
    "strain_2_sigma_percent", "its σ", |r| at(r, |v| v.strain[1].sigma, 100.0);
    "wavelength_nm", "mean of the three wavelengths", |r| at(r, |v| v.wavelength.value, 1.0);
    "wavelength_sigma_nm", "an upper limit of its σ", |r| at(r, |v| v.wavelength.sigma, 1.0);
};
