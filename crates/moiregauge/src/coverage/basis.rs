//! Functions of the place: powers, or splines.

use nalgebra::Vector2;

use crate::numbers::splines::Splines;

/// The functions that describe ψ₁ and ψ₂.
pub(crate) enum Basis {
    /// Powers of x and y up to a degree, on −1 … 1.
    Powers {
        degree: usize,
        middle: Vector2<f64>,
        half: Vector2<f64>,
    },
    Splines(Splines),
}

impl Basis {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Powers { degree, .. } => (degree + 1) * (degree + 2) / 2,
            Self::Splines(splines) => splines.size().iter().product(),
        }
    }

    /// The functions that are not zero at a place: position, value and slopes.
    pub(crate) fn at(&self, at: Vector2<f64>) -> Vec<(usize, [f64; 3])> {
        let mut all = Vec::new();
        self.put(at, &mut all);
        all
    }

    /// The same in place of what was there.
    pub(crate) fn put(&self, at: Vector2<f64>, out: &mut Vec<(usize, [f64; 3])>) {
        out.clear();
        match self {
            Self::Powers {
                degree,
                middle,
                half,
            } => {
                let p = (at - middle).component_div(half);
                let power = |x: f64, n: usize| [x.powi(n as i32), n as f64 * x.powi(n as i32 - 1)];
                let of = |[a, b]: [usize; 2]| {
                    let ([x, dx], [y, dy]) = (power(p.x, a), power(p.y, b));
                    let slope = |n: usize, value: f64| if n == 0 { 0.0 } else { value };
                    [x * y, slope(a, dx * y) / half.x, slope(b, x * dy) / half.y]
                };
                let all = (0..=*degree).flat_map(|total| (0..=total).map(move |b| [total - b, b]));
                out.extend(all.map(of).enumerate());
            }
            Self::Splines(splines) => {
                let s = splines.at(at);
                let all = (0..16).map(|i| (s.places[i], [s.values[i], s.along[i], s.across[i]]));
                out.extend(all);
            }
        }
    }
}
