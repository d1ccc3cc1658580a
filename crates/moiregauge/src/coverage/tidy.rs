//! Patches of cells without what is too small to be one.

use nalgebra::Matrix2;

use crate::coverage::cells::Cells;
use crate::coverage::patch::unit_cells_per_pixel;

/// Parts of the patch smaller than this share of the largest part are dropped, and so are those of fewer unit cells
/// than [`SMALLEST_PART`].
const PART: f64 = 0.05;
/// See [`PART`].
const SMALLEST_PART: f64 = 3.0;
/// Gaps of fewer unit cells than this are closed: a defect, or noise.
const SMALLEST_GAP: f64 = 1.5;

/// The patch without small gaps and small parts. A gap that is two cells wide, half a period, is a line that went wrong.
pub(crate) fn tidy(cells: &Cells, inside: &[bool], pair: &Matrix2<f64>) -> Vec<bool> {
    let outside: Vec<bool> = inside.iter().map(|i| !i).collect();
    let grown: Vec<bool> = shrunk(cells, &outside).iter().map(|o| !o).collect();
    let mut inside = shrunk(cells, &grown);
    let per_cell = (cells.pixels[0] * cells.pixels[1]) as f64 * unit_cells_per_pixel(pair);
    for gap in parts(cells.size, &inside, false) {
        if (gap.len() as f64) * per_cell < SMALLEST_GAP {
            for i in gap {
                inside[i] = true;
            }
        }
    }
    let all = parts(cells.size, &inside, true);
    let largest = all.iter().map(Vec::len).max().unwrap_or(0) as f64;
    for part in all {
        let cells = part.len() as f64;
        if cells < PART * largest || cells * per_cell < SMALLEST_PART {
            for i in part {
                inside[i] = false;
            }
        }
    }
    inside
}

/// Whether a disc of a diameter in mean periods fits into a patch. A patch that is as narrow as what a window makes of a line
/// is one: of a step, the edge of a terrace, a scratch, with the stairs that pixels make of it.
pub(crate) fn is_broad(cells: &Cells, inside: &[bool], diameter: f64) -> bool {
    let [across, up] = cells.size;
    let radii = [0, 1].map(|axis| diameter / 2.0 * cells.period[axis] / cells.pixels[axis] as f64);
    let reach = radii.map(|r| r as usize);
    // Cells to the left and to the right of the middle, on each line of the disc.
    let half = |line: usize| {
        let left = 1.0 - (line as f64 / radii[1]).powi(2);
        (radii[0] * left.max(0.0).sqrt()) as usize
    };
    let halves: Vec<usize> = (0..=reach[1]).map(half).collect();
    let line_is = |x: usize, y: usize, half: usize| {
        x >= half
            && x + half < across
            && inside[y * across + x - half..=y * across + x + half]
                .iter()
                .all(|i| *i)
    };
    let fits = |x: usize, y: usize| {
        let mut lines = halves.iter().enumerate();
        y >= reach[1]
            && y + reach[1] < up
            && lines.all(|(d, half)| line_is(x, y - d, *half) && line_is(x, y + d, *half))
    };
    (0..inside.len()).any(|i| fits(i % across, i / across))
}

/// The patch without the cells at its edges, but for those of the frame: an edge is known to about a cell, and what
/// lies beyond it is no lattice.
pub(crate) fn shrunk(cells: &Cells, inside: &[bool]) -> Vec<bool> {
    let [across, up] = cells.size;
    let all_around = |i: usize| {
        let (x, y) = (i % across, i / across);
        (y.saturating_sub(1)..=(y + 1).min(up - 1)).all(|y| {
            (x.saturating_sub(1)..=(x + 1).min(across - 1)).all(|x| inside[y * across + x])
        })
    };
    (0..inside.len()).map(all_around).collect()
}

/// The connected parts of the cells that are `wanted`.
fn parts(size: [usize; 2], inside: &[bool], wanted: bool) -> Vec<Vec<usize>> {
    let [across, up] = size;
    let mut seen = vec![false; inside.len()];
    let mut all = Vec::new();
    for start in 0..inside.len() {
        if seen[start] || inside[start] != wanted {
            continue;
        }
        let mut part = vec![start];
        seen[start] = true;
        let mut next = 0;
        while next < part.len() {
            let (x, y) = (part[next] % across, part[next] / across);
            next += 1;
            let neighbours = [
                (x > 0).then(|| y * across + x - 1),
                (x + 1 < across).then(|| y * across + x + 1),
                (y > 0).then(|| (y - 1) * across + x),
                (y + 1 < up).then(|| (y + 1) * across + x),
            ];
            for i in neighbours.into_iter().flatten() {
                if !seen[i] && inside[i] == wanted {
                    seen[i] = true;
                    part.push(i);
                }
            }
        }
        all.push(part);
    }
    all
}

/// Unit cells of the lattice in the patch.
pub(crate) fn area(cells: &Cells, inside: &[bool], pair: &Matrix2<f64>) -> f64 {
    let pixels = inside.iter().zip(cells.counts()).filter(|(i, _)| **i);
    pixels.map(|(_, n)| n).sum::<f64>() * unit_cells_per_pixel(pair)
}
