//! Gauss–Newton over all parameters, phases linked outwards from the middle of the campaign, and the
//! choice of terms.

use nalgebra::{DMatrix, DVector, Matrix2, Matrix4, Vector2};

use super::evaluate::{DRIFT, Layout, linearise, wrapped};
use super::{Sighting, Terms};
use crate::estimate::Estimate;
use crate::lattice::LatticeVectors;

/// Gauss–Newton steps; the problem is nearly linear.
const STEPS: usize = 12;
/// Relative damping of the normal equations.
const DAMPING: f64 = 1e-10;
/// Phases are believed to be linked if they scatter by less than this share of a wavelength.
const LINKED: f64 = 0.08;
/// Settling times that are tried, as shares of the duration of the campaign.
const SETTLING: [f64; 5] = [0.05, 0.1, 0.2, 0.4, 0.8];
/// A drift velocity worse than this (condition number of the scaled normal matrix, squared design) is
/// not determined.
const WORST_CONDITION: f64 = 1e4;

/// The result of the fit over all scans.
#[derive(Clone, Debug)]
pub struct JointFit {
    /// Reciprocal pair free of drift, rad/nm.
    pub waves: LatticeVectors,
    /// Drift velocity in the middle of the campaign, nm/s, and its covariance.
    pub velocity: Vector2<f64>,
    /// Covariance of `velocity`, (nm/s)².
    pub velocity_covariance: Matrix2<f64>,
    /// Acceleration, nm/s², where it earned its place.
    pub acceleration: Option<Vector2<f64>>,
    /// Relative gain error of the fast axis with its uncertainty, where it earned its place.
    pub fast_gain: Option<Estimate>,
    /// The terms that the fit has.
    pub terms: Terms,
    /// Standard deviation of positions about the fit beyond the phase noise, nm.
    pub instability_nm: f64,
    /// Weighted sum of squared residuals and its degrees of freedom.
    pub chi2: f64,
    /// Degrees of freedom of `chi2`.
    pub degrees_of_freedom: usize,
    layout: Layout,
    solution: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl JointFit {
    /// Drift velocity at a time (same origin as the sightings), nm/s, with its covariance.
    pub fn velocity_at(&self, time: f64) -> (Vector2<f64>, Matrix2<f64>) {
        let (_, velocity) = self.layout.motion(&self.solution, time);
        let weights = self.layout.drift_weights(time);
        let mut covariance = Matrix2::zeros();
        for &(i, _, a) in &weights {
            for &(j, _, b) in &weights {
                covariance += a * b * self.covariance.fixed_view::<2, 2>(i, j);
            }
        }
        (velocity, covariance)
    }
}

/// Fits all sightings together and adds the terms that earn it by an information criterion.
///
/// `start` is the reciprocal pair (rad/nm) and the drift (nm/s) from the linear solution. `None` where
/// the sightings do not determine lattice and drift.
pub fn fit(sightings: &[Sighting], start: (&Matrix2<f64>, &Vector2<f64>)) -> Option<JointFit> {
    let plain = Terms::default();
    let mut best = solve(sightings, plain, start, None)?;
    let with_phases = Terms {
        phases: true,
        ..plain
    };
    let from = (&best.waves.basis.clone(), &best.velocity.clone());
    if sightings.iter().any(|s| s.phases.is_some())
        && let Some(linked) = solve(sightings, with_phases, from, None)
    {
        best = linked;
    }
    let times = || sightings.iter().map(|s| s.time);
    let duration =
        times().fold(f64::NEG_INFINITY, f64::max) - times().fold(f64::INFINITY, f64::min);
    let instability = Some(best.instability_nm);
    let mut candidates = vec![Terms {
        acceleration: true,
        ..best.terms
    }];
    candidates.extend(SETTLING.map(|share| Terms {
        settling: Some(share * duration),
        ..best.terms
    }));
    best = better(best, sightings, &candidates, instability);
    let classes = sightings.iter().map(|s| s.class).max().unwrap_or(0);
    if classes > 1 {
        let gain = Terms {
            fast_gain: true,
            ..best.terms
        };
        best = better(best, sightings, &[gain], instability);
    }
    // The scatter that is left with the chosen terms is the instability.
    let from = (&best.waves.basis.clone(), &best.velocity.clone());
    solve(sightings, best.terms, from, None).or(Some(best))
}

/// The best of `base` and the candidates by the Bayesian information criterion, for the same weights.
fn better(
    base: JointFit,
    sightings: &[Sighting],
    candidates: &[Terms],
    instability: Option<f64>,
) -> JointFit {
    let criterion = |fit: &JointFit| {
        let n = (fit.degrees_of_freedom + fit.layout.size) as f64;
        fit.chi2 + fit.layout.count() as f64 * n.ln()
    };
    let from = (&base.waves.basis.clone(), &base.velocity.clone());
    let mut best = base;
    // All are compared with the weights of the simplest fit.
    let Some(mut lowest) =
        solve(sightings, best.terms, from, instability).map(|fit| criterion(&fit))
    else {
        return best;
    };
    for &terms in candidates {
        if let Some(fit) = solve(sightings, terms, from, instability)
            && criterion(&fit) < lowest
        {
            lowest = criterion(&fit);
            best = fit;
        }
    }
    best
}

/// Solves for one choice of terms. Without a given instability it is estimated from the phases.
fn solve(
    sightings: &[Sighting],
    terms: Terms,
    start: (&Matrix2<f64>, &Vector2<f64>),
    given: Option<f64>,
) -> Option<JointFit> {
    let layout = Layout::new(sightings, terms);
    let mut x = DVector::zeros(layout.size);
    x.rows_mut(0, 4).copy_from_slice(start.0.as_slice());
    x.rows_mut(DRIFT, 2).copy_from_slice(start.1.as_slice());
    let farthest = sightings
        .iter()
        .map(|s| (s.time - layout.origin).abs())
        .fold(0.0, f64::max);
    let mut instability = given.unwrap_or(0.0);
    if terms.phases {
        start_phases(sightings, &layout, &mut x)?;
        // Outwards from the middle: each round predicts the next scans well enough to unwrap them.
        let mut reach = farthest / 16.0;
        while reach < farthest {
            iterate(sightings, &layout, &mut x, reach, instability.max(0.02))?;
            reach *= 1.5;
        }
    }
    let rounds = if terms.phases && given.is_none() {
        6
    } else {
        1
    };
    let mut covariance = DMatrix::zeros(layout.size, layout.size);
    for _ in 0..rounds {
        covariance = iterate(sightings, &layout, &mut x, f64::INFINITY, instability)?;
        if rounds > 1 {
            instability = estimated_instability(sightings, &layout, &x, instability);
        }
    }
    let last = linearise(sightings, &layout, &x, f64::INFINITY, instability);
    let wavelength = std::f64::consts::TAU / Vector2::new(x[0], x[1]).norm();
    if terms.phases {
        let misses = &last.phase_misses;
        let rms = (misses.iter().map(|m| m * m).sum::<f64>() / misses.len() as f64).sqrt();
        if !(rms < LINKED * wavelength) {
            return None;
        }
    }
    let chi2: f64 = last.residuals.iter().map(|r| r * r).sum();
    let degrees_of_freedom = last.residuals.len().saturating_sub(layout.size);
    let excess = (chi2 / degrees_of_freedom.max(1) as f64).max(1.0);
    covariance *= excess;
    let pair = Matrix2::new(x[0], x[2], x[1], x[3]);
    let (velocity_covariance, lattice_covariance): (Matrix2<f64>, Matrix4<f64>) = (
        covariance.fixed_view::<2, 2>(DRIFT, DRIFT).into_owned(),
        covariance.fixed_view::<4, 4>(0, 0).into_owned(),
    );
    Some(JointFit {
        waves: LatticeVectors {
            basis: pair,
            covariance: lattice_covariance,
        },
        velocity: Vector2::new(x[DRIFT], x[DRIFT + 1]),
        velocity_covariance,
        acceleration: layout
            .acceleration_at()
            .map(|i| Vector2::new(x[i], x[i + 1])),
        fast_gain: layout
            .gain_at()
            .map(|i| Estimate::from_variance(x[i], covariance[(i, i)])),
        terms,
        instability_nm: instability,
        chi2,
        degrees_of_freedom,
        layout,
        solution: x,
        covariance,
    })
}

/// φ of the harmonics from the sighting of the first class that is nearest to the middle of the
/// campaign; then the offset of every other class, modulo the lattice, from its nearest sighting.
fn start_phases(sightings: &[Sighting], layout: &Layout, x: &mut DVector<f64>) -> Option<()> {
    let first = layout.phases?;
    let distance = |s: &&Sighting| (s.time - layout.origin).abs();
    let nearest = |class: usize| {
        sightings
            .iter()
            .filter(|s| s.phases.is_some() && s.class == class)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    let (k1, k2) = (Vector2::new(x[0], x[1]), Vector2::new(x[2], x[3]));
    let unexplained = |s: &Sighting, x: &DVector<f64>| {
        let (shift, _) = layout.motion(x, s.time);
        let place = s.position - shift;
        let miss = |h: usize, k: Vector2<f64>, phases: &[Estimate; 3]| {
            wrapped(phases[h].value - k.dot(&place) - x[first + h])
        };
        s.phases
            .map(|p| [miss(0, k1, &p), miss(1, k2, &p), miss(2, k2 - k1, &p)])
    };
    let phases = unexplained(nearest(0)?, x)?;
    for (h, phase) in phases.into_iter().enumerate() {
        x[first + h] = phase;
    }
    let from_phases = Matrix2::from_rows(&[k1.transpose(), k2.transpose()]).try_inverse()?;
    for class in 1.. {
        let Some(at) = layout.offset_of(class) else {
            break;
        };
        let Some(near) = nearest(class) else { continue };
        let miss = unexplained(near, x)?;
        let offset = -from_phases * Vector2::new(miss[0], miss[1]);
        x[at] = offset.x;
        x[at + 1] = offset.y;
    }
    Some(())
}

/// Gauss–Newton to convergence; returns the covariance of the parameters.
fn iterate(
    sightings: &[Sighting],
    layout: &Layout,
    x: &mut DVector<f64>,
    reach: f64,
    instability: f64,
) -> Option<DMatrix<f64>> {
    let mut covariance = None;
    for _ in 0..STEPS {
        let now = linearise(sightings, layout, x, reach, instability);
        let n = layout.size;
        let mut normal = DMatrix::<f64>::zeros(n, n);
        let mut right = DVector::<f64>::zeros(n);
        for (residual, row) in now.residuals.iter().zip(&now.jacobian) {
            normal.ger(1.0, row, row, 1.0);
            right.axpy(*residual, row, 1.0);
        }
        // Offsets of classes that have no phase within reach are not seen yet: hold them.
        for i in 0..n {
            if normal[(i, i)] == 0.0 {
                normal[(i, i)] = 1.0;
            }
        }
        let scale = normal.diagonal().map(|d| 1.0 / d.sqrt());
        let mut scaled = DMatrix::from_fn(n, n, |i, j| normal[(i, j)] * scale[i] * scale[j]);
        if layout.phases.is_none() {
            let values = scaled.symmetric_eigenvalues();
            if !(values.max() < WORST_CONDITION * values.min()) {
                return None;
            }
        }
        // Near the middle of the campaign offsets and phases may only be seen together; a little
        // damping holds what cannot be told apart and leaves the final solution where it is.
        for i in 0..n {
            scaled[(i, i)] += DAMPING;
        }
        let inverse = scaled.cholesky()?.inverse();
        let inverse = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
        let step = &inverse * &right;
        *x += &step;
        let size = (0..n)
            .map(|i| (step[i] / inverse[(i, i)].sqrt()).abs())
            .fold(0.0, f64::max);
        covariance = Some(inverse);
        if !size.is_finite() {
            return None;
        }
        if size < 1e-4 {
            break;
        }
    }
    covariance
}

/// The position scatter that makes the phases fit: χ² of the phases becomes their number.
fn estimated_instability(
    sightings: &[Sighting],
    layout: &Layout,
    x: &DVector<f64>,
    current: f64,
) -> f64 {
    let now = linearise(sightings, layout, x, f64::INFINITY, current);
    // Phase rows stand behind four rows of waves in each sighting, before the priors of the times.
    let count = now.phase_misses.len() as f64;
    let used = layout.size as f64 - layout.count() as f64 + 2.0;
    let freedom = (count - used).max(1.0);
    let squares: f64 = now.phase_misses.iter().map(|m| m * m).sum();
    let noise: f64 = sightings
        .iter()
        .filter_map(|s| s.phases)
        .flatten()
        .map(|p| (p.sigma / Vector2::new(x[0], x[1]).norm()).powi(2))
        .sum();
    ((squares / freedom) - noise / count).max(0.0).sqrt()
}
