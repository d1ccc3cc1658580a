//! Beside the sides of a frame.
//!
//! There the sides cut windows off, and what is left of one lies inwards: its mean is what is further in, and a lattice that ends close to a
//! side seems to go on to it. A straight line through the envelope, by least squares under the window, says what is at the place itself.
//! Its noise is larger, so that a cell is taken away only where it is plainly less than what makes a cell part of the lattice.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::coverage::cells::Window;
use crate::coverage::look::{Frame, INSIDE, Seen, Waves};

/// Windows of which less than this is there are cut off.
const CUT: f64 = 0.9;

/// A cell is removed if it is below its threshold by this many standard deviations of its noise: by chance one cell of forty that
/// has just enough.
const PLAINLY: f64 = 2.0;

/// Cells that a thread looks at together, at least.
const AT_ONCE: usize = 1024;

/// Powers of the distances along columns and rows that the sums of a straight line need, and those of its normal equations.
const LINE: [[usize; 2]; 3] = [[0, 0], [1, 0], [0, 1]];
const SQUARES: [[usize; 2]; 6] = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];

/// Takes away the cells beside the sides of a frame whose own place carries no lattice.
pub(crate) fn without_tails(
    frame: &Frame,
    waves: &Waves,
    window: &Window,
    seen: &Seen,
) -> Vec<bool> {
    let cut_off = |n: usize| seen.inside[n] && window.support[n] <= CUT;
    if !(0..seen.inside.len()).any(cut_off) {
        return seen.inside.clone();
    }
    let cells = frame.cells;
    let counts = cells.counts();
    // Σ g n, Σ g n dx, …, and the same with g².
    let normal = SQUARES.map(|powers| cells.moments(counts, window, powers, false));
    let noise = SQUARES.map(|powers| cells.moments(counts, window, powers, true));
    let sums = waves.without(&frame.level(window));
    let sums = sums.map(|sums| LINE.map(|powers| cells.moments(&sums, window, powers, false)));
    let asked = INSIDE * seen.typical.iter().sum::<f64>();
    let stays = |n: usize| {
        // The value of a straight line at the cell itself is a weighted sum: `Σ g (first · (1, dx, dy)) S`.
        let Some(inverse) = symmetric(&normal, n).try_inverse() else {
            return true;
        };
        let first = inverse.row(0).transpose();
        let found = sums.iter().zip(seen.typical).map(|(sums, typical)| {
            let value = (0..3).fold(Complex64::ZERO, |value, i| value + sums[i][n] * first[i]);
            value.norm() * typical.sqrt()
        });
        let of_waves = seen.noise.iter().zip(seen.typical);
        let of_waves = of_waves
            .map(|(noise, typical)| noise * typical)
            .sum::<f64>();
        let variance = of_waves * first.dot(&(symmetric(&noise, n) * first));
        found.sum::<f64>() > asked - PLAINLY * (variance / 2.0).max(0.0).sqrt()
    };
    let all = (0..seen.inside.len()).into_par_iter();
    all.with_min_len(AT_ONCE)
        .map(|n| seen.inside[n] && (!cut_off(n) || stays(n)))
        .collect()
}

/// The matrix of six moments at a cell.
fn symmetric(moments: &[Vec<f64>; 6], n: usize) -> Matrix3<f64> {
    let [one, x, y, xx, xy, yy] = moments.each_ref().map(|moment| moment[n]);
    Matrix3::from_columns(&[
        Vector3::new(one, x, y),
        Vector3::new(x, xx, xy),
        Vector3::new(y, xy, yy),
    ])
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
