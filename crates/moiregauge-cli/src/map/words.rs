//! What a map says on the screen.

use std::fmt::Write as _;

use heterostrain::Estimate;
use moiregauge_report::results::{MapResults, ResultEstimate, StripesResult};
use moiregauge_report::screen::caveats;
use moiregauge_report::{layers, plus_minus, two_digits};

use super::regions;
use crate::hints;

/// Quantities whose trend is told on the screen.
const TRENDS: [&str; 3] = ["twist", "strain vector 1", "strain vector 2"];
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
        text.push_str(&patterns(found));
    }
    if let Some(a) = &results.agreement {
        let _ = writeln!(
            text,
            "  images agree with χ²/dof {:.2} at {} nodes",
            a.chi2_per_dof, a.nodes
        );
    }
    text.push_str(&regions::summary(&results.details));
    caveats(&mut text, results.caveats.iter().cloned(), hints::of);
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

/// The patterns, for the screen.
fn patterns(found: &StripesResult) -> String {
    let mut text = String::new();
    for p in &found.patterns {
        let shown = |v: Option<ResultEstimate>| {
            v.map_or_else(
                || "–".to_owned(),
                |e| {
                    let known = |v: Option<f64>| v.unwrap_or(f64::NAN);
                    plus_minus(Estimate::new(known(e.value), known(e.sigma)))
                },
            )
        };
        let strongest = p.harmonics.iter().map(|h| h.local_amplitude);
        let strongest = strongest.fold(0.0, f64::max);
        let harmonics: Vec<String> = p
            .harmonics
            .iter()
            .map(|h| two_digits(h.local_amplitude / strongest))
            .collect();
        let _ = writeln!(
            text,
            "pattern {}: {} % of the nodes, {} good; one wave fitted to its pixels: {} nm along {}° ({:.0} % of the \
             local power); chance of noise 10^{:.0}; its harmonics are as strong as {}",
            p.number,
            p.share_percent.round(),
            p.good_nodes,
            shown(p.wavelength_nm),
            shown(p.direction_deg),
            p.coherence_percent.unwrap_or(f64::NAN),
            p.log10_chance,
            harmonics.join(" : ")
        );
    }
    text
}
