//! What the page says, as text ready for the template.

use moiregauge::campaign::Analysis;
use moiregauge::caveat::{Caveat, Doubt, MoireDoubt, SetDoubt};
use moiregauge::settings::Settings;
use moiregauge::spectrum::Method;
use serde::Serialize;

use super::meanings::Meanings;
use super::template::rendered;
use super::words::{
    Budgeted, Numbers, consistency, conventions, plain, shown, statistical, wavelengths,
};
use crate::draw::base64;
use crate::error::ReportError;
use crate::figures::Figure;
use crate::results::{
    AssumedDriftResult, AtomicResult, DriftResult, LineResult, Results, ScanResult, SetResult,
};

const TEMPLATE: &str = include_str!("report.html");

/// The page. `downloads` are the files that it carries for saving.
pub(crate) fn page(
    of: (&Results, &Analysis),
    figures: &[Figure],
    downloads: &[(String, Vec<u8>)],
) -> Result<Vec<u8>, ReportError> {
    rendered(TEMPLATE, Page::new(of, figures, downloads)?)
}

#[derive(Debug, Serialize)]
struct Page<'a> {
    results: &'a Results,
    scans: usize,
    /// The published method, whose bias the page has to tell, was used.
    paper: bool,
    combined: Option<Numbers>,
    combined_statistical: Option<Numbers>,
    combined_budget: Option<Budgeted>,
    combined_wavelengths: Option<[String; 3]>,
    combined_meanings: Option<Meanings>,
    /// Why there is no combined result, where there is none.
    not_combined: String,
    /// Names of the layers.
    layers: String,
    atomic: Option<Atomic>,
    sets: Vec<Set<'a>>,
    consistency: Vec<[String; 5]>,
    /// Figures of all sets together.
    together: Vec<Shown<'a>>,
    conventions: [(&'static str, &'a str); 15],
    settings: String,
    downloads: Vec<Download<'a>>,
}

#[derive(Debug, Serialize)]
struct Set<'a> {
    number: usize,
    found: &'a SetResult,
    /// Scans that were used.
    used: usize,
    rate: String,
    drift: Option<Drift>,
    /// σ of a drift that is assumed.
    assumed: Option<String>,
    mean: Option<Numbers>,
    mean_statistical: Option<Numbers>,
    /// Of `mean` or, where there is none, of `uncorrected`.
    budget: Option<Budgeted>,
    mean_wavelengths: Option<[String; 3]>,
    meanings: Option<Meanings>,
    uncorrected: Option<Numbers>,
    uncorrected_wavelengths: Option<[String; 3]>,
    /// Where there is no twist: lengths, and their scatter over the scans.
    lattice: Option<[[String; 3]; 2]>,
    forward_backward: Option<Numbers>,
    chi2_per_dof: String,
    twist_scatter: String,
    strain_scatter: String,
    scans: Vec<Scan<'a>>,
    figures: Vec<Shown<'a>>,
    missing: Vec<Missing<'a>>,
}

/// The orientation by atomic images.
#[derive(Debug, Serialize)]
struct Atomic {
    files: String,
    layer: u8,
    angle: String,
    size: String,
    drift: Option<[String; 2]>,
}

#[derive(Debug, Serialize)]
struct Drift {
    x: String,
    y: String,
    /// With the statistical σ.
    statistical: [String; 2],
    given: bool,
    fit: Option<DriftFit>,
    draws: Option<DriftDraws>,
}

#[derive(Debug, Serialize)]
struct DriftFit {
    rank: usize,
    condition: String,
    chi2: String,
    degrees_of_freedom: usize,
    paper: Option<[String; 2]>,
}

#[derive(Debug, Serialize)]
struct DriftDraws {
    count: usize,
    x: String,
    y: String,
}

#[derive(Debug, Serialize)]
struct Scan<'a> {
    number: usize,
    found: &'a ScanResult,
    before: Option<Numbers>,
    after: Option<Numbers>,
    wavelengths: [String; 3],
    periods: String,
    signal_to_noise: String,
    predicted_by: String,
    rivals: String,
    /// Of each line and lattice: line, wavelengths, what it is, share, behind by.
    candidates: Vec<[String; 5]>,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Shown<'a> {
    number: usize,
    pub(super) name: &'a str,
    title: &'a str,
    caption: &'a str,
    svg: &'a str,
    /// Over the full width of a page, not of a column.
    wide: bool,
}

#[derive(Debug, Serialize)]
pub(super) struct Missing<'a> {
    title: &'a str,
    reason: &'a str,
}

#[derive(Debug, Serialize)]
pub(super) struct Download<'a> {
    name: &'a str,
    kind: &'static str,
    base64: String,
}

impl<'a> Page<'a> {
    pub(super) fn new(
        (results, analysis): (&'a Results, &Analysis),
        figures: &'a [Figure],
        downloads: &'a [(String, Vec<u8>)],
    ) -> Result<Self, ReportError> {
        let all = numbered(figures);
        let of = |wanted: Option<usize>| {
            let own = all.iter().filter(move |(set, _)| *set == wanted);
            own.map(|(_, figure)| figure.clone()).collect::<Vec<_>>()
        };
        let combined = results.combined.as_ref();
        let sets = results.sets.iter().enumerate();
        Ok(Self {
            results,
            scans: results.sets.iter().map(used).sum(),
            paper: results.settings.method == Method::Paper,
            combined: combined.map(|c| Numbers::in_all(&c.twist_strain, &c.budget)),
            combined_statistical: combined.map(|c| Numbers::statistical(&c.twist_strain)),
            combined_budget: combined.map(|c| Budgeted::new(&c.budget)),
            combined_wavelengths: combined.map(|c| wavelengths(&c.vectors)),
            combined_meanings: combined.map(|c| Meanings::new(&c.readings)),
            not_combined: not_combined(&analysis.caveats),
            layers: layers(&results.settings),
            atomic: results.atomic.as_ref().map(atomic),
            sets: sets
                .map(|(i, set)| Set::new(i, set, of(Some(i)), missing(figures, Some(i))))
                .collect(),
            consistency: consistency(results),
            together: of(None),
            conventions: conventions(&results.conventions),
            settings: serde_json::to_string_pretty(&results.settings)?,
            downloads: downloads
                .iter()
                .map(|(name, bytes)| download(name, bytes))
                .collect(),
        })
    }
}

/// Why there is no combined result.
fn not_combined(caveats: &[Caveat]) -> String {
    let is_reason = |c: &&Caveat| {
        matches!(
            c.doubt,
            Doubt::Sets(SetDoubt::SamplesSeparated(_) | SetDoubt::DifferentLattices { .. })
                | Doubt::Moire(MoireDoubt::LayersCannotMakeIt(_) | MoireDoubt::NoMoire { .. })
        )
    };
    match caveats.iter().find(is_reason) {
        Some(why) => format!("There is no combined result: {}.", why.message()),
        None => "No set could be corrected for drift, so there is no combined result. The numbers below belong to \
                 single sets and include the distortion by drift."
            .to_owned(),
    }
}

/// `graphene (a = 0.246 nm, ν = 0.16)`, or two of them, and whether nobody chose them.
pub fn layers(settings: &Settings) -> String {
    let bilayer = settings.bilayer();
    let of = |m: &heterostrain::material::Material| {
        format!(
            "{} (a = {} nm, ν = {})",
            m.name, m.lattice_constant_nm, m.poisson_ratio
        )
    };
    let assumed = if settings.layers_are_assumed() {
        " (assumed)"
    } else {
        ""
    };
    if bilayer.reference == bilayer.stretched {
        format!("{}{assumed}", of(bilayer.stretched))
    } else {
        format!(
            "{} on {}{assumed}",
            of(bilayer.stretched),
            of(bilayer.reference)
        )
    }
}

fn atomic(found: &AtomicResult) -> Atomic {
    Atomic {
        files: found.files.join(", "),
        layer: found.layer,
        angle: format!("({})°", shown(found.lattice_angle_deg)),
        size: plain(found.size, 4),
        drift: found.drift_nm_per_min.map(|d| d.map(|part| plain(part, 3))),
    }
}

/// The drawn figures, numbered through, with the set each belongs to.
pub(super) fn numbered(figures: &[Figure]) -> Vec<(Option<usize>, Shown<'_>)> {
    let drawn = figures
        .iter()
        .filter_map(|f| f.drawing.as_ref().ok().map(|d| (f, d)));
    drawn
        .enumerate()
        .map(|(index, (figure, drawing))| {
            let shown = Shown {
                number: index + 1,
                name: &figure.name,
                title: figure.title,
                caption: &drawing.caption,
                svg: &drawing.svg,
                wide: drawing.wide,
            };
            (figure.set, shown)
        })
        .collect()
}

/// The figures of a set that were left out.
pub(super) fn missing(figures: &[Figure], set: Option<usize>) -> Vec<Missing<'_>> {
    let own = figures.iter().filter(|f| f.set == set);
    own.filter_map(|f| {
        f.drawing.as_ref().err().map(|reason| Missing {
            title: f.title,
            reason,
        })
    })
    .collect()
}

pub(super) fn download<'a>(name: &'a str, bytes: &[u8]) -> Download<'a> {
    Download {
        name,
        kind: match name.rsplit('.').next() {
            Some("json") => "application/json",
            Some("csv") => "text/csv;charset=utf-8",
            _ => "text/plain;charset=utf-8",
        },
        base64: base64::encode(bytes),
    }
}

impl<'a> Set<'a> {
    fn new(
        index: usize,
        set: &'a SetResult,
        figures: Vec<Shown<'a>>,
        missing: Vec<Missing<'a>>,
    ) -> Self {
        let (mean, uncorrected) = (set.mean.as_ref(), set.uncorrected.as_ref());
        Self {
            number: index + 1,
            found: set,
            used: used(set),
            rate: set
                .line_rate_hz
                .map_or_else(|| plain(None, 0), |rate| rate.to_string()),
            drift: set.drift.as_ref().map(drift),
            assumed: assumed(set).map(|drift| plain(drift.sigma_nm_per_min, 2)),
            mean: mean.map(|m| Numbers::in_all(&m.twist_strain, &m.budget)),
            mean_statistical: mean.map(|m| Numbers::statistical(&m.twist_strain)),
            budget: mean.or(uncorrected).map(|m| Budgeted::new(&m.budget)),
            mean_wavelengths: mean.map(|m| wavelengths(&m.vectors)),
            meanings: mean.or(uncorrected).map(|m| Meanings::new(&m.readings)),
            uncorrected: uncorrected.map(|m| Numbers::statistical(&m.twist_strain)),
            uncorrected_wavelengths: uncorrected.map(|m| wavelengths(&m.vectors)),
            lattice: set.lattice.as_ref().map(|l| {
                let scatter = l.wavelength_scatter_nm.map(|s| plain(s, 5));
                [wavelengths(&l.vectors), scatter]
            }),
            forward_backward: set.forward_backward.as_ref().map(Numbers::new),
            chi2_per_dof: plain(mean.and_then(|m| m.chi2_per_dof), 2),
            twist_scatter: plain(mean.and_then(|m| m.twist_scatter_deg), 4),
            strain_scatter: plain(mean.and_then(|m| m.strain_scatter_percent), 4),
            scans: set
                .scans
                .iter()
                .enumerate()
                .map(|(i, s)| Scan::new(i, s))
                .collect(),
            figures,
            missing,
        }
    }
}

/// What was assumed of the drift of a set.
fn assumed(set: &SetResult) -> Option<AssumedDriftResult> {
    let alone = || set.lattice.as_ref()?.drift_assumed;
    set.mean.as_ref().map_or_else(alone, |m| m.drift_assumed)
}

/// How many scans of a set were used.
fn used(set: &SetResult) -> usize {
    set.scans.iter().filter(|s| s.excluded.is_none()).count()
}

fn drift(drift: &DriftResult) -> Drift {
    Drift {
        x: shown(drift.x_nm_per_min),
        y: shown(drift.y_nm_per_min),
        statistical: [drift.x_nm_per_min, drift.y_nm_per_min].map(statistical),
        given: drift.given,
        fit: drift.fit.as_ref().map(|fit| DriftFit {
            rank: fit.rank,
            condition: plain(fit.condition, 2),
            chi2: plain(fit.chi2, 1),
            degrees_of_freedom: fit.degrees_of_freedom,
            paper: fit.paper_nm_per_min.map(|v| v.map(|part| plain(part, 3))),
        }),
        draws: drift.monte_carlo.as_ref().map(|draws| DriftDraws {
            count: draws.draws,
            x: shown(draws.x_nm_per_min),
            y: shown(draws.y_nm_per_min),
        }),
    }
}

fn candidates(line: &LineResult) -> impl Iterator<Item = [String; 5]> {
    line.candidates.iter().enumerate().map(|(i, candidate)| {
        let lengths = |all: [Option<f64>; 3]| all.map(|length| plain(length, 2)).join(", ");
        let own = lengths(candidate.wavelengths_nm);
        let second = candidate.second_wavelengths_nm.map(lengths);
        let what = match (i, candidate.cells) {
            (0, _) => "measured".to_owned(),
            _ if second.is_some() => "two on top of each other".to_owned(),
            (_, 1) => "another".to_owned(),
            (_, cells) => format!("1/{cells} of its cell"),
        };
        let share = candidate.predicted_share.map(|share| 100.0 * share);
        [
            line.line.clone(),
            [own]
                .into_iter()
                .chain(second)
                .collect::<Vec<_>>()
                .join(" and "),
            what,
            plain(share, 1),
            plain(candidate.behind_by.filter(|_| i > 0), 1),
        ]
    })
}

impl<'a> Scan<'a> {
    fn new(index: usize, scan: &'a ScanResult) -> Self {
        let lowest = |values: fn(&LineResult) -> Option<f64>| {
            scan.lines.iter().filter_map(values).reduce(f64::min)
        };
        Self {
            number: index + 1,
            found: scan,
            before: scan.twist_strain.sensor.as_ref().map(Numbers::new),
            after: scan.twist_strain.drift_corrected.as_ref().map(Numbers::new),
            wavelengths: scan
                .vectors
                .each_ref()
                .map(|v| shown(v.drift_corrected.unwrap_or(v.sensor).wavelength_nm)),
            periods: plain(lowest(|line| line.periods), 1),
            signal_to_noise: plain(lowest(|line| line.signal_to_noise), 1),
            predicted_by: plain(lowest(|line| line.predicted_by), 1),
            rivals: scan
                .lines
                .iter()
                .filter_map(|line| line.rivals)
                .max()
                .map_or_else(|| "–".to_owned(), |most| most.to_string()),
            candidates: scan.lines.iter().flat_map(candidates).collect(),
        }
    }
}
