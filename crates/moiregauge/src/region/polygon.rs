//! Boxes and polygons.

use nalgebra::{Rotation2, Vector2};

use crate::frame::polygon;
use crate::map::nodes::Grid;

/// An area of a map with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// What the user calls it.
    pub name: String,
    /// Corners in order, nm; the last one is joined to the first.
    pub corners: Vec<Vector2<f64>>,
}

impl Region {
    /// A box from its lower left corner, nm.
    pub fn rectangle(name: &str, corner: Vector2<f64>, size: [f64; 2]) -> Self {
        let centre = corner + Vector2::from(size) / 2.0;
        Self::turned_rectangle(name, centre, size, 0.0)
    }

    /// A box about its centre (nm), its first side at `angle` to x (rad).
    pub fn turned_rectangle(
        name: &str,
        centre: Vector2<f64>,
        [width, height]: [f64; 2],
        angle: f64,
    ) -> Self {
        let turn = Rotation2::new(angle);
        let corner = |x: f64, y: f64| centre + turn * Vector2::new(x * width, y * height);
        Self {
            name: name.to_owned(),
            corners: vec![
                corner(-0.5, -0.5),
                corner(0.5, -0.5),
                corner(0.5, 0.5),
                corner(-0.5, 0.5),
            ],
        }
    }

    /// Area, nm².
    pub fn area(&self) -> f64 {
        polygon::area(&self.corners)
    }

    /// Whether a place lies within, by the even-odd rule.
    pub fn contains(&self, place: Vector2<f64>) -> bool {
        polygon::contains(&self.corners, place)
    }

    /// Whether two sides cross or touch that are no neighbours.
    pub fn crosses_itself(&self) -> bool {
        let sides: Vec<_> = polygon::sides(&self.corners).collect();
        let side = |a: Vector2<f64>, b: Vector2<f64>, p: Vector2<f64>| (b - a).perp(&(p - a));
        let apart = |(a, b), (c, d)| {
            side(a, b, c) * side(a, b, d) > 0.0 || side(c, d, a) * side(c, d, b) > 0.0
        };
        (0..sides.len()).any(|i| {
            let others = i + 2..sides.len() - usize::from(i == 0);
            others.into_iter().any(|j| !apart(sides[i], sides[j]))
        })
    }

    /// The nodes of a grid whose cells it covers, in their order, with the share of the cell (to 4 %).
    pub fn shares(&self, grid: &Grid) -> Vec<(usize, f64)> {
        let parts = [-0.4, -0.2, 0.0, 0.2, 0.4];
        let steps: Vec<Vector2<f64>> = (0..25)
            .map(|i| grid.step * Vector2::new(parts[i % 5], parts[i / 5]))
            .collect();
        let reach = grid.step.abs() * Vector2::repeat(0.5);
        let first = self.corners.first().copied().unwrap_or_default();
        let low = self.corners.iter().fold(first, |a, c| a.inf(c)) - reach;
        let high = self.corners.iter().fold(first, |a, c| a.sup(c)) + reach;
        let of_node = |node: usize| {
            let place = grid.place(node);
            if place.inf(&low) != low || place.sup(&high) != high {
                return None;
            }
            let count = steps.iter().filter(|s| self.contains(place + **s)).count();
            (count > 0).then_some((node, count as f64 / 25.0))
        };
        (0..grid.len()).filter_map(of_node).collect()
    }
}

#[cfg(test)]
mod tests;
