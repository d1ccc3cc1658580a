//! Which terms a fit has: those that lower the Bayesian information criterion.

use crate::drift::joint::sighting::Terms;
use crate::drift::joint::solve::{JointFit, Problem, TestedTerm};

/// Settling times that are tried, as shares of the duration of the campaign: factors of two, between which curves
/// differ little.
const SETTLING: [f64; 5] = [0.05, 0.1, 0.2, 0.4, 0.8];
/// Errors of the lattice that grow by more than this say that a term is not determined. Chosen by eye; see
/// docs/constants.md.
const LOOSE: f64 = 3.0;
/// Fewer scans than this cannot tell an exponential from a parabola. Chosen by eye.
const FEWEST_SETTLING: usize = 6;

/// The fit with the terms that earn their place beside those of `best`.
pub(crate) fn terms(problem: &Problem, best: JointFit) -> JointFit {
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
            Some(fit) => (fit.clone(), criterion(&fit)),
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
            if self.lowest.is_finite() && loosens(&fit, &self.best) {
                continue;
            }
            let name = if terms.fast_gain {
                FAST_GAIN
            } else if terms.acceleration {
                ACCELERATION
            } else {
                EXPONENTIAL
            };
            let value = criterion(&fit);
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

/// Whether a fit knows the lattice much worse than a simpler one: its terms cannot be told from the lattice (two scans
/// do not tell a drift that changes), so that no χ² speaks for them.
pub(crate) fn loosens(fit: &JointFit, simpler: &JointFit) -> bool {
    let variance = |fit: &JointFit, i: usize| fit.unscaled.shared[(i, i)];
    (0..4).any(|i| variance(fit, i) > LOOSE * LOOSE * variance(simpler, i))
}

/// Bayesian information criterion, up to a constant: −2 ln L and ln n for each parameter. A settling time is a
/// parameter as well, and so is the scatter of positions, which lowers χ² at the cost of wider distributions: a
/// drift that changes must not pass for scatter.
pub(crate) fn criterion(fit: &JointFit) -> f64 {
    let n = (fit.degrees_of_freedom + fit.layout.size()) as f64;
    let settling = usize::from(fit.terms.settling.is_some());
    let scatter = usize::from(fit.instability_nm > 0.0);
    let parameters = fit.layout.count() + settling + scatter;
    fit.chi2 + fit.widening + parameters as f64 * n.ln()
}
