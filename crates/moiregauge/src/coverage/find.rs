//! The lattices of a frame, each with the part that carries it.

use heterostrain::lattice::shortest_pair;
use nalgebra::{Matrix2, Vector2};

use crate::coverage::patch::WHOLE;
use crate::coverage::settle::{Settled, settle_if};
use crate::coverage::tiles;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::spectrum::select;
use crate::spectrum::transform::Spectrum;

/// Two lattices are the same if their waves differ by less than this over the frame, cycles: half a bin, at which two
/// peaks are one.
const SAME: f64 = 0.5;

/// Lattices with less than this share of the power of the strongest one are its harmonics, or skirts. Half and twice as
/// much change no result of docs/constants.md.
const WORTH: f64 = 0.1;

/// The patches, the strongest first, on which the lattices settle that the spectra of the frame and of its tiles propose. `flat`: without
/// background; `is_meant`: whether a pair may be the lattice that is looked for.
pub(crate) fn patches(
    flat: &Image,
    geometry: &Geometry,
    first: Option<Matrix2<f64>>,
    is_meant: &dyn Fn(&Matrix2<f64>) -> bool,
) -> Vec<Settled> {
    let of = |spectrum: &Spectrum| {
        let found = select::candidates(spectrum, &geometry.pixel_to_nm);
        found.into_iter().map(|c| c.pair).collect::<Vec<_>>()
    };
    let size = [flat.columns, flat.rows];
    let whole = std::iter::once_with(|| of(&Spectrum::new(flat)));
    let tiles = tiles::spectra(flat).map(|spectrum| of(&spectrum));
    let given = first.into_iter().collect();
    let mut found: Vec<Settled> = Vec::new();
    let mut tried: Vec<Matrix2<f64>> = Vec::new();
    let all = std::iter::once(given).chain(whole).chain(tiles);
    for (stage, proposed) in all.enumerate() {
        for pair in proposed {
            if !is_meant(&pair) || tried.iter().any(|other| same(size, other, &pair)) {
                continue;
            }
            tried.push(pair);
            let is_new = |pair: &Matrix2<f64>| {
                let known = |other: &Settled| same(size, &other.patch.pair, pair);
                is_meant(pair) && !found.iter().any(known)
            };
            let settled = settle_if(flat, &pair, pitch(geometry), &is_new);
            found.extend(settled.map(|settled| settled.on(geometry)));
        }
        // What is plain to see everywhere is not looked for any more.
        let everywhere = |s: &Settled| s.patch.share > WHOLE && s.is_plain();
        if stage > 0 && found.iter().any(everywhere) {
            break;
        }
    }
    found.sort_by(|a, b| b.evidence().total_cmp(&a.evidence()));
    let most = found.first().map_or(0.0, Settled::evidence);
    found.retain(|settled| settled.evidence() > WORTH * most);
    found
}

/// Distance of pixels along columns and rows, nm.
pub(crate) fn pitch(geometry: &Geometry) -> [f64; 2] {
    [geometry.fast_step().norm(), geometry.slow_step().norm()]
}

/// Whether two pairs are waves of the same lattice, in a frame of `size` (columns, rows).
pub(crate) fn same(size: [usize; 2], a: &Matrix2<f64>, b: &Matrix2<f64>) -> bool {
    cells(size, a, b) == Some(1.0)
}

/// How many cells of the lattice `b` one cell of the lattice `a` holds; `None` where waves of `b` are not waves of `a`.
pub(crate) fn cells(size: [usize; 2], a: &Matrix2<f64>, b: &Matrix2<f64>) -> Option<f64> {
    let frame =
        Matrix2::from_diagonal(&Vector2::from(size.map(|n| n as f64))) / std::f64::consts::TAU;
    let short = |pair: &Matrix2<f64>| {
        let pair = frame * pair;
        shortest_pair(&pair).map_or(pair, |change| pair * change)
    };
    let (a, b) = (short(a), short(b));
    let whole = (a.try_inverse()? * b).map(f64::round);
    ((b - a * whole).amax() < SAME).then(|| whole.determinant().abs())
}
