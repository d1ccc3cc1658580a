//! What is wrong with the way of scanning, while there is still time to change it.

use moiregauge::campaign::{Analysis, ScanAnalysis, SetAnalysis};
use moiregauge::scan::MeasuredScan;
use moiregauge_report::{FailedInput, two_digits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spmfile::FrameDirection;

/// Sizes and line rates that differ by less than this share are the same: headers round them, as where scans are grouped.
const SAME: f64 = 0.01;
/// A lattice that stands out so much less than before is worth a word: noise and drift change it by some per cent, a tip
/// that changed by a factor.
const WEAKER: f64 = 0.5;
/// Frames before which nothing is known to be usual.
const USUAL: usize = 3;

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Warning {
    /// Stable code, as in `directions-do-not-alternate`.
    pub code: String,
    /// What it is and what to do.
    pub message: String,
    /// The file or the set that it concerns.
    #[serde(rename = "where")]
    pub place: String,
}

fn warning(code: &str, place: &str, message: String) -> Warning {
    Warning {
        code: code.to_owned(),
        message,
        place: place.to_owned(),
    }
}

/// What is wrong with a set, and with how its last frame follows the one before.
pub(super) fn of_set(
    analysis: &Analysis,
    set: &SetAnalysis,
    scans: &[&MeasuredScan],
) -> Vec<Warning> {
    let used: Vec<&ScanAnalysis> = set.scans.iter().filter(|s| s.excluded.is_none()).collect();
    let mut found: Vec<Warning> = Vec::new();
    found.extend(same_direction(&used));
    found.extend(changed(analysis, scans));
    found.extend(weaker(&used));
    for scan in used
        .iter()
        .filter(|s| s.residual.is_some_and(|r| r.outlying))
    {
        let apart = scan.residual.and_then(|r| r.displacement);
        let apart = apart.map_or_else(String::new, |d| {
            format!(
                "; its lattice lies {} nm from the predicted place",
                two_digits(d.norm())
            )
        });
        found.push(warning(
            "frame-out-of-line",
            &scan.file,
            format!(
                "the frame does not fit the others{apart}. Look for a jump, a tip change or another place, and take \
                 the frame again"
            ),
        ));
    }
    found.extend(moving(set));
    found
}

/// Files that are not whole yet.
pub(super) fn of_waiting(waiting: &[FailedInput]) -> impl Iterator<Item = Warning> + '_ {
    waiting
        .iter()
        .map(|file| warning("not-whole-yet", &file.file, file.error.clone()))
}

/// The last two frames went the same way.
fn same_direction(used: &[&ScanAnalysis]) -> Option<Warning> {
    let [.., before, last] = used else {
        return None;
    };
    let direction = last.frame_direction?;
    if before.frame_direction? != direction {
        return None;
    }
    let way = match direction {
        FrameDirection::Up => "up",
        FrameDirection::Down => "down",
    };
    let message = format!(
        "this frame and the one before it were both scanned {way}. Scan up and down in turn: this separates drift from \
         strain"
    );
    Some(warning("directions-do-not-alternate", &last.file, message))
}

/// The last frame of all is of another kind than the one before it.
fn changed(analysis: &Analysis, scans: &[&MeasuredScan]) -> Vec<Warning> {
    let mut all: Vec<(&ScanAnalysis, &SetAnalysis)> = Vec::new();
    for set in &analysis.sets {
        all.extend(set.scans.iter().map(|scan| (scan, set)));
    }
    // Those without a date come last, as where scans are grouped.
    all.sort_by_key(|(scan, _)| (scan.acquired.is_none(), scan.acquired));
    let [.., (before, old), (last, new)] = all.as_slice() else {
        return Vec::new();
    };
    if old.name == new.name {
        return Vec::new();
    }
    let mut found = Vec::new();
    let mut add = |code: &str, what: &str, from: &str, to: &str| {
        let message = format!(
            "{what} changed from {from} to {to}. A new set begins, and its frames are counted from one"
        );
        found.push(warning(code, &last.file, message));
    };
    if old.channel != new.channel {
        add("channel-changed", "the channel", &old.channel, &new.channel);
    }
    let measured = |scan: &ScanAnalysis| scans.iter().find(|m| m.file == scan.file);
    if let (Some(a), Some(b)) = (measured(before), measured(last)) {
        let same = |x: f64, y: f64| (x - y).abs() <= SAME * y.abs();
        if let (Some(x), Some(y)) = (a.size_nm, b.size_nm)
            && !(same(x[0], y[0]) && same(x[1], y[1]))
        {
            let words = |[w, h]: [f64; 2]| format!("{w:.1} nm × {h:.1} nm");
            add("size-changed", "the size", &words(x), &words(y));
        }
        let columns = |m: &MeasuredScan| m.lines.first().map(|line| line.frame_columns);
        if let (Some(x), Some(y)) = (columns(a), columns(b))
            && x != y
        {
            add(
                "pixels-changed",
                "the number of pixels in a line",
                &x.to_string(),
                &y.to_string(),
            );
        }
        if let (Some(x), Some(y)) = (a.line_rate_hz, b.line_rate_hz)
            && !same(x, y)
        {
            let words = |hz: f64| format!("{hz:.2} Hz");
            add("line-rate-changed", "the line rate", &words(x), &words(y));
        }
    }
    if old.slow_axis != new.slow_axis {
        let words = |set: &SetAnalysis| format!("{:?}", set.slow_axis).to_lowercase();
        add(
            "slow-axis-changed",
            "the slow axis",
            &words(old),
            &words(new),
        );
    }
    found
}

/// The lattice of the last frame stands out less than that of those before.
fn weaker(used: &[&ScanAnalysis]) -> Option<Warning> {
    let (last, before) = used.split_last()?;
    let strength = |scan: &ScanAnalysis| {
        let lines = scan.lines.iter().map(|line| line.signal_to_noise);
        lines.fold(f64::INFINITY, f64::min)
    };
    let mut usual: Vec<f64> = before.iter().map(|scan| strength(scan)).collect();
    if usual.len() < USUAL {
        return None;
    }
    usual.sort_by(f64::total_cmp);
    let (now, usual) = (strength(last), usual[usual.len() / 2]);
    (now < WEAKER * usual).then(|| {
        let message = format!(
            "the signal-to-noise ratio of the lattice is {}; the usual value of this set is {}. Look for a tip change, \
             or for a frame beside the moiré",
            two_digits(now),
            two_digits(usual)
        );
        warning("signal-weaker", &last.file, message)
    })
}

/// The drift is not constant.
fn moving(set: &SetAnalysis) -> Option<Warning> {
    let joint = set.drift.as_ref()?.joint.as_ref()?;
    if let Some(time) = joint.settling_s {
        let message = format!(
            "the drift settles with a time constant of {} min. Later frames are more accurate",
            two_digits(time / 60.0)
        );
        return Some(warning("drift-settles", &set.name, message));
    }
    let change = 3600.0 * joint.acceleration?.norm();
    let message = format!(
        "the drift changes by {} nm/min². The sample or the scanner has not settled",
        two_digits(change)
    );
    Some(warning("drift-not-constant", &set.name, message))
}
