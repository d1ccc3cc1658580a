//! What errors of the grid of the pixels do to positions.

use nalgebra::{Matrix2, Vector2};

/// Quadratic bends of x and y about the middle of what each goes through in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bends {
    /// The middle of the frame, nm.
    pub centre: Vector2<f64>,
    /// The ranges of x and of y, nm.
    pub range: Vector2<f64>,
    /// Whether sensors recorded the places, so that only their own bends are left.
    pub from_sensors: bool,
}

impl Bends {
    /// By how much x and y stretch at a place if each bends, against a straight line, by its whole range: `R (2x/R)²` has the slope 8x/R.
    pub fn stretch(&self, place: Vector2<f64>) -> Vector2<f64> {
        8.0 * (place - self.centre).component_div(&self.range)
    }

    /// Those of several frames that were averaged; `None` of none.
    pub(crate) fn mean(all: impl ExactSizeIterator<Item = Self>) -> Option<Self> {
        let share = 1.0 / all.len() as f64;
        let scaled = all.map(|b| Self {
            centre: b.centre * share,
            range: b.range * share,
            ..b
        });
        scaled.reduce(|a, b| Self {
            centre: a.centre + b.centre,
            range: a.range + b.range,
            from_sensors: a.from_sensors && b.from_sensors,
        })
    }
}

/// Relative changes of positions, each by one standard deviation of an error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GridErrors {
    /// By the pitch of the pixels; zero where that is settled.
    pub pitch: Matrix2<f64>,
    /// By what x and what y may be bent by.
    pub shape: Vector2<f64>,
}

impl GridErrors {
    /// Bends of x and of y are independent.
    pub(crate) fn shape_changes(&self) -> [Matrix2<f64>; 2] {
        let [x, y] = [self.shape.x, self.shape.y];
        [
            Matrix2::new(x, 0.0, 0.0, 0.0),
            Matrix2::new(0.0, 0.0, 0.0, y),
        ]
    }

    /// Of several frames of one instrument: what it does does not average out.
    pub(crate) fn mean(all: impl Iterator<Item = Self>) -> Self {
        let (mut sum, mut count) = (Self::default(), 0.0f64);
        for one in all {
            sum.pitch += one.pitch;
            sum.shape += one.shape;
            count += 1.0;
        }
        Self {
            pitch: sum.pitch / count.max(1.0),
            shape: sum.shape / count.max(1.0),
        }
    }
}
