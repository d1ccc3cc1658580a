//! The model of a sighting and its derivatives.

use nalgebra::{
    DMatrix, DVector, Matrix2, Matrix3, Matrix3x2, Matrix4, SMatrix, SVector, Vector2, Vector3,
};

use crate::drift::joint::path::{DriftPath, Settling};
use crate::drift::joint::sighting::{Sighting, Terms};
use crate::numbers::interrupt;

/// Where each parameter stands in the vector.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) terms: Terms,
    /// Origin of time: the middle of the campaign.
    pub(crate) origin: f64,
    /// Start of the first frame: where settling begins.
    pub(crate) start: f64,
    /// Standard uncertainty of the frame times, s.
    pub(crate) time_sigma: f64,
    acceleration: Option<usize>,
    settling: Option<usize>,
    gain: Option<usize>,
    /// φ of the three harmonics, for every block.
    pub(crate) phases: Option<usize>,
    /// Offsets of the classes after the first.
    offsets: Option<usize>,
    /// Errors of the frame times.
    times: Option<usize>,
    pub(crate) size: usize,
}

/// Lattice 0..4 (K₁, K₂), drift 4..6, then what the terms add.
pub(crate) const DRIFT: usize = 4;

impl Layout {
    pub(crate) fn new(sightings: &[Sighting], terms: Terms, time_sigma: f64) -> Self {
        let mut size = 6;
        let mut take = |wanted: bool, n: usize| {
            wanted.then(|| {
                size += n;
                size - n
            })
        };
        let classes = 1 + sightings.iter().map(|s| s.class).max().unwrap_or(0);
        let blocks = 1 + sightings.iter().map(|s| s.block).max().unwrap_or(0);
        let scans = 1 + sightings.iter().map(|s| s.scan).max().unwrap_or(0);
        let acceleration = take(terms.acceleration, 2);
        let settling = take(terms.settling.is_some(), 2);
        let gain = take(terms.fast_gain, 1);
        let phases = take(terms.phases, 3 * blocks);
        let offsets = take(terms.phases, 2 * (classes - 1));
        let times = take(terms.phases, scans);
        let times_of = || sightings.iter().map(|s| s.time);
        let first = times_of().fold(f64::INFINITY, f64::min);
        let last = times_of().fold(f64::NEG_INFINITY, f64::max);
        Self {
            terms,
            origin: f64::midpoint(first, last),
            start: first,
            time_sigma,
            acceleration,
            settling,
            gain,
            phases,
            offsets,
            times,
            size,
        }
    }

    /// The parameters that are results; the others are nuisance for phases.
    pub(crate) fn count(&self) -> usize {
        self.phases.unwrap_or(self.size)
    }

    /// Where the offset of a class stands; `None` for the first class and beyond the last.
    pub(crate) fn offset_of(&self, class: usize) -> Option<usize> {
        let at = self.offsets? + 2 * class.checked_sub(1)?;
        (at < self.times?).then_some(at)
    }

    /// Where the errors of the frame times start.
    pub(crate) fn times_at(&self) -> Option<usize> {
        self.times
    }

    pub(crate) fn acceleration_at(&self) -> Option<usize> {
        self.acceleration
    }

    pub(crate) fn gain_at(&self) -> Option<usize> {
        self.gain
    }

    /// How much each drift parameter moves the sample at a time, and its velocity: pairs of
    /// (parameter index of the x component, weight in d, weight in d').
    pub(crate) fn drift_weights(&self, time: f64) -> Vec<(usize, f64, f64)> {
        let t = time - self.origin;
        let mut weights = vec![(DRIFT, t, 1.0)];
        if let Some(i) = self.acceleration {
            weights.push((i, 0.5 * t * t, t));
        }
        if let (Some(i), Some(tau)) = (self.settling, self.terms.settling) {
            let decay = (-(time - self.start) / tau).exp();
            let at_origin = (-(self.origin - self.start) / tau).exp();
            weights.push((i, at_origin - decay, decay / tau));
        }
        weights
    }

    /// The way of the sample.
    pub(crate) fn path(&self, x: &DVector<f64>) -> DriftPath {
        let two = |i: usize| Vector2::new(x[i], x[i + 1]);
        let settling = self.settling.zip(self.terms.settling);
        // The origin is the middle of the first and the last frame.
        let last = 2.0 * self.origin - self.start;
        DriftPath::steady(two(DRIFT), self.origin).with_terms(
            self.acceleration.map_or_else(Vector2::zeros, two),
            settling.map(|(i, time)| Settling {
                amount: two(i),
                start: self.start,
                time,
            }),
            [self.start, last],
        )
    }

    /// Displacement and velocity of the sample at a time.
    pub(crate) fn motion(&self, x: &DVector<f64>, time: f64) -> (Vector2<f64>, Vector2<f64>) {
        let (mut d, mut v) = (Vector2::zeros(), Vector2::zeros());
        for (i, shift, speed) in self.drift_weights(time) {
            let p = Vector2::new(x[i], x[i + 1]);
            d += p * shift;
            v += p * speed;
        }
        (d, v)
    }
}

/// The three harmonics as combinations of K₁ and K₂.
const HARMONICS: [(f64, f64); 3] = [(1.0, 0.0), (0.0, 1.0), (-1.0, 1.0)];

/// Whitened residuals (measured − model) and their derivatives with respect to the parameters.
pub(crate) struct Linearised {
    pub(crate) residuals: Vec<f64>,
    pub(crate) jacobian: Vec<DVector<f64>>,
    /// The scan to which each residual belongs.
    pub(crate) scans: Vec<usize>,
    /// The phases, which have three rows each.
    pub(crate) phases: Vec<PhaseMiss>,
}

impl Linearised {
    /// Adds residuals of a scan and their derivatives, whitened by the Cholesky factor of their covariance; `None` where
    /// that has none.
    fn push<const N: usize>(
        &mut self,
        scan: usize,
        lower: &SMatrix<f64, N, N>,
        residuals: &SVector<f64, N>,
        rows: &DMatrix<f64>,
    ) -> Option<()> {
        let residuals = lower.solve_lower_triangular(residuals)?;
        let rows = lower.solve_lower_triangular(rows)?;
        for i in 0..N {
            self.residuals.push(residuals[i]);
            self.jacobian.push(rows.row(i).transpose());
            self.scans.push(scan);
        }
        Some(())
    }
}

/// The phases of one sighting against the model.
pub(crate) struct PhaseMiss {
    /// The first of its three rows.
    pub(crate) row: usize,
    /// Measured − model, rad.
    pub(crate) miss: Vector3<f64>,
    /// Covariance of what noise does to the measured ones, rad².
    pub(crate) noise: Matrix3<f64>,
    /// The three wave vectors as rows, rad/nm: what a displacement does.
    pub(crate) waves: Matrix3x2<f64>,
}

impl PhaseMiss {
    /// The Cholesky factor that whitens the phases where positions have the variance `scatter`, nm².
    pub(crate) fn factor(&self, scatter: f64) -> Option<Matrix3<f64>> {
        let shaken = self.waves * self.waves.transpose() * scatter;
        Some((self.noise + shaken).cholesky()?.l())
    }

    /// By how much `scatter` raises the logarithm of the determinant of their covariance.
    pub(crate) fn widening(&self, scatter: f64) -> f64 {
        let logarithm = |variance| {
            let diagonal = self.factor(variance)?.diagonal();
            Some(2.0 * diagonal.iter().map(|d| d.ln()).sum::<f64>())
        };
        logarithm(scatter)
            .zip(logarithm(0.0))
            .map_or(0.0, |(wide, narrow)| wide - narrow)
    }

    /// The displacement that explains the phases best, nm, and the covariance that noise gives it, nm².
    pub(crate) fn displacement(&self) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let lower = self.factor(0.0)?;
        let design = lower.solve_lower_triangular(&self.waves)?;
        let miss = lower.solve_lower_triangular(&self.miss)?;
        let covariance = (design.transpose() * design).try_inverse()?;
        Some((covariance * design.transpose() * miss, covariance))
    }
}

/// Evaluates the model at `x` for the sightings within `reach` of the origin of time (phases beyond
/// it may be off by a whole turn and are left out). `instability` is the standard deviation of a
/// position, nm.
pub(crate) fn linearise(
    sightings: &[Sighting],
    layout: &Layout,
    x: &DVector<f64>,
    reach: f64,
    instability: f64,
) -> Linearised {
    interrupt::check();
    let mut out = Linearised {
        residuals: Vec::new(),
        jacobian: Vec::new(),
        scans: Vec::new(),
        phases: Vec::new(),
    };
    for sighting in sightings {
        waves(sighting, layout, x, &mut out);
        if (sighting.time - layout.origin).abs() <= reach {
            phases(sighting, layout, x, instability, &mut out);
        }
    }
    if let Some(first) = layout.times {
        for i in first..layout.size {
            let mut row = DVector::zeros(layout.size);
            row[i] = 1.0 / layout.time_sigma;
            out.residuals.push(-x[i] / layout.time_sigma);
            out.jacobian.push(row);
            out.scans.push(i - first);
        }
    }
    out
}

/// `K = (1 + g F)(G − u (D·G))`, two vectors.
fn waves(sighting: &Sighting, layout: &Layout, x: &DVector<f64>, out: &mut Linearised) {
    let u = &sighting.time_gradient;
    let (_, velocity) = layout.motion(x, sighting.time);
    let gain = layout.gain.map_or(0.0, |i| x[i]);
    let stretch = Matrix2::identity() + gain * sighting.fast_gain;
    let map = stretch * (Matrix2::identity() - u * velocity.transpose());
    let mut rows = DMatrix::<f64>::zeros(4, layout.size);
    let mut residual = nalgebra::Vector4::zeros();
    for vector in 0..2 {
        let g = Vector2::new(x[2 * vector], x[2 * vector + 1]);
        let miss = sighting.waves.basis.column(vector) - map * g;
        for i in 0..2 {
            residual[2 * vector + i] = miss[i];
            for j in 0..2 {
                rows[(2 * vector + i, 2 * vector + j)] = map[(i, j)];
            }
        }
        let su = stretch * u;
        for (parameter, _, speed) in layout.drift_weights(sighting.time) {
            for axis in 0..2 {
                for i in 0..2 {
                    rows[(2 * vector + i, parameter + axis)] = -su[i] * g[axis] * speed;
                }
            }
        }
        if let Some(parameter) = layout.gain {
            let change = sighting.fast_gain * (g - u * velocity.dot(&g));
            for i in 0..2 {
                rows[(2 * vector + i, parameter)] = change[i];
            }
        }
    }
    factor(sighting).and_then(|lower| out.push(sighting.scan, &lower, &residual, &rows));
}

/// The Cholesky factor that whitens the waves; a floor keeps noise-free simulations solvable.
pub(crate) fn factor(sighting: &Sighting) -> Option<Matrix4<f64>> {
    let floor = Matrix4::identity() * 1e-18;
    Some((sighting.waves.covariance + floor).cholesky()?.l())
}

/// `Φ_h = G_h·(r − d(t + δt) − o) + φ_h`, wrapped.
fn phases(
    sighting: &Sighting,
    layout: &Layout,
    x: &DVector<f64>,
    instability: f64,
    out: &mut Linearised,
) {
    let (Some(first), Some(measured)) = (layout.phases, &sighting.phases) else {
        return;
    };
    let late = layout.times.map(|i| i + sighting.scan);
    let (shift, velocity) = layout.motion(x, sighting.time);
    let offset = layout.offset_of(sighting.class);
    let mut place = sighting.position - shift;
    if let Some(i) = late {
        place -= velocity * x[i];
    }
    if let Some(i) = offset {
        place -= Vector2::new(x[i], x[i + 1]);
    }
    let mut rows = DMatrix::<f64>::zeros(3, layout.size);
    let mut found = PhaseMiss {
        row: out.residuals.len(),
        miss: Vector3::zeros(),
        noise: measured.covariance,
        waves: Matrix3x2::zeros(),
    };
    for (h, (a, b)) in HARMONICS.into_iter().enumerate() {
        let g = a * Vector2::new(x[0], x[1]) + b * Vector2::new(x[2], x[3]);
        let constant = first + 3 * sighting.block + h;
        let model = g.dot(&place) + x[constant];
        found.miss[h] = wrapped(measured.values[h] - model);
        found.waves.set_row(h, &g.transpose());
        for axis in 0..2 {
            rows[(h, axis)] = a * place[axis];
            rows[(h, 2 + axis)] = b * place[axis];
            for (parameter, weight, _) in layout.drift_weights(sighting.time) {
                rows[(h, parameter + axis)] = -g[axis] * weight;
            }
            if let Some(i) = offset {
                rows[(h, i + axis)] = -g[axis];
            }
        }
        if let Some(i) = late {
            rows[(h, i)] = -g.dot(&velocity);
        }
        rows[(h, constant)] = 1.0;
    }
    let lower = found.factor(instability * instability);
    if lower.is_some_and(|lower| {
        out.push(sighting.scan, &lower, &found.miss, &rows)
            .is_some()
    }) {
        out.phases.push(found);
    }
}

/// The angle in (−π, π].
pub(crate) fn wrapped(angle: f64) -> f64 {
    let turns = (angle / std::f64::consts::TAU).round();
    angle - turns * std::f64::consts::TAU
}
