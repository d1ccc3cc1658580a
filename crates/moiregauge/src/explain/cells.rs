//! Lattices of which one holds the other, compared by what they predict.
//!
//! The lattice with the larger cell (a superlattice) has all wave vectors of the other and more between them. It is taken where these predict pixels
//! that they have not seen, in all directions, and lie on its points: a second moiré that only comes near them does not belong to it.

use std::cell::OnceCell;
use std::f64::consts::PI;

use heterostrain::lattice::shortest_pair;
use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::explain::beside::strongest_near;
use crate::explain::evidence::{BETTER, Blocks, gain, weakest};
use crate::explain::normal::gains;
use crate::explain::phases::Phases;
use crate::explain::scene::Scene;
use crate::frame::background::{Background, remove_background};
use crate::frame::image::Image;
use crate::numbers::three::three;
use crate::spectrum::shells::FIRST_SHELL;

/// Harmonics up to this multiple of the longest first-order wave vector of the smaller cell.
const ORDERS: f64 = 1.1;
/// Largest index of a harmonic of the larger cell.
const LARGEST: i32 = 5;
/// Longest wave vector that counts, rad per bin: three bins a period.
const LONGEST: f64 = 2.1;
/// Standard errors that the waves in each direction of a larger cell add, at least: more than chance. Of half-order waves in one direction the others add none.
const EACH: f64 = 1.0;
/// The smaller cell is taken if it predicts this fraction of what the larger does: the larger one has waves that are not its own.
pub(crate) const MOST: f64 = 0.5;
/// Cells whose shortest and longest waves differ by more than this are compared with those of twice the area: a hexagonal lattice without every other
/// row has a ratio of two.
const ELONGATED: f64 = 1.5;

/// √3 × √3 (three cells in one), 2 × 2 (four), and every other row along one of three vectors (two).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Supercell {
    Root3,
    Double,
    Rows(usize),
}

impl Supercell {
    /// The first-order wave vectors of the smaller cell in those of the larger.
    fn names(self) -> Matrix2<f64> {
        match self {
            Self::Root3 => Matrix2::new(1.0, -1.0, 1.0, 2.0),
            Self::Double => Matrix2::new(2.0, 0.0, 0.0, 2.0),
            Self::Rows(0) => Matrix2::new(2.0, 0.0, 0.0, 1.0),
            Self::Rows(1) => Matrix2::new(1.0, 0.0, 0.0, 2.0),
            // The difference of the waves of the smaller cell is twice a wave of the larger.
            Self::Rows(_) => Matrix2::new(1.0, -1.0, 1.0, 1.0),
        }
    }

    /// How many of the smaller cells the larger one holds.
    fn cells(self) -> usize {
        self.names().determinant().round() as usize
    }

    /// Reciprocal pair of the larger cell, from that of the smaller.
    pub(crate) fn coarse(self, fine: &Matrix2<f64>) -> Option<Matrix2<f64>> {
        Some(fine * self.names().try_inverse()?)
    }

    /// Reciprocal pair of the smaller cell, from that of the larger.
    pub(crate) fn fine(self, coarse: &Matrix2<f64>) -> Matrix2<f64> {
        coarse * self.names()
    }
}

/// A lattice with a larger cell that an image does not clearly show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Larger {
    /// Reciprocal pair, rad per pixel.
    pub(crate) pair: Matrix2<f64>,
    /// By how many standard errors it predicts better.
    pub(crate) predicts: f64,
}

/// A lattice beside those whose cells are several times or a part of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Nested {
    /// Reciprocal pair (rad per pixel) of one that predicts the image better.
    pub(crate) better: Option<Matrix2<f64>>,
    /// Lattices with 2, 3 and 4 of its cells in one that were not taken.
    pub(crate) larger: [Option<Larger>; 3],
}

/// Compares the lattice of `pair` (reciprocal, rad per pixel) with those of larger and smaller cells. `bends`: phases may be cubic polynomials.
pub(crate) fn better_cell(image: &Image, pair: &Matrix2<f64>, bends: bool) -> Nested {
    let all = [Supercell::Root3, Supercell::Double];
    let elongated = is_elongated(pair);
    let rows = (0..3).map(Supercell::Rows).filter(|_| elongated);
    let all = all.into_iter().chain(rows);
    let shows = |coarse: &Matrix2<f64>, supercell| shows(image, coarse, supercell, bends);
    let coarse = all.clone();
    let coarse = coarse.filter_map(|supercell| Some((supercell, supercell.coarse(pair)?)));
    let coarse: Vec<(Supercell, Matrix2<f64>)> = coarse.collect();
    let said = coarse.par_iter();
    let said = said.map(|(supercell, coarse)| shows(coarse, *supercell));
    let said: Vec<Option<Superlattice>> = said.collect();
    let mut larger = [None; 3];
    let mut is_shown = |supercell: Supercell, pair: Matrix2<f64>, said: Option<Superlattice>| {
        if let Some(Superlattice::NotShown(predicts)) = said {
            let most: &mut Option<Larger> = &mut larger[supercell.cells() - 2];
            if most.is_none_or(|most| most.predicts < predicts) {
                *most = Some(Larger { pair, predicts });
            }
        }
        said == Some(Superlattice::Shown)
    };
    let mut said = coarse.into_iter().zip(said);
    let shown = said.find(|((supercell, pair), said)| is_shown(*supercell, *pair, *said));
    let shown = shown.map(|(shown, _)| shown);
    let own = OnceCell::new();
    let better = shown.or_else(|| {
        let mut fine = all.map(|supercell| (supercell, supercell.fine(pair)));
        fine.find(|(supercell, fine)| {
            // Moirés of hexagonal layers are nearly hexagons: half-order waves in one direction make a superlattice of one.
            let is_regular = elongated && !is_elongated(fine);
            let share = *own.get_or_init(|| gain(image, pair, bends));
            predicts_as_well(image, fine, share, bends) == Some(true)
                && (is_regular || !is_shown(*supercell, *pair, shows(pair, *supercell)))
        })
    });
    let better = better.map(|(_, pair)| pair);
    Nested { better, larger }
}

/// What an image shows of a superlattice by straight waves or, where it `bends`, by bent ones.
fn shows(
    image: &Image,
    coarse: &Matrix2<f64>,
    supercell: Supercell,
    bends: bool,
) -> Option<Superlattice> {
    let straight = superlattice(image, coarse, supercell, false);
    if bends && straight != Some(Superlattice::Shown) {
        superlattice(image, coarse, supercell, true)
    } else {
        straight
    }
}

/// By how many standard errors, at least, all waves of a superlattice (reciprocal pair, rad per pixel) predict held-out pixels: those that it has in
/// common with a smaller cell, and those that show it. `None` where it is not shown.
pub(crate) fn predicted_superlattice(
    image: &Image,
    pair: &Matrix2<f64>,
    bends: bool,
) -> Option<f64> {
    let of = |cell: Supercell| {
        let least = weakest(image, &cell.fine(pair), bends)?;
        let shown = least > BETTER && shows(image, pair, cell, bends) == Some(Superlattice::Shown);
        shown.then_some(BETTER)
    };
    [Supercell::Root3, Supercell::Double]
        .into_iter()
        .find_map(of)
}

/// Whether the longest of the three first-order waves has more than one and a half times the wave vector of the shortest.
fn is_elongated(pair: &Matrix2<f64>) -> bool {
    let Some(change) = shortest_pair(pair) else {
        return true;
    };
    let waves = three(&(pair * change)).map(|q| q.norm());
    let shortest = waves.into_iter().fold(f64::INFINITY, f64::min);
    waves.into_iter().fold(0.0, f64::max) > ELONGATED * shortest
}

/// Whether one lattice alone predicts most of what another does, the share `other` of the variance.
fn predicts_as_well(
    image: &Image,
    one: &Matrix2<f64>,
    other: Option<f64>,
    bends: bool,
) -> Option<bool> {
    let enough = gain(image, one, bends)? > MOST * other?;
    Some(enough && weakest(image, one, bends)? > BETTER)
}

/// What an image shows of the superlattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Superlattice {
    /// Its waves predict, in all directions that can be told from offsets of lines, and lie on its points.
    Shown,
    /// They predict better by this many standard errors, but by too few, not in all directions, or better still with wave vectors of their own. 0 where
    /// they are not its harmonics.
    NotShown(f64),
}

/// Whether an image shows the lattice with the larger cell and not only that with the smaller. Where offsets of lines may hide it, the image is looked at
/// without the means of its lines as well. `coarse`: reciprocal pair of the larger cell, at 60°, rad per pixel; `image`: without its background; `bends`:
/// phases may be cubic polynomials. `None` where the two cannot be compared.
pub(crate) fn superlattice(
    image: &Image,
    coarse: &Matrix2<f64>,
    supercell: Supercell,
    bends: bool,
) -> Option<Superlattice> {
    use Superlattice::{NotShown, Shown};
    let of = |image: &Image| of_image(image, coarse, supercell, bends);
    let plain = of(image)?;
    Some(match plain {
        NotShown(by) if by > EACH => match of(&remove_background(image, Background::LineMean)) {
            Some(Shown) => Shown,
            Some(NotShown(level)) => NotShown(by.max(level)),
            None => plain,
        },
        _ => plain,
    })
}

/// The same as the image is.
fn of_image(
    image: &Image,
    coarse: &Matrix2<f64>,
    supercell: Supercell,
    bends: bool,
) -> Option<Superlattice> {
    let fine = supercell.fine(coarse);
    let scene = Scene::new(image, coarse, &fine)?;
    let [coarse, fine] = [*coarse, fine].map(|pair| pair * scene.binning as f64);
    let wave = |[h, k]: [i32; 2]| coarse * Vector2::new(f64::from(h), f64::from(k));
    let most = ORDERS
        * FIRST_SHELL
            .iter()
            .map(|[h, k]| (fine * Vector2::new(f64::from(*h), f64::from(*k))).norm())
            .fold(0.0, f64::max);
    let half = (0..=LARGEST).flat_map(|h| (-LARGEST..=LARGEST).map(move |k| [h, k]));
    let half = half.filter(|[h, k]| *h > 0 || *k > 0);
    let inverse = supercell.names().try_inverse()?;
    let is_fine = |[h, k]: [i32; 2]| {
        let index = inverse * Vector2::new(f64::from(h), f64::from(k));
        (index - index.map(f64::round)).amax() < 1e-6
    };
    // A wave of less than a cycle along the lines cannot be told from their offsets: where it is not of both lattices it says nothing.
    let cycle = PI / scene.half.x;
    let tells = |index: &[i32; 2]| is_fine(*index) || wave(*index).x.abs() > cycle;
    let indices: Vec<[i32; 2]> = half
        .filter(|index| wave(*index).norm() < most.min(LONGEST) && tells(index))
        .collect();
    let scene = scene.without_waves_beside(&coarse, &fine, &indices);
    let lattice = Phases::shown(&scene, coarse, bends);
    let normals = lattice.normals(&scene, &indices);
    let of = |kept: &dyn Fn(usize) -> bool| {
        let kept: Vec<usize> = (0..2 * indices.len()).filter(|i| kept(i / 2)).collect();
        gains(&normals, &kept)
    };
    let (large, small) = (of(&|_| true)?, of(&|i| is_fine(indices[i]))?);
    let errors =
        |one: &[f64], other: &[f64]| Blocks::difference(&scene, one, other).standard_errors();
    // Waves in one direction alone are stripes.
    let in_line = |[h, k]: [i32; 2], [m, n]: [i32; 2]| h * n == k * m;
    let adds = |first: &[i32; 2]| {
        let without = of(&|i| is_fine(indices[i]) || !in_line(indices[i], *first))?;
        Some(errors(&large, &without))
    };
    let first: Vec<[i32; 2]> = FIRST_SHELL
        .into_iter()
        .filter(|i| !is_fine(*i) && tells(i))
        .collect();
    let predicts = errors(&large, &small);
    if first.len() < 2 {
        return Some(Superlattice::NotShown(predicts));
    }
    let adds: Option<Vec<f64>> = first.iter().map(adds).collect();
    let least = adds?.into_iter().fold(f64::INFINITY, f64::min);
    // Where they beat, the sum of several waves differs from block to block more than each.
    let predicts = predicts.max(least);
    if predicts < BETTER {
        return Some(Superlattice::NotShown(predicts));
    }
    if least < 0.0 {
        return Some(Superlattice::NotShown(0.0));
    }
    // Waves with wave vectors of their own in place of the first order.
    let others: Vec<[i32; 2]> = indices
        .iter()
        .copied()
        .filter(|i| !first.iter().any(|f| f == i || f.map(|x| -x) == *i))
        .collect();
    let mut own = lattice.clone();
    let rest = lattice.residual(
        &scene,
        &indices
            .iter()
            .copied()
            .filter(|i| is_fine(*i))
            .collect::<Vec<_>>(),
    )?;
    own.others = first
        .iter()
        .map(|[h, k]| lattice.pair * Vector2::new(f64::from(*h), f64::from(*k)))
        .map(|q| strongest_near(&scene, &lattice, &rest, q))
        .collect();
    let normals = own.normals(&scene, &others);
    let all: Vec<usize> = (0..2 * (others.len() + first.len())).collect();
    let beside = gains(&normals, &all)?;
    let by = Blocks::difference(&scene, &beside, &large).by_blocks();
    Some(if by > BETTER {
        Superlattice::NotShown(0.0)
    } else if least > EACH && by <= BETTER / 2.0 {
        Superlattice::Shown
    } else {
        Superlattice::NotShown(predicts)
    })
}
