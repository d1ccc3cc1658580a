//! Images of relaxed moirés at small angles: bright nodes, sharp walls between them, triangular domains.
//!
//! In: a lattice, a smooth displacement, missing nodes, a dislocation. Out: an image in pixels and the exact places
//! of its nodes. It shares nothing with what looks for them.

use nalgebra::{Matrix2, Vector2};
use rand_distr::{Distribution, StandardNormal};

use crate::frame::image::Image;
use crate::numbers::rng;

/// Nodes, walls and noise.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DomainScene {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Two primitive vectors as columns, 60° apart, pixels.
    pub lattice: Matrix2<f64>,
    /// Nodes move by `amplitude · sin(wave · place + phase)`: wave vector, phase, amplitude (pixels).
    pub ripples: Vec<(Vector2<f64>, f64, Vector2<f64>)>,
    /// Random displacement of every node, pixels.
    pub disorder: f64,
    /// Indices of nodes that are not there, nor the walls that end at them.
    pub missing: Vec<[i32; 2]>,
    /// A dislocation with the first primitive vector as its Burgers vector: where, pixels.
    pub dislocation: Option<Vector2<f64>>,
    /// Height and width (standard deviation, pixels) of a node.
    pub node: [f64; 2],
    /// Height and width of a wall.
    pub wall: [f64; 2],
    /// Standard deviation of white noise.
    pub white: f64,
    /// Standard deviation of an offset per line.
    pub line: f64,
    /// Seed of all that is random.
    pub seed: u64,
}

impl DomainScene {
    /// Nodes `period` pixels apart, the first vector at `angle` to x.
    pub fn hexagonal(size: [usize; 2], period: f64, angle: f64) -> Self {
        let vector = |t: f64| Vector2::new(t.cos(), t.sin()) * period;
        Self {
            size,
            lattice: Matrix2::from_columns(&[
                vector(angle),
                vector(angle + std::f64::consts::FRAC_PI_3),
            ]),
            ripples: Vec::new(),
            disorder: 0.0,
            missing: Vec::new(),
            dislocation: None,
            node: [1.0, 0.1 * period],
            wall: [0.4, 0.04 * period],
            white: 0.0,
            line: 0.0,
            seed: 1,
        }
    }

    /// Indices and places (column, row) of the nodes in and around the frame.
    pub fn nodes(&self) -> Vec<([i32; 2], Vector2<f64>)> {
        let centre = Vector2::new(self.size[0] as f64, self.size[1] as f64) / 2.0;
        let period = self.lattice.column(0).norm();
        let reach = (1.3 * (centre.norm() + 3.0 * period) / period).ceil() as i32;
        let mut rng = rng::stream(self.seed, "domain nodes", 0);
        let mut nodes = Vec::new();
        for j in -reach..=reach {
            for i in -reach..=reach {
                let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
                let scatter = self.disorder * Vector2::new(normal(), normal());
                let place = centre + self.lattice * Vector2::new(f64::from(i), f64::from(j));
                let place = place + self.displacement(place) + scatter;
                let margin = 2.0 * period;
                let inside = (0..2)
                    .all(|axis| (-margin..self.size[axis] as f64 + margin).contains(&place[axis]));
                if inside && !self.missing.contains(&[i, j]) {
                    nodes.push(([i, j], place));
                }
            }
        }
        nodes
    }

    fn displacement(&self, place: Vector2<f64>) -> Vector2<f64> {
        let mut out = Vector2::zeros();
        for (wave, phase, amplitude) in &self.ripples {
            out += amplitude * (wave.dot(&place) + phase).sin();
        }
        if let Some(core) = self.dislocation {
            // The cut runs along the Burgers vector: nothing is added or taken away there.
            let burgers = self.lattice.column(0).into_owned();
            let (along, d) = (burgers.normalize(), place - core);
            let angle = along.perp(&d).atan2(along.dot(&d));
            out += burgers * angle / std::f64::consts::TAU;
        }
        out
    }

    /// The image.
    pub fn image(&self) -> Image {
        let [columns, rows] = self.size;
        let nodes: Vec<Vector2<f64>> = self.nodes().into_iter().map(|n| n.1).collect();
        let period = self.lattice.column(0).norm();
        let mut walls = vec![0.0f64; columns * rows];
        let mut values = vec![0.0f64; columns * rows];
        let paint =
            |low: Vector2<f64>, high: Vector2<f64>, paint: &mut dyn FnMut(usize, Vector2<f64>)| {
                let range = |axis: usize, count: usize| {
                    let from = low[axis].floor().clamp(0.0, count as f64) as usize;
                    from..(high[axis].ceil() + 1.0).clamp(0.0, count as f64) as usize
                };
                for row in range(1, rows) {
                    for column in range(0, columns) {
                        paint(
                            row * columns + column,
                            Vector2::new(column as f64, row as f64),
                        );
                    }
                }
            };
        for (i, a) in nodes.iter().enumerate() {
            for b in &nodes[i + 1..] {
                let way = b - a;
                if way.norm() > 1.35 * period {
                    continue;
                }
                let reach = Vector2::repeat(4.0 * self.wall[1]);
                paint(a.inf(b) - reach, a.sup(b) + reach, &mut |n, at| {
                    let share = ((at - a).dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
                    let away = (at - a - share * way).norm() / self.wall[1];
                    walls[n] = walls[n].max(self.wall[0] * (-0.5 * away * away).exp());
                });
            }
            let reach = Vector2::repeat(5.0 * self.node[1]);
            paint(a - reach, a + reach, &mut |n, at| {
                let away = (at - a).norm() / self.node[1];
                values[n] += self.node[0] * (-0.5 * away * away).exp();
            });
        }
        for row in 0..rows {
            let mut rng = rng::stream(self.seed, "domain noise", row as u64);
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let offset = self.line * normal();
            for n in row * columns..(row + 1) * columns {
                values[n] += walls[n] + offset + self.white * normal();
            }
        }
        Image::new(rows, columns, values)
    }
}
