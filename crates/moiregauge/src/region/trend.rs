//! Separates the spread of a map into a linear trend across the frame, noise, and the rest.
//!
//! Creep, a drift that changes and a scanner that bows stretch one side of a frame more than the other. A plane fitted to
//! the good nodes by least squares gives its size: `s² = trend² + noise² + rest²`. The mean of a map belongs to the centre of
//! its good nodes, the fit of a whole image to the centre of the frame; the plane gives the value of the map there. Errors
//! include the correlated noise of neighbouring nodes (see [`correlation`](crate::region::correlation)).

use heterostrain::Estimate;
use nalgebra::{Matrix2, Vector2};

use crate::map::quantities::{Plane, TwistStrainMap};
use crate::region::correlation::pairs;
use crate::window::mask::Mask;

/// Fewest good nodes: four for each parameter of a plane.
const FEWEST: usize = 12;
/// Most nodes that are used: the correlation sums over all pairs, 10⁸ of them.
const MOST: usize = 10_000;
/// Smallest extent of the nodes along either axis, in windows (rms distance from their centre times √12): within one window
/// a map has one independent value.
const REACH: f64 = 1.0;

/// A plane through a quantity of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Trend {
    /// Change per nm along x and along y.
    pub gradient: [Estimate; 2],
    /// Value of the plane at the centre of the frame, or at the position passed to [`Trends::about`].
    pub middle: Estimate,
    /// Standard deviation over the good nodes due to the plane.
    pub of_trend: f64,
    /// Standard deviation due to noise.
    pub noise: f64,
    /// Standard deviation that neither trend nor noise explains.
    pub rest: f64,
}

/// The good nodes of a map, ready for planes through its quantities.
pub struct Trends {
    nodes: Vec<(usize, Vector2<f64>)>,
    inverse: Matrix2<f64>,
    second: Matrix2<f64>,
    /// Vector from the centre of the good nodes to the position of [`Trend::middle`], nm.
    aside: Vector2<f64>,
    /// Variance of the mean, of the slopes and of the value at that position, for node noise of unit variance.
    mean: f64,
    slopes: Matrix2<f64>,
    middle: f64,
}

impl Trends {
    /// Planes about the centre of the frame. `None` if there are fewer than 12 good nodes or they lie within one window.
    pub fn new(map: &TwistStrainMap) -> Option<Self> {
        let [columns, rows] = map.grid.size.map(|n| n as f64 - 1.0);
        let half = Vector2::new(columns, rows) / 2.0;
        Self::about(map, map.grid.origin + map.grid.step * half)
    }

    /// Planes about the position `place`, nm.
    pub fn about(map: &TwistStrainMap, place: Vector2<f64>) -> Option<Self> {
        let columns = map.grid.size[0];
        let every = ((map.good() as f64 / MOST as f64).sqrt().ceil() as usize).max(1);
        let good: Vec<usize> = (0..map.grid.len())
            .filter(|n| (n % columns).is_multiple_of(every) && (n / columns).is_multiple_of(every))
            .filter(|&n| map.mask[n] == Mask::Good)
            .collect();
        if good.len() < FEWEST {
            return None;
        }
        let count = good.len() as f64;
        let middle = good
            .iter()
            .map(|&n| map.grid.place(n))
            .sum::<Vector2<f64>>()
            / count;
        let nodes: Vec<(usize, Vector2<f64>)> = good
            .iter()
            .map(|&n| (n, map.grid.place(n) - middle))
            .collect();
        let second = nodes
            .iter()
            .map(|(_, d)| d * d.transpose())
            .sum::<Matrix2<f64>>()
            / count;
        let shortest = second.symmetric_eigenvalues().min();
        if (12.0 * shortest).sqrt() < REACH * map.window_nm {
            return None;
        }
        let inverse = second.try_inverse()?;
        let aside = place - middle;
        let left = |weight: &dyn Fn(&Vector2<f64>) -> f64| {
            let weights: Vec<(usize, f64)> =
                nodes.iter().map(|(n, d)| (*n, weight(d) / count)).collect();
            pairs(&map.grid, &weights, map.window_nm).mean
        };
        let slope = |way: Vector2<f64>| left(&|d| way.dot(&(inverse * d)));
        let (x, y) = (slope(Vector2::x()), slope(Vector2::y()));
        let both = 0.5 * (slope(Vector2::new(1.0, 1.0)) - x - y);
        Some(Self {
            mean: left(&|_| 1.0),
            middle: left(&|d| 1.0 + aside.dot(&(inverse * d))),
            slopes: Matrix2::new(x, both, both, y),
            inverse,
            second,
            aside,
            nodes,
        })
    }

    /// The plane fitted to a quantity of this map. `None` if a good node has no value.
    pub fn of(&self, plane: &Plane) -> Option<Trend> {
        let count = self.nodes.len() as f64;
        let (mut mean, mut noise) = (0.0, 0.0);
        for (n, _) in &self.nodes {
            let Estimate { value, sigma } = plane.at(*n);
            mean += value / count;
            noise += sigma * sigma / count;
        }
        if !(mean.is_finite() && noise.is_finite()) {
            return None;
        }
        let (mut cross, mut square) = (Vector2::zeros(), 0.0);
        for (n, d) in &self.nodes {
            let off = plane.at(*n).value - mean;
            cross += d * off / count;
            square += off * off / count;
        }
        let gradient = self.inverse * cross;
        let trend = gradient.dot(&cross);
        let fitted = self.mean + (self.slopes * self.second).trace();
        let by_noise = noise * (1.0 - fitted).max(0.0);
        let sigma = |share: f64| (noise * share).sqrt();
        Some(Trend {
            gradient: [0, 1].map(|i| Estimate::new(gradient[i], sigma(self.slopes[(i, i)]))),
            middle: Estimate::new(mean + gradient.dot(&self.aside), sigma(self.middle)),
            of_trend: trend.max(0.0).sqrt(),
            noise: by_noise.sqrt(),
            rest: (square - trend - by_noise).max(0.0).sqrt(),
        })
    }
}
