//! A plan as a table and a few sentences.

use std::fmt::Write as _;

use moiregauge::meaning::Source;
use moiregauge::plan::{Prediction, Quantity};
use moiregauge::settings::Settings;
use moiregauge::simulate::Simulation;
use moiregauge_report::two_digits;

use super::search::{Plan, beyond};
use super::wishes::Wishes;

/// Plans that are shown.
const SHOWN: usize = 8;

/// Conditions, wishes, the table, and what limits.
pub(super) fn plan(
    conditions: &Simulation,
    settings: &Settings,
    wishes: &Wishes,
    plans: &[Plan],
) -> String {
    let mut text = String::new();
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
        settings.frame_time_sigma_s
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
        row(&mut text, mark, plan, wishes);
    }
    if let Some(best) = plans.first() {
        text.push('\n');
        recommendation(&mut text, best);
        limits(&mut text, best, wishes);
    }
    text
}

fn two_digits_or_more(value: f64) -> String {
    format!("{}", (value * 1e4).round() / 1e4)
}

fn row(text: &mut String, mark: &str, plan: &Plan, wishes: &Wishes) {
    let p = &plan.prediction;
    let raster = &plan.set.raster;
    let [width, height] = plan.size_nm();
    let pair = |quantity: Quantity, unit: f64| {
        format!(
            "{} ({})",
            two_digits(unit * p.statistical(quantity)),
            two_digits(unit * p.sigma(quantity, |_| true))
        )
    };
    let _ = writeln!(
        text,
        "{mark}  {:>5} {:>6} {:>14} {:>8.1} {:>10} {:>19} {:>19}  {}",
        raster.scans,
        two_digits_or_more(raster.line_rate_hz),
        format!("{width:.0} × {height:.0}"),
        plan.duration_s() / 60.0,
        two_digits(60.0 * p.drift_sigma()),
        pair(Quantity::Twist, 1f64.to_degrees()),
        pair(Quantity::Strain, 100.0),
        limit(p, wishes)
    );
}

/// What makes most of the error that is nearest to its wish, or farthest beyond it.
fn limit(p: &Prediction, wishes: &Wishes) -> &'static str {
    let twist = wishes.twist_deg.map(|w| {
        (
            p.sigma(Quantity::Twist, |_| true) / w.to_radians(),
            source(p.largest(Quantity::Twist)),
        )
    });
    let strain = wishes.strain_percent.map(|w| {
        (
            100.0 * p.sigma(Quantity::Strain, |_| true) / w,
            source(p.largest(Quantity::Strain)),
        )
    });
    let drift = wishes
        .drift_nm_per_min
        .map(|w| (60.0 * p.drift_sigma() / w, of_drift(p)));
    let all = [twist, strain, drift];
    let worst = all.into_iter().flatten().max_by(|a, b| a.0.total_cmp(&b.0));
    worst.map_or("", |(_, name)| name)
}

fn source(source: Source) -> &'static str {
    match source {
        Source::Image => "noise of the images",
        Source::Drift => "drift",
        Source::Sensor => "noise of the sensors",
        Source::Gain => "calibration: gain",
        Source::Mismatch => "calibration: mismatch of x and y",
        Source::Orthogonality => "calibration: orthogonality",
        Source::Pitch => "pitch of the pixels",
        Source::LatticeConstant => "lattice constant",
        Source::StrainedLayer => "which layer is strained",
        Source::IsotropicStrain => "isotropic strain",
        Source::PoissonRatio => "Poisson ratio",
    }
}

/// Exact times would make a clearly smaller error, or phases would.
fn of_drift(p: &Prediction) -> &'static str {
    if !p.linked {
        "frames that cannot be linked by phases"
    } else if p.drift_sigma_with_clock() < 0.7 * p.drift_sigma() {
        "times of the frames"
    } else {
        "noise of the images"
    }
}

fn recommendation(text: &mut String, best: &Plan) {
    let raster = &best.set.raster;
    let [width, height] = best.size_nm();
    let _ = writeln!(
        text,
        "{}: {} scans, up and down in turn, {width:.0} nm × {height:.0} nm in {} × {} pixels at {} Hz: {:.1} minutes. \
         One slow axis will do; as many scans of the other one, the frame turned by 90°, show besides whether the fast \
         axis lags",
        if best.met {
            "recommended"
        } else {
            "nothing in the table will do; nearest to it"
        },
        raster.scans,
        raster.pixels[0],
        raster.pixels[1],
        two_digits_or_more(raster.line_rate_hz),
        best.duration_s() / 60.0
    );
    if !best.prediction.linked {
        text.push_str(
            "phases of the frames cannot be linked (no position sensors, pauses that are too long, or a drift that is \
             not known well enough): the drift comes from wave vectors alone\n",
        );
    }
}

/// Which wishes no number of scans fulfils, and what would.
fn limits(text: &mut String, best: &Plan, wishes: &Wishes) {
    let p = &best.prediction;
    let wanted = [
        (
            Quantity::Twist,
            "twist",
            wishes.twist_deg,
            1f64.to_degrees(),
            "°",
        ),
        (
            Quantity::Strain,
            "strain",
            wishes.strain_percent,
            100.0,
            " %",
        ),
    ];
    for (quantity, name, wish, unit, sign) in wanted {
        let Some(wish) = wish else { continue };
        if !beyond(p, quantity, wish / unit) {
            continue;
        }
        let floor = unit * p.sigma(quantity, |s| !s.is_statistical());
        let largest = Source::ALL
            .into_iter()
            .filter(|s| !s.is_statistical())
            .max_by(|a, b| {
                let of = |source: &Source| p.sigma(quantity, |s| s == *source);
                of(a).total_cmp(&of(b))
            })
            .unwrap_or(Source::Gain);
        let _ = writeln!(
            text,
            "out of reach: {name} ± {wish}{sign}. Calibration and model alone make ± {}{sign}, most of it {} (± {}{sign}), and \
             no scan of this sample makes that smaller; {}. The plan has the statistical error that is wanted",
            two_digits(floor),
            source(largest),
            two_digits(unit * p.sigma(quantity, |s| s == largest)),
            remedy(largest)
        );
    }
}

fn remedy(source: Source) -> &'static str {
    match source {
        Source::Gain | Source::Mismatch | Source::Orthogonality => {
            "`moiregauge calibrate` on a known lattice does"
        }
        Source::Pitch => "recording the position sensors does",
        Source::LatticeConstant => "a better known lattice constant does",
        Source::IsotropicStrain => "the orientation of one of the layers does",
        Source::PoissonRatio => "a better known Poisson ratio does",
        Source::StrainedLayer => "knowing which layer is strained does",
        Source::Image | Source::Drift | Source::Sensor => "more scans do",
    }
}
