//! Gauss–Newton over all parameters, phases linked outwards from the middle of the campaign.

use std::sync::Arc;

use heterostrain::Estimate;
use heterostrain::lattice::Waves;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use crate::drift::joint::arrow::Arrow;
use crate::drift::joint::evaluate::{DRIFT, Layout, linearise, wrapped};
use crate::drift::joint::found::{JointFit, motion};
use crate::drift::joint::instability::Displacements;
use crate::drift::joint::link::number_blocks;
use crate::drift::joint::sighting::{Detection, Terms};
use crate::drift::joint::sums::ScanSums;
use crate::numbers::MOST_ROUNDS;
use crate::numbers::chi2::enlargement;
use crate::numbers::normal_equations::NormalEquations;
use crate::spectrum::phases::Phases;

/// The instability stands when it changes by less than this share: it is known to some ten per cent at best.
const STILL: f64 = 0.01;
/// Relative damping of the normal equations: any number between rounding and what changes an answer.
const DAMPING: f64 = 1e-10;
/// Phases are believed to be linked if they scatter by less than this share of a wavelength: less than a third of
/// that of phases at random (0.29).
const LINKED: f64 = 0.08;
/// A drift velocity worse than this (condition number of the scaled normal matrix, squared design) is not determined:
/// 100 squared, as in the linear fit.
const WORST_CONDITION: f64 = 1e4;

/// What is fitted.
pub(crate) struct Problem {
    /// All fits share them.
    pub(crate) sightings: Arc<[Detection]>,
    time_sigma: f64,
}

impl Problem {
    /// The problem with its scans in blocks whose phases can be linked, and the fit without phases that tells
    /// the blocks.
    pub(crate) fn linked(
        sightings: &[Detection],
        pair: &Matrix2<f64>,
        velocity: &Vector2<f64>,
        time_sigma: f64,
    ) -> Option<(Self, JointFit)> {
        let mut problem = Self {
            sightings: sightings.into(),
            // Exact times would make the weights infinite; a millisecond is exact enough.
            time_sigma: time_sigma.max(1e-3),
        };
        let plain = problem.solve(Terms::default(), pair, velocity, None)?;
        let speeds = plain.velocity_covariance.symmetric_eigenvalues();
        let sigma = speeds.max().sqrt();
        number_blocks(
            Arc::make_mut(&mut problem.sightings),
            &plain.waves.basis,
            sigma,
        );
        Some((problem, plain))
    }

    /// Solves for one choice of terms. Without a given instability it is estimated from the phases.
    pub(crate) fn solve(
        &self,
        terms: Terms,
        pair: &Matrix2<f64>,
        velocity: &Vector2<f64>,
        given: Option<f64>,
    ) -> Option<JointFit> {
        let sightings = &self.sightings;
        let layout = Layout::new(sightings, terms, self.time_sigma);
        let mut x = DVector::zeros(layout.size());
        x.rows_mut(0, 4).copy_from_slice(pair.as_slice());
        x.rows_mut(DRIFT, 2).copy_from_slice(velocity.as_slice());
        let (unscaled, instability) = converge(sightings, &layout, &mut x, given)?;
        let last = linearise(sightings, &layout, &x, f64::INFINITY);
        if terms.phases {
            // In units of a whole turn, which is a wavelength.
            let squares = last.phases.iter().map(|p| p.miss.norm_squared());
            let rms = (squares.sum::<f64>() / (3 * last.phases.len()) as f64).sqrt();
            if !(rms < LINKED * std::f64::consts::TAU) {
                return None;
            }
        }
        let scatter = instability * instability;
        let ScanSums { squares, rows, .. } = last.sums(&layout.shape, instability);
        let degrees_of_freedom = rows.saturating_sub(layout.size());
        let covariance = &unscaled.shared * enlargement(squares, degrees_of_freedom);
        let (velocity, velocity_covariance) = motion(&layout, &x, &covariance, layout.origin);
        Some(JointFit {
            waves: Waves::new(
                Matrix2::new(x[0], x[2], x[1], x[3]),
                covariance.fixed_view::<4, 4>(0, 0).into_owned(),
            ),
            velocity,
            velocity_covariance,
            acceleration: layout
                .acceleration_at()
                .map(|i| Vector2::new(x[i], x[i + 1])),
            fast_gain: layout
                .gain_at()
                .map(|i| Estimate::from_variance(x[i], covariance[(i, i)])),
            terms,
            instability_nm: instability,
            chi2: squares,
            degrees_of_freedom,
            widening: last.phases.iter().map(|p| p.widening(scatter)).sum(),
            tested: Vec::new(),
            sightings: Arc::clone(sightings),
            layout,
            solution: x,
            unscaled,
            covariance,
        })
    }
}

/// The covariance of the parameters at the best ones, and the instability: as `given`, or estimated from the phases.
fn converge(
    sightings: &[Detection],
    layout: &Layout,
    x: &mut DVector<f64>,
    given: Option<f64>,
) -> Option<(Arrow, f64)> {
    let mut instability = given.unwrap_or(0.0);
    if layout.terms.phases {
        start_phases(sightings, layout, x)?;
        link_outwards(sightings, layout, x, instability.max(0.02))?;
    }
    let mut unscaled = iterate(sightings, layout, x, f64::INFINITY, instability)?;
    if layout.terms.phases && given.is_none() {
        for _ in 0..MOST_ROUNDS {
            let before = instability;
            let now = linearise(sightings, layout, x, f64::INFINITY);
            let scatter = instability * instability;
            let seen = Displacements::new(&now.phases, &unscaled.locals(), scatter);
            instability = seen.scatter();
            unscaled = iterate(sightings, layout, x, f64::INFINITY, instability)?;
            if (instability - before).abs() <= STILL * instability {
                break;
            }
        }
    }
    Some((unscaled, instability))
}

/// Outwards from the middle of the campaign: each round predicts the next scans well enough to
/// unwrap them.
fn link_outwards(
    sightings: &[Detection],
    layout: &Layout,
    x: &mut DVector<f64>,
    instability: f64,
) -> Option<()> {
    let distances = || sightings.iter().map(|s| (s.time - layout.origin).abs());
    let farthest = distances().fold(0.0, f64::max);
    let mut reach = farthest / 16.0;
    while reach < farthest {
        iterate(sightings, layout, x, reach, instability)?;
        reach *= 1.5;
    }
    Some(())
}

/// φ of the harmonics of each block from its sighting of the lowest class nearest to the middle of the
/// campaign; then the offset of every other class, modulo the lattice, from its nearest sighting in a
/// block that another class has begun.
fn start_phases(sightings: &[Detection], layout: &Layout, x: &mut DVector<f64>) -> Option<()> {
    let first = layout.phases_of(0)?;
    let distance = |s: &&Detection| (s.time - layout.origin).abs();
    let with_phases = || sightings.iter().filter(|s| s.phases.is_some());
    let (k1, k2) = (Vector2::new(x[0], x[1]), Vector2::new(x[2], x[3]));
    let unexplained = |s: &Detection, x: &DVector<f64>| {
        let (shift, _) = layout.motion(x, s.time);
        let place = s.position - shift;
        let miss = |h: usize, k: Vector2<f64>, phases: &Phases| {
            wrapped(phases.values[h] - k.dot(&place) - x[first + 3 * s.block + h])
        };
        s.phases
            .map(|p| [miss(0, k1, &p), miss(1, k2, &p), miss(2, k2 - k1, &p)])
    };
    let blocks = 1 + sightings.iter().map(|s| s.block).max()?;
    let begun: Vec<Option<usize>> = (0..blocks)
        .map(|block| {
            let inside = || with_phases().filter(move |s| s.block == block);
            let class = inside().map(|s| s.class).min()?;
            let near = inside()
                .filter(|s| s.class == class)
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            for (h, phase) in unexplained(near, x)?.into_iter().enumerate() {
                x[first + 3 * block + h] = phase;
            }
            Some(class)
        })
        .collect();
    let from_phases = Matrix2::from_rows(&[k1.transpose(), k2.transpose()]).try_inverse()?;
    for class in 1.. {
        let Some(at) = layout.offset_of(class) else {
            break;
        };
        let near = with_phases()
            .filter(|s| s.class == class && begun[s.block] != Some(class))
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let Some(near) = near else { continue };
        let miss = unexplained(near, x)?;
        let offset = -from_phases * Vector2::new(miss[0], miss[1]);
        x[at] = offset.x;
        x[at + 1] = offset.y;
    }
    Some(())
}

/// Gauss–Newton to convergence; returns the covariance of the parameters.
fn iterate(
    sightings: &[Detection],
    layout: &Layout,
    x: &mut DVector<f64>,
    reach: f64,
    instability: f64,
) -> Option<Arrow> {
    let mut covariance = None;
    for _ in 0..MOST_ROUNDS {
        let now = linearise(sightings, layout, x, reach);
        let sums = now.sums(&layout.shape, instability);
        if !layout.terms.phases && !is_determined(&sums.shared()) {
            return None;
        }
        // Near the middle of the campaign offsets and phases may only be seen together; a little damping holds what
        // cannot be told apart and leaves the final solution where it is. Offsets of classes that have no phase within
        // reach are not seen yet at all: hold them.
        let held = |d: f64| if d == 0.0 { 1.0 } else { DAMPING * d };
        let inverse = Arrow::new(&sums, &sums.diagonal().map(held))?;
        let step = inverse.solve(&sums.right());
        *x += &step;
        let in_sigmas = step.zip_map(&inverse.variances(), |step, variance| {
            (step / variance.sqrt()).abs()
        });
        let size = in_sigmas.iter().copied().fold(0.0, f64::max);
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

/// Whether a normal matrix tells its parameters apart.
fn is_determined(normal: &DMatrix<f64>) -> bool {
    let scale = NormalEquations::units(normal);
    let (rows, columns) = normal.shape();
    let scaled = DMatrix::from_fn(rows, columns, |i, j| {
        // Parameters that nothing sees are held.
        let held = i == j && normal[(i, j)] == 0.0;
        if held {
            1.0
        } else {
            normal[(i, j)] * scale[i] * scale[j]
        }
    });
    let values = scaled.symmetric_eigenvalues();
    values.max() < WORST_CONDITION * values.min()
}
