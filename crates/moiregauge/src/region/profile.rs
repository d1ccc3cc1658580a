//! A map along a line.

use heterostrain::Estimate;
use nalgebra::{Matrix2, Vector2};

use crate::map::quantities::TwistStrainMap;
use crate::region::statistics::mean_wavelength;
use crate::window::mask::Mask;

/// Values along a line, as far as the map reaches.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Profile {
    /// What the user calls it.
    pub name: String,
    /// From the first place to the second, nm.
    pub ends: [Vector2<f64>; 2],
    /// Points a node's distance apart, both ends included.
    pub points: Vec<ProfilePoint>,
}

/// The map at a point of a line, between its nodes (bilinear). The errors of points nearer than the window
/// are not independent.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct ProfilePoint {
    /// From the start of the line, nm.
    pub distance: f64,
    /// Place, nm.
    pub place: Vector2<f64>,
    /// The worst mask of the nodes around; `None` beyond the map.
    pub mask: Option<Mask>,
    /// Values, where all nodes around are good.
    pub values: Option<ProfileValues>,
}

/// What a profile shows.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct ProfileValues {
    /// θ, rad.
    pub twist: Estimate,
    /// Components of the strain vector.
    pub strain: [Estimate; 2],
    /// |E|, the bias of noise removed.
    pub magnitude: Estimate,
    /// Mean of the three wavelengths, nm.
    pub wavelength: Estimate,
}

impl Profile {
    /// The map along the line between two places, nm.
    pub fn new(map: &TwistStrainMap, name: &str, ends: [Vector2<f64>; 2]) -> Self {
        let way = ends[1] - ends[0];
        let step = [0, 1].map(|i| map.grid.step.column(i).norm());
        let steps = (way.norm() / step[0].min(step[1])).ceil().clamp(1.0, 1e5) as usize;
        let inverse = map.grid.step.try_inverse();
        let point = |i: usize| {
            let share = i as f64 / steps as f64;
            let place = ends[0] + share * way;
            let around = inverse.and_then(|inverse| around(map, &inverse, place));
            let mask = around.as_ref().and_then(|a| a.iter().map(|n| n.mask).max());
            let values = around.filter(|_| mask == Some(Mask::Good));
            ProfilePoint {
                distance: share * way.norm(),
                place,
                mask,
                values: values.map(|a| values_of(map, &a)),
            }
        };
        Self {
            name: name.to_owned(),
            ends,
            points: (0..=steps).map(point).collect(),
        }
    }
}

/// A node beside a place.
struct Beside {
    node: usize,
    weight: f64,
    mask: Mask,
}

/// The nodes around a place with their weights; `None` beyond the map.
fn around(
    map: &TwistStrainMap,
    inverse: &Matrix2<f64>,
    place: Vector2<f64>,
) -> Option<Vec<Beside>> {
    let at = inverse * (place - map.grid.origin);
    let along = |axis: usize| {
        let last = map.grid.size[axis] as f64 - 1.0;
        if !(-1e-6..=last + 1e-6).contains(&at[axis]) {
            return None;
        }
        let cell = at[axis].floor().clamp(0.0, (last - 1.0).max(0.0));
        Some((cell as usize, (at[axis] - cell).clamp(0.0, 1.0)))
    };
    let ((column, u), (row, v)) = (along(0)?, along(1)?);
    let all = [
        (0, 0, (1.0 - u) * (1.0 - v)),
        (1, 0, u * (1.0 - v)),
        (0, 1, (1.0 - u) * v),
        (1, 1, u * v),
    ];
    let kept = all.into_iter().filter(|(_, _, weight)| *weight > 1e-9);
    Some(
        kept.map(|(c, r, weight)| {
            let node = (row + r) * map.grid.size[0] + column + c;
            Beside {
                node,
                weight,
                mask: map.mask[node],
            }
        })
        .collect(),
    )
}

fn values_of(map: &TwistStrainMap, around: &[Beside]) -> ProfileValues {
    let mean = |value: &dyn Fn(usize) -> [f64; 2]| {
        let sum = around.iter().fold([0.0; 2], |sum, beside| {
            let [v, s] = value(beside.node);
            [sum[0] + beside.weight * v, sum[1] + beside.weight * s]
        });
        Estimate::new(sum[0], sum[1])
    };
    let plane = |plane: &crate::map::quantities::Plane| {
        mean(&|n| {
            let e = plane.at(n);
            [e.value, e.sigma]
        })
    };
    ProfileValues {
        twist: plane(&map.twist),
        strain: [plane(&map.strain[0]), plane(&map.strain[1])],
        magnitude: plane(&map.magnitude),
        wavelength: mean(&|n| mean_wavelength(map, n)),
    }
}
