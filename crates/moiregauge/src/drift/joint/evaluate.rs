//! The model of a detection (one line direction of one scan): whitened residuals and their derivatives.

use nalgebra::{
    DVector, Matrix2, Matrix2x3, Matrix3, Matrix3x2, Matrix3xX, Matrix4, Matrix4xX, Vector2,
    Vector3, Vector4,
};

use crate::drift::joint::path::{DriftPath, Settling};
use crate::drift::joint::shape::Shape;
use crate::drift::joint::sighting::{Detection, Terms};
use crate::drift::joint::sums::{ScanSums, Whitened};
use crate::numbers::interrupt;

/// Index of each parameter in the parameter vector.
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
    /// Offsets of the classes after the first.
    offsets: Option<usize>,
    /// Parameters on which each scan depends.
    pub(crate) shape: Shape,
}

/// Index of the drift: the lattice has 0..4 (G₁, G₂), the drift 4..6, the optional terms follow.
pub(crate) const DRIFT: usize = 4;

impl Layout {
    pub(crate) fn new(sightings: &[Detection], terms: Terms, time_sigma: f64) -> Self {
        let mut size = 6;
        let mut take = |wanted: bool, n: usize| {
            wanted.then(|| {
                size += n;
                size - n
            })
        };
        let classes = 1 + sightings.iter().map(|s| s.class).max().unwrap_or(0);
        let scans = 1 + sightings.iter().map(|s| s.scan).max().unwrap_or(0);
        let mut blocks = vec![0; scans];
        for sighting in sightings {
            blocks[sighting.scan] = sighting.block;
        }
        let acceleration = take(terms.acceleration, 2);
        let settling = take(terms.settling.is_some(), 2);
        let gain = take(terms.fast_gain, 1);
        let offsets = take(terms.phases, 2 * (classes - 1));
        let with_phases = 1 + sightings.iter().map(|s| s.block).max().unwrap_or(0);
        let shape = Shape {
            shared: size,
            blocks,
            with_phases: if terms.phases { with_phases } else { 0 },
        };
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
            offsets,
            shape,
        }
    }

    /// Number of parameters.
    pub(crate) fn size(&self) -> usize {
        self.shape.size()
    }

    /// Number of parameters that are results; the others are nuisance parameters of the phases.
    pub(crate) fn count(&self) -> usize {
        self.offsets.unwrap_or(self.shape.shared)
    }

    /// Index of the offset of a class; `None` for the first class, the reference, and beyond the last.
    pub(crate) fn offset_of(&self, class: usize) -> Option<usize> {
        let at = self.offsets? + 2 * class.checked_sub(1)?;
        (at < self.shape.shared).then_some(at)
    }

    /// First index of the phases of a block; `None` for a fit without phases.
    pub(crate) fn phases_of(&self, block: usize) -> Option<usize> {
        self.terms.phases.then(|| self.shape.phases_at(block))
    }

    /// First index of the errors of the frame times; `None` for a fit without phases.
    pub(crate) fn times_at(&self) -> Option<usize> {
        self.terms.phases.then(|| self.shape.clocks_at())
    }

    pub(crate) fn acceleration_at(&self) -> Option<usize> {
        self.acceleration
    }

    pub(crate) fn gain_at(&self) -> Option<usize> {
        self.gain
    }

    /// Weights of the drift parameters in displacement and velocity of the sample at a time: (index of the x component,
    /// weight in d, weight in d').
    pub(crate) fn drift_weights(&self, time: f64) -> impl Iterator<Item = (usize, f64, f64)> {
        let t = time - self.origin;
        let settling = self.settling.zip(self.terms.settling).map(|(i, tau)| {
            let decay = (-(time - self.start) / tau).exp();
            let at_origin = (-(self.origin - self.start) / tau).exp();
            (i, at_origin - decay, decay / tau)
        });
        let acceleration = self.acceleration.map(|i| (i, 0.5 * t * t, t));
        [Some((DRIFT, t, 1.0)), acceleration, settling]
            .into_iter()
            .flatten()
    }

    /// Path of the sample.
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

/// Residuals of all detections and their derivatives by the parameters of their scans.
pub(crate) struct Linearised {
    /// The waves, whitened.
    pub(crate) waves: Vec<WavesMiss>,
    /// The phases.
    pub(crate) phases: Vec<PhaseMiss>,
    /// Errors of the clocks, s; none without phases.
    clocks: Vec<f64>,
    /// Their standard uncertainty, s.
    time_sigma: f64,
}

impl Linearised {
    /// The normal equations, for positions with a scatter of `instability`, nm.
    pub(crate) fn sums(&self, shape: &Shape, instability: f64) -> ScanSums {
        let mut sums = self.sums_without_phases(shape);
        self.add_phases(&mut sums, instability);
        sums
    }

    /// The normal equations of waves and clocks.
    pub(crate) fn sums_without_phases(&self, shape: &Shape) -> ScanSums {
        let mut sums = ScanSums::new(shape);
        for waves in &self.waves {
            sums.add(waves.scan, &waves.rows);
        }
        for scan in 0..self.clocks.len() {
            if let Some([residual, slope]) = self.clock(scan) {
                sums.add_clock(scan, residual, slope);
            }
        }
        sums
    }

    /// Adds the phases, for positions with a scatter of `instability`, nm.
    pub(crate) fn add_phases(&self, sums: &mut ScanSums, instability: f64) {
        for phases in &self.phases {
            if let Some(rows) = phases.whitened(instability * instability) {
                sums.add(phases.scan, &rows);
            }
        }
    }

    /// The whitened residual of the frame time of a scan, and its derivative. The prior of the error is 0 ± `time_sigma`.
    pub(crate) fn clock(&self, scan: usize) -> Option<[f64; 2]> {
        let late = self.clocks.get(scan)?;
        Some([-late / self.time_sigma, 1.0 / self.time_sigma])
    }
}

/// Whitened residuals of the wave vectors of one detection.
pub(crate) struct WavesMiss {
    /// Index of the detection.
    pub(crate) sighting: usize,
    pub(crate) scan: usize,
    pub(crate) rows: Whitened<4>,
}

/// Residuals of the phases of one detection.
pub(crate) struct PhaseMiss {
    pub(crate) scan: usize,
    /// Measured − model, rad.
    pub(crate) miss: Vector3<f64>,
    /// Covariance of the measured phases, rad².
    pub(crate) noise: Matrix3<f64>,
    /// The three wave vectors as rows, rad/nm: derivatives by a displacement.
    pub(crate) waves: Matrix3x2<f64>,
    /// Derivatives of the model by the local parameters of the scan.
    pub(crate) slopes: Matrix3xX<f64>,
}

impl PhaseMiss {
    /// The three rows, whitened where positions have the variance `scatter`, nm²; `None` if the covariance is not positive definite.
    pub(crate) fn whitened(&self, scatter: f64) -> Option<Whitened<3>> {
        let lower = self.factor(scatter)?;
        let mut slopes = self.slopes.clone();
        lower
            .solve_lower_triangular_mut(&mut slopes)
            .then_some(())?;
        Some(Whitened {
            residuals: lower.solve_lower_triangular(&self.miss)?,
            slopes,
        })
    }

    /// The Cholesky factor that whitens the phases where positions have the variance `scatter`, nm².
    pub(crate) fn factor(&self, scatter: f64) -> Option<Matrix3<f64>> {
        let shaken = self.waves * self.waves.transpose() * scatter;
        Some((self.noise + shaken).cholesky()?.l())
    }

    /// Increase of the logarithm of the determinant of the covariance by a position variance `scatter`, nm².
    pub(crate) fn widening(&self, scatter: f64) -> f64 {
        let logarithm = |variance| {
            let diagonal = self.factor(variance)?.diagonal();
            Some(2.0 * diagonal.iter().map(|d| d.ln()).sum::<f64>())
        };
        logarithm(scatter)
            .zip(logarithm(0.0))
            .map_or(0.0, |(wide, narrow)| wide - narrow)
    }

    /// The matrix that maps phase residuals to the displacement of least χ², nm/rad, and the covariance of that displacement, nm².
    pub(crate) fn displacement(&self) -> Option<(Matrix2x3<f64>, Matrix2<f64>)> {
        let weight = self.noise.cholesky()?;
        let design = weight.solve(&self.waves);
        let covariance = (self.waves.transpose() * design).try_inverse()?;
        Some((covariance * design.transpose(), covariance))
    }
}

/// Evaluates the model at `x`. Phases of detections farther than `reach` (s) from the origin of time may be off by 2π and are left
/// out; their wave vectors are used.
pub(crate) fn linearise(
    sightings: &[Detection],
    layout: &Layout,
    x: &DVector<f64>,
    reach: f64,
) -> Linearised {
    interrupt::check();
    let near = |s: &&Detection| (s.time - layout.origin).abs() <= reach;
    Linearised {
        waves: sightings
            .iter()
            .enumerate()
            .filter_map(|(i, sighting)| waves(i, sighting, layout, x))
            .collect(),
        phases: sightings
            .iter()
            .filter(near)
            .filter_map(|sighting| phases(sighting, layout, x))
            .collect(),
        clocks: layout
            .times_at()
            .map_or_else(Vec::new, |first| x.as_slice()[first..].to_vec()),
        time_sigma: layout.time_sigma,
    }
}

/// `K = (1 + g F)(G − u (D·G))`, two vectors.
fn waves(
    number: usize,
    sighting: &Detection,
    layout: &Layout,
    x: &DVector<f64>,
) -> Option<WavesMiss> {
    let u = &sighting.time_gradient;
    let (_, velocity) = layout.motion(x, sighting.time);
    let gain = layout.gain.map_or(0.0, |i| x[i]);
    let stretch = Matrix2::identity() + gain * sighting.fast_gain;
    let map = stretch * (Matrix2::identity() - u * velocity.transpose());
    let su = stretch * u;
    let mut slopes = Matrix4xX::<f64>::zeros(layout.shape.width());
    let mut residual = Vector4::zeros();
    for vector in 0..2 {
        let g = Vector2::new(x[2 * vector], x[2 * vector + 1]);
        let miss = sighting.waves.basis.column(vector) - map * g;
        for i in 0..2 {
            residual[2 * vector + i] = miss[i];
            for j in 0..2 {
                slopes[(2 * vector + i, 2 * vector + j)] = map[(i, j)];
            }
        }
        for (parameter, _, speed) in layout.drift_weights(sighting.time) {
            for axis in 0..2 {
                for i in 0..2 {
                    slopes[(2 * vector + i, parameter + axis)] = -su[i] * g[axis] * speed;
                }
            }
        }
        if let Some(parameter) = layout.gain {
            let change = sighting.fast_gain * (g - u * velocity.dot(&g));
            for i in 0..2 {
                slopes[(2 * vector + i, parameter)] = change[i];
            }
        }
    }
    let lower = factor(sighting)?;
    lower
        .solve_lower_triangular_mut(&mut slopes)
        .then_some(())?;
    Some(WavesMiss {
        sighting: number,
        scan: sighting.scan,
        rows: Whitened {
            residuals: lower.solve_lower_triangular(&residual)?,
            slopes,
        },
    })
}

/// The Cholesky factor that whitens the waves; a floor keeps noise-free simulations solvable.
pub(crate) fn factor(sighting: &Detection) -> Option<Matrix4<f64>> {
    let floor = Matrix4::identity() * 1e-18;
    Some((sighting.waves.covariance + floor).cholesky()?.l())
}

/// The phases of a detection, `Φ_h = G_h·(r − d(t + δt) − o) + φ_h`, wrapped to (−π, π]. `None` if it has none.
pub(crate) fn phases(sighting: &Detection, layout: &Layout, x: &DVector<f64>) -> Option<PhaseMiss> {
    let first = layout.phases_of(sighting.block)?;
    let late = layout.times_at()? + sighting.scan;
    let measured = sighting.phases.as_ref()?;
    let (shift, velocity) = layout.motion(x, sighting.time);
    let offset = layout.offset_of(sighting.class);
    let mut place = sighting.position - shift - velocity * x[late];
    if let Some(i) = offset {
        place -= Vector2::new(x[i], x[i + 1]);
    }
    let (own, clock) = (layout.shape.shared, layout.shape.width() - 1);
    let mut found = PhaseMiss {
        scan: sighting.scan,
        miss: Vector3::zeros(),
        noise: measured.covariance,
        waves: Matrix3x2::zeros(),
        slopes: Matrix3xX::zeros(layout.shape.width()),
    };
    for (h, (a, b)) in HARMONICS.into_iter().enumerate() {
        let g = a * Vector2::new(x[0], x[1]) + b * Vector2::new(x[2], x[3]);
        let model = g.dot(&place) + x[first + h];
        found.miss[h] = wrapped(measured.values[h] - model);
        found.waves.set_row(h, &g.transpose());
        let slopes = &mut found.slopes;
        for axis in 0..2 {
            slopes[(h, axis)] = a * place[axis];
            slopes[(h, 2 + axis)] = b * place[axis];
            for (parameter, weight, _) in layout.drift_weights(sighting.time) {
                slopes[(h, parameter + axis)] = -g[axis] * weight;
            }
            if let Some(i) = offset {
                slopes[(h, i + axis)] = -g[axis];
            }
        }
        slopes[(h, clock)] = -g.dot(&velocity);
        slopes[(h, own + h)] = 1.0;
    }
    found.factor(0.0).map(|_| found)
}

/// The angle in (−π, π].
pub(crate) fn wrapped(angle: f64) -> f64 {
    let turns = (angle / std::f64::consts::TAU).round();
    angle - turns * std::f64::consts::TAU
}
