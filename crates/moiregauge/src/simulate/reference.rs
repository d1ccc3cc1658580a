//! The part of the sample that the frames of a set see in the mean: what shares and angles of a sample are counted on.

use nalgebra::{Matrix2, Vector2};

use crate::simulate::motion::Motion;
use crate::simulate::raster::FramePlan;
use crate::simulate::settings::Simulation;

/// Places on each side at which areas are counted: shares are right to 1/1000.
const COUNTED: usize = 256;

/// A frame at rest on the sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reference {
    /// Its middle, nm.
    pub(crate) centre: Vector2<f64>,
    /// Its sides as columns, nm.
    pub(crate) sides: Matrix2<f64>,
}

/// The half of the plane with `normal·R > at`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HalfPlane {
    pub(crate) normal: Vector2<f64>,
    pub(crate) at: f64,
}

impl HalfPlane {
    pub(crate) fn has(&self, at: Vector2<f64>) -> bool {
        self.inside(at) > 0.0
    }

    /// How far a place lies in it, nm; negative beyond its line.
    pub(crate) fn inside(&self, at: Vector2<f64>) -> f64 {
        self.normal.dot(&at) - self.at
    }
}

impl Reference {
    pub(crate) fn new(settings: &Simulation) -> Self {
        let motion = Motion::new(&settings.drift);
        let frames = settings.raster.scans;
        let [columns, rows] = settings.raster.pixels.map(|n| n as f64 - 1.0);
        let mut centre = Vector2::zeros();
        let mut sides = Matrix2::zeros();
        for index in 0..frames {
            let plan = FramePlan::new(settings, index);
            centre += plan.centre - motion.at(f64::midpoint(plan.start, plan.end));
            sides = plan.pixel_to_nm * Matrix2::from_diagonal(&Vector2::new(columns, rows));
        }
        Self {
            centre: centre / frames as f64,
            sides,
        }
    }

    /// nm².
    pub(crate) fn area(&self) -> f64 {
        self.sides.determinant().abs()
    }

    /// Of a square of the same area, nm.
    pub(crate) fn side(&self) -> f64 {
        self.area().sqrt()
    }

    /// The place at the shares (x, y) of the sides away from the middle.
    pub(crate) fn place(&self, x: f64, y: f64) -> Vector2<f64> {
        self.centre + self.sides * Vector2::new(x, y)
    }

    /// Places on a regular grid of cells, each in the middle of its own.
    pub(crate) fn grid(&self, cells: usize) -> impl Iterator<Item = Vector2<f64>> + '_ {
        let share = move |i: usize| (i as f64 + 0.5) / cells as f64 - 0.5;
        (0..cells * cells).map(move |n| self.place(share(n % cells), share(n / cells)))
    }

    /// The half plane towards `angle` (rad) that leaves this share of the frame outside.
    pub(crate) fn beyond(&self, share_outside: f64, angle: f64) -> HalfPlane {
        let normal = Vector2::new(angle.cos(), angle.sin());
        let mut along: Vec<f64> = self.grid(COUNTED).map(|at| normal.dot(&at)).collect();
        along.sort_by(f64::total_cmp);
        let last = along.len() - 1;
        let n = (share_outside * along.len() as f64).round() as usize;
        HalfPlane {
            normal,
            at: match n {
                0 => f64::NEG_INFINITY,
                n if n > last => f64::INFINITY,
                n => f64::midpoint(along[n - 1], along[n]),
            },
        }
    }

    /// The point of the rim of a half plane that lies nearest to the middle.
    pub(crate) fn on_rim(&self, half: &HalfPlane) -> Vector2<f64> {
        self.centre + half.normal * (half.at - half.normal.dot(&self.centre))
    }
}
