//! Nodes → triangles of neighbours, each edge with its step on the lattice; holes, missing nodes, dislocations.
//!
//! Delaunay triangles that are nearly those of the lattice are kept. The steps of one triangle's edges give those of
//! its neighbours by topology alone (a shared edge is the same step backwards, the next edge is turned by 120°),
//! so that no distance is ever rounded far from the start. Around a hole the steps add up to nothing, and
//! lattice points within are missing nodes; or to a Burgers vector, and there is a dislocation.

use std::collections::VecDeque;

use delaunator::{EMPTY, Point, next_halfedge, triangulate};
use nalgebra::{Matrix2, Vector2};

/// Longest over shortest edge of a triangle, in coordinates in which the mean lattice is hexagonal: below √3, the
/// triangle across a missing node.
const STRETCH: f64 = 1.65;
/// Area of a triangle against the usual one, at most this factor off: below 3, that of the even triangle across a
/// missing node.
const AREA: f64 = 2.5;
/// Parts of the mesh with fewer triangles are no lattice: six make the ring around one node.
const FEW: usize = 6;

/// A triangle of neighbouring nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct MeshTriangle {
    /// Its nodes, counter-clockwise in pixels (columns right, rows up).
    pub nodes: [usize; 3],
    /// Steps (h, k) on the lattice from each node to the next one.
    pub steps: [[i32; 2]; 3],
}

/// A line along which the lattice does not close.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Dislocation {
    /// The middle of the hole in the mesh around it, pixels.
    pub place: Vector2<f64>,
    /// By which lattice vector (h, k) a way around it, counter-clockwise, fails to close.
    pub burgers: [i32; 2],
}

/// Nodes connected.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Mesh {
    /// Triangles that are cells of the lattice.
    pub triangles: Vec<MeshTriangle>,
    /// (h, k) of every node, counted from some node of its part of the mesh; `None` for nodes in no triangle. Behind
    /// a dislocation the count depends on the way around it.
    pub indices: Vec<Option<[i32; 2]>>,
    /// Where nodes should be and are not, pixels.
    pub missing: Vec<Vector2<f64>>,
    /// Nodes within the mesh that belong to no triangle.
    pub extra: Vec<usize>,
    /// Dislocations.
    pub dislocations: Vec<Dislocation>,
}

/// Turns a step by 120°, for primitive vectors at 60°.
fn turned([h, k]: [i32; 2]) -> [i32; 2] {
    [-h - k, h]
}

fn minus([h, k]: [i32; 2]) -> [i32; 2] {
    [-h, -k]
}

fn plus(a: [i32; 2], b: [i32; 2]) -> [i32; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

/// The Delaunay triangles and what is known of them.
struct Net<'a> {
    places: &'a [Vector2<f64>],
    /// Three per triangle: where its half-edges start, counter-clockwise.
    starts: Vec<usize>,
    /// The other half of each half-edge, or [`EMPTY`].
    twins: Vec<usize>,
    kept: Vec<bool>,
    steps: Vec<Option<[i32; 2]>>,
}

impl Mesh {
    /// Connects nodes at these places (pixels); `lattice` has two primitive vectors about 60° apart as
    /// columns, about right.
    pub fn new(places: &[Vector2<f64>], lattice: &Matrix2<f64>) -> Self {
        let nothing = Self {
            indices: vec![None; places.len()],
            ..Self::default()
        };
        let Some(inverse) = lattice.try_inverse() else {
            return nothing;
        };
        let mut net = Net::new(places, &inverse);
        net.drop_cores();
        let indices = net.label(lattice);
        let steps = |t: usize| {
            let all = [0, 1, 2].map(|i| net.steps[3 * t + i]);
            Some([all[0]?, all[1]?, all[2]?])
        };
        let triangles = (0..net.kept.len())
            .filter(|&t| net.kept[t])
            .filter_map(|t| {
                Some(MeshTriangle {
                    nodes: [0, 1, 2].map(|i| net.starts[3 * t + i]),
                    steps: steps(t)?,
                })
            });
        let mut mesh = Self {
            triangles: triangles.collect(),
            indices,
            ..nothing
        };
        net.holes(&mut mesh, lattice);
        mesh
    }
}

impl<'a> Net<'a> {
    fn new(places: &'a [Vector2<f64>], inverse: &Matrix2<f64>) -> Self {
        // In these coordinates the mean lattice is hexagonal, with neighbours at 1.
        let hexagon = Matrix2::new(1.0, 0.5, 0.0, 0.75f64.sqrt()) * inverse;
        let even: Vec<Vector2<f64>> = places.iter().map(|p| hexagon * p).collect();
        let points: Vec<Point> = even.iter().map(|p| Point { x: p.x, y: p.y }).collect();
        let found = triangulate(&points);
        let mut net = Self {
            places,
            starts: found.triangles,
            twins: found.halfedges,
            kept: Vec::new(),
            steps: Vec::new(),
        };
        net.steps = vec![None; net.starts.len()];
        net.orient(&even);
        let count = net.starts.len() / 3;
        let area = |t: usize| {
            let [a, b, c] = [0, 1, 2].map(|i| even[net.starts[3 * t + i]]);
            0.5 * (b - a).perp(&(c - a))
        };
        let shapely = |t: usize| {
            let corners = [0, 1, 2].map(|i| even[net.starts[3 * t + i]]);
            let sides = [0, 1, 2].map(|i| (corners[(i + 1) % 3] - corners[i]).norm());
            let longest = sides.iter().copied().fold(0.0, f64::max);
            let shortest = sides.iter().copied().fold(f64::INFINITY, f64::min);
            longest < STRETCH * shortest
        };
        let mut areas: Vec<f64> = (0..count).filter(|&t| shapely(t)).map(area).collect();
        areas.sort_by(f64::total_cmp);
        let usual = areas.get(areas.len() / 2).copied().unwrap_or(0.0);
        net.kept = (0..count)
            .map(|t| shapely(t) && area(t) < AREA * usual && area(t) > usual / AREA)
            .collect();
        net
    }

    /// Makes all triangles counter-clockwise.
    fn orient(&mut self, places: &[Vector2<f64>]) {
        let clockwise = self
            .starts
            .first_chunk::<3>()
            .is_some_and(|&[a, b, c]| (places[b] - places[a]).perp(&(places[c] - places[a])) < 0.0);
        if clockwise {
            // Half-edges a→b, b→c, c→a become a→c, c→b, b→a: the new i-th is the old (2 − i)-th turned round.
            let old = self.starts.clone();
            let twins = self.twins.clone();
            let place = |e: usize| 3 * (e / 3) + 2 - e % 3;
            for e in 0..old.len() {
                self.starts[place(e)] = old[next_halfedge(e)];
                self.twins[place(e)] = if twins[e] == EMPTY {
                    EMPTY
                } else {
                    place(twins[e])
                };
            }
        }
    }

    /// The other half of an edge, if a kept triangle has it.
    fn twin(&self, edge: usize) -> Option<usize> {
        let twin = self.twins[edge];
        (twin != EMPTY && self.kept[twin / 3]).then_some(twin)
    }

    /// Drops the triangles around nodes that are surrounded by five or seven of them: cores of dislocations.
    fn drop_cores(&mut self) {
        let mut around = vec![0usize; self.places.len()];
        let mut open = vec![false; self.places.len()];
        for edge in 0..self.starts.len() {
            if self.kept[edge / 3] {
                around[self.starts[edge]] += 1;
                if self.twin(edge).is_none() {
                    open[self.starts[edge]] = true;
                    open[self.starts[next_halfedge(edge)]] = true;
                }
            }
        }
        let core = |node: usize| !open[node] && around[node] != 6 && around[node] > 0;
        let bad: Vec<usize> = (0..self.kept.len())
            .filter(|t| (0..3).any(|i| core(self.starts[3 * t + i])))
            .collect();
        for triangle in bad {
            self.kept[triangle] = false;
        }
    }

    /// Gives every edge its step and every node its index, part by part; drops parts that are too small.
    fn label(&mut self, lattice: &Matrix2<f64>) -> Vec<Option<[i32; 2]>> {
        let mut indices: Vec<Option<[i32; 2]>> = vec![None; self.places.len()];
        let mut seeds: Vec<(f64, usize, [i32; 2])> = (0..self.kept.len())
            .filter(|&t| self.kept[t])
            .map(|t| self.seed(t, lattice))
            .collect();
        seeds.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, seed, step) in seeds {
            if !self.kept[seed] || self.steps[3 * seed].is_some() {
                continue;
            }
            let part = self.spread(seed, step);
            if part.len() < FEW {
                for t in part {
                    self.kept[t] = false;
                    self.steps[3 * t..3 * t + 3].fill(None);
                }
                continue;
            }
            indices[self.starts[3 * seed]].get_or_insert([0, 0]);
            for t in part {
                // Triangles come in the order in which they were reached: one of its nodes has an index.
                for _ in 0..2 {
                    for i in 0..3 {
                        let edge = 3 * t + i;
                        let (from, to) = (self.starts[edge], self.starts[next_halfedge(edge)]);
                        if let (Some(index), Some(step)) = (indices[from], self.steps[edge]) {
                            indices[to].get_or_insert(plus(index, step));
                        }
                    }
                }
            }
        }
        indices
    }

    /// How far a triangle is from one of the mean lattice, and the step of its first edge if it is one.
    fn seed(&self, t: usize, lattice: &Matrix2<f64>) -> (f64, usize, [i32; 2]) {
        let corners = [0, 1, 2].map(|i| self.places[self.starts[3 * t + i]]);
        let mut best = (f64::INFINITY, t, [1, 0]);
        for start in [[1, 0], [0, 1], [-1, 1], [-1, 0], [0, -1], [1, -1]] {
            let mut step = start;
            let mut off = 0.0;
            for i in 0..3 {
                let expected = lattice * Vector2::from(step.map(f64::from));
                off += (corners[(i + 1) % 3] - corners[i] - expected).norm_squared();
                step = turned(step);
            }
            if off < best.0 {
                best = (off, t, start);
            }
        }
        best
    }

    /// Labels all triangles that hang together with one; returns them.
    fn spread(&mut self, seed: usize, step: [i32; 2]) -> Vec<usize> {
        let mut part = Vec::new();
        let mut queue = VecDeque::from([(3 * seed, step)]);
        while let Some((edge, step)) = queue.pop_front() {
            if self.steps[edge].is_some() {
                continue;
            }
            part.push(edge / 3);
            let (mut edge, mut step) = (edge, step);
            for _ in 0..3 {
                self.steps[edge] = Some(step);
                if let Some(twin) = self.twin(edge)
                    && self.steps[twin].is_none()
                {
                    queue.push_back((twin, minus(step)));
                }
                edge = next_halfedge(edge);
                step = turned(step);
            }
        }
        part
    }

    /// Follows every rim of the mesh and says what the holes are.
    fn holes(&self, mesh: &mut Mesh, lattice: &Matrix2<f64>) {
        let on_rim = |e: usize| self.kept[e / 3] && self.twin(e).is_none();
        let mut seen = vec![false; self.starts.len()];
        let mut inside = Vec::new();
        for first in 0..self.starts.len() {
            if seen[first] || !on_rim(first) {
                continue;
            }
            let mut rim = Vec::new();
            let mut edge = first;
            while !seen[edge] {
                seen[edge] = true;
                rim.push(edge);
                let mut next = next_halfedge(edge);
                while let Some(twin) = self.twin(next) {
                    next = next_halfedge(twin);
                }
                edge = next;
            }
            let places: Vec<Vector2<f64>> =
                rim.iter().map(|&e| self.places[self.starts[e]]).collect();
            if area(&places) < 0.0 {
                self.hole(&rim, &places, mesh, lattice);
            } else {
                inside.push(places);
            }
        }
        for (node, place) in self.places.iter().enumerate() {
            if mesh.indices[node].is_none() && inside.iter().any(|rim| contains(rim, *place)) {
                mesh.extra.push(node);
            }
        }
    }

    /// A hole, its rim run through clockwise.
    fn hole(
        &self,
        rim: &[usize],
        places: &[Vector2<f64>],
        mesh: &mut Mesh,
        lattice: &Matrix2<f64>,
    ) {
        let mut at = [0, 0];
        let mut corners = Vec::with_capacity(rim.len());
        for &edge in rim {
            corners.push(Vector2::from(at.map(f64::from)));
            at = plus(at, self.steps[edge].unwrap_or_default());
        }
        let count = places.len() as f64;
        let middle = places.iter().sum::<Vector2<f64>>() / count;
        if at != [0, 0] {
            mesh.dislocations.push(Dislocation {
                place: middle,
                burgers: minus(at),
            });
            return;
        }
        // Index → place by the nodes of the rim.
        let centre = corners.iter().sum::<Vector2<f64>>() / count;
        let (mut normal, mut right) = (Matrix2::zeros(), Matrix2::zeros());
        for (corner, place) in corners.iter().zip(places) {
            let (c, p) = (corner - centre, place - middle);
            normal += c * c.transpose();
            right += p * c.transpose();
        }
        let linear = normal
            .try_inverse()
            .map_or(*lattice, |inverse| right * inverse);
        let bounds = |axis: usize| {
            let low = corners
                .iter()
                .map(|c| c[axis])
                .fold(f64::INFINITY, f64::min);
            let high = corners
                .iter()
                .map(|c| c[axis])
                .fold(f64::NEG_INFINITY, f64::max);
            low as i32..=high as i32
        };
        for h in bounds(0) {
            for k in bounds(1) {
                let index = Vector2::new(f64::from(h), f64::from(k));
                if !corners.contains(&index) && contains(&corners, index) {
                    mesh.missing.push(middle + linear * (index - centre));
                }
            }
        }
    }
}

/// Area of a polygon, positive if it runs counter-clockwise.
fn area(corners: &[Vector2<f64>]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    0.5 * corners
        .iter()
        .zip(next)
        .map(|(a, b)| a.perp(b))
        .sum::<f64>()
}

fn contains(corners: &[Vector2<f64>], place: Vector2<f64>) -> bool {
    let region = crate::region::polygon::Region {
        name: String::new(),
        corners: corners.to_vec(),
    };
    region.contains(place)
}
