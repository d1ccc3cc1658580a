//! The lattices that an image may show, in one table, by what each predicts.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Vector2};

use crate::explain::evidence::{BETTER, Blocks};
use crate::explain::normal::gains;
use crate::explain::phases::{CUBIC, Phases};
use crate::explain::scene::Scene;
use crate::explain::split::{Guess, split};
use crate::frame::image::Image;
use crate::numbers::three::three;
use crate::spectrum::rivals::LOBE;
use crate::spectrum::select::TOLERANCE;
use crate::spectrum::shells::shells;

/// What predicts less than this share of the variance is not listed.
const LISTED: f64 = 0.05;
/// Wave vectors within this part of those of a cell of several times or a part of the area are harmonics: such cells are compared by
/// [`superlattice`](crate::explain::cells::superlattice).
const NESTED: f64 = 0.1;

/// Ratio of periods beyond which lattices lie on top of each other, as atoms and moiré do: an image that shows both
/// shows neither instead of the other.
const LIKE: f64 = 2.0;

/// What one lattice predicts.
pub(crate) struct Row {
    /// Reciprocal pair at 60°, rad per pixel.
    pub(crate) pair: Matrix2<f64>,
    /// A second lattice on top of it that is described with it: share and comparison are those of both.
    pub(crate) second: Option<Matrix2<f64>>,
    /// Share of the variance of held-out blocks (without slow background) that it predicts.
    pub(crate) share: f64,
    /// By how many standard errors over blocks the first lattice of the table predicts better.
    pub(crate) behind: f64,
    /// How many of its cells the first lattice has in one.
    pub(crate) cells: usize,
}

/// A lattice (reciprocal pair at 60°, rad per pixel), the lattices whose cells are a third and a fourth of its own, and those proposals of about its
/// period that are neither it nor a cell of several times or a part of its area. `bends`: phases may be cubic polynomials. `None` where the image is too small.
pub(crate) fn table(
    image: &Image,
    first: &Matrix2<f64>,
    proposals: &[Matrix2<f64>],
    bends: bool,
) -> Option<Vec<Row>> {
    let area = |pair: &Matrix2<f64>| pair.determinant().abs();
    let is_like = |pair: &&Matrix2<f64>| {
        let ratio = area(pair) / area(first);
        (LIKE.powi(-2)..LIKE.powi(2)).contains(&ratio)
    };
    let proposals = || proposals.iter().filter(is_like);
    let finest = proposals()
        .chain([first])
        .max_by(|a, b| area(a).total_cmp(&area(b)));
    let scene = Scene::new(image, first, finest?)?;
    let binning = scene.binning as f64;
    let power = scene.values.iter().map(|v| v * v).sum::<f64>();
    let indices = shells(3);
    let all: Vec<usize> = (0..2 * indices.len()).collect();
    let normals = |phases: &Phases| phases.normals(&scene, indices);
    let straight = |pair: &Matrix2<f64>| Phases::straight(pair * binning);
    let fitted = |pair: &Matrix2<f64>| {
        let terms = if bends { CUBIC } else { 0 };
        let fitted = straight(pair).fitted(&scene, shells(2), terms);
        fitted.unwrap_or_else(|| straight(pair))
    };
    let answer = normals(&if bends {
        fitted(first)
    } else {
        straight(first)
    });
    let most = gains(&answer, &all)?;
    let row = |pair: Matrix2<f64>, own: &[f64], cells: usize| Row {
        pair,
        second: None,
        share: own.iter().sum::<f64>() / power,
        behind: Blocks::difference(&scene, &most, own).standard_errors(),
        cells,
    };
    let mut rows = Vec::new();
    // The second shell is the first of a third of the cell, the third that of a fourth.
    for (shell, cells) in [(2, 3), (3, 4)] {
        let kept: Vec<usize> = (2 * shells(shell - 1).len()..2 * shells(shell).len()).collect();
        let gain = gains(&answer, &kept)?;
        rows.push(row(of_shell(first, shell), &gain, cells));
    }
    for proposal in proposals() {
        let is_known = |pair: &Matrix2<f64>| {
            let mut known = rows.iter().map(|row| &row.pair).chain([first]);
            known.any(|known| are_nested(known, pair))
        };
        if is_known(proposal) {
            continue;
        }
        // What predicts next to nothing where it was proposed is not fitted.
        let roughly = gains(&normals(&straight(proposal)), &all)?;
        if roughly.iter().sum::<f64>() < LISTED * power {
            continue;
        }
        let phases = fitted(proposal);
        let pair = phases.pair / binning;
        if !is_known(&pair) {
            rows.push(row(pair, &gains(&normals(&phases), &all)?, 1));
        }
    }
    if let Some(both) = two_close(&scene, &(first * binning)) {
        let waves: Vec<usize> = (0..2 * (indices.len() + both.others.len())).collect();
        let second = Matrix2::from_columns(&both.others[..2]) / binning;
        let row = Row {
            second: Some(second),
            ..row(both.pair / binning, &gains(&normals(&both), &waves)?, 1)
        };
        rows.extend((row.behind < -BETTER).then_some(row));
    }
    rows.retain(|row| row.share > LISTED);
    rows.sort_by(|a, b| a.behind.total_cmp(&b.behind));
    let answer = Row {
        behind: 0.0,
        ..row(*first, &most, 1)
    };
    rows.insert(0, answer);
    Some(rows)
}

/// Two waves of a shell, 60° apart: the reciprocal pair of a part of the cell.
pub(crate) fn of_shell(pair: &Matrix2<f64>, shell: usize) -> Matrix2<f64> {
    let first = shells(shell - 1).len();
    let wave = |[h, k]: [i32; 2]| pair * Vector2::new(f64::from(h), f64::from(k));
    Matrix2::from_columns(&[first, first + 1].map(|i| wave(shells(shell)[i])))
}

/// Two straight lattices on top of each other that look like one (reciprocal pair at 60°, rad per bin), since their waves beat: the stronger one, and the
/// three first waves of the other. `None` where what is beside its waves is no lattice of its own.
fn two_close(scene: &Scene, first: &Matrix2<f64>) -> Option<Phases> {
    let rows = scene.values.len() / scene.columns;
    let image = Image::new(rows, scene.columns, scene.values.clone());
    let mut guesses = split(&image, first)?;
    let power = |guess: &Guess| (guess.waves.iter().map(|w| w.amplitude.norm_sqr())).sum::<f64>();
    guesses.sort_by(|a, b| power(b).total_cmp(&power(a)));
    let [stronger, other] = guesses.map(|guess| guess.pair);
    let mut both = Phases::straight(stronger);
    both.others = three(&other).to_vec();
    let both = both.fitted(scene, shells(2), 0)?;
    let cycles = |q: Vector2<f64>| (q.component_mul(&scene.half) * 2.0 / TAU).norm();
    let apart = three(&both.pair).into_iter().zip(&both.others);
    let mut apart = apart.map(|(own, other)| cycles(other - own));
    let [a, b, c] = both.others[..] else {
        return None;
    };
    let beat = apart.all(|apart| (TOLERANCE..LOBE).contains(&apart));
    (beat && cycles(b - a - c) < TOLERANCE).then_some(both)
}

/// Whether all points of one lattice are those of the other.
fn are_nested(one: &Matrix2<f64>, other: &Matrix2<f64>) -> bool {
    let holds = |large: &Matrix2<f64>, small: &Matrix2<f64>| {
        large.try_inverse().is_some_and(|inverse| {
            let names = inverse * small;
            (names - names.map(f64::round)).amax() < NESTED
        })
    };
    holds(one, other) || holds(other, one)
}
