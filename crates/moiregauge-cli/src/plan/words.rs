//! A plan as a table and a few sentences.

use std::fmt::Write as _;

use moiregauge::meaning::Source;
use moiregauge_pipeline::plan::{Expected, Limit, OutOfReach, Plan, Plans};
use moiregauge_report::two_digits;

/// Plans that are shown.
const SHOWN: usize = 8;

/// Conditions, wishes, the table, and what limits.
pub(super) fn plan(found: &Plans) -> String {
    let mut text = String::new();
    let (conditions, wishes, plans) = (&found.conditions, &found.wishes, &found.plans);
    let raster = &conditions.raster;
    let _ = writeln!(
        text,
        "conditions: twist {}°, {} × {} pixels, noise {} of the signal at {} Hz{}{}, frame times ± {} s",
        two_digits_or_more(conditions.sample.twist_deg),
        raster.pixels[0],
        raster.pixels[1],
        two_digits(conditions.noise.pixel_deg / conditions.sample.contrast_deg),
        raster.line_rate_hz,
        if raster.retrace {
            ", trace and retrace"
        } else {
            ""
        },
        if raster.sensors {
            ", position sensors"
        } else {
            ", no position sensors"
        },
        found.settings.frame_time_sigma_s
    );
    let wish =
        |value: Option<f64>, name: &str, unit: &str| value.map(|v| format!("{name} ± {v}{unit}"));
    let wanted: Vec<String> = [
        wish(wishes.twist_deg, "twist", "°"),
        wish(wishes.strain_percent, "strain", " %"),
        wish(wishes.drift_nm_per_min, "drift", " nm/min"),
    ]
    .into_iter()
    .flatten()
    .collect();
    let _ = writeln!(text, "wanted: {}\n", wanted.join(", "));
    let _ = writeln!(
        text,
        "   {:>5} {:>6} {:>14} {:>8} {:>10} {:>19} {:>19}  limited by",
        "scans", "Hz", "size nm", "minutes", "σ drift", "σ twist ° (all)", "σ strain % (all)"
    );
    for (index, plan) in plans.iter().take(SHOWN).enumerate() {
        let mark = match (index, plan.met) {
            (0, true) => "→",
            (_, true) => " ",
            (_, false) => "✗",
        };
        row(&mut text, mark, plan);
    }
    if let Some(best) = plans.first() {
        text.push('\n');
        recommendation(&mut text, best);
        for one in &best.out_of_reach {
            limit(&mut text, one);
        }
    }
    text
}

fn two_digits_or_more(value: f64) -> String {
    format!("{}", (value * 1e4).round() / 1e4)
}

fn row(text: &mut String, mark: &str, plan: &Plan) {
    let raster = &plan.set.raster;
    let [width, height] = plan.size_nm;
    let pair = |sigma: Expected| {
        format!(
            "{} ({})",
            two_digits(sigma.statistical),
            two_digits(sigma.total)
        )
    };
    let _ = writeln!(
        text,
        "{mark}  {:>5} {:>6} {:>14} {:>8.1} {:>10} {:>19} {:>19}  {}",
        raster.scans,
        two_digits_or_more(raster.line_rate_hz),
        format!("{width:.0} × {height:.0}"),
        plan.duration_s / 60.0,
        two_digits(plan.drift_sigma_nm_per_min),
        pair(plan.twist_sigma_deg),
        pair(plan.strain_sigma_percent),
        plan.limited_by.map_or("", source)
    );
}

fn source(limit: Limit) -> &'static str {
    match limit {
        Limit::Of(Source::Image) => "noise of the images",
        Limit::Of(Source::Drift) => "drift",
        Limit::Of(Source::Sensor) => "noise of the sensors",
        Limit::Of(Source::Gain) => "calibration: gain",
        Limit::Of(Source::Mismatch) => "calibration: mismatch of x and y",
        Limit::Of(Source::Orthogonality) => "calibration: orthogonality",
        Limit::Of(Source::Pitch) => "pitch of the pixels",
        Limit::Of(Source::Shape) => "shape of the grid",
        Limit::Of(Source::LatticeConstant) => "lattice constant",
        Limit::Of(Source::StrainedLayer) => "which layer is strained",
        Limit::Of(Source::IsotropicStrain) => "isotropic strain",
        Limit::Of(Source::PoissonRatio) => "Poisson ratio",
        Limit::Of(Source::RulerStrain) => "strain of the ruler",
        Limit::Unlinked => "frames that cannot be linked by phases",
        Limit::FrameTimes => "times of the frames",
        _ => "",
    }
}

fn recommendation(text: &mut String, best: &Plan) {
    let raster = &best.set.raster;
    let [width, height] = best.size_nm;
    let _ = writeln!(
        text,
        "{}: {} scans, up and down in turn, {width:.0} nm × {height:.0} nm in {} × {} pixels at {} Hz: {:.1} minutes. \
         One slow axis is enough. The same number of scans with the frame turned by 90° also shows whether the fast \
         axis lags",
        if best.met {
            "recommended"
        } else {
            "no row of the table reaches it; the nearest is"
        },
        raster.scans,
        raster.pixels[0],
        raster.pixels[1],
        two_digits_or_more(raster.line_rate_hz),
        best.duration_s / 60.0
    );
    if !best.linked {
        text.push_str(
            "the phases of the frames cannot be linked, so the drift comes from wave vectors alone. Reasons can be \
             missing position sensors, long pauses, or a drift that is not known well enough\n",
        );
    }
}

/// A wish that no number of scans fulfils, and what would.
fn limit(text: &mut String, one: &OutOfReach) {
    let (name, sign) = if one.is_twist {
        ("twist", "°")
    } else {
        ("strain", " %")
    };
    let _ = writeln!(
        text,
        "out of reach: {name} ± {}{sign}. Calibration and model alone give ± {}{sign}, most of it {} (± {}{sign}), and \
         more scans do not make this smaller; {}. The plan reaches the wanted value with its statistical error alone",
        one.wish,
        two_digits(one.floor),
        source(one.largest),
        two_digits(one.largest_sigma),
        remedy(one.largest)
    );
}

fn remedy(limit: Limit) -> &'static str {
    match limit {
        Limit::Of(Source::Gain | Source::Mismatch | Source::Orthogonality) => {
            "`moiregauge calibrate` with a known lattice does"
        }
        Limit::Of(Source::Pitch | Source::Shape) => "recording the position sensors does",
        Limit::Of(Source::LatticeConstant) => "a better known lattice constant does",
        Limit::Of(Source::IsotropicStrain) => "the orientation of one of the layers does",
        Limit::Of(Source::PoissonRatio) => "a better known Poisson ratio does",
        Limit::Of(Source::StrainedLayer) => "knowing which layer is strained does",
        _ => "more scans do",
    }
}
