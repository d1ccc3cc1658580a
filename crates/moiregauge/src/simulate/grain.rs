//! One lattice of the sample, seen at any place: smooth waves or walls, bent by displacement fields.

use heterostrain::strain::{StrainError, moire_pair_of};
use nalgebra::{Matrix2, Vector2};
use rustfft::num_complex::Complex64;

use crate::simulate::bend::Bend;
use crate::simulate::error::SimulateError;
use crate::simulate::feature::SampleFeature;
use crate::simulate::scene::Scene;
use crate::simulate::settings::{Pattern, Sample};

/// One lattice.
#[derive(Clone, Debug)]
pub(crate) struct Grain {
    /// Twist, strain and orientation where nothing is bent.
    pub(crate) sample: Sample,
    /// The lattice where nothing is bent.
    pub(crate) scene: Scene,
    /// How the phases of the two waves fall when layer 2 is displaced, rad/nm, as columns.
    pub(crate) moved: Matrix2<f64>,
    /// Of the two waves at R = 0, rad.
    start: Vector2<f64>,
    /// Indices and complex amplitudes.
    harmonics: Vec<([i32; 2], Complex64)>,
    contrast: Contrast,
    atoms: Atoms,
}

/// The atoms that are seen.
#[derive(Clone, Debug, Default)]
struct Atoms {
    /// Waves of each layer that shows as columns, rad/nm, and whether it is displaced: layer 2 is.
    layers: Vec<(Matrix2<f64>, bool)>,
    /// Degrees of phase; negative for a honeycomb, which has its hollows where a triangular lattice has its atoms.
    amplitude: f64,
    /// By which share of itself a degree of phase of the moiré changes the amplitude.
    change: f64,
}

/// Three waves that meet, over one of them.
const BRIGHTEST: f64 = 3.0;

/// What a cell looks like.
#[derive(Clone, Copy, Debug)]
enum Contrast {
    Waves,
    /// Width (nm), and heights in degrees of phase over the brighter domain.
    Walls {
        width: f64,
        wall: f64,
        node: f64,
        domains: f64,
    },
}

/// Width of a node in widths of a wall: round spots.
const NODE: f64 = 2.0;

impl Grain {
    pub(crate) fn new(sample: &Sample, features: &[SampleFeature]) -> Result<Self, SimulateError> {
        let scene = Scene::new(sample)?;
        let [lower, upper] = sample
            .stacking()
            .atoms(sample.bilayer(), sample.strain_convention)?;
        let [lower, upper] = [waves(&lower)?, waves(&upper)?];
        let moved = match sample.pattern {
            // The pair of the scene may be another one of the same lattice.
            Pattern::Moire => {
                let pair = moire_pair_of(
                    &sample.stacking(),
                    sample.bilayer(),
                    sample.strain_convention,
                )?;
                let names = waves(&pair)?.try_inverse().ok_or(StrainError::NoMoire)?;
                upper * (names * scene.reciprocal).map(f64::round)
            }
            Pattern::Layer1 => Matrix2::zeros(),
            Pattern::Layer2 => upper,
        };
        let mut grain = Self {
            sample: sample.clone(),
            moved,
            start: -scene.reciprocal.transpose() * Vector2::from(sample.origin_nm),
            harmonics: Vec::new(),
            contrast: Contrast::Waves,
            atoms: Atoms::default(),
            scene,
        };
        let mut shells = [1.0, 1.0];
        for feature in features {
            match feature.class.as_str() {
                "second-shell" => {
                    shells = [feature.value("first"), feature.value("second")];
                }
                "atoms" => {
                    let layer = feature.value("layer").round();
                    let all = [(1.0, lower, false), (2.0, upper, true)];
                    let seen = all.into_iter().filter(|(other, ..)| layer + other != 3.0);
                    let form = 1.0 - 2.0 * feature.value("honeycomb").round();
                    grain.atoms = Atoms {
                        layers: seen.map(|(_, waves, moves)| (waves, moves)).collect(),
                        amplitude: form * feature.value("ratio") * sample.contrast_deg,
                        change: feature.value("change")
                            / (BRIGHTEST * sample.contrast_deg).max(f64::MIN_POSITIVE),
                    };
                }
                "walls" => {
                    grain.contrast = Contrast::Walls {
                        width: feature.value("width"),
                        wall: sample.contrast_deg,
                        node: sample.contrast_deg * feature.value("nodes"),
                        domains: sample.contrast_deg * feature.value("domains"),
                    };
                }
                _ => {}
            }
        }
        let given = features.iter().any(|f| f.class == "second-shell");
        grain.harmonics = grain.of_shells(given.then_some(shells));
        Ok(grain)
    }

    /// The harmonics of the scene, the first two shells as given.
    fn of_shells(&self, shells: Option<[f64; 2]>) -> Vec<([i32; 2], Complex64)> {
        let phase_there = |index: [i32; 2]| self.start.dot(&Vector2::from(index.map(f64::from)));
        let own = self.scene.harmonics.iter().map(|h| {
            let [i, k] = h.index;
            let amplitude = match (i * i - i * k + k * k, shells) {
                (1, Some([first, _])) => h.amplitude * first,
                (3, Some([_, second])) => self.sample.contrast_deg * second,
                _ => h.amplitude,
            };
            let shift = h.phase - phase_there(h.index);
            (h.index, Complex64::from_polar(amplitude, shift))
        });
        let mut all: Vec<([i32; 2], Complex64)> = own.collect();
        if let Some([_, second]) = shells {
            // Three cosines have no second shell yet.
            for index in [[1, -1], [2, 1], [1, 2]] {
                if !all.iter().any(|h| h.0 == index) {
                    all.push((index, Complex64::from(self.sample.contrast_deg * second)));
                }
            }
        }
        all
    }

    /// Shifts the lattice so that its two phases at a place are these.
    pub(crate) fn fit_phases(&mut self, at: Vector2<f64>, phases: Vector2<f64>) {
        self.start = phases - self.scene.reciprocal.transpose() * at;
    }

    /// The phases of the two waves at a place that is displaced by u.
    pub(crate) fn phases(&self, at: Vector2<f64>, u: Vector2<f64>) -> Vector2<f64> {
        self.start + self.scene.reciprocal.tr_mul(&at) - self.moved.tr_mul(&u)
    }

    /// The slopes of these phases: the local reciprocal vectors as columns, rad/nm.
    pub(crate) fn waves(&self, at: Vector2<f64>, bends: &[Bend]) -> Matrix2<f64> {
        let gradient: Matrix2<f64> = bends.iter().map(|bend| bend.gradient(at)).sum();
        self.scene.reciprocal - gradient.transpose() * self.moved
    }

    /// What is seen of the moiré, degrees of phase.
    pub(crate) fn moire(&self, at: Vector2<f64>, u: Vector2<f64>) -> f64 {
        let phases = self.phases(at, u);
        match self.contrast {
            Contrast::Waves => {
                let (first, second) = (powers(phases.x), powers(phases.y));
                let of = |&([h, k], amplitude): &([i32; 2], Complex64)| {
                    (amplitude * power(&first, h) * power(&second, k)).re
                };
                self.harmonics.iter().map(of).sum()
            }
            Contrast::Walls {
                width,
                wall,
                node,
                domains,
            } => {
                let d = self.wall_distances(phases);
                let nearest = d[0].min(d[1]).min(d[2]) / width;
                let bright = (-0.5 * nearest * nearest).exp();
                let away = self.node_distance(phases) / (NODE * width);
                let spot = (-0.5 * away * away).exp();
                let side = if upper_triangle(phases) { 0.5 } else { -0.5 };
                wall * bright + node * spot + domains * side * (1.0 - bright)
            }
        }
    }

    /// What is seen of the atoms where the moiré is so bright, degrees of phase.
    pub(crate) fn atoms(&self, at: Vector2<f64>, u: Vector2<f64>, moire: f64) -> f64 {
        let of_layer = |(waves, moves): &(Matrix2<f64>, bool)| {
            let phases = waves.tr_mul(&if *moves { at - u } else { at });
            phases.x.cos() + phases.y.cos() + (phases.x + phases.y).cos()
        };
        let all = self.atoms.layers.iter().map(of_layer);
        self.atoms.amplitude * (1.0 + self.atoms.change * moire) * all.sum::<f64>()
    }

    /// Distances to the nearest walls of the three directions: lines from node to node, nm.
    fn wall_distances(&self, phases: Vector2<f64>) -> [f64; 3] {
        let g = &self.scene.reciprocal;
        [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|index| {
            let index = Vector2::from(index);
            let phase = phases.dot(&index);
            wrapped(phase).abs() / (g * index).norm()
        })
    }

    /// Distance to the nearest node, nm.
    fn node_distance(&self, phases: Vector2<f64>) -> f64 {
        let shares = phases.map(|phase| wrapped(phase) / std::f64::consts::TAU);
        let mut nearest = f64::INFINITY;
        for i in [-1.0, 0.0, 1.0] {
            for k in [-1.0, 0.0, 1.0] {
                let away = self.scene.basis * (shares + Vector2::new(i, k));
                nearest = nearest.min(away.norm());
            }
        }
        nearest
    }
}

/// Reciprocal vectors as columns.
fn waves(basis: &Matrix2<f64>) -> Result<Matrix2<f64>, SimulateError> {
    let inverse = basis.try_inverse().ok_or(StrainError::NoMoire)?;
    Ok(std::f64::consts::TAU * inverse.transpose())
}

/// e^{inφ} for n = 0 to 3.
fn powers(phase: f64) -> [Complex64; 4] {
    let one = Complex64::cis(phase);
    [Complex64::from(1.0), one, one * one, one * one * one]
}

fn power(powers: &[Complex64; 4], n: i32) -> Complex64 {
    let value = powers[n.unsigned_abs() as usize];
    if n < 0 { value.conj() } else { value }
}

/// To −π … π.
fn wrapped(phase: f64) -> f64 {
    phase - std::f64::consts::TAU * (phase / std::f64::consts::TAU).round()
}

/// Which of the two triangles of the cell.
fn upper_triangle(phases: Vector2<f64>) -> bool {
    let share = |phase: f64| (phase / std::f64::consts::TAU).rem_euclid(1.0);
    share(phases.x) + share(phases.y) > 1.0
}
