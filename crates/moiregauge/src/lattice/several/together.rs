//! Lattices that take turns.

use nalgebra::{Matrix2, Vector2, Vector4};

use crate::explain::split::{Guess, split};
use crate::frame::background::{Background, remove_background};
use crate::frame::departure::Departure;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::fit::waves::sum;
use crate::lattice::measure::measure_whole;
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::several::entangled::{Part, beside_each_other};
use crate::lattice::start::Start;
use crate::numbers::MOST_ROUNDS;
use crate::spectrum::error::LatticeError;
use crate::spectrum::method::Method;

/// Nothing moves any more: changes below this part of σ. Any small number: each round costs time.
const STILL: f64 = 0.03;
/// What is left after a round is taken to be at most this part of what was left before: with 0.97 the errors of two of 120 images with a second moiré
/// are ten times as large.
const MOST_LEFT: f64 = 0.8;
/// Signal over noise of the weakest first harmonic of a lattice, at least, when all are taken off: 25 in power, a
/// little more than the 20 of the search.
const WEAKEST: f64 = 5.0;
/// The same while others are still in the image and count as noise. On the scenes of docs/constants.md half and double change no result.
const ON_TRIAL: f64 = 1.5;
/// Lattices whose wave vectors lie within this of each other (cycles per frame) are one: far less than a main lobe.
const SAME: f64 = 0.3;
/// Wave vectors of a superlattice are off points of its lattice by fewer standard errors: at most 2 where one lattice is drawn, 11 and more where two are
/// whose cells differ by a factor of 1.68 to 1.8.
const NESTED: f64 = 8.0;
/// A lattice whose first harmonics lie so near to higher ones of another (indices of a cell 3, 4 or 7 times as dense) that
/// they are taken for these shows by its own higher ones: those of a cell that is at least this much denser ...
const HIDDEN: f64 = 9.0;
/// ... and whose waves lie within this of the other's: cycles per frame, and as a share of the distance of the
/// points. Chosen by eye.
const NEAR_HIDDEN: [f64; 2] = [1.5, 0.2];

/// Finds and measures `count` lattices, the strongest first.
///
/// # Errors
/// As [`measure`](crate::lattice::measure()) for the first; [`LatticeError::FewerLattices`] where fewer than `count` stand out, and
/// [`LatticeError::Entangled`] where two of them cannot be told apart on this frame.
pub fn measure_several(
    image: &Image,
    geometry: &Geometry,
    background: Background,
    count: usize,
) -> Result<Vec<MeasuredLattice>, LatticeError> {
    measure_several_from(None, image, geometry, background, count)
}

/// The same with the first of them.
pub(crate) fn measure_several_from(
    first: Option<&MeasuredLattice>,
    image: &Image,
    geometry: &Geometry,
    background: Background,
    count: usize,
) -> Result<Vec<MeasuredLattice>, LatticeError> {
    let displacement = geometry.displacement();
    let scene = Scene {
        image,
        geometry,
        background,
        displacement: displacement.as_ref(),
    };
    let first = first.and_then(|first| scene.part(first.clone()));
    let mut parts: Vec<Part> = first.into_iter().collect();
    while parts.len() < count {
        match scene.next(&parts) {
            Ok(part) => parts.push(part),
            Err(error) if count == 1 => return Err(error),
            Err(error) => scene.split_one(&mut parts, count, error)?,
        }
        scene.take_turns(&mut parts)?;
    }
    // A superlattice is one lattice, whichever of its cells was found first.
    let nested =
        |i: &Part, j: &Part| j.to_points_of(i, image).1 < SAME && j.standard_errors_off(i) < NESTED;
    let one = |i: &Part, j: &Part| i.is(j, image) || nested(i, j);
    let own = |i: usize| !parts[..i].iter().any(|other| one(&parts[i], other));
    let found = (0..parts.len())
        .filter(|&i| parts[i].is_significant() && own(i))
        .count();
    if count > 1 && found < count {
        return Err(LatticeError::FewerLattices {
            found,
            wanted: count,
        });
    }
    if count > 1 {
        beside_each_other(&mut parts, image, scene.displacement)?;
    }
    Ok(parts.into_iter().map(|part| part.lattice).collect())
}

/// An image and how it is measured.
struct Scene<'a> {
    image: &'a Image,
    geometry: &'a Geometry,
    background: Background,
    /// How far from its own place each pixel is on a straight grid.
    displacement: Option<&'a Departure>,
}

impl Part {
    /// Whether its first harmonics are more than noise.
    fn is_significant(&self) -> bool {
        self.lattice.signal_to_noise > WEAKEST
    }

    /// Whether both are the same lattice: the pair of this one lies on points of the other, as what is left of the
    /// harmonics of the other does, and as a lattice does whose first harmonics lie so near to those of the other that
    /// they are taken for them.
    fn is(&self, other: &Self, image: &Image) -> bool {
        let (cells, apart) = self.to_points_of(other, image);
        let near = if cells >= HIDDEN - 0.5 {
            let points = cycles(image, &other.fit.wave_vectors.basis);
            let spacing = points[0].min(points[1]);
            NEAR_HIDDEN[0].min(NEAR_HIDDEN[1] * spacing).max(SAME)
        } else {
            SAME
        };
        apart < near
    }

    /// By how many standard errors of both its pair is off points of another lattice.
    fn standard_errors_off(&self, other: &Self) -> f64 {
        let [own, theirs] = [self, other].map(|part| &part.fit.wave_vectors);
        let Some(inverse) = theirs.basis.try_inverse() else {
            return f64::INFINITY;
        };
        let whole = (inverse * own.basis).map(f64::round);
        let off = own.basis - theirs.basis * whole;
        let carry = whole.transpose().kronecker(&Matrix2::identity());
        let covariance = own.covariance + carry * theirs.covariance * carry.transpose();
        let off = Vector4::from_column_slice(off.as_slice());
        let chi2 = covariance.cholesky().map(|c| off.dot(&c.solve(&off)));
        chi2.map_or(f64::INFINITY, f64::sqrt)
    }

    /// How many cells of its own size are one of another lattice, and how far its pair is from points of that one at most, cycles per frame.
    fn to_points_of(&self, other: &Self, image: &Image) -> (f64, f64) {
        let [pair, theirs] = [self, other].map(|part| part.fit.wave_vectors.basis);
        let whole = theirs
            .try_inverse()
            .map(|inverse| (inverse * pair).map(f64::round));
        whole.map_or((0.0, f64::INFINITY), |whole| {
            let [a, b] = cycles(image, &(pair - theirs * whole));
            (whole.determinant().abs(), a.max(b))
        })
    }
}

impl Scene<'_> {
    fn part(&self, lattice: MeasuredLattice) -> Option<Part> {
        let fit = lattice.fit.clone()?;
        let model = fit.waves(self.image, self.displacement);
        Some(Part {
            lattice,
            fit,
            model,
        })
    }

    /// Another lattice beside the known ones. Those that are still to be found are noise to it: where it does
    /// not stand out of that, what the spectrum proposes is taken on trial.
    fn next(&self, parts: &[Part]) -> Result<Part, LatticeError> {
        let left = self.without(parts, None);
        let new = |lattice: MeasuredLattice| {
            let known = |part: &Part| parts.iter().any(|other| part.is(other, self.image));
            self.part(lattice).filter(|part| !known(part))
        };
        let error = match measure_whole(&left, self.geometry, self.background, Method::Lattice) {
            Ok(lattice) => return new(lattice).ok_or(LatticeError::Entangled),
            Err(error) => error,
        };
        Start::proposals(&left, self.geometry, self.background)
            .iter()
            .filter_map(|pair| self.near(&left, pair))
            .filter_map(new)
            .find(|part| part.lattice.signal_to_noise > ON_TRIAL)
            .ok_or(error)
    }

    fn near(&self, image: &Image, pair: &Matrix2<f64>) -> Option<MeasuredLattice> {
        let start = Start::near(image, self.geometry, self.background, pair)?;
        start.measure(Method::Lattice).ok()
    }

    /// Takes one lattice, known or first seen in a part of the frame, for two that look like one.
    fn split_one(
        &self,
        parts: &mut Vec<Part>,
        wanted: usize,
        error: LatticeError,
    ) -> Result<(), LatticeError> {
        let none = match parts.len() {
            0 => error,
            found => LatticeError::FewerLattices { found, wanted },
        };
        let left = remove_background(&self.without(parts, None), self.background);
        let in_pieces = self.pair_in_pieces(&left);
        let known = (0..parts.len()).map(|i| (Some(i), parts[i].fit.wave_vectors.basis));
        let candidates: Vec<_> = known.chain(in_pieces.map(|pair| (None, pair))).collect();
        for (replaced, pair) in candidates {
            let others: Vec<usize> = (0..parts.len()).filter(|i| Some(*i) != replaced).collect();
            let mut left = self.image.clone();
            for &i in &others {
                take_off(&mut left, &parts[i].model);
            }
            let flat = remove_background(&left, self.background);
            let Some([a, b]) = split(&flat, &pair) else {
                continue;
            };
            let near = |model: &[f64], pair: &Matrix2<f64>| {
                let mut rest = left.clone();
                take_off(&mut rest, model);
                self.part(self.near(&rest, pair)?)
            };
            let Some(first) = near(&model(&flat, &b), &a.pair) else {
                continue;
            };
            let Some(second) = near(&first.model, &b.pair) else {
                continue;
            };
            if first.is(&second, self.image) || !(first.is_significant() && second.is_significant())
            {
                continue;
            }
            if let Some(i) = replaced {
                parts.remove(i);
            }
            parts.extend([first, second]);
            return Ok(());
        }
        Err(none)
    }

    /// The lattice as a half or a quarter of the frame shows it, where the two beat as one.
    fn pair_in_pieces(&self, left: &Image) -> Option<Matrix2<f64>> {
        let (w, h) = (left.columns / 2, left.rows / 2);
        let corners = [[w / 2, h / 2], [0, 0], [w, 0], [0, h], [w, h]];
        let found = corners.into_iter().filter_map(|first| {
            let piece = left.cropped(first, [w, h]);
            let geometry = self.geometry.cropped(first, [w, h]);
            let start = Start::find(&piece, &geometry, self.background).ok()?;
            let lattice = start.measure(Method::Fourier).ok()?;
            Some((lattice.signal_to_noise, lattice.reciprocal))
        });
        found
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, pair)| pair)
    }

    /// The image less the models of all parts but one.
    fn without(&self, parts: &[Part], but: Option<usize>) -> Image {
        let mut image = self.image.clone();
        for (i, part) in parts.iter().enumerate() {
            if but != Some(i) {
                take_off(&mut image, &part.model);
            }
        }
        image
    }

    /// Fits each anew to what the others leave, until none moves. Lattices that share power move by about the same part of what is left each time: two
    /// rounds tell where that ends (Aitken's Δ² process).
    fn take_turns(&self, parts: &mut [Part]) -> Result<(), LatticeError> {
        let mut before: Option<Vec<f64>> = None;
        for round in 0..MOST_ROUNDS {
            let mut most = 0.0f64;
            let mut change = Vec::new();
            for i in 0..parts.len() {
                let left = self.without(parts, Some(i));
                let pair = parts[i].fit.wave_vectors.basis;
                let refitted = self.near(&left, &pair).and_then(|l| self.part(l));
                let part = refitted.ok_or(LatticeError::Entangled)?;
                let moved = part.fit.wave_vectors.basis - pair;
                let sigma = part.fit.wave_vectors.covariance.diagonal().map(f64::sqrt);
                let moved = moved.iter().zip(sigma.iter());
                most = moved.fold(most, |most, (d, s)| most.max(d.abs() / s));
                change.extend(
                    part.model
                        .iter()
                        .zip(&parts[i].model)
                        .map(|(new, old)| new - old),
                );
                parts[i] = part;
            }
            if most < STILL {
                return Ok(());
            }
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let Some(last) = before.take() else {
                before = Some(change);
                continue;
            };
            // Lattices that can be told apart move by less than σ by then.
            if round > MOST_ROUNDS / 8 && most > 1.0 {
                break;
            }
            let ratio = (dot(&change, &last) / dot(&last, &last)).clamp(-1.0, MOST_LEFT);
            let further = ratio / (1.0 - ratio);
            let models = parts.iter_mut().flat_map(|part| &mut part.model);
            let changed = models.zip(&change);
            changed.for_each(|(model, change)| *model += further * change);
        }
        Err(LatticeError::Entangled)
    }
}

/// Lengths of two wave vectors (rad per pixel), cycles per frame.
fn cycles(image: &Image, pair: &Matrix2<f64>) -> [f64; 2] {
    let frame = Vector2::new(image.columns as f64, image.rows as f64) / std::f64::consts::TAU;
    [0, 1].map(|i| pair.column(i).component_mul(&frame).norm())
}

/// What the first waves of a lattice make of an image.
fn model(image: &Image, guess: &Guess) -> Vec<f64> {
    let centre = Vector2::new(image.columns as f64 - 1.0, image.rows as f64 - 1.0) / 2.0;
    let waves = guess
        .waves
        .iter()
        .map(|wave| (wave.q, 2.0 * wave.amplitude));
    sum(image, waves, centre, None)
}

pub(crate) fn take_off(image: &mut Image, model: &[f64]) {
    for (value, model) in image.values.iter_mut().zip(model) {
        *value -= model;
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Matrix4;

    use super::*;
    use crate::frame::departure::{Across, Term};
    use crate::lattice::fit::fitted::LatticeFit;
    use crate::numbers::rng::normals;

    const SIZE: [usize; 2] = [150, 121];

    /// Bows of up to 2 % of the frame.
    fn bent() -> Departure {
        let term = |along, across, x, y| Term {
            along,
            across: Across::Power(across),
            size: Vector2::new(x, y),
        };
        let terms = vec![
            term(2, 0, 1.9, 0.4),
            term(1, 2, 0.3, -0.4),
            term(0, 2, 0.7, -1.5),
        ];
        Departure::new(terms, [0, SIZE[0] - 1], [0, SIZE[1] - 1])
    }

    /// Two uniform lattices under a known bend come out within their errors, and neither is said to change.
    #[test]
    fn known_bends_are_no_change_of_either_lattice() {
        const SEEDS: u64 = 12;
        let pairs = [
            Matrix2::new(0.45, -0.02, 0.21, 0.52),
            Matrix2::new(0.33, 0.12, 0.04, 0.35),
        ];
        let bent = bent();
        let geometry = Geometry {
            pixel_to_nm: Matrix2::identity(),
            origin: Vector2::zeros(),
            from_sensors: true,
            size: SIZE,
            covariance: Matrix4::zeros(),
            departure: Some(Arc::new(bent.clone())),
        };
        let mut pulls = 0.0;
        for seed in 0..SEEDS {
            let mut normal = normals(seed, "several on a bent grid", 0);
            let value = |i: usize| {
                let at = Vector2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
                let at = at + bent.at(at);
                let of = |pair: &Matrix2<f64>| {
                    let [a, b] = [0, 1].map(|j| pair.column(j).dot(&at));
                    a.cos() + b.cos() + (b - a).cos()
                };
                of(&pairs[0]) + 0.8 * of(&pairs[1]) + 0.3 * normal()
            };
            let values = (0..SIZE[0] * SIZE[1]).map(value);
            let image = Image::new(SIZE[1], SIZE[0], values.collect());
            let found = measure_several(&image, &geometry, Background::Plane, 2).unwrap();
            let fits = found.into_iter().map(|found| found.fit.unwrap());
            let fits: Vec<_> = fits.collect();
            assert!(fits.iter().all(|fit| fit.change().is_none()), "{seed}");
            for pair in &pairs {
                let pulls_of = |fit: &LatticeFit| {
                    let waves = fit.wave_vectors;
                    let name = (pair.try_inverse().unwrap() * waves.basis).map(f64::round);
                    let miss = waves.basis - pair * name;
                    (0..4)
                        .map(|i| miss[i].powi(2) / waves.covariance[(i, i)])
                        .sum::<f64>()
                };
                pulls += fits.iter().map(pulls_of).fold(f64::INFINITY, f64::min);
            }
        }
        let rms = (pulls / (8.0 * SEEDS as f64)).sqrt();
        assert!((0.8..1.25).contains(&rms), "{rms}");
    }
}
