//! Which peaks of the spectrum are the lattice?
//!
//! Not the highest ones: line noise, tip events and pick-up make high peaks too. Local maxima are
//! measured against the noise around them; every pair of them proposes a lattice, and the lattice
//! wins that explains most of the peaks with the fewest places to put them (sum rule, primitive
//! cell, small distortion).

use std::cell::OnceCell;
use std::f64::consts::TAU;

use heterostrain::lattice::{distortion, shortest_pair};
use nalgebra::{Matrix2, Vector2};

use crate::numbers::interrupt;
use crate::spectrum::noise_map::{BLOCK_WIDTH, NoiseMap};
use crate::spectrum::rivals::{ENOUGH, Rivals};
use crate::spectrum::transform::Spectrum;

/// Peaks, and multiple of the chance matches, that explain a lattice well. Chosen by eye.
const EXPLAINED: f64 = 6.0;
/// Peaks over noise (power) that are looked at: e⁻⁴, so that some of the noise are among them.
const PEAK: f64 = 4.0;
/// Peaks below this many cycles per frame are background: a plane or a bow fills the first bin.
const LOWEST_CYCLES: f64 = 1.25;
/// Peaks beyond this many cycles per pixel are noise: fewer than 2.5 pixels per period.
const HIGHEST_FREQUENCY: f64 = 0.4;
/// How many peaks are looked at: more than two shells have, and as many of noise. On the scenes of docs/constants.md half and double change results
/// by at most 0.05 σ.
const PEAKS: usize = 40;
/// How many of them may span a lattice: all pairs of them are tried. Chosen by eye.
pub(crate) const GENERATORS: usize = 16;
/// A peak belongs to a lattice point if it is this close, in cycles per frame: below half a bin, at which two peaks
/// are one.
pub(crate) const TOLERANCE: f64 = 0.45;
/// Harmonics up to this order count. Chosen by eye.
const ORDERS: f64 = 4.0;
/// A moiré of hexagonal layers is a hexagon distorted by less than this; see [`distortion`]. Beyond, other pairs of
/// the lattice are nearer to a hexagon.
pub(crate) const MOST_DISTORTION: f64 = 0.45;

/// Fewest periods across the frame: a few protrusions can mimic a lattice. Of simulated discs with sharp edges 0.8 to 1.0 fit across the
/// frame, of the smallest recorded images three; a cell √3 times too large with 1.6 was taken for a lattice in one of 400 frames of few spots.
pub(crate) const FEWEST_PERIODS: f64 = 2.0;

/// A lattice proposed by the spectrum.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Reciprocal pair at 60°, rad per pixel.
    pub(crate) pair: Matrix2<f64>,
    /// How well it explains the peaks; larger is better.
    pub(crate) score: f64,
    /// How many peaks it explains, and how many it would by chance.
    pub(crate) explained: [f64; 2],
}

/// Whether more peaks lie on the lattice than chance puts there, were it to try many times.
pub(crate) fn well_explained(candidate: &Candidate) -> bool {
    let [found, expected] = candidate.explained;
    found >= EXPLAINED && found > EXPLAINED * expected
}

/// A local maximum of the spectrum.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Peak {
    /// rad per pixel, sub-bin.
    pub(crate) q: Vector2<f64>,
    /// The same in cycles per frame.
    cycles: Vector2<f64>,
    /// Power over the local noise power.
    significance: f64,
    /// Power.
    power: f64,
}

/// Lattices proposed by the spectrum, best first, each a different one.
///
/// `pixel_to_nm` is the metric in which vectors are short and hexagons regular.
pub(crate) fn candidates(spectrum: &Spectrum, pixel_to_nm: &Matrix2<f64>) -> Vec<Candidate> {
    distinct(spectrum, pixel_to_nm, || Rivals::new(spectrum))
}

/// The same beside a lattice that is there (reciprocal pair, rad per pixel): its waves are no rivals.
pub(crate) fn candidates_beside(
    pair: &Matrix2<f64>,
    spectrum: &Spectrum,
    pixel_to_nm: &Matrix2<f64>,
) -> Vec<Candidate> {
    distinct(spectrum, pixel_to_nm, || Rivals::new(spectrum).beside(pair))
}

fn distinct<'a>(
    spectrum: &'a Spectrum,
    pixel_to_nm: &Matrix2<f64>,
    rivals: impl Fn() -> Rivals<'a>,
) -> Vec<Candidate> {
    let Some(to_physical) = pixel_to_nm.try_inverse().map(|m| m.transpose()) else {
        return Vec::new();
    };
    let peaks = spectrum_peaks(spectrum);
    let mut found: Vec<Candidate> = Vec::new();
    let generators = &peaks[..peaks.len().min(GENERATORS)];
    for (i, a) in generators.iter().enumerate() {
        for b in &generators[i + 1..] {
            let pair = Matrix2::from_columns(&[a.q, b.q]);
            if let Some(candidate) = assess(&pair, &peaks, &to_physical, spectrum) {
                found.push(candidate);
            }
        }
    }
    let ranked = OnceCell::new();
    // A cell of many atoms explains many peaks; single shells of it need not stand out.
    by_score(found, spectrum, |candidate| {
        let rivals = ranked.get_or_init(&rivals);
        well_explained(candidate) || rivals.of(&candidate.pair, &to_physical, ENOUGH) < ENOUGH
    })
}

/// The best few that are different lattices, of those that are to be kept.
pub(crate) fn by_score(
    mut found: Vec<Candidate>,
    spectrum: &Spectrum,
    keep: impl Fn(&Candidate) -> bool,
) -> Vec<Candidate> {
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut distinct: Vec<Candidate> = Vec::new();
    let frame = frame_cycles(spectrum);
    for candidate in found {
        let same = |other: &Candidate| {
            let d = frame * (candidate.pair - other.pair);
            d.column(0).norm() < TOLERANCE && d.column(1).norm() < TOLERANCE
        };
        if !distinct.iter().any(same) && keep(&candidate) {
            distinct.push(candidate);
        }
        if distinct.len() == 4 {
            break;
        }
    }
    distinct
}

/// rad per pixel → cycles per frame.
pub(crate) fn frame_cycles(spectrum: &Spectrum) -> Matrix2<f64> {
    let [w, h] = spectrum.image_size;
    Matrix2::from_diagonal(&Vector2::new(w as f64, h as f64)) / TAU
}

/// Periods of a lattice (reciprocal pair, cycles per frame) along the longest of its three vectors; `None` where it has none.
pub(crate) fn periods(cycles: &Matrix2<f64>) -> Option<f64> {
    let real = cycles.try_inverse()?.transpose();
    let (a, b) = (real.column(0), real.column(1));
    let third = (a + b).norm().min((a - b).norm());
    Some(1.0 / a.norm().max(b.norm()).max(third))
}

/// Labels the pair canonically, refines it with the peaks it explains, and scores it.
fn assess(
    pair: &Matrix2<f64>,
    peaks: &[Peak],
    to_physical: &Matrix2<f64>,
    spectrum: &Spectrum,
) -> Option<Candidate> {
    let change = shortest_pair(&(to_physical * pair))?;
    let mut pair = pair * change;
    // One labelling for each lattice: the first vector upwards-right in pixel space.
    for _ in 0..6 {
        let first = pair.column(0);
        let angle = first.y.atan2(first.x);
        if (0.0..=std::f64::consts::FRAC_PI_3 + 0.2).contains(&angle) {
            break;
        }
        pair *= Matrix2::new(0.0, -1.0, 1.0, 1.0);
    }
    let frame = frame_cycles(spectrum);
    let may_be = |pair: &Matrix2<f64>| distortion(&(to_physical * pair)) <= MOST_DISTORTION;
    if !may_be(&pair) {
        return None;
    }
    let candidate = score(&pair, peaks, spectrum, Orders(ORDERS))?;
    let repeats = periods(&(frame * candidate.pair))? >= FEWEST_PERIODS;
    (repeats && may_be(&candidate.pair)).then_some(Candidate {
        score: candidate.score * (1.0 - distortion(&(to_physical * candidate.pair)).powi(2)),
        ..candidate
    })
}

/// The highest order of harmonics that count.
#[derive(Clone, Copy)]
pub(crate) struct Orders(pub(crate) f64);

/// Refines the pair with the peaks it explains and scores it.
pub(crate) fn score(
    pair: &Matrix2<f64>,
    peaks: &[Peak],
    spectrum: &Spectrum,
    orders: Orders,
) -> Option<Candidate> {
    let frame = frame_cycles(spectrum);
    let mut pair = *pair;
    // Two rounds: the first with peaks near by, the second with all that fit the refined pair.
    for _ in 0..2 {
        pair = refined(&pair, peaks, &frame, orders)?;
    }
    let cell = (frame * pair).determinant().abs();
    let chance = (std::f64::consts::PI * TOLERANCE * TOLERANCE / cell).min(1.0);
    let mut score = 0.0;
    let mut first_shell = [0.0f64; 3];
    let mut found = 0.0;
    for peak in peaks {
        let Some((h, k)) = explained(peak, &pair, &frame, orders) else {
            continue;
        };
        let weight = (1.0 + peak.significance).ln();
        score += weight * (1.0 - chance);
        found += 1.0;
        let shell = [[1.0, 0.0], [0.0, 1.0], [-1.0, 1.0]];
        for (best, [sh, sk]) in first_shell.iter_mut().zip(shell) {
            if (h, k) == (sh, sk) || (h, k) == (-sh, -sk) {
                *best = best.max(weight);
            }
        }
    }
    // The sum rule: a lattice is as good as the weakest of its three shortest vectors.
    first_shell.sort_by(f64::total_cmp);
    score += 2.0 * first_shell[0] + first_shell[1];
    Some(Candidate {
        pair,
        score,
        explained: [found, chance * peaks.len() as f64],
    })
}

/// The indices of the lattice point on which the peak lies, if it does.
fn explained(
    peak: &Peak,
    pair: &Matrix2<f64>,
    frame: &Matrix2<f64>,
    orders: Orders,
) -> Option<(f64, f64)> {
    let indices = pair.try_inverse()? * peak.q;
    let (h, k) = (indices.x.round(), indices.y.round());
    if (h == 0.0 && k == 0.0) || h.abs().max(k.abs()).max((h + k).abs()) > orders.0 {
        return None;
    }
    let miss = frame * (peak.q - pair * Vector2::new(h, k));
    (miss.norm() < TOLERANCE).then_some((h, k))
}

/// Least-squares pair through the peaks it explains, each weighted by its significance.
fn refined(
    pair: &Matrix2<f64>,
    peaks: &[Peak],
    frame: &Matrix2<f64>,
    orders: Orders,
) -> Option<Matrix2<f64>> {
    let mut normal = Matrix2::zeros();
    let mut right = Matrix2::zeros();
    for peak in peaks {
        if let Some((h, k)) = explained(peak, pair, frame, orders) {
            let index = Vector2::new(h, k);
            let weight = peak.significance.min(1e4);
            normal += weight * index * index.transpose();
            right += weight * peak.q * index.transpose();
        }
    }
    Some(right * normal.try_inverse()?)
}

/// The most significant local maxima of the spectrum, best first.
pub(crate) fn spectrum_peaks(spectrum: &Spectrum) -> Vec<Peak> {
    let noise = NoiseMap::new(spectrum);
    let half = spectrum.half();
    let rows = spectrum.rows;
    let step = spectrum.step();
    let frame = frame_cycles(spectrum);
    let mut found = Vec::new();
    for ky in 0..rows {
        interrupt::check();
        let signed = if ky <= rows / 2 {
            ky as f64
        } else {
            ky as f64 - rows as f64
        };
        let (line, noise) = (&spectrum.values[ky * half..][..half - 1], noise.row(ky));
        for (kx, value) in line.iter().enumerate() {
            let (power, noise) = (value.norm_sqr(), noise[kx / BLOCK_WIDTH]);
            // On the axis kx = 0 the lower half repeats the upper one.
            if power < PEAK * noise || (kx == 0 && signed <= 0.0) {
                continue;
            }
            let significance = power / noise;
            let near = |dx: i64, dy: i64| {
                let (mut x, mut y) = (kx as i64 + dx, ky as i64 + dy);
                if x < 0 {
                    (x, y) = (-x, -y);
                }
                spectrum.power(x as usize, y.rem_euclid(rows as i64) as usize)
            };
            let highest = (-1..=1)
                .flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)))
                .all(|(dx, dy)| (dx, dy) == (0, 0) || near(dx, dy) <= power);
            if !highest {
                continue;
            }
            let bin = Vector2::new(
                kx as f64 + summit(near(-1, 0), power, near(1, 0)),
                signed + summit(near(0, -1), power, near(0, 1)),
            );
            let q = bin.component_mul(&step);
            let cycles = frame * q;
            if cycles.norm() < LOWEST_CYCLES || q.norm() > TAU * HIGHEST_FREQUENCY {
                continue;
            }
            found.push(Peak {
                q,
                cycles,
                significance,
                power,
            });
        }
    }
    best(found)
}

/// The most significant ones, best first, without side lobes.
fn best(mut found: Vec<Peak>) -> Vec<Peak> {
    found.sort_by(|a, b| b.significance.total_cmp(&a.significance));
    found.truncate(8 * PEAKS);
    let all = found.clone();
    found.retain(|peak| !all.iter().any(|other| is_side_lobe(peak, other)));
    found.truncate(PEAKS);
    found
}

/// The place of the highest point between three neighbouring powers, in bins from the middle one: that of a parabola through their logarithms.
fn summit(minus: f64, middle: f64, plus: f64) -> f64 {
    let (m, c, p) = (minus.ln(), middle.ln(), plus.ln());
    let curvature = m - 2.0 * c + p;
    if curvature < 0.0 {
        (0.5 * (m - p) / curvature).clamp(-0.5, 0.5)
    } else {
        0.0
    }
}

/// Whether `peak` is no higher than what the window spreads there from the stronger `other`.
fn is_side_lobe(peak: &Peak, other: &Peak) -> bool {
    if other.power <= peak.power {
        return false;
    }
    // Envelope of the Hann transform: main lobe of ±2 cycles, then falling with the third power.
    let envelope = |d: f64| {
        let d = d.abs();
        if d < 1.0 {
            1.0
        } else {
            1.0 / (d * (d * d - 1.0).max(0.5)) / std::f64::consts::PI * 1.5
        }
    };
    [1.0, -1.0].into_iter().any(|sign| {
        let d = peak.cycles - sign * other.cycles;
        let leak = (envelope(d.x) * envelope(d.y)).powi(2);
        peak.power < 2.0 * other.power * leak.min(0.4)
    })
}
