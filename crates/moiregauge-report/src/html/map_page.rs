//! `report.html` of a map.

use heterostrain::Estimate;
use serde::Serialize;

use super::page::{Download, Missing, Shown, download, layers, missing, numbered};
use super::template::rendered;
use super::words::{Numbers, conventions, plain};
use crate::error::ReportError;
use crate::figures::Figure;
use crate::format::{plus_minus, two_digits};
use crate::results::{
    DomainsResult, MapResults, RegionMeanResult, RegionResult, ResultEstimate, StripePatternResult,
    StripesResult, TrendResult,
};
use crate::tables::COMMON;

const TEMPLATE: &str = include_str!("map.html");

/// Figures before the numbers; a map of stripes has its own.
const FIRST: [&str; 7] = [
    "map-image",
    "map-undistorted",
    "map-cell",
    "map-twist",
    "map-strain",
    "map-overlays",
    "map-direction",
];

#[derive(Debug, Serialize)]
struct Page<'a> {
    results: &'a MapResults,
    /// Names of the layers.
    layers: String,
    whole: Option<Numbers>,
    /// Name, mean, spread, noise, spread without noise.
    quantities: Vec<[String; 5]>,
    /// Name, slopes along x and y, spread by trend, noise and rest, middle of the frame.
    trends: Vec<[String; 7]>,
    /// Reason, nodes, per cent.
    masks: Vec<[String; 3]>,
    resolution: [String; 2],
    grains: Vec<Area>,
    regions: Vec<Area>,
    devices: Vec<Area>,
    wanted: Option<[String; 7]>,
    /// Number, share, good nodes, wavelength and direction of the fit, coherence, chance of noise.
    stripes: Vec<[String; 7]>,
    /// Names and values.
    domains: Option<Vec<[String; 2]>>,
    /// χ²/dof, nodes, factor.
    agreement: Option<[String; 3]>,
    /// What the errors of regions leave out.
    common: &'static str,
    /// The image and the maps that are wanted most.
    first: Vec<Shown<'a>>,
    figures: Vec<Shown<'a>>,
    missing: Vec<Missing<'a>>,
    conventions: [(&'static str, &'a str); 15],
    settings: String,
    downloads: Vec<Download<'a>>,
}

/// A region in words.
#[derive(Debug, Serialize)]
struct Area {
    name: String,
    /// Centre and direction of a device.
    place: String,
    masked: String,
    twist: String,
    spread: String,
    below: String,
    strain: String,
    axis: String,
    wavelength: String,
}

fn mean(found: Option<RegionMeanResult>) -> String {
    found.map_or_else(|| "–".to_owned(), |m| estimate(m.mean, m.sigma))
}

fn estimate(value: Option<f64>, sigma: Option<f64>) -> String {
    plus_minus(Estimate::new(
        value.unwrap_or(f64::NAN),
        sigma.unwrap_or(f64::NAN),
    ))
}

impl Area {
    fn new(name: String, place: String, region: &RegionResult) -> Self {
        let digits = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), two_digits);
        let twist = region.twist_deg;
        let strain = region.mean.as_ref();
        let axis = strain.and_then(|m| m.strain_axis_lab_deg);
        Self {
            name,
            place,
            masked: plain(Some(region.masked_percent), 1),
            twist: mean(twist),
            spread: digits(twist.and_then(|t| t.spread_corrected)),
            below: digits(twist.and_then(|t| t.spread_below_95)),
            strain: strain
                .map(|m| m.heterostrain_percent)
                .map_or_else(|| "–".to_owned(), |e| estimate(e.value, e.sigma)),
            axis: axis.map_or_else(
                || "not significant".to_owned(),
                |a| estimate(a.value, a.sigma),
            ),
            wavelength: mean(region.wavelength_nm),
        }
    }
}

fn domains(found: &DomainsResult) -> Vec<[String; 2]> {
    let digits = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), two_digits);
    let rows = [
        ("nodes", format!("{} ({})", found.nodes, found.nodes_are)),
        ("error of a node (nm)", digits(found.node_sigma_nm)),
        ("triangles", found.triangles.to_string()),
        ("median twist (°)", plain(found.median_twist_deg, 4)),
        ("spread (°)", digits(found.twist_spread_deg)),
        ("error of a triangle (°)", digits(found.twist_noise_deg)),
        ("missing nodes", found.missing_nm.len().to_string()),
        ("extra nodes", found.extra_nm.len().to_string()),
        ("dislocations", found.dislocations.len().to_string()),
    ];
    rows.map(|(name, value)| [name.to_owned(), value]).into()
}

fn trend(name: &str, unit: &str, t: &TrendResult) -> [String; 7] {
    let [x, y] = [0, 1].map(|i| plus_minus(Estimate::new(t.per_100nm[i], t.per_100nm_sigma[i])));
    let [trend, noise, rest] = [t.of_trend, t.noise, t.rest].map(two_digits);
    let middle = plus_minus(Estimate::new(t.middle, t.middle_sigma));
    [format!("{name} ({unit})"), x, y, trend, noise, rest, middle]
}

fn stripes(found: &StripesResult) -> Vec<[String; 7]> {
    let shown =
        |e: Option<ResultEstimate>| e.map_or_else(|| "–".to_owned(), |e| plus_minus(e.plain()));
    let row = |p: &StripePatternResult| {
        [
            p.number.to_string(),
            plain(Some(p.share_percent), 0),
            p.good_nodes.to_string(),
            shown(p.wavelength_nm),
            shown(p.direction_deg),
            plain(p.coherence_percent, 0),
            format!("10^{:.0}", p.log10_chance),
        ]
    };
    found.patterns.iter().map(row).collect()
}

/// The page of a map. `downloads` are the files that it carries for saving.
///
/// # Errors
/// [`ReportError`] if the page cannot be made.
pub fn map_page(
    results: &MapResults,
    figures: &[Figure],
    downloads: &[(String, Vec<u8>)],
) -> Result<Vec<u8>, ReportError> {
    let all: usize = results.masks.iter().map(|m| m.nodes).sum();
    let details = &results.details;
    let shown = numbered(figures).into_iter().map(|(_, shown)| shown);
    let (first, others) = shown.partition(|shown: &Shown| FIRST.contains(&shown.name));
    let page = Page {
        results,
        layers: layers(&results.settings),
        whole: results.whole_image.as_ref().map(Numbers::new),
        quantities: results
            .quantities
            .iter()
            .map(|q| {
                [
                    format!("{} ({})", q.name, q.unit),
                    plus_minus(Estimate::new(q.mean, q.mean_sigma)),
                    two_digits(q.spread),
                    two_digits(q.noise),
                    two_digits(q.spread_corrected),
                ]
            })
            .collect(),
        trends: results
            .quantities
            .iter()
            .filter_map(|q| Some(trend(&q.name, &q.unit, &q.trend?)))
            .collect(),
        masks: results
            .masks
            .iter()
            .map(|m| {
                let share = 100.0 * m.nodes as f64 / all.max(1) as f64;
                [m.name.clone(), m.nodes.to_string(), plain(Some(share), 1)]
            })
            .collect(),
        resolution: [
            two_digits(results.window_nm),
            two_digits(results.resolution_nm),
        ],
        grains: details
            .grains
            .iter()
            .map(|g| Area::new(g.name.clone(), g.good_nodes.to_string(), g))
            .collect(),
        regions: details
            .regions
            .iter()
            .map(|r| Area::new(r.name.clone(), String::new(), r))
            .collect(),
        devices: details
            .devices
            .iter()
            .map(|d| {
                let [x, y] = d.centre_nm.map(|v| plain(Some(v), 1));
                let place = format!("({x}, {y}), {}°", plain(Some(d.angle_deg), 1));
                Area::new(d.rank.to_string(), place, &d.area)
            })
            .collect(),
        wanted: details.wanted.map(|w| {
            [
                plain(Some(w.twist_deg), 4),
                plain(Some(w.within_deg), 4),
                plain(w.corrected_percent, 1),
                plain(w.measured_percent, 1),
                plain(w.certain_percent, 1),
                plain(w.possible_percent, 1),
                plain(w.blur_percent, 1),
            ]
        }),
        stripes: results.stripes.as_ref().map_or_else(Vec::new, stripes),
        domains: details.domains.as_ref().map(domains),
        agreement: results.agreement.as_ref().map(|a| {
            let [chi2, factor] = [a.chi2_per_dof, a.variance_factor].map(|v| plain(Some(v), 2));
            [chi2, a.nodes.to_string(), factor]
        }),
        common: COMMON,
        first,
        figures: others,
        missing: missing(figures, None),
        conventions: conventions(&results.conventions),
        settings: serde_json::to_string_pretty(&results.settings)?,
        downloads: downloads
            .iter()
            .map(|(name, bytes)| download(name, bytes))
            .collect(),
    };
    rendered(TEMPLATE, page)
}
