//! Images with a known lattice, made by their definition.

use moiregauge::frame::Geometry;
use moiregauge::frame::Image;
use moiregauge::numbers::stream;
use nalgebra::{Matrix2, Vector2};
use rand_distr::{Distribution, StandardNormal};

/// What a test image holds.
pub struct Scene {
    pub size: [usize; 2],
    /// Real-space pair, px.
    pub basis: Matrix2<f64>,
    /// Amplitudes of the first, second and third shell.
    pub shells: [f64; 3],
    pub noise: f64,
    pub line_noise: f64,
    pub plane: f64,
    pub seed: u64,
}

impl Scene {
    /// A lattice of `periods` periods across a square frame, turned by `angle`, a little distorted.
    pub fn new(size: usize, periods: f64, angle: f64, seed: u64) -> Self {
        let length = size as f64 / periods;
        let (s, c) = angle.sin_cos();
        let turn = Matrix2::new(c, -s, s, c);
        let hexagon = Matrix2::new(1.0, 0.5, 0.0, 0.75f64.sqrt()) * length;
        let stretch = Matrix2::new(1.04, 0.01, 0.01, 0.97);
        Self {
            size: [size, size],
            basis: stretch * turn * hexagon,
            shells: [1.0, 0.0, 0.0],
            noise: 0.0,
            line_noise: 0.0,
            plane: 0.0,
            seed,
        }
    }

    pub fn geometry(&self) -> Geometry {
        Geometry::nominal(
            self.size,
            self.size[0] as f64 - 1.0,
            (self.size[1] as f64) * (self.size[0] as f64 - 1.0) / self.size[0] as f64,
            0.0,
            Vector2::zeros(),
        )
        .unwrap()
    }

    pub fn image(&self) -> Image {
        let dual = self.basis.try_inverse().unwrap().transpose() * std::f64::consts::TAU;
        let shells: [&[(f64, f64)]; 3] = [
            &[(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)],
            &[(1.0, -1.0), (2.0, 1.0), (1.0, 2.0)],
            &[(2.0, 0.0), (0.0, 2.0), (2.0, 2.0)],
        ];
        let mut rng = stream(self.seed, "scene", 0);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut waves = Vec::new();
        for (amplitude, shell) in self.shells.iter().zip(shells) {
            for &(h, k) in shell {
                waves.push((*amplitude, dual * Vector2::new(h, k), 3.0 * normal()));
            }
        }
        waves.retain(|w| w.0 != 0.0);
        let [columns, rows] = self.size;
        let mut values = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            let offset = self.line_noise * normal();
            for column in 0..columns {
                let n = Vector2::new(column as f64, row as f64);
                let lattice: f64 = waves
                    .iter()
                    .map(|(a, q, p)| a * (q.dot(&n) + p).cos())
                    .sum();
                let plane = self.plane * (column as f64 - 0.5 * row as f64) / columns as f64;
                values.push(lattice + offset + plane + self.noise * normal());
            }
        }
        Image::new(rows, columns, values)
    }
}

/// `lattice` in the labelling closest to `truth`.
pub fn like(lattice: &Matrix2<f64>, truth: &Matrix2<f64>) -> Matrix2<f64> {
    let mut best = *lattice;
    for a in -1..=1 {
        for b in -1..=1 {
            for c in -1..=1 {
                for d in -1..=1 {
                    let u = Matrix2::new(f64::from(a), f64::from(b), f64::from(c), f64::from(d));
                    if u.determinant().abs() == 1.0
                        && (lattice * u - truth).norm() < (best - truth).norm()
                    {
                        best = lattice * u;
                    }
                }
            }
        }
    }
    best
}
