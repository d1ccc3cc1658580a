//! The mean of a lattice that changes across its patch.
//!
//! The phases of the three first waves, seen under a narrow window, are fitted with smooth functions: a plane for a
//! lattice that is the same everywhere, a quadratic form for one that changes evenly, cubic splines for any other. What the data pay
//! for decides (BIC). The mean of the slopes over the patch is the mean lattice: that of its unit cells, which no
//! transform of the whole patch gives, since there the ends weigh less than the middle.
//!
//! # References
//! Schwarz, Ann. Stat. 6, 461 (1978), BIC; Eilers and Marx, Statistical Science 11, 89 (1996), splines.

use heterostrain::lattice::{Px, Waves};
use nalgebra::{DMatrix, Matrix2, Matrix3, Matrix4, Vector2, Vector4};
use serde::{Deserialize, Serialize};

use crate::coverage::cells::Cells;
use crate::coverage::choose::{ChangeModel, Chosen, choose, choose_change};
use crate::coverage::higher;
use crate::coverage::hollows::hollows;
use crate::coverage::nodes::{Node, View, nodes};
use crate::coverage::patch::LatticeRegion;
use crate::coverage::phases::{Fit, fit, powers, rows};
use crate::coverage::slopes::{Slopes, area, slopes};
use crate::coverage::windows::straightened;
use crate::numbers::exact;
use crate::numbers::three::three;

/// An edge cuts a window off that makes the variance of a phase larger than this, times the least.
const WHOLE_WINDOW: f64 = 1.5;

/// Fewer nodes than this tell nothing of a lattice: twice as many as a phase that is a plane has numbers.
const FEWEST_INNER: usize = 6;

/// Rounds in which what windows make of a description is taken off: each leaves a tenth or two of what the one before left.
const STRAIGHTENED: usize = 3;

/// Where the frame ends is known, but windows see only half of what is there: the share of what is told of an edge in the frame. By the
/// coverage of a hundred simulated sets whose twist or strain swings once across the frame.
const FRAME_ENDS: f64 = 1.0 / 6.0;

/// How a lattice changes across its patch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Change {
    /// What describes it.
    pub model: ChangeModel,
    /// Standard deviation of the wavelengths over the patch as a share of their mean, the most of the three.
    #[serde(with = "exact")]
    pub wavelength: f64,
    /// Standard deviation of their directions, rad.
    #[serde(with = "exact")]
    pub angle: f64,
    /// By how much the evidence (BIC) for it, as windows show it, exceeds that for a lattice that is the same everywhere; below 20 and even negative where
    /// the fit to the pixels says that the lattice changes.
    #[serde(with = "exact")]
    pub evidence: f64,
}

/// The mean of a lattice over its patch.
pub(crate) struct Mean {
    /// Rad per pixel.
    pub(crate) waves: Waves<Px>,
    /// What they would be with the finest description.
    pub(crate) other: Matrix2<f64>,
    /// The part of their covariance that comes from where the patch ends.
    pub(crate) edges: Matrix4<f64>,
    /// `None` where it is the same everywhere, as far as can be seen.
    pub(crate) change: Option<Change>,
    /// Phases of the three first waves at `middle` and their covariance.
    pub(crate) phases: [f64; 3],
    pub(crate) phase_covariance: Matrix3<f64>,
    /// Where the phases hold, pixels.
    pub(crate) middle: Vector2<f64>,
    /// Amplitude over noise amplitude in one resolution cell of the patch, weakest of the three.
    pub(crate) signal_to_noise: f64,
    /// χ² over its degrees of freedom, 1 at least.
    reduced: f64,
    /// What is left of the phases, rad, root mean square.
    left: f64,
}

/// Largest variation (standard deviation) of wavelengths or directions of a lattice. Half and twice as much change no
/// result of docs/constants.md.
const WILD: f64 = 0.25;

/// Standard deviation of the waves times the periods across: the phase bends by 2π √12/8 times that, half a radian here.
const GENTLE: f64 = 0.18;

/// χ² over its degrees of freedom beyond which the phases are not those of one lattice: noise is known far better.
const POOR: f64 = 9.0;

/// ..., if so much is left of them, rad, root mean square: half of what two grains leave that are a wave apart across a patch.
const LEFT: f64 = 0.25;

impl Mean {
    /// Whether the phases are not those of one lattice that changes smoothly.
    pub(crate) fn is_poor(&self) -> bool {
        let wild = |change: Change| change.wavelength.max(change.angle) > WILD;
        (self.reduced > POOR && self.left > LEFT) || self.change.is_some_and(wild)
    }

    /// Whether the wave vectors change in proportion to the place and bend the phases of this number of unit cells so little
    /// that a straight wave still fits.
    pub(crate) fn is_gentle(&self, unit_cells: f64) -> bool {
        let bent = |change: &Change| change.wavelength.max(change.angle) * unit_cells.sqrt();
        let even = self
            .change
            .filter(|change| change.model == ChangeModel::Even);
        even.is_some_and(|change| bent(&change) < GENTLE)
    }

    /// The same in pixels of which `bins` make one along each axis.
    pub(crate) fn in_pixels(self, bins: usize) -> Self {
        let size = bins as f64;
        Self {
            waves: self.waves.mapped(&(Matrix2::identity() / size)),
            other: self.other / size,
            edges: self.edges / (size * size),
            middle: self.middle * size + Vector2::repeat((size - 1.0) / 2.0),
            ..self
        }
    }
}

/// The mean over a patch; `None` where its phases cannot be described.
pub(crate) fn mean(view: &View, patch: &LatticeRegion) -> Option<Mean> {
    let nodes = nodes(view, patch);
    let chosen = choose(view, patch, &nodes)?;
    Some(summary(&chosen, &nodes, view, patch))
}

/// The same without what higher harmonics put into the windows, and without what windows make of waves that bend.
pub(crate) fn refined(view: &View, patch: &LatticeRegion) -> Option<Mean> {
    refined_by(choose, view, patch)
}

/// The same for a lattice that is known to change.
pub(crate) fn refined_change(view: &View, patch: &LatticeRegion) -> Option<Mean> {
    refined_by(choose_change, view, patch)
}

fn refined_by(
    choose: impl Fn(&View, &LatticeRegion, &[Node]) -> Option<Chosen>,
    view: &View,
    patch: &LatticeRegion,
) -> Option<Mean> {
    let rough = choose(view, patch, &nodes(view, patch))?;
    let parts = higher::parts(view, patch, &rough.fit)?;
    // Waves that the envelopes stand still against: where exactly a phase holds does not matter then.
    let patch = &LatticeRegion {
        pair: patch.pair + slopes(&rough.fit, view.cells, patch).mean,
        ..patch.clone()
    };
    // What the windows see beside the waves with all that leaks into them stands for what still does.
    let left = parts.noise(view.cells, patch, view.width, &hollows(&patch.pair));
    let view = View {
        image: &parts.first,
        noise: [0, 1, 2].map(|i| view.noise[i].max(left[i])),
        ..*view
    };
    let read = nodes(&view, patch);
    let mut nodes = read.clone();
    let mut chosen = choose(&view, patch, &nodes)?;
    for _ in 0..STRAIGHTENED {
        if chosen.model.is_none() {
            break;
        }
        nodes = straightened(&view, patch, &read, &chosen.fit);
        chosen = choose(&view, patch, &nodes)?;
    }
    Some(summary(&chosen, &nodes, &view, patch))
}

/// χ² of the best description of some nodes, its parameters, and the number of independent phases that it describes.
pub(crate) fn described(view: &View, patch: &LatticeRegion, nodes: &[Node]) -> Option<[f64; 3]> {
    let fit = choose(view, patch, nodes)?.fit;
    Some([fit.chi2, fit.coefficients.len() as f64, fit.independent])
}

/// The same for one lattice that is the same everywhere; `None` where the phases are not those of one.
pub(crate) fn described_as_straight(patch: &LatticeRegion, nodes: &[Node]) -> Option<[f64; 3]> {
    let fit = fit(powers(patch, 1), nodes)?;
    let straight = fit.left < LEFT;
    straight.then_some([fit.chi2, fit.coefficients.len() as f64, fit.independent])
}

/// By how much the mean `step` (ψ₁ and ψ₂, a column each) would differ with another choice.
struct Otherwise {
    /// By the next description or, where the lattice is the same everywhere, by the nodes whose windows no edge cuts off.
    next: Matrix2<f64>,
    /// By the finest description, where that is another one.
    finest: Option<Matrix2<f64>>,
}

fn otherwise(
    chosen: &Chosen,
    step: &Matrix2<f64>,
    nodes: &[Node],
    view: &View,
    patch: &LatticeRegion,
) -> Otherwise {
    let inner = || {
        let least = nodes.iter().map(|n| n.gain).fold(f64::INFINITY, f64::min);
        let inner: Vec<Node> = (nodes.iter())
            .filter(|node| node.gain < WHOLE_WINDOW * least)
            .cloned()
            .collect();
        let enough = inner.len() >= FEWEST_INNER && inner.len() < nodes.len();
        enough.then(|| fit(powers(patch, 1), &inner)).flatten()
    };
    let again = if chosen.model.is_none() {
        inner()
    } else {
        None
    };
    let off = |other: &Fit| slopes(other, view.cells, patch).mean - step;
    let next = chosen.next.as_ref().or(again.as_ref());
    Otherwise {
        next: next.map_or_else(Matrix2::zeros, off),
        finest: chosen.finest.as_ref().map(off),
    }
}

fn summary(chosen: &Chosen, nodes: &[Node], view: &View, patch: &LatticeRegion) -> Mean {
    let cells = view.cells;
    let fit = &chosen.fit;
    let reach = Vector2::from_fn(|axis, _| view.width * view.cells.period[axis]);
    let size = fit.coefficients.len();
    let Slopes {
        sums,
        mean: step,
        local,
        pixels,
    } = slopes(fit, cells, patch);
    let covariance = fit.covariance(&sums, nodes, reach);
    let covariance = Matrix4::from_column_slice(covariance.as_slice());
    let edges = edges(fit, cells, patch, &step);
    let Otherwise { next, finest } = otherwise(chosen, &step, nodes, view, patch);
    let square = |off: &Matrix2<f64>| {
        let off = Vector4::from_column_slice(off.as_slice());
        off * off.transpose()
    };
    let doubt = square(&next) + finest.as_ref().map_or_else(Matrix4::zeros, square);
    let covariance = covariance + edges + doubt;
    let pair = patch.pair + step;
    let middle = patch.middle(cells);
    let mut at_middle = DMatrix::zeros(3, size);
    for (wave, row) in rows(&fit.basis, middle).iter().enumerate() {
        for (i, x) in row {
            at_middle[(wave, *i)] += x;
        }
    }
    let waves = [patch.pair.column(0), patch.pair.column(1)].map(|q| q.dot(&middle));
    let carried = [waves[0], waves[1], waves[1] - waves[0]];
    let phases = &at_middle * &fit.coefficients;
    let phase_covariance = fit.covariance(&at_middle, nodes, reach);
    let (wavelength, angle) = spread(&pair, &step, &local, pixels);
    Mean {
        waves: Waves::new(pair, covariance),
        other: pair + finest.unwrap_or(next),
        edges,
        change: chosen.model.map(|model| Change {
            model,
            wavelength,
            angle,
            evidence: chosen.evidence,
        }),
        phases: [0, 1, 2].map(|i| phases[i] + carried[i]),
        phase_covariance: Matrix3::from_column_slice(phase_covariance.as_slice()),
        middle,
        signal_to_noise: view.signal_to_noise,
        reduced: fit.enlarged,
        left: fit.left,
    }
}

/// What the mean owes to where the patch begins and ends on the sample: moved by x, it changes by x times the mean of
/// the second derivatives of the phases. A place is known to a period at most, evenly: 1/√12 of it, and where the frame ends to a share of
/// that.
fn edges(fit: &Fit, cells: &Cells, patch: &LatticeRegion, mean: &Matrix2<f64>) -> Matrix4<f64> {
    let local = |cell: [usize; 2]| {
        let mut slopes = Matrix2::<f64>::zeros();
        for (i, [_, along, across]) in fit.basis.at(cells.middle(cell)) {
            for wave in 0..2 {
                let c = fit.coefficients[wave * fit.basis.len() + i];
                slopes[(0, wave)] += c * along;
                slopes[(1, wave)] += c * across;
            }
        }
        slopes - mean
    };
    let [across, up] = cells.size;
    let inside = area(cells, patch);
    // How far the area is open towards a cell.
    let open = |x: Option<usize>, y: Option<usize>| match (x, y) {
        (Some(x), Some(y)) if x < across && y < up => f64::from(u8::from(!inside[y * across + x])),
        _ => FRAME_ENDS,
    };
    let mut sums = [Matrix2::zeros(); 2];
    let mut count = 0.0;
    for i in (0..cells.len()).filter(|&i| inside[i]) {
        let (x, y) = (i % across, i / across);
        count += 1.0;
        // A cell at the far edge comes in, one at the near edge goes out.
        let sides = [
            open(Some(x + 1), Some(y)) - open(x.checked_sub(1), Some(y)),
            open(Some(x), Some(y + 1)) - open(Some(x), y.checked_sub(1)),
        ];
        if sides != [0.0; 2] {
            let here = local([x, y]);
            for (sum, side) in sums.iter_mut().zip(sides) {
                *sum += here * side;
            }
        }
    }
    let mut covariance = Matrix4::zeros();
    for (axis, sum) in sums.iter().enumerate() {
        let moved = cells.period[axis] / cells.pixels[axis] as f64 / 12f64.sqrt();
        let change = Vector4::from_column_slice((sum * (moved / count)).as_slice());
        covariance += change * change.transpose();
    }
    covariance
}

/// Standard deviation of the wavelengths (share) and directions (rad) of the local lattices, the most of three.
fn spread(
    pair: &Matrix2<f64>,
    mean: &Matrix2<f64>,
    local: &[(f64, Matrix2<f64>)],
    pixels: f64,
) -> (f64, f64) {
    let waves = three(pair);
    let mut sums = [[0.0; 2]; 3];
    for (count, slopes) in local {
        for ((sum, change), wave) in sums.iter_mut().zip(three(&(slopes - mean))).zip(&waves) {
            let length = wave.norm_squared();
            sum[0] += count * (change.dot(wave) / length).powi(2);
            sum[1] += count * (change.perp(wave) / length).powi(2);
        }
    }
    let most = |i: usize| sums.iter().map(|s| s[i]).fold(0.0, f64::max);
    ((most(0) / pixels).sqrt(), (most(1) / pixels).sqrt())
}
