//! Do the headers agree with the images?
//!
//! Within a frame a drift D changes wave vectors by `−u (D·G)`, from frame to frame it moves the phases by `−G·D Δt`. A
//! slow direction that is the other way round, or a line rate that is off by a factor, changes u and with it the D that
//! the wave vectors tell; the phases, timed by dates, tell the true one. The joint fit is tried with such headers: where
//! the scans fit together far better, a header says something else than the images. Dates tell of line rates, too.

use heterostrain::lattice::{Lattice, labelled_like, reciprocal};
use nalgebra::{Matrix2, Vector2};
use spmfile::FrameDirection;

use crate::campaign::sightings::{seconds, sightings};
use crate::caveat::Caveat;
use crate::caveat::drifting::{DriftDoubt, FrameDates};
use crate::drift::joint::choose::fit;
use crate::drift::joint::found::JointFit;
use crate::drift::joint::sighting::Detection;
use crate::scan::measured::MeasuredScan;
use crate::settings::knobs::Settings;

/// χ²/dof of such a fit, at most. On the scenes of docs/constants.md half and double change no result.
const CLEAN_CHI2: f64 = 1.5;
/// Positions of scans that fit together scatter by less than this, nm. Half and twice as much change no result of
/// docs/constants.md.
const SCATTER: f64 = 0.3;
/// The information criterion has to fall by this much, with the scatter of the scans as unit: odds of e²⁵.
const FAR_BETTER: f64 = 50.0;
/// Below this scatter (nm) a fit needs no other explanation. Half and twice as much change no result of
/// docs/constants.md.
const CLEAN: f64 = 0.01;
/// Dates are whole seconds, and files are written some time after the frame, s: a second for each.
const CLOCK: f64 = 2.0;
/// Pauses of one frame are as long as that to this share. On the scenes of docs/constants.md half and double change no result.
const SHARE: f64 = 0.05;

/// Other headers that are tried: by what they multiply the time gradient, and in words.
const OTHERS: [(f64, &str); 5] = [
    (-1.0, "with all slow directions the other way (up is down)"),
    (2.0, "with half the line rate"),
    (0.5, "with twice the line rate"),
    (
        -2.0,
        "with half the line rate and all slow directions the other way",
    ),
    (
        -0.5,
        "with twice the line rate and all slow directions the other way",
    ),
];

/// Caveats of the headers of a set, by its joint fit `found`, which started from `lattice` and `velocity`.
pub(crate) fn about_headers(
    name: &str,
    scans: &[&MeasuredScan],
    reference: &Matrix2<f64>,
    lattice: &Lattice,
    velocity: &Vector2<f64>,
    found: &JointFit,
    settings: &Settings,
) -> Option<Caveat> {
    let seen = sightings(scans, reference)?;
    if !linkable(found) || is_clean(found) {
        return None;
    }
    let waves = labelled_like(&lattice.waves()?, &reciprocal(reference)?);
    let mut tried: Vec<(&str, Option<JointFit>)> = Vec::new();
    for (factor, words) in OTHERS {
        let mut other = seen.clone();
        for sighting in &mut other {
            sighting.time_gradient *= factor;
        }
        let (velocity, sigma) = (velocity / factor, settings.frame_time_sigma_s);
        tried.push((words, fit(&other, &waves.basis, &velocity, sigma)));
    }
    let best = tried
        .iter()
        .filter_map(|(words, other)| Some((*words, other.as_ref()?)))
        .filter(|(_, other)| is_better(other, found))
        .min_by(|a, b| a.1.criterion().total_cmp(&b.1.criterion()));
    let troubled = !found.terms.phases || found.instability_nm > SCATTER;
    if best.is_none() && !troubled {
        return None;
    }
    let others = tried.iter().map(|(words, fit)| (*words, fit.as_ref()));
    let attempts = std::iter::once(("with the headers", Some(found)))
        .chain(others)
        .map(|(words, fit)| format!("{words}: {}", in_words(fit)))
        .collect();
    let doubt = match best {
        Some((headers, _)) => DriftDoubt::HeadersContradictImages {
            headers: headers.to_owned(),
            attempts,
        },
        None => DriftDoubt::FramesDoNotLink { attempts },
    };
    Some(Caveat::new(doubt, name))
}

/// Whether phases could link frames at all: there are some in two scans of a block.
fn linkable(found: &JointFit) -> bool {
    let all = || found.sightings().iter().filter(|s| s.phases.is_some());
    let mut pairs = all().flat_map(|a| all().map(move |b| (a, b)));
    pairs.any(|(a, b): (&Detection, &Detection)| a.block == b.block && a.scan != b.scan)
}

fn reduced(found: &JointFit) -> f64 {
    found.chi2 / found.degrees_of_freedom.max(1) as f64
}

fn is_clean(found: &JointFit) -> bool {
    found.terms.phases && found.instability_nm < CLEAN && reduced(found) < CLEAN_CHI2
}

/// Whether the scans fit together with other headers, and far better than `found`.
fn is_better(other: &JointFit, found: &JointFit) -> bool {
    if !other.terms.phases || other.instability_nm > SCATTER {
        return false;
    }
    // Without phases a fit has fewer residuals, which compares with nothing: that the others link is enough.
    !found.terms.phases
        || found.criterion() - other.criterion() > FAR_BETTER * reduced(other).max(1.0)
}

fn in_words(found: Option<&JointFit>) -> String {
    match found {
        Some(found) if found.terms.phases => format!(
            "positions scatter by {:.0} pm, χ²/dof {:.1}, drift ({:.3}, {:.3}) nm/min",
            1000.0 * found.instability_nm,
            reduced(found),
            60.0 * found.velocity.x,
            60.0 * found.velocity.y
        ),
        _ => "the frames cannot be registered".to_owned(),
    }
}

/// What the dates of consecutive frames say of their line rate.
pub(crate) fn about_dates(name: &str, scans: &[&MeasuredScan]) -> Option<Caveat> {
    let pairs: Vec<(f64, f64, bool)> = scans
        .windows(2)
        .filter_map(|pair| {
            let [a, b] = pair else { return None };
            let interval = seconds(b.acquired?) - seconds(a.acquired?);
            let turned = matches!(
                (a.frame_direction, b.frame_direction),
                (Some(FrameDirection::Up), Some(FrameDirection::Down))
                    | (Some(FrameDirection::Down), Some(FrameDirection::Up))
            );
            Some((interval, duration(a)?.min(duration(b)?), turned))
        })
        .collect();
    let (interval, frame, _) = *pairs.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let rate = scans.first()?.line_rate_hz?;
    if interval < (1.0 - SHARE) * frame - CLOCK {
        let dates = FrameDates::TooClose {
            interval,
            frame,
            rate,
        };
        return Some(Caveat::new(
            DriftDoubt::DatesContradictLineRate(dates),
            name,
        ));
    }
    let doubled = |&(interval, frame, turned): &(f64, f64, bool)| {
        turned && (interval - 2.0 * frame).abs() < 2.0 * SHARE * frame + CLOCK
    };
    (pairs.len() > 1 && frame > 4.0 * CLOCK && pairs.iter().all(doubled)).then(|| {
        let dates = FrameDates::Doubled {
            interval,
            frame,
            rate,
        };
        Caveat::new(DriftDoubt::DatesContradictLineRate(dates), name)
    })
}

/// How long the lines of a frame take that were surely recorded, s.
fn duration(scan: &MeasuredScan) -> Option<f64> {
    let line = scan.lines.first()?;
    Some((line.geometry.size[1] + line.lines_after) as f64 / scan.line_rate_hz?)
}
