//! Which part of white noise a fit takes up, bin by bin of the windowed transform around a harmonic.
//!
//! White noise of unit variance leaves the power `Σw² − vᴴ G⁻¹ v` in a bin, with w the window, v the transform of the window
//! times each fitted function and G their normal matrix. Of the waves only those count whose main lobes reach the bins.

use std::f64::consts::PI;
use std::ops::RangeInclusive;

use nalgebra::{DMatrix, DVector, Vector2};

use crate::lattice::fit::frame::{Basis, Frame, wave};
use crate::lattice::fit::model::Model;
use crate::lattice::fit::solve;

/// Bins (cycles per frame) on either side of a harmonic that count, along the lines: few, since noise in time is a
/// function of kx, ...
pub(super) const ALONG: i64 = 4;
/// ... and across, where it is the same: 300 bins, four of which count as one, tell it to about a tenth.
pub(super) const ACROSS: i64 = 16;
/// On small frames at most one in this many of all lines' frequencies counts on either side.
const SHARE: usize = 6;
/// A wave reaches no farther through the window (bins): beyond, 10⁻⁴ of its power is left.
const SPREAD: f64 = 4.0;

/// Which part of white noise the fitted functions take up.
pub(crate) struct Leverage<'a> {
    basis: &'a Basis,
    model: &'a Model,
    /// Inverse of the normal matrix of (cos, sin) of each harmonic and the four derivatives.
    inverse: DMatrix<f64>,
    size: [usize; 2],
    /// Bins on either side that count, across the lines.
    pub(super) across: i64,
}

/// What the fitted functions take up around one place: those of the waves near by, and the four
/// derivatives.
pub(crate) struct Taps {
    waves: Vec<Tap>,
    /// The transform of a cosine is real, that of a sine imaginary: the parts of the inverse that belong to the cosines and to
    /// the sines near by, each with the four derivatives, which have both.
    inverse: [DMatrix<f64>; 2],
    /// Position of a harmonic in these parts.
    places: Vec<Option<usize>>,
    /// The transform of the window times each of these functions, real and imaginary part: room for it.
    seen: [DVector<f64>; 2],
}

/// One of the two waves of a harmonic.
struct Tap {
    harmonic: usize,
    /// Of its wave vector.
    sign: f64,
    /// Transform of the window along x and along y: value and slope at each bin.
    transform: [Vec<[f64; 2]>; 2],
}

impl<'a> Leverage<'a> {
    /// `normal` is that of the whole model: background, cosines and sines, derivatives.
    pub(crate) fn new(frame: &Frame, model: &'a Model, normal: &DMatrix<f64>) -> Option<Self> {
        let terms = model.basis.terms.len();
        let rest = normal.nrows() - terms;
        let inverse = solve::inverse(normal)?;
        // The block of the inverse is the inverse with the background projected out.
        let inverse = inverse.view((terms, terms), (rest, rest)).into_owned();
        Some(Self {
            basis: &model.basis,
            model,
            inverse,
            size: [frame.image.columns, frame.image.rows],
            across: ACROSS.min((frame.image.rows / SHARE) as i64),
        })
    }

    pub(super) fn taps(&self, centre: Vector2<i64>) -> Taps {
        let half = [ALONG, self.across];
        let count = self.basis.indices.len();
        let mut waves = Vec::new();
        let mut places = vec![None; count];
        let mut near = Vec::new();
        for (i, &index) in self.basis.indices.iter().enumerate() {
            for sign in [1.0, -1.0] {
                let p = sign * wave(&self.model.pair, index);
                let cycles = p / PI;
                let apart = |axis: usize| (cycles[axis] - centre[axis] as f64).abs();
                let reaches = |axis: usize| apart(axis) < half[axis] as f64 + SPREAD;
                if !(reaches(0) && reaches(1)) {
                    continue;
                }
                let transform = [0, 1].map(|axis| {
                    let bins = centre[axis] - half[axis]..=centre[axis] + half[axis];
                    window_transforms(p[axis], bins, self.size[axis])
                });
                waves.push(Tap {
                    harmonic: i,
                    sign,
                    transform,
                });
                if places[i].is_none() {
                    places[i] = Some(near.len());
                    near.push(i);
                }
            }
        }
        let room = || DVector::zeros(near.len() + 4);
        let part = |first: usize| {
            let waves = near.iter().map(|i| 2 * i + first);
            let used: Vec<usize> = waves.chain(2 * count..2 * count + 4).collect();
            self.inverse.select_rows(&used).select_columns(&used)
        };
        Taps {
            waves,
            seen: [room(), room()],
            inverse: [part(0), part(1)],
            places,
        }
    }

    /// `vᴴ G⁻¹ v` for the bin at (dx, dy) from the centre of the taps.
    pub(super) fn at(&self, taps: &mut Taps, dx: i64, dy: i64) -> f64 {
        let [re, im] = &mut taps.seen;
        let n = re.len();
        re.fill(0.0);
        im.fill(0.0);
        for tap in &taps.waves {
            let (i, sign, [along, across]) = (tap.harmonic, tap.sign, &tap.transform);
            let [x, slope_x] = along[(dx + ALONG) as usize];
            let [y, slope_y] = across[(dy + self.across) as usize];
            if let Some(place) = taps.places[i] {
                re[place] += 0.5 * x * y;
                im[place] -= 0.5 * sign * x * y;
            }
            let [alpha, beta] = self.model.waves[i];
            for (axis, slope) in [slope_x * y, x * slope_y].into_iter().enumerate() {
                // X e^{iθ} transforms into −i times the slope; the derivative of the model is
                // X (β cos θ − α sin θ).
                for (vector, index) in self.basis.indices[i].into_iter().enumerate() {
                    let j = n - 4 + 2 * vector + axis;
                    im[j] -= 0.5 * f64::from(index) * beta * slope;
                    re[j] += 0.5 * f64::from(index) * alpha * sign * slope;
                }
            }
        }
        let form = |inverse: &DMatrix<f64>, v: &DVector<f64>| {
            let columns = inverse.column_iter().zip(v.iter());
            columns
                .map(|(column, value)| value * column.dot(v))
                .sum::<f64>()
        };
        form(&taps.inverse[0], re) + form(&taps.inverse[1], im)
    }
}

/// `Σ w cos((p − π bin) X)` over the Hann window of `n` pixels and its slope, for a run of bins.
///
/// The window is three Dirichlet kernels, `sin u / sin(u/n)` at a bin and at its neighbours. From bin to bin u is π less, so that
/// one sine is that of all of them.
fn window_transforms(p: f64, bins: RangeInclusive<i64>, n: usize) -> Vec<[f64; 2]> {
    let nearest = (p / PI).round();
    let offset = p - PI * nearest;
    let (sin, cos) = offset.sin_cos();
    let kernel = |bin: i64| {
        let from_nearest = bin - nearest as i64;
        let sign = if from_nearest % 2 == 0 { 1.0 } else { -1.0 };
        dirichlet(
            offset - PI * from_nearest as f64,
            [sign * sin, sign * cos],
            n as f64,
        )
    };
    let (first, last) = (*bins.start(), *bins.end());
    let kernels: Vec<[f64; 2]> = (first - 1..=last + 1).map(kernel).collect();
    let window =
        |three: &[[f64; 2]]| [0, 1].map(|i| 0.5 * three[1][i] + 0.25 * (three[0][i] + three[2][i]));
    kernels.windows(3).map(window).collect()
}

/// `sin u / sin(u/n)` and its slope, from (sin u, cos u).
fn dirichlet(u: f64, [sin, cos]: [f64; 2], n: f64) -> [f64; 2] {
    /// Nearer to 0 the first terms of the series are exact.
    const SMALL: f64 = 1e-4;
    if u.abs() < SMALL {
        let curvature = (n * n - 1.0) / (3.0 * n);
        return [n - 0.5 * curvature * u * u, -curvature * u];
    }
    let (below, slope) = (u / n).sin_cos();
    [sin / below, (cos - sin * slope / (n * below)) / below]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::hann::hann_transform;

    /// The transforms of a run of bins are those by themselves, also at the bins, and slopes are their differences.
    #[test]
    fn bins_have_the_transform_of_the_window() {
        for (p, n) in [
            (40.3, 64),
            (7.0 * PI, 33),
            (7.0 * PI + 3e-5, 128),
            (-2.2, 16),
        ] {
            let centre = (p / PI).round() as i64;
            let found = window_transforms(p, centre - 4..=centre + 4, n);
            for (bin, [value, slope]) in (centre - 4..).zip(&found) {
                let at = |p: f64| hann_transform(2.0 * (p - PI * bin as f64) / n as f64, n);
                assert!((value - at(p)).abs() < 1e-9, "{p} {n} {bin}: {value}");
                let wanted = (at(p + 1e-4) - at(p - 1e-4)) / 2e-4;
                assert!(
                    (slope - wanted).abs() < 1e-6,
                    "{p} {n} {bin}: {slope} {wanted}"
                );
            }
            assert_eq!(found.len(), 9);
        }
    }
}
