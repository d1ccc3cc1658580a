//! What describes the phases of a lattice over its patch: a plane, where it is the same everywhere, or a change.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::coverage::basis::Basis;
use crate::coverage::nodes::{Node, View};
use crate::coverage::patch::LatticeRegion;
use crate::coverage::phases::{Fit, fit, powers};
use crate::numbers::splines::Splines;

/// What describes the phases of a lattice that changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ChangeModel {
    /// The wave vectors change evenly across the patch.
    Even,
    /// The phases are cubic polynomials.
    Cubic,
    /// Any smooth variation, on a number of cells along columns and rows.
    Smooth([usize; 2]),
}

/// Cells of splines along the longer side of the patch that are tried.
const SPLINES: [usize; 7] = [1, 2, 3, 4, 6, 9, 13];

/// Smallest cell of the splines, windows: the window does not resolve less.
const WINDOWS_PER_CELL: f64 = 2.0;

/// By how much the evidence (BIC) of a lattice that changes has to be better: chance does that once in e¹⁰.
pub(crate) const BETTER: f64 = 20.0;

/// What describes the phases over a patch best.
pub(crate) struct Chosen {
    /// `None` for a lattice that is the same everywhere.
    pub(crate) model: Option<ChangeModel>,
    pub(crate) fit: Fit,
    /// By how much its evidence exceeds that for a lattice that is the same everywhere.
    pub(crate) evidence: f64,
    /// The description that comes next, with more numbers or, where it has the most, with fewer.
    pub(crate) next: Option<Fit>,
    /// The description with the most numbers, where there is one with more than the next.
    pub(crate) finest: Option<Fit>,
}

/// The best description; a change only where the data pay for it (BIC).
pub(crate) fn choose(view: &View, patch: &LatticeRegion, nodes: &[Node]) -> Option<Chosen> {
    let straight = fit(powers(patch, 1), nodes)?;
    let even = (ChangeModel::Even, powers(patch, 2));
    let fits = changes(view, patch, nodes, vec![even]);
    let best = cheapest(&fits);
    let best = best.filter(|best| straight.price - fits[*best].1.price > BETTER);
    let Some(best) = best else {
        return Some(Chosen {
            model: None,
            fit: straight,
            evidence: 0.0,
            next: None,
            finest: None,
        });
    };
    chosen(fits, best, &straight)
}

/// The best description of a lattice that is known to change; of a few periods cubic polynomials say it in fewer numbers than splines.
pub(crate) fn choose_change(view: &View, patch: &LatticeRegion, nodes: &[Node]) -> Option<Chosen> {
    let straight = fit(powers(patch, 1), nodes)?;
    let even = (ChangeModel::Even, powers(patch, 2));
    let cubic = (ChangeModel::Cubic, powers(patch, 3));
    let fits = changes(view, patch, nodes, vec![even, cubic]);
    let best = cheapest(&fits)?;
    chosen(fits, best, &straight)
}

fn cheapest(fits: &[(ChangeModel, Fit)]) -> Option<usize> {
    let by_price = |a: &usize, b: &usize| fits[*a].1.price.total_cmp(&fits[*b].1.price);
    (0..fits.len()).min_by(by_price)
}

/// The phases by some powers, and by splines of as many cells as their windows see.
fn changes(
    view: &View,
    patch: &LatticeRegion,
    nodes: &[Node],
    powers: Vec<(ChangeModel, Basis)>,
) -> Vec<(ChangeModel, Fit)> {
    let frame = patch.corners();
    let half = (frame[1] - frame[0]) / 2.0;
    let window = [0, 1].map(|axis| view.width * view.cells.period[axis]);
    let sizes = SPLINES.map(|n| {
        let longer = half.x.max(half.y);
        [0, 1].map(|axis| ((n as f64 * half[axis] / longer).ceil() as usize).max(1))
    });
    let smooth = sizes.into_iter().filter(|size| {
        (0..2)
            .all(|i| size[i] == 1 || 2.0 * half[i] / size[i] as f64 > WINDOWS_PER_CELL * window[i])
    });
    let all = powers.into_iter().chain(smooth.map(|size| {
        (
            ChangeModel::Smooth(size),
            Basis::Splines(Splines::new(frame, size)),
        )
    }));
    let all = all.take_while(|(_, basis)| 2 * basis.len() < nodes.len());
    let all: Vec<(ChangeModel, Basis)> = all.collect();
    let fits = all
        .into_par_iter()
        .map(|(model, basis)| Some((model, fit(basis, nodes)?)));
    let fits: Vec<Option<(ChangeModel, Fit)>> = fits.collect();
    fits.into_iter().flatten().collect()
}

/// One of some descriptions, the simplest first.
fn chosen(fits: Vec<(ChangeModel, Fit)>, best: usize, straight: &Fit) -> Option<Chosen> {
    let beside = if best + 1 < fits.len() {
        Some(best + 1)
    } else {
        best.checked_sub(1)
    };
    let mut fits: Vec<_> = fits.into_iter().map(Some).collect();
    let (model, chosen) = fits[best].take()?;
    let next = beside.and_then(|i| fits[i].take());
    let finest = fits.pop().flatten();
    Some(Chosen {
        model: Some(model),
        evidence: straight.price - chosen.price,
        fit: chosen,
        next: next.map(|(_, fit)| fit),
        finest: finest.map(|(_, fit)| fit),
    })
}
