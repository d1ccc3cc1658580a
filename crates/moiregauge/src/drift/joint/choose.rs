//! Which terms a fit has: those that lower the Bayesian information criterion.

use nalgebra::{Matrix2, Vector2};

use crate::drift::joint::found::{JointFit, TestedTerm};
use crate::drift::joint::sighting::{Detection, Terms};
use crate::drift::joint::solve::Problem;

/// Settling times that are tried, as shares of the duration of the campaign: factors of two, between which curves
/// differ little.
const SETTLING: [f64; 5] = [0.05, 0.1, 0.2, 0.4, 0.8];
/// Fewer scans than this cannot tell an exponential from a parabola: twice as many as either has numbers.
const FEWEST_SETTLING: usize = 6;

/// Fits all sightings together and adds the terms that earn it by an information criterion.
///
/// The reciprocal `pair` (rad/nm) and the drift `velocity` (nm/s) are those of the linear solution, `time_sigma` is the standard uncertainty of a frame time, s. `None` where the sightings do not determine lattice
/// and drift.
pub fn fit(
    sightings: &[Detection],
    pair: &Matrix2<f64>,
    velocity: &Vector2<f64>,
    time_sigma: f64,
) -> Option<JointFit> {
    let (problem, mut best) = Problem::linked(sightings, pair, velocity, time_sigma)?;
    let plain = Terms::default();
    let (pair, velocity) = (best.waves.basis, best.velocity);
    if sightings.iter().any(|s| s.phases.is_some()) {
        // Over a long campaign a drift that changes can be linked only as what it is.
        let linked = [false, true].into_iter().find_map(|acceleration| {
            let terms = Terms {
                phases: true,
                acceleration,
                ..plain
            };
            let linked = problem.solve(terms, &pair, &velocity, None);
            linked.filter(|fit| !fit.loosens(&best))
        });
        best = linked.unwrap_or(best);
    }
    Some(with_terms(&problem, best))
}

/// The covariance that a fit with a constant drift has for sightings that are exactly what the model says:
/// nothing is chosen, nothing scatters. Otherwise as [`fit`].
pub(crate) fn foreseen(
    sightings: &[Detection],
    pair: &Matrix2<f64>,
    velocity: &Vector2<f64>,
    time_sigma: f64,
) -> Option<JointFit> {
    let (problem, plain) = Problem::linked(sightings, pair, velocity, time_sigma)?;
    let with_phases = Terms {
        phases: sightings.iter().any(|s| s.phases.is_some()),
        ..Terms::default()
    };
    Some(
        problem
            .solve(with_phases, pair, velocity, Some(0.0))
            .unwrap_or(plain),
    )
}

/// The fit with the terms that earn their place beside those of `best`.
fn with_terms(problem: &Problem, best: JointFit) -> JointFit {
    let sightings = &problem.sightings;
    let times = || sightings.iter().map(|s| s.time);
    let duration =
        times().fold(f64::NEG_INFINITY, f64::max) - times().fold(f64::INFINITY, f64::min);
    let scans = 1 + sightings.iter().map(|s| s.scan).max().unwrap_or(0);
    let base = Terms {
        acceleration: false,
        ..best.terms
    };
    let changing = [Terms {
        acceleration: true,
        ..base
    }]
    .into_iter()
    .chain(
        SETTLING
            .into_iter()
            .filter(|_| scans >= FEWEST_SETTLING)
            .map(|share| Terms {
                settling: Some(share * duration),
                ..base
            }),
    );
    let mut choice = Choice::new(problem, best, base);
    choice.offer(changing);
    let classes = sightings.iter().map(|s| s.class).max().unwrap_or(0);
    if classes > 1 {
        let gain = Terms {
            fast_gain: true,
            ..choice.best.terms
        };
        choice.offer([gain].into_iter());
    }
    let Choice { best, tested, .. } = choice;
    let has = |name| match name {
        ACCELERATION => best.terms.acceleration,
        EXPONENTIAL => best.terms.settling.is_some(),
        _ => best.terms.fast_gain,
    };
    let tested = tested
        .into_iter()
        .map(|(name, gain)| TestedTerm {
            name,
            gain,
            used: has(name),
        })
        .collect();
    JointFit { tested, ..best }
}

/// Names of the terms, as results have them: a change of the velocity, ...
const ACCELERATION: &str = "acceleration";
/// ... one that dies out, ...
const EXPONENTIAL: &str = "settling";
/// ... and a gain of the lines against the frame.
const FAST_GAIN: &str = "fast-axis gain";

/// Terms that are offered one after the other, each with the scatter of positions that it leaves.
struct Choice<'a> {
    problem: &'a Problem,
    best: JointFit,
    lowest: f64,
    tested: Vec<(&'static str, f64)>,
}

impl<'a> Choice<'a> {
    fn new(problem: &'a Problem, best: JointFit, base: Terms) -> Self {
        let plain = problem.solve(base, &best.waves.basis, &best.velocity, None);
        // Where only a changing drift can be linked there is nothing simpler to compare with.
        let (best, lowest) = match plain {
            Some(fit) => {
                let lowest = fit.criterion();
                (fit, lowest)
            }
            None => (best, f64::INFINITY),
        };
        Self {
            problem,
            best,
            lowest,
            tested: Vec::new(),
        }
    }

    fn offer(&mut self, candidates: impl Iterator<Item = Terms>) {
        let before = self.lowest;
        let (pair, velocity) = (self.best.waves.basis, self.best.velocity);
        for terms in candidates {
            let Some(fit) = self.problem.solve(terms, &pair, &velocity, None) else {
                continue;
            };
            if self.lowest.is_finite() && fit.loosens(&self.best) {
                continue;
            }
            let name = if terms.fast_gain {
                FAST_GAIN
            } else if terms.acceleration {
                ACCELERATION
            } else {
                EXPONENTIAL
            };
            let value = fit.criterion();
            let gain = if before.is_finite() {
                before - value
            } else {
                f64::NAN
            };
            match self.tested.iter_mut().find(|(known, _)| *known == name) {
                Some((_, best)) => *best = best.max(gain),
                None => self.tested.push((name, gain)),
            }
            if value < self.lowest {
                self.lowest = value;
                self.best = fit;
            }
        }
    }
}
