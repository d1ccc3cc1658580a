//! The few lines on the screen at the end.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use moiregauge::analysis::{Analysis, Combined, SetAnalysis};
use moiregauge::caveat::Caveat;
use moiregauge::estimate::Estimate;
use moiregauge::strain::TwistStrain;
use moiregauge_report::{FailedInput, plus_minus};
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
        (Some(mean), _) => twist_strain(text, &mean.twist_strain),
        (None, Some(mean)) => {
            text.push_str(
                "  not corrected for drift (statistical errors only, drift not included):\n",
            );
            twist_strain(text, &mean.twist_strain);
        }
        (None, None) => text.push_str("  no twist and strain explain this lattice\n"),
    }
    text.push('\n');
}

fn twist_strain(text: &mut String, found: &TwistStrain) {
    let degrees = |e: Estimate| plus_minus(e.scaled(1f64.to_degrees()));
    let _ = writeln!(text, "  twist         {}°", degrees(found.twist()));
    match found.axis_lab() {
        Some(axis) => {
            let _ = writeln!(
                text,
                "  heterostrain  {} %, axis {}° to x",
                plus_minus(found.heterostrain().scaled(100.0)),
                degrees(axis)
            );
        }
        None => {
            let _ = writeln!(
                text,
                "  heterostrain  below {:.4} % (95 %), not significant",
                found.strain_upper_limit_95() * 100.0
            );
        }
    }
}

fn combined_summary(text: &mut String, combined: &Combined) {
    text.push_str("all sets together\n");
    twist_strain(text, &combined.twist_strain);
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
fn caveats(text: &mut String, all: &[Caveat]) {
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
pub(super) fn failures(failed: &[FailedInput]) -> String {
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
