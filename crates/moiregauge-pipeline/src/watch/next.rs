//! What more frames would bring, before they are made.

use moiregauge::campaign::SetAnalysis;
use moiregauge::plan::{Prediction, Quantity, predict};
use moiregauge::scan::MeasuredScan;
use moiregauge::settings::Settings;
use moiregauge::simulate::Simulation;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mean::{Mean, Number};
use super::until::Until;
use crate::validate::conditions_of;

/// Frames that are asked for at a time: one up, one down.
const PAIR: usize = 2;
/// A wish that takes more frames than that is not counted out.
const MOST: usize = 1000;
/// Frames beyond which errors fall with the root of their number: the ends of a long series no longer matter.
const LONG: usize = 40;

/// Errors after two more frames like those before, the slow axis up and down in turn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Next {
    /// Of the twist, degrees.
    pub twist_sigma_deg: Option<f64>,
    /// The same with calibration and model.
    pub twist_sigma_total_deg: Option<f64>,
    /// Of the heterostrain, per cent.
    pub strain_sigma_percent: Option<f64>,
    /// The same with calibration and model.
    pub strain_sigma_total_percent: Option<f64>,
}

/// How errors fall with the number of frames.
pub(super) struct Outlook {
    set: Simulation,
    settings: Settings,
    /// Frames now, and what these would tell.
    frames: usize,
    now: [f64; 2],
    numbers: Mean,
}

impl Outlook {
    /// For a set with these numbers, which may be those of several sets together. `None` where nothing can be foreseen: a
    /// drift that was given, methods without errors of this kind, files without times.
    pub(super) fn new(
        set: &SetAnalysis,
        scans: &[&MeasuredScan],
        frames: usize,
        numbers: Mean,
        settings: &Settings,
    ) -> Option<Self> {
        if !settings.method.is_joint() || settings.drift.is_some() || frames == 0 {
            return None;
        }
        let mut conditions = conditions_of(set, scans, settings).ok()?;
        // One frame, or several of one direction, tell no drift; a pair does.
        conditions.raster.alternating = true;
        let mut outlook = Self {
            set: conditions,
            settings: settings.clone(),
            frames,
            now: [f64::NAN; 2],
            numbers,
        };
        if numbers.twist_deg.value.is_some() {
            outlook.now = outlook.foreseen(frames)?;
        }
        Some(outlook)
    }

    fn predicted(&self, frames: usize) -> Option<Prediction> {
        let mut set = self.set.clone();
        set.raster.scans = frames;
        predict(&[set], &self.settings, 1)
    }

    /// Statistical errors of this number of frames, degrees and per cent.
    fn foreseen(&self, frames: usize) -> Option<[f64; 2]> {
        let found = self.predicted(frames.min(LONG))?;
        let fewer = (frames.min(LONG) as f64 / frames as f64).sqrt();
        Some([
            fewer * found.statistical(Quantity::Twist).to_degrees(),
            fewer * 100.0 * found.statistical(Quantity::Strain),
        ])
    }

    /// What two more frames would bring.
    pub(super) fn next(&self) -> Option<Next> {
        self.after(self.frames + PAIR)
    }

    /// The measured errors, less by as much as the foreseen ones; without measured ones those that are foreseen.
    fn after(&self, frames: usize) -> Option<Next> {
        let then = self.foreseen(frames)?;
        if self.numbers.twist_deg.value.is_none() {
            let all = self.predicted(frames.min(LONG))?;
            let total = |quantity: Quantity| all.sigma(quantity, |_| true);
            return Some(Next {
                twist_sigma_deg: known(then[0]),
                twist_sigma_total_deg: known(total(Quantity::Twist).to_degrees()),
                strain_sigma_percent: known(then[1]),
                strain_sigma_total_percent: known(100.0 * total(Quantity::Strain)),
            });
        }
        let [twist, strain] = [
            (self.numbers.twist_deg, then[0] / self.now[0]),
            (self.numbers.heterostrain_percent, then[1] / self.now[1]),
        ]
        .map(|(number, share)| shrunk(number, share));
        Some(Next {
            twist_sigma_deg: twist.sigma,
            twist_sigma_total_deg: twist.sigma_total,
            strain_sigma_percent: strain.sigma,
            strain_sigma_total_percent: strain.sigma_total,
        })
    }

    /// Further frames that reach the wanted error; `None` where no number does.
    pub(super) fn frames_needed(&self, wish: &Until) -> Option<usize> {
        let met = |more: usize| {
            let then = self.after(self.frames + more);
            then.is_some_and(|n| wish.is_met(n.twist_sigma_total_deg, n.strain_sigma_total_percent))
        };
        let (mut low, mut high) = (0, MOST / PAIR);
        if !met(PAIR * high) {
            return None;
        }
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            if met(PAIR * middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Some(PAIR * high)
    }
}

/// Whether what no frame changes is more than the wish.
pub(super) fn is_out_of_reach(wish: &Until, numbers: &Mean) -> bool {
    let beyond = |wish: Option<f64>, number: Number| {
        let floor = shrunk(number, 0.0).sigma_total;
        wish.zip(floor).is_some_and(|(wish, floor)| floor > wish)
    };
    beyond(wish.twist_deg, numbers.twist_deg)
        || beyond(wish.strain_percent, numbers.heterostrain_percent)
}

/// The statistical part of an error less by a factor; what calibration and model make stays.
fn shrunk(number: Number, share: f64) -> Number {
    let part = number.sigma.map(|sigma| sigma * share);
    let others = number.sigma_total.zip(number.sigma);
    let others = others.map(|(total, part)| (total * total - part * part).max(0.0));
    let total = others
        .zip(part)
        .map(|(others, part)| (others + part * part).sqrt());
    Number {
        value: number.value,
        sigma: part.and_then(known),
        sigma_total: total.and_then(known),
    }
}

fn known(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calibration_stays() {
        let number = Number {
            value: Some(1.0),
            sigma: Some(0.3),
            sigma_total: Some(0.5),
        };
        let half = shrunk(number, 0.5);
        assert_eq!(half.sigma, Some(0.15));
        assert!((half.sigma_total.unwrap() - (0.16f64 + 0.0225).sqrt()).abs() < 1e-12);
        let mean = Mean {
            twist_deg: number,
            ..Mean::default()
        };
        let wish = |twist| Until {
            twist_deg: Some(twist),
            strain_percent: None,
        };
        assert!(is_out_of_reach(&wish(0.39), &mean) && !is_out_of_reach(&wish(0.41), &mean));
    }
}
