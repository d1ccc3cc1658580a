//! An analysis in the few lines that fit on a screen.
//!
//! `value ± total`: calibration, lattice constant and model are in it. What noise, drift and sensors make of
//! that stands behind it as the statistical part.

use std::fmt::Write as _;

use heterostrain::lattice::Lattice;
use heterostrain::strain::{StrainTensor, TwistStrain};
use heterostrain::{Estimate, TotalEstimate};
use moiregauge::campaign::{
    Analysis, Combined, Drift, Ruled, ScanAnalysis, SetAnalysis, SetLattice, SetMean,
};
use moiregauge::caveat::ChosenBy;
use moiregauge::meaning::Budget;
use moiregauge::meaning::{NameReading, Naming, Readings};
use moiregauge::settings::Settings;
use spmfile::FrameDirection;

use crate::draw::scale::fixed;
use crate::format::{plus_minus, two_digits, with_statistical};
use crate::html::layers;
use crate::input::FailedInput;
use crate::results::ResultCaveat;

/// The option that helps against a doubt, by its code.
pub type Hint = fn(&str) -> Option<&'static str>;

/// Per set and combined: drift, twist, strain; then what to keep in mind.
pub fn summary(analysis: &Analysis, hint: Hint) -> String {
    let mut text = format!("Layers: {}\n", layers(&analysis.settings));
    for set in &analysis.sets {
        set_summary(&mut text, set, &analysis.settings);
    }
    if let Some(combined) = analysis
        .combined
        .as_ref()
        .filter(|_| analysis.sets.len() > 1)
    {
        combined_summary(&mut text, combined);
    }
    caveats(&mut text, analysis.caveats.iter().map(Into::into), hint);
    text
}

fn set_summary(text: &mut String, set: &SetAnalysis, settings: &Settings) {
    let used = || set.scans.iter().filter(|s| s.excluded.is_none());
    let (count, others) = (used().count(), set.scans.len() - used().count());
    let _ = writeln!(
        text,
        "{}: {}, {count} scan{} ({}){}",
        set.name,
        set.channel,
        if count == 1 { "" } else { "s" },
        directions(&used().collect::<Vec<_>>()),
        match others {
            0 => String::new(),
            n => format!(", {n} more not used"),
        }
    );
    let ruled = set.ruler.as_ref().is_some_and(|ruler| ruler.used);
    if let Some(drift) = &set.drift {
        drift_line(text, drift, settings);
    } else if !ruled {
        let alone = || set.lattice.as_ref()?.assumed;
        let assumed = set.mean.as_ref().map_or_else(alone, |mean| mean.assumed);
        let words = assumed.map_or_else(String::new, |drift| {
            format!("; assumed: 0 ± {} nm/min", two_digits(60.0 * drift.sigma))
        });
        let _ = writeln!(text, "  drift         not determined{words}");
    }
    match (&set.mean, &set.uncorrected) {
        (Some(mean), _) => {
            if let Some(ruler) = &set.ruler {
                ruler_lines(text, ruler, set.by_scanner.as_ref());
            }
            set_mean(text, mean);
        }
        (None, Some(mean)) => {
            text.push_str(
                "  not corrected for drift; the errors do not include the effect of the drift:\n",
            );
            set_mean(text, mean);
        }
        (None, None) => {
            if let Some(found) = &set.lattice {
                lattice_alone(text, found);
            } else {
                for scan in used() {
                    let lattice = scan.drift_corrected.as_ref().unwrap_or(&scan.sensor);
                    let lengths = [0, 1, 2].map(|i| plus_minus(lattice.wavelength(i)));
                    let words = format!("{} nm in {}", lengths.join(", "), scan.file);
                    lattice_line(text, lattice, &words);
                }
                text.push_str("  no result for all scans together\n");
            }
        }
    }
    text.push('\n');
}

/// The scanner by the atoms of a layer, and the twist without them.
fn ruler_lines(text: &mut String, ruler: &Ruled, by_scanner: Option<&SetMean>) {
    let off = Estimate::new(
        100.0 * (ruler.fast_gain.value - 1.0),
        100.0 * ruler.fast_gain.sigma,
    );
    let _ = writeln!(
        text,
        "  ruler         atoms of layer {}{}; lengths along the fast axis of the scanner are off by {} %",
        ruler.layer,
        if ruler.used { "" } else { ", not used" },
        plus_minus(off)
    );
    if let Some(drift) = ruler.drift.filter(|_| ruler.used) {
        let [x, y] = drift.map(|part| plus_minus(part.scaled(60.0)));
        let _ = writeln!(
            text,
            "                drift in these frames x {x}, y {y} nm/min, if both axes have this gain and a right angle"
        );
    }
    if let Some(found) = ruler.calibration {
        let [gain, mismatch, orthogonality] = found.map(plus_minus);
        let _ = writeln!(
            text,
            "                at the drift of the set, lengths off by {gain} %, x against y by {mismatch} %, axes by \
             {orthogonality} mrad"
        );
    }
    if let Some(alone) = by_scanner {
        let twist = alone.twist().scaled(1f64.to_degrees());
        let _ = writeln!(
            text,
            "                the scanner alone: twist {}",
            with_statistical(twist, "°")
        );
    }
}

fn drift_line(text: &mut String, drift: &Drift, settings: &Settings) {
    let [x, y] = drift
        .velocities(settings)
        .map(|v| with_statistical(v.scaled(60.0), " nm/min"));
    let given = if drift.given { " (given)" } else { "" };
    let _ = writeln!(text, "  drift         x {x}, y {y}{given}");
}

fn set_mean(text: &mut String, mean: &SetMean) {
    let lengths = [0, 1, 2].map(|i| {
        let variance = mean.budget.known().wavelengths[i];
        TotalEstimate::new(mean.lattice.wavelength(i), variance)
    });
    lattice_line(text, &mean.lattice, &in_all(&lengths));
    twist_strain(text, &mean.twist_strain, &mean.budget, &mean.readings);
    readings(text, &mean.readings);
}

/// Lengths with their totals, in words.
fn in_all(lengths: &[TotalEstimate; 3]) -> String {
    let totals = lengths.map(|l| plus_minus(l.total())).join(", ");
    let parts = lengths.map(|l| two_digits(l.statistical)).join(", ");
    format!("{totals} nm (statistical ± {parts} nm)")
}

/// A lattice without twist and strain, and how the scans scatter about it.
fn lattice_alone(text: &mut String, found: &SetLattice) {
    lattice_line(text, &found.lattice, &in_all(&found.wavelengths));
    if found.scatter.iter().all(|s| s.is_finite()) {
        let scatter = found.scatter.map(two_digits).join(", ");
        let _ = writeln!(text, "  scatter       {scatter} nm over the scans");
    }
    text.push_str("  no twist and strain explain this lattice\n");
}

/// How many scans went up, how many down.
fn directions(scans: &[&ScanAnalysis]) -> String {
    let count = |direction: Option<FrameDirection>| {
        let scans = scans.iter();
        scans.filter(|s| s.frame_direction == direction).count()
    };
    let known = format!(
        "{} up, {} down",
        count(Some(FrameDirection::Up)),
        count(Some(FrameDirection::Down))
    );
    match count(None) {
        0 => known,
        all if all == scans.len() => "direction unknown".to_owned(),
        unknown => format!("{known}, {unknown} unknown"),
    }
}

/// Lengths, in words, and directions of the three vectors.
fn lattice_line(text: &mut String, lattice: &Lattice, lengths: &str) {
    let angles = [0, 1, 2].map(|i| fixed(lattice.polar_angle(i).value.to_degrees(), 1));
    let _ = writeln!(
        text,
        "  lattice       {lengths} at {}° to x",
        angles.join(", ")
    );
}

/// Twist and strain with everything in the budget that is known, and the statistical part.
fn twist_strain(text: &mut String, found: &TwistStrain, budget: &Budget, readings: &Readings) {
    let twist = TotalEstimate::new(found.twist(), budget.known().covariance[(0, 0)]);
    let _ = writeln!(
        text,
        "  twist         {}{}{}",
        with_statistical(twist.scaled(1f64.to_degrees()), "°"),
        if budget.drift_known() {
            ""
        } else {
            ", without drift"
        },
        if budget.ruler.is_some() {
            ""
        } else if readings.tensor.is_some() {
            ", without isotropic strain"
        } else if readings.layers_differ {
            ", one solution of several"
        } else {
            ""
        }
    );
    heterostrain(text, found, budget);
}

fn heterostrain(text: &mut String, found: &TwistStrain, budget: &Budget) {
    let degree = 1f64.to_degrees();
    let (known, all) = (budget.known(), budget.applied_to(found));
    let below = |e: &TwistStrain| format!("{:.4} %", 100.0 * e.strain().upper_limit_95());
    let magnitude = TotalEstimate::new(found.heterostrain(), known.magnitude).scaled(100.0);
    match found.axis_lab() {
        Some(axis) if all.axis_lab().is_some() => {
            let axis = TotalEstimate::new(axis, known.axis_lab).scaled(degree);
            let _ = writeln!(
                text,
                "  heterostrain  {}, axis {} to x",
                with_statistical(magnitude, " %"),
                with_statistical(axis, "°")
            );
        }
        Some(axis) => {
            let _ = writeln!(
                text,
                "  heterostrain  below {} (95 %), not significant; the image shows {} % along {}° to x (statistical \
                 errors), which the calibration error alone can explain",
                below(&all),
                plus_minus(magnitude.statistical()),
                plus_minus(axis.scaled(degree))
            );
        }
        None => {
            let _ = writeln!(
                text,
                "  heterostrain  below {} (95 %; by the statistical part below {}), not significant",
                below(&all),
                below(found)
            );
        }
    }
    let parts = [0, 1].map(|i| {
        let part = found.strain().covariance[(i, i)];
        let total = known.covariance[(i + 2, i + 2)];
        let part = Estimate::from_variance(found.strain_vector[i], part);
        TotalEstimate::new(part, total).scaled(100.0)
    });
    let percent = |[low, high]: [f64; 2]| format!("{:.4} to {:.4} %", 100.0 * low, 100.0 * high);
    let _ = writeln!(
        text,
        "                vector ({}, {}) % (statistical ± {}, {} %); 95 %: {} (statistical {})",
        plus_minus(parts[0].total()),
        plus_minus(parts[1].total()),
        two_digits(parts[0].statistical),
        two_digits(parts[1].statistical),
        percent(all.strain().interval_95()),
        percent(found.strain().interval_95())
    );
}

/// A strain tensor with the errors of the scans and those of all.
fn strain_tensor(
    text: &mut String,
    word: &str,
    found: &StrainTensor,
    all: &StrainTensor,
    poisson_ratio: f64,
) {
    let degrees = |e: Estimate| plus_minus(e.scaled(1f64.to_degrees()));
    let percent = |e: Estimate| plus_minus(e.scaled(100.0));
    let both = |part: Estimate, all: Estimate, factor: f64, unit: &str| {
        let found = TotalEstimate::new(part, all.sigma * all.sigma);
        with_statistical(found.scaled(factor), unit)
    };
    let _ = writeln!(
        text,
        "    {word}twist       {}\n    mean strain {}, shear part {}{}",
        both(found.twist(), all.twist(), 1f64.to_degrees(), "°"),
        both(found.mean(), all.mean(), 100.0, " %"),
        both(found.shear(), all.shear(), 100.0, " %"),
        all.axis_lab()
            .map_or_else(String::new, |a| format!(", axis {}°", degrees(a)))
    );
    for (word, split) in ["= uniaxial", "or"].iter().zip(all.splits(poisson_ratio)) {
        let _ = writeln!(
            text,
            "    {word:11} {} %{} and biaxial {} %",
            percent(split.uniaxial),
            split
                .axis_lab
                .map_or_else(String::new, |a| format!(" along {}°", degrees(a))),
            percent(split.biaxial)
        );
    }
}

/// What else the lattice can mean: all solutions of different layers, or the strain tensor.
fn readings(text: &mut String, readings: &Readings) {
    let degrees = |e: Estimate| plus_minus(e.scaled(1f64.to_degrees()));
    let percent = |e: Estimate| plus_minus(e.scaled(100.0));
    if let Some(naming) = &readings.naming {
        names(text, naming);
    }
    if let Some(tensor) = &readings.tensor {
        let ratio = tensor.poisson_ratio;
        match &tensor.opposite {
            None => {
                text.push_str("  with the orientation of a layer:\n");
                strain_tensor(text, "", &tensor.best, &tensor.in_all(), ratio);
            }
            Some(opposite) => {
                text.push_str(
                    "  with the orientation of a layer; the sense of the twist is open, and both solutions fit equally \
                     well:\n",
                );
                strain_tensor(text, "either ", &tensor.best, &tensor.in_all(), ratio);
                strain_tensor(text, "or     ", &opposite.found, &opposite.in_all(), ratio);
                if let Some([low, high]) = tensor.magnitudes() {
                    let ends = [low, high].map(|end| fixed(end.to_degrees(), 4));
                    let _ = writeln!(
                        text,
                        "    magnitudes from {}° to {}° are open (95 %)",
                        ends[0], ends[1]
                    );
                }
            }
        }
        let others = tensor.alternatives.iter().map(|other| &other.found);
        for other in others.filter(|_| readings.layers_differ) {
            let _ = writeln!(
                text,
                "    the same orientation by symmetry: twist {}°, mean strain {} % (statistical errors)",
                degrees(other.twist()),
                percent(other.mean())
            );
        }
        return;
    }
    if !readings.layers_differ {
        return;
    }
    text.push_str("  the layers differ: these pairs of twist and strain fit equally well (statistical errors):\n");
    for (index, branch) in readings.choices().enumerate() {
        let _ = writeln!(
            text,
            "  {} twist {}°, strain {} % along {:.2}°",
            if index == 0 {
                "either       "
            } else {
                "or           "
            },
            degrees(Estimate::new(branch.twist, branch.twist_sigma)),
            percent(Estimate::new(branch.strain, branch.strain_sigma)),
            branch.axis_lab.to_degrees()
        );
    }
}

/// What chose the pair of waves that is read, and the pairs that may be right as well.
fn names(text: &mut String, naming: &Naming) {
    let words = |n: &NameReading| {
        format!(
            "twist {}° with {} % of strain",
            fixed(n.twist.to_degrees(), 4),
            fixed(100.0 * n.strain, 3)
        )
    };
    let by = match naming.chosen_by {
        ChosenBy::LeastStrain => None,
        ChosenBy::Image => {
            Some("the image: every other plausible pair has a wave that is too weak")
        }
        ChosenBy::Orientation => Some("the orientation of a layer"),
        ChosenBy::User => Some("the user"),
    };
    if let Some(by) = by {
        let _ = writeln!(text, "  pair of waves chosen by {by}");
    }
    for other in naming.open() {
        let _ = writeln!(text, "  or, by another pair of waves, {}", words(other));
    }
}

fn combined_summary(text: &mut String, combined: &Combined) {
    text.push_str("all sets together\n");
    twist_strain(
        text,
        &combined.twist_strain,
        &combined.budget,
        &combined.readings,
    );
    readings(text, &combined.readings);
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

/// One line for each caveat, in order of their codes; after the last of a code the option that helps.
pub fn caveats(text: &mut String, all: impl IntoIterator<Item = ResultCaveat>, hint: Hint) {
    let mut all: Vec<ResultCaveat> = all.into_iter().collect();
    all.sort_by(|a, b| a.code.cmp(&b.code));
    for same in all.chunk_by(|a, b| a.code == b.code) {
        for ResultCaveat {
            code,
            message,
            place,
            ..
        } in same
        {
            let _ = writeln!(text, "caveat {code} ({place}): {message}");
        }
        if let Some(option) = hint(&same[0].code) {
            let _ = writeln!(text, "  try {option}");
        }
    }
}

/// The table of what failed and why; empty if nothing did.
pub fn failures(failed: &[FailedInput]) -> String {
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
