//! Held-out prediction against closed forms and known truth.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Vector2};

use crate::explain::beside::wave_beside;
use crate::explain::cells::{Supercell, Superlattice, better_cell, superlattice};
use crate::explain::evidence::{BETTER, Blocks, gain, weakest};
use crate::explain::scene::{Scene, gaussian_mean};
use crate::explain::table::table;
use crate::frame::image::Image;
use crate::numbers::rng::normals;
use crate::numbers::spread::mean_and_spread;
use crate::numbers::three::three;

/// (columns, rows), not square: exchanged axes would show.
const SIZE: [usize; 2] = [132, 92];

/// Waves of some nine pixels at 60°.
fn pair() -> Matrix2<f64> {
    Matrix2::new(0.70, 0.24, 0.05, 0.63)
}

fn image(seed: u64, noise: f64, value: impl Fn(Vector2<f64>) -> f64) -> Image {
    let mut normal = normals(seed, "explain", 0);
    let at = |i: usize| Vector2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
    let values = (0..SIZE[0] * SIZE[1]).map(|i| value(at(i)) + noise * normal());
    Image::new(SIZE[1], SIZE[0], values.collect())
}

fn lattice(pair: &Matrix2<f64>, at: Vector2<f64>) -> f64 {
    three(pair).iter().map(|q| (q.dot(&at) + 0.4).cos()).sum()
}

/// Three cosines have a variance of 3/2 beside that of the noise. One family of stripes, and noise, have no weakest family.
#[test]
fn the_gain_is_the_fraction_of_the_variance() {
    for seed in 0..4 {
        let weakest = |image: &Image, bends| weakest(image, &pair(), bends).unwrap();
        let noisy = image(seed, 1.0, |at| lattice(&pair(), at));
        let found = gain(&noisy, &pair(), false).unwrap();
        assert!((found - 0.6).abs() < 0.02, "{found}");
        assert!(weakest(&noisy, false) > 15.0 && weakest(&noisy, true) > 15.0);
        let stripes = image(seed, 0.5, |at| pair().column(0).dot(&at).cos());
        assert!(weakest(&stripes, false) < 3.0);
        let noise = image(seed, 1.0, |_| 0.0);
        assert!(weakest(&noise, false) < 3.0 && gain(&noise, &pair(), false).unwrap() < 0.01);
    }
}

/// Means under a Gaussian are what their definition says, with missing pixels and without, in the lines that are wanted.
#[test]
fn gaussian_means_match_their_definition() {
    let (columns, rows, sigma) = (11, 7, 1.3_f64);
    let mut normal = normals(3, "means", 0);
    let whole: Vec<f64> = (0..rows * columns).map(|_| normal()).collect();
    let mut holes = whole.clone();
    for missing in [0, 5, 24, 76] {
        holes[missing] = f64::NAN;
    }
    let wanted: Vec<bool> = (0..rows).map(|row| row != 2).collect();
    let tap = |a: usize, b: usize| {
        let off = a.abs_diff(b) as f64;
        let near = off <= (3.0 * sigma).ceil();
        if near {
            (-0.5 * (off / sigma).powi(2)).exp()
        } else {
            0.0
        }
    };
    for values in [whole, holes] {
        let found = gaussian_mean(&values, columns, sigma, &wanted);
        for (i, found) in found.iter().enumerate() {
            let [x, y] = [i % columns, i / columns];
            let (mut sum, mut weights) = (0.0, 0.0);
            for (k, value) in values.iter().enumerate().filter(|(_, v)| v.is_finite()) {
                let weight = tap(x, k % columns) * tap(y, k / columns);
                sum += weight * value;
                weights += weight;
            }
            let expected = if wanted[y] { sum / weights } else { 0.0 };
            assert!(
                (found - expected).abs() < 1e-12,
                "{x} {y}: {found} {expected}"
            );
        }
    }
}

/// A lattice without every other row is taken for none.
#[test]
fn every_other_row_belongs_to_the_lattice() {
    for rows in 0..3 {
        let fine = Supercell::Rows(rows).fine(&pair());
        let value = |at: Vector2<f64>| lattice(&pair(), at) + 1.5 * lattice(&fine, at);
        let found = better_cell(&image(1, 0.5, value), &fine, false)
            .better
            .unwrap();
        assert!((found - pair()).amax() < 1e-12, "{rows}: {found}");
        let alone = image(1, 0.5, |at| lattice(&fine, at));
        assert_eq!(better_cell(&alone, &fine, false).better, None, "{rows}");
    }
}

/// Each line has its own gain. That puts power beside the waves of the lattice, where a superlattice has some of its own, but no line tells that of
/// another: over forty frames the superlattice predicts nothing in the mean, and none of them shows it.
#[test]
fn gains_of_lines_make_no_superlattice() {
    let fine = Matrix2::new(0.7, 0.35, 0.0, 0.61);
    let coarse = Supercell::Root3.coarse(&fine).unwrap();
    let of_frame = |seed: u64| {
        let mut normal = normals(seed, "gains", 0);
        let gains: Vec<f64> = (0..SIZE[1]).map(|_| 1.0 + 0.35 * normal()).collect();
        let frame = image(seed, 0.3, |at| gains[at.y as usize] * lattice(&fine, at));
        match superlattice(&frame, &coarse, Supercell::Root3, false) {
            Some(Superlattice::NotShown(predicts)) => predicts,
            other => panic!("{seed}: {other:?}"),
        }
    };
    let all: Vec<f64> = (0..40).map(of_frame).collect();
    let found = mean_and_spread(&all);
    let error = found.sigma / (all.len() as f64).sqrt();
    assert!(found.value < 3.0 * error, "{found:?}");
}

/// Few cells of a superlattice: its waves of two directions beat, and what they predict differs more between bands of lines than what each does.
#[test]
fn waves_that_beat_make_a_superlattice() {
    let [x, y] = SIZE.map(|n| TAU / n as f64);
    let coarse = Matrix2::new(3.95 * x, 0.07 * x, 1.5 * y, 3.0 * y);
    let fine = Supercell::Double.fine(&coarse);
    for seed in 0..10 {
        let value =
            |first: f64| move |at: Vector2<f64>| lattice(&fine, at) + first * lattice(&coarse, at);
        let shown = |image: &Image| superlattice(image, &coarse, Supercell::Double, false).unwrap();
        let found = shown(&image(seed, 0.2, value(0.2)));
        assert_eq!(found, Superlattice::Shown, "{seed}");
        let alone = shown(&image(seed, 0.2, value(0.0)));
        assert!(alone != Superlattice::Shown, "{seed}: {alone:?}");
    }
}

/// Waves that stand along the slow axis have less than a cycle along the lines: offsets of the lines look the same. They neither make a superlattice nor
/// hide one, which has waves in other directions.
#[test]
fn offsets_of_lines_say_nothing_of_a_superlattice() {
    let coarse = Matrix2::new(0.62, 0.62, -0.36, 0.36);
    let fine = Supercell::Root3.fine(&coarse);
    for seed in 0..10 {
        for first in [0.0, 0.1] {
            let mut normal = normals(seed, "offsets", 0);
            let offsets: Vec<f64> = (0..SIZE[1]).map(|_| normal()).collect();
            let value = |at: Vector2<f64>| {
                offsets[at.y as usize] + lattice(&fine, at) + first * lattice(&coarse, at)
            };
            let found = superlattice(&image(seed, 0.3, value), &coarse, Supercell::Root3, false);
            let shown = found.unwrap() == Superlattice::Shown;
            assert_eq!(shown, first > 0.0, "{seed}: {found:?}");
        }
    }
}

/// Two descriptions that differ by rounding alone are as good, however small the scatter of their difference.
#[test]
fn rounding_decides_nothing() {
    let bins = image(1, 0.5, |at| lattice(&pair(), at));
    let scene = Scene::new(&bins, &pair(), &pair()).unwrap();
    let one: Vec<f64> = (0..Scene::blocks())
        .map(|block| 3.0 + block as f64)
        .collect();
    let other: Vec<f64> = one.iter().map(|gain| gain * (1.0 - f64::EPSILON)).collect();
    assert!(Blocks::difference(&scene, &one, &other).standard_errors() < 1e-3);
}

/// Half-order waves in one direction make a superlattice of a lattice that is nearly hexagonal: its cell is measured.
#[test]
fn half_order_rows_are_no_cell() {
    for rows in 0..3 {
        let coarse = Supercell::Rows(rows).coarse(&pair()).unwrap();
        let value = |at: Vector2<f64>| lattice(&pair(), at) + 0.7 * lattice(&coarse, at);
        let found = better_cell(&image(3, 0.3, value), &coarse, false)
            .better
            .unwrap();
        let names = pair().try_inverse().unwrap() * found;
        assert!(
            (names - names.map(f64::round)).amax() < 1e-9,
            "{rows}: {names}"
        );
        assert!(
            (names.determinant().abs() - 1.0).abs() < 1e-9,
            "{rows}: {names}"
        );
    }
}

/// A lattice with every other of its waves missing in one direction is that of the finer cell.
#[test]
fn waves_that_are_missing_belong_to_no_lattice() {
    let alone = image(2, 0.5, |at| lattice(&pair(), at));
    for rows in 0..3 {
        let coarse = Supercell::Rows(rows).coarse(&pair()).unwrap();
        let found = better_cell(&alone, &coarse, false).better.unwrap();
        assert!((found - pair()).amax() < 1e-12, "{rows}: {found}");
    }
}

/// Waves in one direction, as gains of lines or stripes make them, are no first shell: those of the other directions predict nothing.
#[test]
fn waves_in_one_direction_refute_a_first_shell() {
    let coarse = Supercell::Root3.coarse(&pair()).unwrap();
    for seed in 0..12 {
        let stripes = |at: Vector2<f64>| 0.4 * coarse.column(0).dot(&at).cos();
        let striped = image(seed, 0.5, |at| lattice(&pair(), at) + stripes(at));
        let said = superlattice(&striped, &coarse, Supercell::Root3, false);
        assert_ne!(said, Some(Superlattice::Shown), "{seed}");
    }
}

/// A superlattice is found from its sublattice and kept; peaks 0.4 cycles per frame off its points leave the sublattice, and lead back to it.
#[test]
fn superlattices_are_told_from_foreign_peaks() {
    for cell in [Supercell::Root3, Supercell::Double] {
        let coarse = cell.coarse(&pair()).unwrap();
        let frame = Vector2::new(TAU / SIZE[0] as f64, TAU / SIZE[1] as f64);
        let off =
            Matrix2::from_columns(&[0.5 * frame, Vector2::new(-0.5 * frame.x, 0.5 * frame.y)]);
        for seed in 0..4 {
            let with = |other: Matrix2<f64>| {
                image(seed, 0.5, |at| {
                    lattice(&pair(), at) + 0.4 * lattice(&other, at)
                })
            };
            let nested = with(coarse);
            assert_eq!(
                better_cell(&nested, &pair(), false).better,
                Some(coarse),
                "{cell:?}"
            );
            assert_eq!(
                better_cell(&nested, &coarse, false).better,
                None,
                "{cell:?}"
            );
            let foreign = with(coarse + off);
            let said = superlattice(&foreign, &coarse, cell, false);
            assert!(
                matches!(said, Some(Superlattice::NotShown(by)) if by <= BETTER),
                "{cell:?}"
            );
            assert_eq!(
                better_cell(&foreign, &pair(), false).better,
                None,
                "{cell:?}"
            );
            assert_eq!(
                better_cell(&foreign, &coarse, false).better,
                Some(cell.fine(&coarse)),
                "{cell:?}"
            );
            let alone = image(seed, 0.5, |at| lattice(&pair(), at));
            let said = superlattice(&alone, &coarse, cell, false);
            assert!(
                matches!(said, Some(Superlattice::NotShown(by)) if by <= BETTER),
                "{cell:?}"
            );
        }
    }
}

/// Stripes and hum that are far stronger than the first shell do not drown it: they are a part of what is described.
#[test]
fn stripes_beside_a_lattice_drown_no_first_shell() {
    let coarse = Supercell::Root3.coarse(&pair()).unwrap();
    for seed in 0..6 {
        let beside = |at: Vector2<f64>| {
            3.0 * (0.45 * at.x + 0.36 * at.y + 1.0).cos() + 1.5 * (0.93 * at.x - 0.05 * at.y).cos()
        };
        let value = |at: Vector2<f64>| lattice(&pair(), at) + 0.15 * lattice(&coarse, at);
        let striped = image(seed, 0.3, |at| value(at) + beside(at));
        let plain = image(seed, 0.3, value);
        let said = superlattice(&striped, &coarse, Supercell::Root3, false);
        assert_eq!(said, Some(Superlattice::Shown), "{seed}");
        let [with, without] = [&striped, &plain].map(|i| weakest(i, &coarse, false).unwrap());
        assert!(
            with > 0.5 * without && without > 5.0,
            "{seed}: {with} {without}"
        );
        let none = image(seed, 0.3, |at| lattice(&pair(), at) + beside(at));
        let said = superlattice(&none, &coarse, Supercell::Root3, false);
        assert!(
            matches!(said, Some(Superlattice::NotShown(by)) if by < BETTER),
            "{seed}"
        );
    }
}

/// A place under a scanner that bends by some pixels.
fn bent(at: Vector2<f64>) -> Vector2<f64> {
    let (u, v) = (
        2.0 * at.x / SIZE[0] as f64 - 1.0,
        2.0 * at.y / SIZE[1] as f64 - 1.0,
    );
    at + Vector2::new(3.0 * u * u - 2.0 * u * v, 2.5 * v * v + u * u * v)
}

/// A wave beside a lattice is found with its amplitude, straight or bent with it; of a lattice alone nothing is left.
#[test]
fn a_wave_beside_a_lattice_is_told_with_its_strength() {
    let wave = Vector2::new(0.33, 0.41);
    for (seed, bends) in [(0, false), (1, false), (2, true), (3, true)] {
        let place = |at| if bends { bent(at) } else { at };
        let with = |strength: f64| {
            image(seed, 0.4, |at| {
                lattice(&pair(), place(at)) + strength * wave.dot(&place(at)).cos()
            })
        };
        for strength in [0.3, 1.2] {
            let found = wave_beside(&with(strength), &pair(), bends).unwrap();
            // Slow ground is taken off: 1 − exp(−(0.45 · 2π / 0.67 · 0.53)²/2) = 0.92 of this wave is left, all of the lattice.
            let expected = 0.92 * strength;
            assert!(
                (found.strength - expected).abs() < 0.08 * strength,
                "{found:?}"
            );
            let off = (found.wave_vector - wave)
                .norm()
                .min((found.wave_vector + wave).norm());
            assert!(off < 0.4 * TAU / SIZE[1] as f64, "{found:?}");
        }
        assert_eq!(wave_beside(&with(0.0), &pair(), bends), None, "{seed}");
    }
}

/// A superlattice is told from its sublattice under a scanner that bends, too.
#[test]
fn a_bent_superlattice_is_found() {
    for cell in [Supercell::Root3, Supercell::Double] {
        let coarse = cell.coarse(&pair()).unwrap();
        let value = |at| lattice(&pair(), bent(at)) + 0.6 * lattice(&coarse, bent(at));
        let both = image(1, 0.4, value);
        assert_eq!(
            better_cell(&both, &pair(), true).better,
            Some(coarse),
            "{cell:?}"
        );
        let alone = image(1, 0.4, |at| lattice(&pair(), bent(at)));
        assert_eq!(better_cell(&alone, &pair(), true).better, None, "{cell:?}");
    }
}

/// Of two moirés in one image the table tells the shares, in closed form, and which predicts more, whichever was measured. Cells of several times the
/// area are no other lattices.
#[test]
fn the_table_ranks_two_moires_by_what_they_predict() {
    let (sin, cos) = 0.31_f64.sin_cos();
    let other = 1.21 * Matrix2::new(cos, -sin, sin, cos) * pair();
    let coarse = Supercell::Root3.coarse(&pair()).unwrap();
    for seed in 0..3 {
        let value = |at: Vector2<f64>| lattice(&pair(), at) + 0.7 * lattice(&other, at);
        let both = image(seed, 0.5, value);
        // Variances: 3/2, 0.49 · 3/2, 1/4.
        let all = 1.5 * 1.49 + 0.25;
        let near = other * 1.004;
        let rows = table(&both, &pair(), &[near, pair(), coarse], false).unwrap();
        assert_eq!(rows.len(), 2);
        assert!(
            (rows[0].share - 1.5 / all).abs() < 0.02,
            "{}",
            rows[0].share
        );
        assert!((rows[1].share - 1.5 * 0.49 / all).abs() < 0.02);
        assert!(rows[1].behind > 10.0 && (rows[1].pair - other).amax() < 0.003);
        let swapped = table(&both, &other, &[pair()], false).unwrap();
        assert!(swapped[1].behind < -10.0 && swapped[1].cells == 1);
    }
}

/// Two lattices whose waves beat, less than a cycle of the frame apart, look like one between them, that bends: both together predict more, in closed form,
/// and the stronger one is told. A lattice that bends or fades is no two.
#[test]
fn the_table_knows_two_lattices_that_beat() {
    let (sin, cos) = 0.02_f64.sin_cos();
    let other = 1.06 * Matrix2::new(cos, -sin, sin, cos) * pair();
    let between = pair() + (other - pair()) / 3.0;
    let middle = Vector2::new(SIZE[0] as f64, SIZE[1] as f64) / 2.0;
    for seed in 0..3 {
        let value = |at: Vector2<f64>| lattice(&pair(), at) + 0.5 * lattice(&other, at);
        let rows = table(&image(seed, 0.3, value), &between, &[], true).unwrap();
        assert_eq!(rows.len(), 2);
        let share = 1.5 * 1.25 / (1.5 * 1.25 + 0.09);
        assert!((rows[1].share - share).abs() < 0.02, "{}", rows[1].share);
        assert!(rows[1].behind < -BETTER && (rows[1].pair - pair()).amax() < 0.003);
        assert!((rows[1].second.unwrap() - other).amax() < 0.003);
        let alone = |value: &dyn Fn(Vector2<f64>) -> f64| {
            let image = image(seed, 0.3, value);
            table(&image, &pair(), &[], true).unwrap().len()
        };
        let bent = |at: Vector2<f64>| {
            let unit = (at - middle).component_div(&middle);
            at + 2.0 * Vector2::new(unit.y * unit.y, unit.x * unit.y)
        };
        let fade = |at: Vector2<f64>| 1.0 + 0.7 * (at.x / middle.x - 1.0);
        assert_eq!(alone(&|at| lattice(&pair(), at)), 1);
        assert_eq!(alone(&|at| lattice(&pair(), bent(at))), 1);
        assert_eq!(alone(&|at| fade(at) * lattice(&pair(), at)), 1);
    }
}

/// A superlattice lists the lattice of a third of its cell with what the harmonics of that predict.
#[test]
fn the_table_knows_the_parts_of_a_cell() {
    for (cell, cells) in [(Supercell::Root3, 3), (Supercell::Double, 4)] {
        let coarse = cell.coarse(&pair()).unwrap();
        let value = |at: Vector2<f64>| lattice(&pair(), at) + 0.5 * lattice(&coarse, at);
        let rows = table(&image(1, 0.2, value), &coarse, &[pair()], false).unwrap();
        let all = 1.5 * 1.25 + 0.04;
        assert_eq!((rows.len(), rows[1].cells), (2, cells));
        assert!(
            (rows[1].share - 1.5 / all).abs() < 0.03,
            "{}",
            rows[1].share
        );
        assert!((rows[1].pair - pair()).amax() < 1e-9 || cells == 3);
    }
}

/// Atoms that are stronger than the moiré they make are no other lattice in its place: they lie on top of it.
#[test]
fn atoms_are_not_listed_beside_a_moire() {
    let (sin, cos) = 0.2_f64.sin_cos();
    let atoms = 3.3 * Matrix2::new(cos, -sin, sin, cos) * pair();
    let value = |at: Vector2<f64>| lattice(&pair(), at) + 2.0 * lattice(&atoms, at);
    let rows = table(&image(1, 0.5, value), &pair(), &[atoms], false).unwrap();
    assert_eq!(rows.len(), 1);
}
