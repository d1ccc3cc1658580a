//! The mean of a lattice that changes across its patch.
//!
//! The phases of the three first waves, seen under a narrow window, are fitted with smooth functions: a plane for a
//! lattice that is the same everywhere, a quadratic form for one that changes evenly, cubic splines for any other. What the data pay
//! for decides (BIC). The mean of the slopes over the patch is the mean lattice: that of its unit cells, which no
//! transform of the whole patch gives, since there the ends weigh less than the middle.
//!
//! Differences of phases over a window come first, which need no unwrapping, then the phases themselves.
//!
//! # References
//! Schwarz, Ann. Stat. 6, 461 (1978), BIC; Eilers and Marx, Statistical Science 11, 89 (1996), splines.

use heterostrain::lattice::{Px, Waves};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Matrix4, Vector2};
use rustfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};

use crate::coverage::cells::Cells;
use crate::coverage::local::{Local, local};
use crate::coverage::settle::Patch;
use crate::frame::image::Image;
use crate::numbers::exact;
use crate::numbers::normal_equations::NormalEquations;
use crate::numbers::splines::Splines;

/// Distance of nodes in widths of the window: small patches need every place, ...
const CLOSE: f64 = 1.0;
/// ... and large ones, of more unit cells than this, few nodes. Information is kept by both.
const LARGE: f64 = 400.0;
/// Distance of nodes in large patches.
const STRIDE: f64 = 2.0;
/// Independent phases in a node of one window: nodes closer than a window are correlated.
const INDEPENDENT: f64 = 2.5;
/// The least degrees of freedom by which an error is enlarged: fewer say nothing of the noise.
const FREEDOM: f64 = 4.0;
/// Cells of splines along the longer side of the patch that are tried.
const SPLINES: [usize; 7] = [1, 2, 3, 4, 6, 9, 13];
/// A cell of the splines is at least so many windows wide: what is smaller the window does not see.
const WINDOWS_PER_CELL: f64 = 2.0;
/// Rounds of differences and of phases. Chosen by eye.
const ROUNDS: [usize; 2] = [2, 3];
/// Phases that are off by more than this are not followed: a dislocation, or nothing, rad.
const LOST: f64 = 2.0;
/// What holds coefficients that nothing sees, as a share of the mean of the diagonal.
const STIFFNESS: f64 = 1e-6;
/// By how much the evidence (BIC) of a lattice that changes has to be better: chance does that once in e¹⁰.
const BETTER: f64 = 20.0;

/// Nodes whose errors are correlated by less than this are independent.
const UNCORRELATED: f64 = 1e-3;

/// How a lattice changes across its patch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// What describes it.
    pub model: ChangeModel,
    /// Standard deviation of the wavelengths over the patch as a share of their mean, the most of the three.
    #[serde(with = "exact")]
    pub wavelength: f64,
    /// Standard deviation of their directions, rad.
    #[serde(with = "exact")]
    pub angle: f64,
    /// By how much the evidence (BIC) for it exceeds that for a lattice that is the same everywhere.
    #[serde(with = "exact")]
    pub evidence: f64,
}

/// What describes the phases of a lattice that changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ChangeModel {
    /// The wave vectors change evenly across the patch.
    Even,
    /// Any smooth change, on so many cells along columns and rows.
    Smooth([usize; 2]),
}

/// The mean of a lattice over its patch.
pub(crate) struct Mean {
    /// Rad per pixel.
    pub(crate) waves: Waves<Px>,
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

/// A lattice whose wavelengths or directions change by more than this (standard deviation) is none. Chosen by eye.
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

    /// Whether the wave vectors change in proportion to the place and bend the phases of so many unit cells so little
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
            middle: self.middle * size + Vector2::repeat((size - 1.0) / 2.0),
            ..self
        }
    }
}

/// What the phases of a patch are read from, all in bins.
pub(crate) struct View<'a> {
    pub(crate) image: &'a Image,
    pub(crate) cells: &'a Cells,
    /// The window, mean periods.
    pub(crate) width: f64,
    /// Noise power per pixel at each wave.
    pub(crate) noise: [f64; 3],
    pub(crate) signal_to_noise: f64,
}

/// One place where the phases are read.
#[derive(Clone)]
pub(crate) struct Node {
    pub(crate) at: Vector2<f64>,
    /// Position on the grid of nodes.
    pub(crate) place: [usize; 2],
    pub(crate) envelopes: [Complex64; 3],
    /// Information on the phase of each wave, 1/rad²: that of the pixels that belong to this node alone.
    weights: [f64; 3],
    /// Pixels that belong to this node over those of its window.
    share: f64,
    /// Standard deviation of the phases; that of nodes beside each other is correlated.
    errors: [f64; 3],
}

/// The functions that describe ψ₁ and ψ₂.
enum Basis {
    /// Powers of x and y up to a degree, on −1 … 1.
    Powers {
        degree: usize,
        middle: Vector2<f64>,
        half: Vector2<f64>,
    },
    Splines(Splines),
}

impl Basis {
    fn len(&self) -> usize {
        match self {
            Self::Powers { degree, .. } => (degree + 1) * (degree + 2) / 2,
            Self::Splines(splines) => splines.size().iter().product(),
        }
    }

    /// The functions that are not zero at a place: position, value and slopes.
    fn at(&self, at: Vector2<f64>) -> Vec<(usize, [f64; 3])> {
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
                all.map(of).enumerate().collect()
            }
            Self::Splines(splines) => {
                let s = splines.at(at);
                (0..16)
                    .map(|i| (s.places[i], [s.values[i], s.along[i], s.across[i]]))
                    .collect()
            }
        }
    }
}

/// A fitted description: coefficients of ψ₁, of ψ₂, and what φ₃ has beside ψ₂ − ψ₁.
struct Fit {
    basis: Basis,
    coefficients: DVector<f64>,
    /// Inverse of the normal matrix.
    inverse: DMatrix<f64>,
    /// BIC.
    price: f64,
    /// χ².
    chi2: f64,
    /// Independent phases.
    independent: f64,
    /// By how much variances are enlarged, since χ² is larger than its degrees of freedom.
    enlarged: f64,
    /// What is left of the phases, rad, root mean square.
    left: f64,
}

impl Fit {
    /// Covariance of sums over the coefficients (a row each): what the errors of all nodes, correlated as they are under the
    /// window, do to them.
    fn covariance(&self, sums: &DMatrix<f64>, nodes: &[Node], reach: Vector2<f64>) -> DMatrix<f64> {
        let gains = sums * &self.inverse;
        // What each phase does to the sums, times its error.
        let of_node = |node: &Node| {
            rows(&self.basis, node.at).map(|row| {
                let mut gain = DVector::zeros(sums.nrows());
                for (i, x) in row {
                    gain += gains.column(i) * x;
                }
                gain
            })
        };
        let all: Vec<[DVector<f64>; 3]> = nodes
            .iter()
            .map(|node| {
                let mut gains = of_node(node);
                for (wave, gain) in gains.iter_mut().enumerate() {
                    *gain *= node.weights[wave] * node.errors[wave];
                }
                gains
            })
            .collect();
        let mut covariance = DMatrix::zeros(sums.nrows(), sums.nrows());
        for (i, a) in nodes.iter().enumerate() {
            for (j, b) in nodes.iter().enumerate().skip(i) {
                let d = (b.at - a.at).component_div(&reach);
                let correlation = (-0.25 * d.norm_squared()).exp();
                if correlation < UNCORRELATED {
                    continue;
                }
                for (first, second) in all[i].iter().zip(&all[j]) {
                    let product = correlation * first * second.transpose();
                    covariance += &product;
                    if i != j {
                        covariance += product.transpose();
                    }
                }
            }
        }
        covariance * self.enlarged
    }
}

/// What describes the phases over a patch best.
struct Chosen {
    /// `None` for a lattice that is the same everywhere.
    model: Option<ChangeModel>,
    fit: Fit,
    /// By how much its evidence exceeds that for a lattice that is the same everywhere.
    evidence: f64,
}

/// The mean over a patch; `None` where its phases cannot be described.
pub(crate) fn mean(view: &View, patch: &Patch) -> Option<Mean> {
    let nodes = nodes(view, patch);
    let chosen = choose(view, patch, &nodes)?;
    Some(summary(&chosen, &nodes, view, patch))
}

/// χ² of the best description of some nodes, its parameters, and the number of independent phases that it describes.
pub(crate) fn described(view: &View, patch: &Patch, nodes: &[Node]) -> Option<[f64; 3]> {
    let fit = choose(view, patch, nodes)?.fit;
    Some([fit.chi2, fit.coefficients.len() as f64, fit.independent])
}

/// The same for one lattice that is the same everywhere; `None` where the phases are not those of one.
pub(crate) fn described_as_straight(patch: &Patch, nodes: &[Node]) -> Option<[f64; 3]> {
    let fit = fit(powers(patch, 1), nodes)?;
    let straight = fit.left < LEFT;
    straight.then_some([fit.chi2, fit.coefficients.len() as f64, fit.independent])
}

/// Powers of x and y up to a degree, on the extent of a patch.
fn powers(patch: &Patch, degree: usize) -> Basis {
    let [low, high] = patch.corners();
    Basis::Powers {
        degree,
        middle: (low + high) / 2.0,
        half: (high - low) / 2.0,
    }
}

fn choose(view: &View, patch: &Patch, nodes: &[Node]) -> Option<Chosen> {
    let frame = patch.corners();
    let half = (frame[1] - frame[0]) / 2.0;
    let straight = fit(powers(patch, 1), nodes)?;
    let window = [0, 1].map(|axis| view.width * view.cells.period[axis]);
    let sizes = SPLINES.map(|n| {
        let longer = half.x.max(half.y);
        [0, 1].map(|axis| ((n as f64 * half[axis] / longer).ceil() as usize).max(1))
    });
    let smooth = sizes.into_iter().filter(|size| {
        (0..2)
            .all(|i| size[i] == 1 || 2.0 * half[i] / size[i] as f64 > WINDOWS_PER_CELL * window[i])
    });
    let even = (ChangeModel::Even, powers(patch, 2));
    let all = std::iter::once(even).chain(smooth.map(|size| {
        (
            ChangeModel::Smooth(size),
            Basis::Splines(Splines::new(frame, size)),
        )
    }));
    let mut best: Option<(ChangeModel, Fit)> = None;
    for (model, basis) in all {
        if 2 * basis.len() + 1 > nodes.len() {
            break;
        }
        let Some(fit) = fit(basis, nodes) else {
            continue;
        };
        if best.as_ref().is_none_or(|(_, best)| fit.price < best.price) {
            best = Some((model, fit));
        }
    }
    Some(match best {
        Some((model, fit)) if straight.price - fit.price > BETTER => Chosen {
            model: Some(model),
            evidence: straight.price - fit.price,
            fit,
        },
        _ => Chosen {
            model: None,
            fit: straight,
            evidence: 0.0,
        },
    })
}

/// The nodes of a patch at which the three waves can be told apart.
pub(crate) fn nodes(view: &View, patch: &Patch) -> Vec<Node> {
    let cells = view.cells;
    let width = [0, 1].map(|axis| view.width * cells.period[axis]);
    let apart = if patch.unit_cells > LARGE {
        STRIDE
    } else {
        CLOSE
    };
    let stride = [0, 1]
        .map(|axis| ((apart * width[axis] / cells.pixels[axis] as f64).round() as usize).max(1));
    let pixels = [0, 1].map(|axis| (stride[axis] * cells.pixels[axis]) as f64);
    let share = pixels[0] * pixels[1] / (4.0 * std::f64::consts::PI * width[0] * width[1]);
    let mut places = Vec::new();
    for (j, y) in (stride[1] / 2..cells.size[1])
        .step_by(stride[1])
        .enumerate()
    {
        for (i, x) in (stride[0] / 2..cells.size[0])
            .step_by(stride[0])
            .enumerate()
        {
            if patch.inside[y * cells.size[0] + x] {
                places.push(([i, j], [x, y]));
            }
        }
    }
    let at: Vec<usize> = places
        .iter()
        .map(|(_, [x, y])| y * cells.size[0] + x)
        .collect();
    let seen = local(cells, &patch.of(view.image), &patch.pair, view.width, &at);
    let all = places.into_iter().zip(seen);
    all.filter_map(|((place, cell), local)| {
        let Local { envelopes, noise } = local?;
        let errors =
            [0, 1, 2].map(|i| (view.noise[i] * noise[i] / (2.0 * envelopes[i].norm_sqr())).sqrt());
        Some(Node {
            at: cells.middle(cell),
            place,
            envelopes,
            weights: errors.map(|e| share / (e * e)),
            share,
            errors,
        })
    })
    .collect()
}

/// ψ of the three waves as sums over the coefficients: those of ψ₁, of ψ₂ and the last.
fn rows(basis: &Basis, at: Vector2<f64>) -> [Vec<(usize, f64)>; 3] {
    let n = basis.len();
    let functions = basis.at(at);
    let of = |first: usize, sign: f64| functions.iter().map(move |(i, f)| (first + i, sign * f[0]));
    [
        of(0, 1.0).collect(),
        of(n, 1.0).collect(),
        of(n, 1.0)
            .chain(of(0, -1.0))
            .chain([(2 * n, 1.0)])
            .collect(),
    ]
}

fn value(row: &[(usize, f64)], coefficients: &DVector<f64>) -> f64 {
    row.iter().map(|(i, x)| coefficients[*i] * x).sum()
}

/// Normal equations that are filled row by row.
struct Sums {
    normal: DMatrix<f64>,
    right: DVector<f64>,
}

impl Sums {
    fn new(size: usize) -> Self {
        Self {
            normal: DMatrix::zeros(size, size),
            right: DVector::zeros(size),
        }
    }

    fn add(&mut self, row: &[(usize, f64)], measured: f64, weight: f64) {
        for (i, x) in row {
            self.right[*i] += weight * x * measured;
            for (j, y) in row {
                self.normal[(*i, *j)] += weight * x * y;
            }
        }
    }

    fn solved(mut self, basis: &Basis) -> Option<(DVector<f64>, NormalEquations)> {
        let size = self.right.len();
        let stiffness = STIFFNESS * self.normal.trace() / size as f64;
        if let Basis::Splines(splines) = basis {
            for first in [0, basis.len()] {
                splines.in_lines(|places| {
                    for (a, x) in places.iter().zip([1.0, -2.0, 1.0]) {
                        for (b, y) in places.iter().zip([1.0, -2.0, 1.0]) {
                            self.normal[(first + a, first + b)] += stiffness * x * y;
                        }
                    }
                });
            }
        }
        // Constants are free where only differences are looked at.
        for i in 0..size {
            self.normal[(i, i)] += 1e-3 * stiffness;
        }
        let units = NormalEquations::units(&self.normal);
        let equations = NormalEquations::new(&self.normal, units, |_| 0.0)?;
        Some((equations.solve(&self.right), equations))
    }
}

fn fit(basis: Basis, nodes: &[Node]) -> Option<Fit> {
    let size = 2 * basis.len() + 1;
    let rows: Vec<[Vec<(usize, f64)>; 3]> = nodes.iter().map(|n| rows(&basis, n.at)).collect();
    let mut coefficients = DVector::zeros(size);
    let neighbours = neighbours(nodes);
    for _ in 0..ROUNDS[0] {
        let mut sums = Sums::new(size);
        for &(a, b) in &neighbours {
            for (wave, (before, after)) in rows[a].iter().zip(&rows[b]).enumerate() {
                let row = difference(after, before);
                let turn = nodes[a].envelopes[wave].conj() * nodes[b].envelopes[wave];
                let left = (turn * Complex64::cis(-value(&row, &coefficients))).arg();
                let weight = nodes[a].weights[wave].min(nodes[b].weights[wave]);
                sums.add(&row, left, weight);
            }
        }
        coefficients += sums.solved(&basis)?.0;
    }
    align(&basis, nodes, &rows, &mut coefficients);
    let all: f64 = nodes.iter().flat_map(|node| node.weights).sum();
    let mut last = None;
    for _ in 0..ROUNDS[1] {
        let mut sums = Sums::new(size);
        let (mut chi2, mut count) = (0.0, 0.0);
        for (node, rows) in nodes.iter().zip(&rows) {
            for (wave, row) in rows.iter().enumerate() {
                let left = node.envelopes[wave] * Complex64::cis(-value(row, &coefficients));
                let (left, weight) = (left.arg(), node.weights[wave]);
                // What is lost counts as if it were at the limit, and moves nothing.
                chi2 += weight * left.clamp(-LOST, LOST).powi(2);
                count += 1.0;
                if left.abs() < LOST {
                    sums.add(row, left, weight);
                }
            }
        }
        let (step, equations) = sums.solved(&basis)?;
        coefficients += step;
        last = Some((equations, chi2, count));
    }
    let (equations, chi2, count) = last?;
    let share = nodes.first()?.share;
    let independent = count * (INDEPENDENT * share).min(1.0);
    // The information of all nodes together is that of the pixels, each of them once.
    let freedom = share * count - size as f64;
    Some(Fit {
        inverse: equations.inverse(),
        coefficients,
        price: price(chi2, size as f64, independent),
        chi2,
        left: (chi2 / all).sqrt(),
        independent,
        enlarged: if freedom > FREEDOM {
            (chi2 / freedom).max(1.0)
        } else {
            1.0
        },
        basis,
    })
}

/// BIC of χ² (in units that do not matter), parameters and independent data.
pub(crate) fn price(chi2: f64, parameters: f64, independent: f64) -> f64 {
    independent * (chi2 / independent).ln() + parameters * independent.ln()
}

/// b − a.
fn difference(b: &[(usize, f64)], a: &[(usize, f64)]) -> Vec<(usize, f64)> {
    let minus = a.iter().map(|(i, x)| (*i, -x));
    b.iter().copied().chain(minus).collect()
}

/// Pairs of nodes beside each other.
pub(crate) fn neighbours(nodes: &[Node]) -> Vec<(usize, usize)> {
    let at: std::collections::HashMap<[usize; 2], usize> = nodes
        .iter()
        .enumerate()
        .map(|(i, n)| (n.place, i))
        .collect();
    let mut pairs = Vec::new();
    for (i, node) in nodes.iter().enumerate() {
        let [x, y] = node.place;
        for next in [[x + 1, y], [x, y + 1]] {
            pairs.extend(at.get(&next).map(|&j| (i, j)));
        }
    }
    pairs
}

/// Sets the constants to the mean phases.
fn align(
    basis: &Basis,
    nodes: &[Node],
    rows: &[[Vec<(usize, f64)>; 3]],
    coefficients: &mut DVector<f64>,
) {
    let mean = |wave: usize, coefficients: &DVector<f64>| {
        let sum = nodes.iter().zip(rows).map(|(node, rows)| {
            node.envelopes[wave] * Complex64::cis(-value(&rows[wave], coefficients))
        });
        sum.sum::<Complex64>().arg()
    };
    let n = basis.len();
    for wave in 0..2 {
        let constant = mean(wave, coefficients);
        match basis {
            Basis::Powers { .. } => coefficients[wave * n] += constant,
            // The splines add up to one everywhere.
            Basis::Splines(_) => (0..n).for_each(|i| coefficients[wave * n + i] += constant),
        }
    }
    let third = mean(2, coefficients);
    coefficients[2 * n] += third;
}

fn summary(chosen: &Chosen, nodes: &[Node], view: &View, patch: &Patch) -> Mean {
    let cells = view.cells;
    let fit = &chosen.fit;
    let reach = Vector2::from_fn(|axis, _| view.width * view.cells.period[axis]);
    let n = fit.basis.len();
    let size = fit.coefficients.len();
    // Mean slopes of ψ₁ and ψ₂ as sums over the coefficients, and how they spread.
    let mut sums = DMatrix::zeros(4, size);
    let mut local = Vec::new();
    let mut pixels = 0.0;
    for cell in (0..cells.len()).filter(|&c| patch.inside[c]) {
        let count = cells.counts()[cell];
        let mut slopes = Matrix2::zeros();
        for (i, [_, along, across]) in fit.basis.at(cells.middle_of(cell)) {
            for wave in 0..2 {
                let c = fit.coefficients[wave * n + i];
                for (axis, slope) in [along, across].into_iter().enumerate() {
                    sums[(2 * wave + axis, wave * n + i)] += count * slope;
                    slopes[(axis, wave)] += c * slope;
                }
            }
        }
        local.push((count, slopes));
        pixels += count;
    }
    sums /= pixels;
    let step = &sums * &fit.coefficients;
    let step = Matrix2::from_column_slice(step.as_slice());
    let covariance = fit.covariance(&sums, nodes, reach);
    let covariance = Matrix4::from_column_slice(covariance.as_slice());
    let covariance = covariance + edges(fit, cells, patch, &step);
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
/// the second derivatives of the phases. A place is known to a period at most, evenly: 1/√12 of it.
fn edges(fit: &Fit, cells: &Cells, patch: &Patch, mean: &Matrix2<f64>) -> Matrix4<f64> {
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
    let holds = |x: Option<usize>, y: Option<usize>| match (x, y) {
        (Some(x), Some(y)) if x < across && y < up => patch.inside[y * across + x],
        _ => false,
    };
    let mut sums = [Matrix2::zeros(); 2];
    let mut count = 0.0;
    for i in (0..cells.len()).filter(|&i| patch.inside[i]) {
        let (x, y) = (i % across, i / across);
        count += 1.0;
        let sides = [
            [
                holds(x.checked_sub(1), Some(y)),
                holds(Some(x + 1), Some(y)),
            ],
            [
                holds(Some(x), y.checked_sub(1)),
                holds(Some(x), Some(y + 1)),
            ],
        ];
        if sides == [[true; 2]; 2] {
            continue;
        }
        let here = local([x, y]);
        for (sum, [before, after]) in sums.iter_mut().zip(sides) {
            // A cell at the far edge comes in, one at the near edge goes out.
            *sum += here * (f64::from(u8::from(!after)) - f64::from(u8::from(!before)));
        }
    }
    let mut covariance = Matrix4::zeros();
    for (axis, sum) in sums.iter().enumerate() {
        let moved = cells.period[axis] / cells.pixels[axis] as f64 / 12f64.sqrt();
        let change = nalgebra::Vector4::from_column_slice((sum * (moved / count)).as_slice());
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
    let third = |m: &Matrix2<f64>| {
        [
            m.column(0).into_owned(),
            m.column(1).into_owned(),
            m.column(1) - m.column(0),
        ]
    };
    let waves = third(pair);
    let mut sums = [[0.0; 2]; 3];
    for (count, slopes) in local {
        for ((sum, change), wave) in sums.iter_mut().zip(third(&(slopes - mean))).zip(&waves) {
            let length = wave.norm_squared();
            sum[0] += count * (change.dot(wave) / length).powi(2);
            sum[1] += count * (change.perp(wave) / length).powi(2);
        }
    }
    let most = |i: usize| sums.iter().map(|s| s[i]).fold(0.0, f64::max);
    ((most(0) / pixels).sqrt(), (most(1) / pixels).sqrt())
}
