//! The most uniform areas of a given size: where to put a device.
//!
//! Every node is tried as the centre, in every wanted orientation, by running sums along the rows of nodes. Areas
//! are ranked by the twist spread that they do not exceed (95 %, noise taken off), so that neither a noisy
//! area nor one that noise makes look smooth comes first; areas that overlap a better one are left out.

use nalgebra::Vector2;
use rayon::prelude::*;

use crate::map::nodes::Grid;
use crate::map::quantities::TwistStrainMap;
use crate::numbers::interrupt;
use crate::region::correlation::pairs;
use crate::region::polygon::Region;
use crate::region::smoothing::{Bends, Bent};
use crate::region::statistics::{RegionMean, RegionStatistics};
use crate::window::mask::Mask;

/// What is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceSearch {
    /// Length and width, nm.
    pub size: [f64; 2],
    /// Orientations to try, evenly over half a turn, the first along x.
    pub orientations: usize,
    /// How many areas are wanted at most.
    pub most: usize,
    /// Share of the nodes within that have to be good.
    pub good: f64,
}

impl DeviceSearch {
    /// Along x only, the ten best, 95 % of the nodes good.
    pub fn new(size: [f64; 2]) -> Self {
        Self {
            size,
            orientations: 1,
            most: 10,
            good: 0.95,
        }
    }
}

/// An area for a device.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Device {
    /// Centre, nm.
    pub centre: Vector2<f64>,
    /// Direction of the first side, rad in [0, π).
    pub angle: f64,
    /// The area in numbers.
    pub found: RegionStatistics,
}

/// The most uniform areas, best first; empty where none fits into the map.
pub fn uniform_areas(map: &TwistStrainMap, search: &DeviceSearch) -> Vec<Device> {
    let sums = RunningSums::new(map);
    let turns = search.orientations.max(1);
    let angles = (0..turns).map(|i| std::f64::consts::PI * i as f64 / turns as f64);
    let mut candidates: Vec<Candidate> = angles
        .flat_map(|angle| sums.candidates(map, search, angle))
        .collect();
    candidates.sort_by(|a, b| {
        let by_place = || a.angle.total_cmp(&b.angle).then(a.node.cmp(&b.node));
        a.below.total_cmp(&b.below).then_with(by_place)
    });
    let mut chosen: Vec<(Region, Device)> = Vec::new();
    for Candidate { angle, node, .. } in candidates {
        if chosen.len() >= search.most {
            break;
        }
        let centre = map.grid.place(node);
        let name = (chosen.len() + 1).to_string();
        let region = Region::turned_rectangle(&name, centre, search.size, angle);
        let free = |(other, device): &(Region, Device)| {
            are_apart(&region, other, [angle, device.angle], search.size)
        };
        if chosen.iter().all(free) {
            let found = RegionStatistics::new(map, &region);
            let device = Device {
                centre,
                angle,
                found,
            };
            chosen.push((region, device));
        }
    }
    chosen.into_iter().map(|(_, device)| device).collect()
}

/// A place and direction for a device.
struct Candidate {
    /// What the twist varies by at most.
    below: f64,
    angle: f64,
    node: usize,
}

/// Equal weights.
fn evenly(nodes: &[usize]) -> Vec<(usize, f64)> {
    let weight = 1.0 / nodes.len().max(1) as f64;
    nodes.iter().map(|&n| (n, weight)).collect()
}

/// The nodes of a box about a node: for each row of the grid, the first and the last column.
struct Shape {
    /// Rows above the middle one, columns from the middle one.
    rows: Vec<(i64, [i64; 2])>,
}

impl Shape {
    /// `None` where the grid is flat or the box holds no node.
    fn new(grid: &Grid, size: [f64; 2], angle: f64) -> Option<Self> {
        let inverse = grid.step.try_inverse()?;
        // Half a node more on every side: cells that are covered in part count.
        let size = size.map(|s| s + grid.step.determinant().abs().sqrt());
        let region = Region::turned_rectangle("", Vector2::zeros(), size, angle);
        let rows = region.corners.iter().map(|c| (inverse * c).y.abs());
        let most = rows.fold(0.0, f64::max).ceil().min(grid.size[1] as f64) as i64;
        let reach = region.corners.iter().map(|c| (inverse * c).x.abs());
        let wide = reach.fold(0.0, f64::max).ceil().min(grid.size[0] as f64) as i64;
        let inside = |column: i64, row: i64| {
            region.contains(grid.step * Vector2::new(column as f64, row as f64))
        };
        let rows = (-most..=most).filter_map(|row| {
            let mut columns = (-wide..=wide).filter(|&c| inside(c, row));
            let first = columns.next()?;
            Some((row, [first, columns.next_back().unwrap_or(first)]))
        });
        let rows: Vec<_> = rows.collect();
        (!rows.is_empty()).then_some(Self { rows })
    }

    /// The nodes of the box somewhere in the grid; `None` where it does not fit.
    fn nodes_about(&self, grid: &Grid) -> Option<Vec<usize>> {
        let bounds = |values: &mut dyn Iterator<Item = i64>| {
            values.fold((i64::MAX, i64::MIN), |(a, b), v| (a.min(v), b.max(v)))
        };
        let (bottom, top) = bounds(&mut self.rows.iter().map(|r| r.0));
        let (left, right) = bounds(&mut self.rows.iter().flat_map(|r| r.1));
        if top - bottom >= grid.size[1] as i64 || right - left >= grid.size[0] as i64 {
            return None;
        }
        let nodes = self.rows.iter().flat_map(|&(row, [first, last])| {
            let start = (row - bottom) * grid.size[0] as i64 - left;
            (start + first..=start + last).map(|n| n as usize)
        });
        Some(nodes.collect())
    }
}

/// Sums along each row of nodes: good nodes, their twist, its square and the variance of its noise; those with a
/// curvature, that, its product with the twist, and what noise makes of the product.
struct RunningSums {
    size: [usize; 2],
    sums: Vec<[f64; 8]>,
    bends: Bends,
}

impl RunningSums {
    fn new(map: &TwistStrainMap) -> Self {
        let size = map.grid.size;
        let good = |n: usize| map.mask[n] == Mask::Good && map.twist.value[n].is_finite();
        let (total, count) = (0..map.grid.len())
            .filter(|&n| good(n))
            .fold((0.0, 0.0f64), |(s, c), n| {
                (s + map.twist.at(n).value, c + 1.0)
            });
        // Against the mean, so that squares keep their digits.
        let mean = total / count.max(1.0);
        let bends = Bends::new(map);
        let twist = |node: usize| {
            let twist = map.twist.at(node);
            [twist.value, twist.sigma]
        };
        let mut sums = Vec::with_capacity(size[1] * (size[0] + 1));
        for row in 0..size[1] {
            let mut sum = [0.0; 8];
            sums.push(sum);
            for node in row * size[0]..(row + 1) * size[0] {
                if good(node) {
                    let [value, sigma] = twist(node);
                    let value = value - mean;
                    let none = Bent::default();
                    let bend = bends.at(map, node, &twist);
                    let bent = bend.map_or(none, |bend| none.and(1.0, value, bend));
                    let new = [
                        1.0,
                        value,
                        value * value,
                        sigma * sigma,
                        bent.weight,
                        bent.bends,
                        bent.products,
                        bent.noise,
                    ];
                    sum.iter_mut().zip(new).for_each(|(s, n)| *s += n);
                }
                sums.push(sum);
            }
        }
        Self { size, sums, bends }
    }

    /// Places where a device of this direction may lie; none where it does not fit into the map.
    fn candidates(
        &self,
        map: &TwistStrainMap,
        search: &DeviceSearch,
        angle: f64,
    ) -> Vec<Candidate> {
        let shape = Shape::new(&map.grid, search.size, angle);
        let fitting = shape.and_then(|shape| Some((shape.nodes_about(&map.grid)?, shape)));
        let Some((middle, shape)) = fitting else {
            return Vec::new();
        };
        let pairs = pairs(&map.grid, &evenly(&middle), map.window_nm);
        let of_node = |node: usize| {
            interrupt::check();
            let (sum, all) = self.within(&shape, node)?;
            if sum[0] < search.good * all || sum[0] < 1.0 {
                return None;
            }
            let [values @ .., weight, bends, products, noise] = sum;
            let bent = Bent {
                weight,
                bends,
                products,
                noise,
            };
            let below = RegionMean::of_sums(values, &self.bends, &bent, &pairs)?.below;
            below
                .is_finite()
                .then_some(Candidate { below, angle, node })
        };
        let nodes = (0..map.grid.len()).into_par_iter();
        nodes.filter_map(of_node).collect()
    }

    /// The sums over a box about a node and the number of its nodes; `None` where it leaves the map.
    fn within(&self, shape: &Shape, node: usize) -> Option<([f64; 8], f64)> {
        let [columns, rows] = self.size.map(|n| n as i64);
        let (column, row) = (node as i64 % columns, node as i64 / columns);
        let (mut sum, mut all) = ([0.0; 8], 0);
        for &(up, [first, last]) in &shape.rows {
            let (row, first, last) = (row + up, column + first, column + last);
            if !(0..rows).contains(&row) || first < 0 || last >= columns {
                return None;
            }
            let line = row * (columns + 1);
            let (from, to) = (
                self.sums[(line + first) as usize],
                self.sums[(line + last + 1) as usize],
            );
            for i in 0..8 {
                sum[i] += to[i] - from[i];
            }
            all += last - first + 1;
        }
        Some((sum, all as f64))
    }
}

/// Whether two boxes of the same size do not overlap: some side of one separates them.
fn are_apart(one: &Region, other: &Region, angles: [f64; 2], size: [f64; 2]) -> bool {
    angles
        .into_iter()
        .flat_map(|t| [t, t + std::f64::consts::FRAC_PI_2])
        .any(|t| {
            let axis = Vector2::new(t.cos(), t.sin());
            let ends = |corners: &[Vector2<f64>]| {
                let along = corners.iter().map(|c| c.dot(&axis));
                along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
                    (l.min(x), h.max(x))
                })
            };
            let ((low, high), (from, to)) = (ends(&one.corners), ends(&other.corners));
            let slack = 1e-9 * (size[0] + size[1]);
            high <= from + slack || to <= low + slack
        })
}
