//! The few lines on the screen at the end.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use moiregauge::analysis::{Analysis, Combined, SetAnalysis};
use moiregauge::budget::Budget;
use moiregauge::caveat::Caveat;
use moiregauge::estimate::Estimate;
use moiregauge::strain::TwistStrain;
use moiregauge_report::{FailedInput, plus_minus, two_digits};
use spmfile::FrameDirection;

/// Per set and combined: drift, twist, strain; then what to keep in mind.
pub(crate) fn summary(analysis: &Analysis) -> String {
    let mut text = String::new();
    for set in &analysis.sets {
        set_summary(&mut text, set);
    }
    if let Some(combined) = analysis
        .combined
        .as_ref()
        .filter(|_| analysis.sets.len() > 1)
    {
        combined_summary(&mut text, combined);
    }
    caveats(&mut text, &analysis.caveats);
    text
}

fn set_summary(text: &mut String, set: &SetAnalysis) {
    let up = set
        .scans
        .iter()
        .filter(|s| s.frame_direction == FrameDirection::Up)
        .count();
    let count = set.scans.len();
    let _ = writeln!(
        text,
        "{}: {}, {count} scan{} ({up} up, {} down)",
        set.name,
        set.channel,
        if count == 1 { "" } else { "s" },
        count - up
    );
    match &set.drift {
        Some(drift) => {
            let per_minute = |i: usize| {
                Estimate::from_variance(drift.velocity[i], drift.covariance[(i, i)]).scaled(60.0)
            };
            let _ = writeln!(
                text,
                "  drift         x {}, y {} nm/min{}",
                plus_minus(per_minute(0)),
                plus_minus(per_minute(1)),
                if drift.given { " (given)" } else { "" }
            );
        }
        None => text.push_str("  drift         not determined\n"),
    }
    match (&set.mean, &set.uncorrected) {
        (Some(mean), _) => twist_strain(text, &mean.twist_strain, &mean.budget),
        (None, Some(mean)) => {
            text.push_str(
                "  not corrected for drift (statistical errors only, drift not included):\n",
            );
            twist_strain(text, &mean.twist_strain, &mean.budget);
        }
        (None, None) => text.push_str("  no twist and strain explain this lattice\n"),
    }
    text.push('\n');
}

/// σ of the scans, and in brackets σ with everything in the budget.
fn twist_strain(text: &mut String, found: &TwistStrain, budget: &Budget) {
    let degree = 1f64.to_degrees();
    let degrees = |e: Estimate| plus_minus(e.scaled(degree));
    let known = budget.known();
    let all = budget.applied_to(found);
    let sigma = |variance: f64, factor: f64| {
        two_digits(factor * Estimate::from_variance(0.0, variance).sigma)
    };
    let _ = writeln!(
        text,
        "  twist         {}° (± {}° with calibration and model{})",
        degrees(found.twist()),
        sigma(known.covariance[(0, 0)], degree),
        if budget.drift_known() {
            ""
        } else {
            ", without drift"
        }
    );
    let percent = |[low, high]: [f64; 2]| format!("{:.4} to {:.4} %", 100.0 * low, 100.0 * high);
    let below = |e: &TwistStrain| format!("{:.4} %", 100.0 * e.strain_upper_limit_95());
    let (axis, interval, in_all) = (
        found.axis_lab(),
        found.strain_interval_95(),
        all.strain_interval_95(),
    );
    match axis {
        Some(axis) if all.axis_lab().is_some() => {
            let _ = writeln!(
                text,
                "  heterostrain  {} % (± {} %), axis {}° (± {}°) to x",
                plus_minus(found.heterostrain().scaled(100.0)),
                sigma(known.magnitude, 100.0),
                degrees(axis),
                sigma(known.axis_lab, degree)
            );
        }
        Some(axis) => {
            let _ = writeln!(
                text,
                "  heterostrain  {} %, axis {}° to x, in the image; with calibration and model below {} \
                 (95 %), not significant",
                plus_minus(found.heterostrain().scaled(100.0)),
                degrees(axis),
                below(&all)
            );
        }
        None => {
            let _ = writeln!(
                text,
                "  heterostrain  below {} (95 %; {} with calibration and model), not significant",
                below(found),
                below(&all)
            );
        }
    }
    let part = |i: usize| {
        let variance = found.strain_covariance()[(i, i)];
        plus_minus(Estimate::from_variance(found.strain_vector[i], variance).scaled(100.0))
    };
    let _ = writeln!(
        text,
        "                vector ({}, {}) %; 95 %: {} ({})",
        part(0),
        part(1),
        percent(interval),
        percent(in_all)
    );
}

fn combined_summary(text: &mut String, combined: &Combined) {
    text.push_str("all sets together\n");
    twist_strain(text, &combined.twist_strain, &combined.budget);
    for pair in &combined.consistency {
        let drift = pair
            .drift_sigmas
            .map_or(String::new(), |s| format!("drift {s:.1} σ, "));
        let _ = writeln!(
            text,
            "  {} / {}: {drift}twist {:.1} σ, strain {:.1} σ apart",
            pair.sets[0], pair.sets[1], pair.twist_sigmas, pair.strain_sigmas
        );
    }
    text.push('\n');
}

/// One line for each caveat, however many files it concerns.
pub(crate) fn caveats(text: &mut String, all: &[Caveat]) {
    let mut by_message: BTreeMap<(&str, &str), Vec<&str>> = BTreeMap::new();
    for caveat in all {
        let places = by_message
            .entry((&caveat.code, &caveat.message))
            .or_default();
        places.push(&caveat.place);
    }
    for ((code, message), places) in by_message {
        let place = match places.as_slice() {
            [one] => (*one).to_owned(),
            many => format!("{} and {} more", many[0], many.len() - 1),
        };
        let _ = writeln!(text, "caveat {code} ({place}): {message}");
    }
}

/// The table of what failed and why; empty if nothing did.
pub(crate) fn failures(failed: &[FailedInput]) -> String {
    let mut text = String::new();
    if failed.is_empty() {
        return text;
    }
    let _ = writeln!(text, "\nnot used: {}", failed.len());
    let width = failed
        .iter()
        .map(|f| f.file.chars().count())
        .max()
        .unwrap_or(0);
    for FailedInput { file, error } in failed {
        let _ = writeln!(text, "  {file:width$}  {error}");
    }
    text
}
