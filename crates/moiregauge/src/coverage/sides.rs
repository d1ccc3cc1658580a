//! Beside the sides of a frame.
//!
//! There the sides cut windows off, and what is left of one lies inwards: its mean is what is further in, and a lattice that ends close to a
//! side seems to go on to it. A straight line through the envelope, by least squares under the window, says what is at the place itself.
//! Its noise is larger, so that a cell is taken away only where it is plainly less than what makes a cell part of the lattice.

use std::collections::HashMap;

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::coverage::cells::Window;
use crate::coverage::look::{Frame, INSIDE, Seen, Waves};

/// Windows of which less than this is there are cut off.
const CUT: f64 = 0.9;

/// A cell is taken away if it has less than is asked of it by so many standard deviations of its noise: by chance one cell of forty that
/// has just enough.
const PLAINLY: f64 = 2.0;

/// Cells that a thread looks at together, at least.
const AT_ONCE: usize = 1024;

/// Takes away the cells beside the sides of a frame whose own place carries no lattice.
pub(crate) fn without_tails(
    frame: &Frame,
    waves: &Waves,
    window: &Window,
    seen: &Seen,
) -> Vec<bool> {
    let sums = waves.without(&frame.level(window));
    let asked = INSIDE * seen.typical.iter().sum::<f64>();
    let stays = |lines: &mut Lines, n: usize| {
        let Some(line) = lines.at(n) else {
            return true;
        };
        let found = line.values(&sums, n).into_iter().zip(seen.typical);
        let found = found.map(|(value, typical)| value.norm() * typical.sqrt());
        let noise = seen.noise.iter().zip(seen.typical);
        let noise = noise.map(|(noise, typical)| noise * typical).sum::<f64>() * line.noise;
        found.sum::<f64>() > asked - PLAINLY * (noise / 2.0).sqrt()
    };
    let cells = seen.inside.par_iter().zip(&window.support).enumerate();
    cells
        .with_min_len(AT_ONCE)
        .map_init(
            || Lines::new(frame, window),
            |lines, (n, (inside, support))| *inside && (*support > CUT || stays(lines, n)),
        )
        .collect()
}

/// Straight lines at cells. Cells that see as much of the frame on all sides, and as many pixels in each cell there, have the same one.
struct Lines<'a> {
    frame: &'a Frame<'a>,
    window: &'a Window,
    /// The last one for each extent of the window, with the pixels of the cells under it.
    known: HashMap<[usize; 4], (Vec<f64>, Option<Line>)>,
}

impl<'a> Lines<'a> {
    fn new(frame: &'a Frame, window: &'a Window) -> Self {
        let known = HashMap::new();
        Self {
            frame,
            window,
            known,
        }
    }

    /// `None` where the cells under the window lie on a line.
    fn at(&mut self, n: usize) -> Option<&Line> {
        let cells = self.frame.cells;
        let across = cells.size[0];
        let [x, y] = self.window.under(cells.size, n);
        let pixels = || y.clone().map(|y| &cells.counts()[y * across..][x.clone()]);
        let extent = [
            n % across - x.start,
            x.end - n % across,
            n / across - y.start,
            y.end - n / across,
        ];
        let (before, line) = self.known.entry(extent).or_default();
        let lines = before.chunks_exact(x.len());
        if before.is_empty() || !lines.eq(pixels()) {
            *before = pixels().flatten().copied().collect();
            *line = Line::at(self.frame, self.window, n);
        }
        line.as_ref()
    }
}

/// A straight line through the cells under the window at one of them: its value there is a weighted sum.
struct Line {
    /// Weights of cells, by how far behind that one they come.
    weights: Vec<(isize, f64)>,
    /// Variance that white noise of unit power per pixel gives the value.
    noise: f64,
}

impl Line {
    /// `None` where the cells under the window lie on a line.
    fn at(frame: &Frame, window: &Window, n: usize) -> Option<Self> {
        let counts = frame.cells.counts();
        let under: Vec<(usize, f64, Vector3<f64>)> = window
            .cells(frame.cells.size, n)
            .filter(|(cell, ..)| counts[*cell] > 0.0)
            .map(|(cell, [x, y], tap)| (cell, tap, Vector3::new(1.0, x, y)))
            .collect();
        let mut normal = Matrix3::zeros();
        for (cell, tap, place) in &under {
            normal += place * place.transpose() * (tap * counts[*cell]);
        }
        let first = normal.try_inverse()?.row(0).transpose();
        let weights = under
            .iter()
            .map(|(cell, tap, place)| (*cell, tap * first.dot(place)));
        let weights: Vec<(usize, f64)> = weights.collect();
        let noise = weights.iter().map(|(cell, w)| w * w * counts[*cell]).sum();
        let from_here = |(cell, w): (usize, f64)| (cell as isize - n as isize, w);
        Some(Self {
            weights: weights.into_iter().map(from_here).collect(),
            noise,
        })
    }

    /// Those of three waves.
    fn values(&self, sums: &[Vec<Complex64>; 3], n: usize) -> [Complex64; 3] {
        let mut values = [Complex64::default(); 3];
        for (by, w) in &self.weights {
            let cell = n.wrapping_add_signed(*by);
            for (value, sums) in values.iter_mut().zip(sums) {
                *value += sums[cell] * w;
            }
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use crate::coverage::settle::settle;
    use crate::frame::image::Image;
    use crate::numbers::three::three;

    /// A lattice that ends half a period before the lower side of the frame, beside a step, does not go on to it, but for the corners; one
    /// that goes on to all sides does.
    #[test]
    fn a_lattice_that_ends_near_a_side_does_not_reach_it() {
        let pair = Matrix2::new(0.25, 0.125, 0.0, 0.2165);
        let inside = |first: f64| {
            let values = (0..192 * 192).map(|i| {
                let at = Vector2::new(f64::from(i % 192), f64::from(i / 192));
                let noise = 0.3 * f64::from((i * 7919 + i / 192 * 104_729) % 1009) / 1009.0;
                let waves = three(&pair).map(|q| q.dot(&at).cos()).iter().sum::<f64>();
                noise + if at.y < first { -2.5 } else { waves }
            });
            let image = Image::new(192, 192, values.collect());
            let settled = settle(&image, &pair, [1.0, 1.0]).unwrap();
            let (patch, mut below, mut all) = (settled.patch, 0, 0);
            for row in 0..192 {
                for column in 0..192 {
                    let holds = patch.holds([column, row]);
                    below += usize::from(holds && (row as f64) < first);
                    all += usize::from(holds);
                }
            }
            (below, all)
        };
        let (below, all) = inside(14.0);
        // In the corners, where little of a window is there, noise may hide that.
        assert!(below < 14 * 192 / 4, "{below}");
        assert!(all > 192 * 150, "{all}");
        assert_eq!(inside(0.0), (0, 192 * 192));
    }
}
