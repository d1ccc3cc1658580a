//! The slopes of phases over a patch.

use std::borrow::Cow;

use nalgebra::{DMatrix, Matrix2};
use rayon::prelude::*;

use crate::coverage::cells::Cells;
use crate::coverage::patch::{LatticeRegion, WHOLE};
use crate::coverage::phases::Fit;

/// The slopes of ψ₁ and ψ₂ over a patch.
pub(crate) struct Slopes {
    /// Their means as sums over the coefficients, a row each.
    pub(super) sums: DMatrix<f64>,
    /// Their means, a column each.
    pub(super) mean: Matrix2<f64>,
    /// Those of each cell, with its pixels.
    pub(super) local: Vec<(f64, Matrix2<f64>)>,
    /// Pixels of the patch.
    pub(super) pixels: f64,
}

/// The cells of which the mean is told: those of the patch; all where it is everywhere but for small gaps.
pub(crate) fn area<'a>(cells: &Cells, patch: &'a LatticeRegion) -> Cow<'a, [bool]> {
    if patch.share > WHOLE {
        cells.counts().iter().map(|count| *count > 0.0).collect()
    } else {
        Cow::Borrowed(&patch.inside)
    }
}

pub(crate) fn slopes(fit: &Fit, cells: &Cells, patch: &LatticeRegion) -> Slopes {
    let n = fit.basis.len();
    let inside = area(cells, patch);
    let lines = (0..cells.size[1]).into_par_iter().map(|row| {
        let mut sums = DMatrix::zeros(4, fit.coefficients.len());
        let (mut local, mut functions) = (Vec::new(), Vec::new());
        let first = row * cells.size[0];
        for cell in (first..first + cells.size[0]).filter(|&c| inside[c]) {
            let count = cells.counts()[cell];
            let mut slopes = Matrix2::zeros();
            fit.basis.put(cells.middle_of(cell), &mut functions);
            for &(i, [_, along, across]) in &functions {
                for wave in 0..2 {
                    let c = fit.coefficients[wave * n + i];
                    for (axis, slope) in [along, across].into_iter().enumerate() {
                        sums[(2 * wave + axis, wave * n + i)] += count * slope;
                        slopes[(axis, wave)] += c * slope;
                    }
                }
            }
            local.push((count, slopes));
        }
        (sums, local)
    });
    let lines: Vec<_> = lines.collect();
    let mut sums = DMatrix::zeros(4, fit.coefficients.len());
    let mut local = Vec::with_capacity(cells.len());
    for (of_line, cells) in lines {
        sums += of_line;
        local.extend(cells);
    }
    let pixels = local.iter().map(|(count, _)| count).sum::<f64>();
    sums /= pixels;
    let mean = &sums * &fit.coefficients;
    Slopes {
        mean: Matrix2::from_column_slice(mean.as_slice()),
        sums,
        local,
        pixels,
    }
}
