//! The names of a lattice: which of its wave vectors belong to the first reciprocal vectors of the atoms.
//!
//! In: a lattice (nm) and similar layers. Out: every name under which the anisotropic part |q| of P stays below a bound,
//! so that every uniaxial strain up to a bound is there. With `M = P G` the wave vectors of such a name are no longer
//! than `(|p| + |q|) |G|`, and `|p|² = |q|² ± |det P|` has the area of the cell in it: a finite search, complete.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use nalgebra::{Matrix2, Rotation2, Vector2};

use crate::complex_pair::ComplexPair;
use crate::lattice::reduce::shortest_pair;
use crate::lattice::vectors::Lattice;
use crate::strain::labelling::moire_matrix;
use crate::strain::layers::Layers;

/// Solutions that need more strain are not listed: strains between layers are a few tenths of a per cent, rarely one.
/// See docs/constants.md.
const LARGEST_STRAIN: f64 = 0.01;
/// Wave vectors that are tried, at most, for the time's sake; the bound is lowered for lattices with more.
const MOST_WAVES: f64 = 4000.0;
/// Names that are listed, at most. Chosen by eye.
const MOST_NAMES: usize = 150;

/// A name: the wave vectors `M₁ = h₁ K₁ + k₁ K₂` and `M₂ = h₂ K₁ + k₂ K₂` as `[[h₁, k₁], [h₂, k₂]]`, with
/// `K_i · L_j = 2π δ_ij` for the lattice vectors L₁, L₂. They belong to the reciprocal vectors of layer 1 at 0° and, for
/// hexagonal layers, 120°; there `M₁ + M₂` is the third wave of the first shell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LatticeName(pub [[i32; 2]; 2]);

impl LatticeName {
    /// The three waves of the first shell of hexagonal layers.
    pub fn first_shell(self) -> [[i32; 2]; 3] {
        let [a, b] = self.0;
        [a, b, [a[0] + b[0], a[1] + b[1]]]
    }

    /// The wave vectors M₁ and M₂ (columns, rad/nm) for the lattice vectors `basis` (columns, nm).
    pub fn waves(self, basis: &Matrix2<f64>) -> Option<Matrix2<f64>> {
        Some(basis.try_inverse()?.transpose() * self.matrix() * TAU)
    }

    /// The name by which `named` is `lattice`, in its simplest form.
    pub(crate) fn of(
        lattice: &Matrix2<f64>,
        named: &Matrix2<f64>,
        layers: &Layers,
    ) -> Option<Self> {
        let waves = named.try_inverse()?.transpose();
        simplest(&(lattice.transpose() * waves), layers)
    }

    fn matrix(self) -> Matrix2<f64> {
        let [[a, b], [c, d]] = self.0.map(|wave| wave.map(f64::from));
        Matrix2::new(a, c, b, d)
    }

    /// U of the named pair `L U`.
    pub(crate) fn change(self) -> Option<Matrix2<f64>> {
        Some(self.matrix().try_inverse()?.transpose().map(f64::round))
    }
}

/// The change of basis to the pair whose wave vectors are nearest to `waves` (rad/nm): `None` where they are not those of
/// a primitive pair.
pub(crate) fn change_to(basis: &Matrix2<f64>, waves: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    let numbers = (basis.transpose() * waves / TAU).map(f64::round);
    (numbers.determinant().abs() == 1.0)
        .then(|| numbers.try_inverse())
        .flatten()
        .map(|inverse| inverse.transpose().map(f64::round))
}

/// All names with strains up to a bound, the least strained first, and the bound.
pub(crate) fn all_names(lattice: &Lattice, layers: &Layers) -> Option<(Vec<LatticeName>, f64)> {
    let ratio = layers.ratio()?;
    let to_short = shortest_pair(&lattice.basis)?;
    let short = lattice.basis * to_short;
    let waves = short.try_inverse()?.transpose();
    let dual = layers.atoms.try_inverse()?.transpose();
    let area = moire_matrix(&short, &layers.atoms)?.determinant().abs();
    let mut bound = LARGEST_STRAIN;
    let (anisotropy, reach) = loop {
        // A little beyond: tension and compression differ at second order.
        let q = ratio * bound * (1.0 + layers.poisson_ratio) / 2.0 * (1.0 + 3.0 * bound);
        let reach = ((q * q + area).sqrt() + q) * (1.0 + 1e-9);
        let tried = reach * dual.column(0).norm().max(dual.column(1).norm());
        let sides = [0, 1].map(|i| 2.0 * tried * short.column(i).norm() + 1.0);
        if sides[0] * sides[1] < MOST_WAVES {
            break (q, reach);
        }
        bound *= 0.9;
        if bound < 1e-6 {
            return None;
        }
    };
    let [first, second] =
        [0, 1].map(|j| waves_within(reach * dual.column(j).norm(), &short, &waves));
    let inverse = dual.try_inverse()?;
    let back = to_short.try_inverse()?.transpose();
    let mut found = BTreeSet::new();
    for a in &first {
        for b in second
            .iter()
            .filter(|b| (a[0] * b[1] - a[1] * b[0]).abs() == 1)
        {
            let name = LatticeName([*a, *b]).matrix();
            let q = ComplexPair::from(waves * name * inverse).q.norm();
            if q <= anisotropy
                && let Some(name) = simplest(&(back * name), layers)
            {
                found.insert((ordered(q), name));
            }
        }
    }
    // One name comes in all its turns, whose |q| differ by rounding.
    let mut seen = BTreeSet::new();
    let mut names: Vec<(f64, LatticeName)> = found
        .into_iter()
        .filter(|(_, name)| seen.insert(*name))
        .map(|(q, name)| (f64::from_bits(q), name))
        .collect();
    if let Some((q, _)) = names.get(MOST_NAMES) {
        bound = bound.min(0.99 * 2.0 * q / (ratio * (1.0 + layers.poisson_ratio)));
        names.truncate(MOST_NAMES);
    }
    Some((names.into_iter().map(|(_, name)| name).collect(), bound))
}

/// The waves `h K₁ + k K₂` up to a length (in units of `waves`, which are the K of the pair `short`).
fn waves_within(reach: f64, short: &Matrix2<f64>, waves: &Matrix2<f64>) -> Vec<[i32; 2]> {
    let most = [0, 1].map(|i| (reach * short.column(i).norm()).floor() as i32);
    (-most[0]..=most[0])
        .flat_map(|h| (-most[1]..=most[1]).map(move |k| [h, k]))
        .filter(|[h, k]| (waves * Vector2::new(f64::from(*h), f64::from(*k))).norm() <= reach)
        .collect()
}

/// Bits of a number that is not negative are in the order of the numbers.
fn ordered(q: f64) -> u64 {
    q.to_bits()
}

/// Of the forms of a name that differ by a turn of the atoms onto themselves, the one with the smallest numbers.
fn simplest(waves: &Matrix2<f64>, layers: &Layers) -> Option<LatticeName> {
    let dual = layers.atoms.try_inverse()?.transpose();
    let turns = (TAU / layers.period).round() as usize;
    let turn = dual.try_inverse()? * Rotation2::new(layers.period).into_inner() * dual;
    let turn = turn.map(f64::round);
    let mut current = waves.map(f64::round);
    let mut best: Option<([i32; 5], LatticeName)> = None;
    for _ in 0..turns {
        let [a, b, c, d] = [current.m11, current.m21, current.m12, current.m22].map(|x| x as i32);
        let size = a.abs() + b.abs() + c.abs() + d.abs();
        let key = [size, -a, -b, -c, -d];
        if best.is_none_or(|(least, _)| key < least) {
            best = Some((key, LatticeName([[a, b], [c, d]])));
        }
        current *= turn;
    }
    best.map(|(_, name)| name)
}

/// A lattice under one of its names, and P of that name.
pub(crate) struct Labelled {
    pub(crate) name: LatticeName,
    pub(crate) lattice: Lattice,
    pub(crate) moire: Matrix2<f64>,
}
