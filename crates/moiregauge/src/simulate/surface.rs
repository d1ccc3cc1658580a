//! The sample with all that it has: which lattice is where, what lies beside it, how high it is.

use nalgebra::{Matrix2, Vector2};
use rand::RngExt as _;

use crate::numbers::rng;
use crate::simulate::bend::Bend;
use crate::simulate::error::SimulateError;
use crate::simulate::feature::SampleFeature;
use crate::simulate::grain::Grain;
use crate::simulate::ground;
use crate::simulate::reference::{HalfPlane, Reference};
use crate::simulate::scene::Harmonic;
use crate::simulate::settings::Simulation;

/// The sample, in its own frame.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    pub(crate) reference: Reference,
    /// The first one and what lies beyond each of the boundaries.
    pub(crate) grains: Vec<Grain>,
    pub(crate) boundaries: Vec<HalfPlane>,
    pub(crate) bends: Vec<Bend>,
    empty: Vec<Empty>,
    fades: Vec<Fade>,
    bumps: Vec<Bump>,
    steps: Vec<(HalfPlane, f64)>,
    /// Ground without a lattice.
    pub(crate) ground: Vec<Harmonic>,
    bare: bool,
}

/// A part without moiré, and its height.
#[derive(Clone, Debug)]
struct Empty {
    shape: Shape,
    height: f64,
}

#[derive(Clone, Debug)]
enum Shape {
    Beyond(HalfPlane),
    Discs {
        centres: Vec<Vector2<f64>>,
        radius: f64,
    },
    Around {
        centre: Vector2<f64>,
        radius: f64,
    },
}

/// Contrast that falls across a line.
#[derive(Clone, Copy, Debug)]
struct Fade {
    /// Where less than half of it is left.
    beyond: HalfPlane,
    width: f64,
}

/// A smooth bump.
#[derive(Clone, Copy, Debug)]
struct Bump {
    centre: Vector2<f64>,
    sigma: f64,
    height: f64,
    keep: f64,
}

/// Tries to place a hole where no other one is.
const TRIES: usize = 200;

impl Surface {
    /// Lays out the sample; `None` if it is nothing but a lattice.
    pub(crate) fn new(settings: &Simulation) -> Result<Option<Self>, SimulateError> {
        let features = &settings.features;
        if features.iter().all(|f| f.class == "clean") {
            return Ok(None);
        }
        let sample = &settings.sample;
        let reference = Reference::new(settings);
        let poisson_ratio = sample.bilayer().stretched.poisson_ratio;
        let mut surface = Self {
            reference,
            grains: vec![Grain::new(sample, features)?],
            boundaries: Vec::new(),
            bends: features
                .iter()
                .filter_map(|f| Bend::of(f, &reference, poisson_ratio))
                .collect(),
            empty: Vec::new(),
            fades: Vec::new(),
            bumps: Vec::new(),
            steps: Vec::new(),
            ground: Vec::new(),
            bare: features.iter().any(|f| f.class == "bare"),
        };
        for (feature, index) in features.iter().zip(0..) {
            let ground = ground::waves(feature, &reference, sample.seed, index);
            surface.ground.extend(ground);
            surface.add(feature, settings, index)?;
        }
        Ok(Some(surface))
    }

    fn add(
        &mut self,
        feature: &SampleFeature,
        settings: &Simulation,
        index: u64,
    ) -> Result<(), SimulateError> {
        let value = |key: &str| feature.value(key);
        let reference = self.reference;
        let area = reference.area();
        let beyond = || reference.beyond(value("share"), value("angle").to_radians());
        let middle = || reference.place(value("x"), value("y"));
        match feature.class.as_str() {
            "edge" => self.empty(Shape::Beyond(beyond()), value("height")),
            "fade" => self.fades.push(Fade {
                beyond: beyond(),
                width: value("width") * reference.side(),
            }),
            "island" => {
                let radius = (value("share") * area / std::f64::consts::PI).sqrt();
                let centre = middle();
                self.empty(Shape::Around { centre, radius }, value("height"));
            }
            "hole" => {
                let count = value("count").round().max(1.0) as usize;
                let each = value("share") * area / count as f64;
                let radius = (each / std::f64::consts::PI).sqrt();
                let centres = if count == 1 {
                    vec![middle()]
                } else {
                    self.apart(count, radius, settings.sample.seed, index)
                };
                self.empty(Shape::Discs { centres, radius }, value("height"));
            }
            "bump" => self.bumps.push(Bump {
                centre: middle(),
                sigma: value("size") * reference.side(),
                height: value("height"),
                keep: value("keep"),
            }),
            "step" => self.steps.push((beyond(), value("height"))),
            "grains" => self.add_grain(feature, settings, beyond())?,
            _ => {}
        }
        Ok(())
    }

    fn empty(&mut self, shape: Shape, height: f64) {
        self.empty.push(Empty { shape, height });
    }

    /// Another lattice beyond a boundary.
    fn add_grain(
        &mut self,
        feature: &SampleFeature,
        settings: &Simulation,
        boundary: HalfPlane,
    ) -> Result<(), SimulateError> {
        let mut sample = settings.sample.clone();
        sample.twist_deg += feature.value("twist");
        sample.strain_percent += feature.value("strain");
        sample.lattice_angle_deg += feature.value("turn");
        let mut grain = Grain::new(&sample, &settings.features)?;
        let at = self.reference.on_rim(&boundary);
        // Half as much along the second wave: a step that is no mirror image of itself.
        let step = Vector2::new(1.0, 0.5) * feature.value("shift") * std::f64::consts::TAU;
        let here = self.grains[0].phases(at, Vector2::zeros());
        grain.fit_phases(at, here + step);
        self.grains.push(grain);
        self.boundaries.push(boundary);
        Ok(())
    }

    /// Random places inside the frame, two radii apart where there is room.
    fn apart(&self, count: usize, radius: f64, seed: u64, index: u64) -> Vec<Vector2<f64>> {
        let mut rng = rng::stream(seed, "simulate holes", index);
        let mut centres: Vec<Vector2<f64>> = Vec::new();
        let room = 1.0 - 2.0 * radius / self.reference.side();
        for _ in 0..count {
            let mut best = self.reference.centre;
            let mut widest = f64::NEG_INFINITY;
            for _ in 0..TRIES {
                let mut share = || room.max(0.0) * (rng.random::<f64>() - 0.5);
                let place = self.reference.place(share(), share());
                let gaps = centres.iter().map(|other| (place - other).norm());
                let gap = gaps.fold(f64::INFINITY, f64::min);
                if gap > widest {
                    (best, widest) = (place, gap);
                }
                // A little wall between two holes.
                if gap > 2.2 * radius {
                    break;
                }
            }
            centres.push(best);
        }
        centres
    }

    /// Which lattice is at a place.
    pub(crate) fn grain_at(&self, at: Vector2<f64>) -> usize {
        let last = self.boundaries.iter().rposition(|half| half.has(at));
        last.map_or(0, |index| index + 1)
    }

    /// Share of the contrast that the moiré has at a place.
    pub(crate) fn contrast(&self, at: Vector2<f64>) -> f64 {
        if self.bare || self.empty.iter().any(|empty| empty.shape.has(at)) {
            return 0.0;
        }
        let left = |bump: &Bump| 1.0 - (1.0 - bump.keep) * bump.form(at);
        let bumps: f64 = self.bumps.iter().map(left).product();
        bumps * self.fades.iter().map(|fade| fade.left(at)).product::<f64>()
    }

    /// Whether there is moiré at a place: at least half of its contrast.
    pub(crate) fn is_covered(&self, at: Vector2<f64>) -> bool {
        self.contrast(at) >= 0.5
    }

    /// What is seen at a place, without the ground, degrees of phase.
    pub(crate) fn value(&self, at: Vector2<f64>) -> f64 {
        let mut height = 0.0;
        for empty in self.empty.iter().filter(|empty| empty.shape.has(at)) {
            height += empty.height;
        }
        for bump in &self.bumps {
            height += bump.height * bump.form(at);
        }
        for (half, step) in &self.steps {
            height += if half.has(at) { *step } else { 0.0 };
        }
        let contrast = self.contrast(at);
        if contrast == 0.0 {
            return height;
        }
        let grain = &self.grains[self.grain_at(at)];
        let u = self.displacement(at);
        let moire = grain.moire(at, u);
        height + contrast * (moire + grain.atoms(at, u, moire))
    }

    fn displacement(&self, at: Vector2<f64>) -> Vector2<f64> {
        self.bends.iter().map(|bend| bend.displacement(at)).sum()
    }

    /// The local reciprocal vectors as columns, rad/nm.
    pub(crate) fn waves(&self, at: Vector2<f64>) -> Matrix2<f64> {
        self.grains[self.grain_at(at)].waves(at, &self.bends)
    }
}

impl Shape {
    fn has(&self, at: Vector2<f64>) -> bool {
        match self {
            Self::Beyond(half) => half.has(at),
            Self::Discs { centres, radius } => {
                let inside = |centre: &Vector2<f64>| (at - centre).norm_squared() < radius * radius;
                centres.iter().any(inside)
            }
            Self::Around { centre, radius } => (at - centre).norm_squared() >= radius * radius,
        }
    }
}

impl Fade {
    fn left(&self, at: Vector2<f64>) -> f64 {
        1.0 / (1.0 + (self.beyond.inside(at) / self.width).exp())
    }
}

impl Bump {
    fn form(&self, at: Vector2<f64>) -> f64 {
        (-0.5 * (at - self.centre).norm_squared() / (self.sigma * self.sigma)).exp()
    }
}
