//! The lattice of an image with waves beside it, such as stripes.
//!
//! A wave as strong as those of a lattice makes another lattice with two of them, or beats with one of them, so that the lattice seems to cover a part of
//! the frame, or to be grains. Which description is right is told by what they predict.

use std::sync::Arc;

use nalgebra::Matrix2;

use crate::coverage::find::cells;
use crate::explain::beside::wave_beside;
use crate::explain::evidence::BETTER;
use crate::explain::table::of_shell;
use crate::explain::waves::{Part, WithWaves, better_with_waves};
use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::measure::measure_levelled;
use crate::lattice::measured::{Evidence, MeasuredLattice};
use crate::lattice::predicted::{bends, with_evidence_beside};
use crate::lattice::several::together::{measure_several_from, take_off};
use crate::lattice::start::{Start, measure_pair};
use crate::spectrum::method::Method;

/// The lattice in what an image without its background leaves without strong waves, if that predicts better than the lattice `found` without them.
pub(crate) fn without_waves(
    image: &Image,
    found: &MeasuredLattice,
    geometry: &Geometry,
    background: Background,
) -> Option<MeasuredLattice> {
    is_doubtful(image, found).then_some(())?;
    let (own, size) = (found.reciprocal, [image.columns, image.rows]);
    // A smaller cell has the stronger waves of the same lattice: which one it is, is asked once the waves are off.
    let is_other = |pair: &Matrix2<f64>| cells(size, &own, pair).is_none();
    let others = Start::proposals(image, geometry, background).into_iter();
    let pairs = std::iter::once(own).chain(others.filter(is_other));
    let all = pairs.filter_map(|pair| WithWaves::of(image, &pair));
    // The waves of another grain have several directions.
    let all = all.filter(|with| found.grains.is_empty() || with.are_stripes);
    let best = all.max_by(|a, b| a.weakest.total_cmp(&b.weakest))?;
    (best.weakest > BETTER).then_some(())?;
    let rest = Arc::new(best.taken_off(image)?);
    let straight = best.lattice();
    // Skirts of a lattice that ends count as waves, and are no better than an end.
    (better_with_waves(image, &rest, &[straight], &parts(found))? > 0.0).then_some(())?;
    let mut other = measure_levelled(&rest, geometry, background, Method::Lattice).ok()?;
    // The waves that are taken off may be those of a larger cell.
    for (larger, before) in other.larger.iter_mut().zip(found.larger) {
        let both = [*larger, before].into_iter().flatten();
        *larger = both.max_by(|a, b| a.predicts.total_cmp(&b.predicts));
    }
    let predicts = better_with_waves(image, &rest, &parts(&other), &parts(found))?;
    (predicts > BETTER).then_some(other)
}

/// The lattice that makes the most of an image without its background, measured together with a second one on top of it, if both predict better than
/// the lattice `found` does.
pub(crate) fn with_another(
    image: &Image,
    found: &MeasuredLattice,
    geometry: &Geometry,
    background: Background,
) -> Option<MeasuredLattice> {
    shows_more(found).then_some(())?;
    // What was found may be a superlattice of both.
    let evidence = found.evidence.as_ref();
    let mut starts = vec![Some(found.clone())];
    if let Some([_, part]) = evidence.and_then(Evidence::part_of_cell) {
        let pair = of_shell(&found.reciprocal, part.cells - 1);
        let part = measure_pair(&pair, None, image, geometry, background, Method::Lattice);
        starts.extend([part, None]);
    }
    let both = starts.iter().filter_map(|first| {
        let first = first.as_ref();
        let both = measure_several_from(first, image, geometry, background, 2).ok()?;
        better_of_two(&both, image, found, geometry)
    });
    let (_, best) = both.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(best)
}

/// The same of the two lattices `both`, and the power that they leave.
fn better_of_two(
    both: &[MeasuredLattice],
    image: &Image,
    found: &MeasuredLattice,
    geometry: &Geometry,
) -> Option<(f64, MeasuredLattice)> {
    let displacement = geometry.displacement();
    let model = |lattice: &MeasuredLattice| {
        let fit = lattice.fit.as_ref()?;
        Some(fit.waves(image, displacement.as_ref()))
    };
    let models = both.iter().map(model).collect::<Option<Vec<_>>>()?;
    // Higher orders of one may lie where the other has its first.
    let power = |lattice: &MeasuredLattice| {
        let first = lattice.fit.iter().flat_map(|fit| &fit.harmonics[..3]);
        first
            .map(|harmonic| harmonic.amplitude.powi(2))
            .sum::<f64>()
    };
    let own = usize::from(power(&both[1]) > power(&both[0]));
    let mut rest = image.clone();
    take_off(&mut rest, &models[1 - own]);
    let better = better_with_waves(image, &rest, &parts(&both[own]), &parts(found))?;
    (better > BETTER).then_some(())?;
    let second = &both[1 - own].reciprocal;
    let answer = with_evidence_beside(both[own].clone(), second, [image, &rest], geometry)?;
    take_off(&mut rest, &models[own]);
    let there = rest.values.iter().filter(|value| value.is_finite());
    Some((there.map(|value| value * value).sum(), answer))
}

/// Whether the image may show more than one lattice.
fn shows_more(found: &MeasuredLattice) -> bool {
    let shows = |evidence: &Evidence| {
        let other = evidence.undecided().or_else(|| evidence.part_of_cell());
        evidence.beside.is_some() || evidence.rivals > 0 || other.is_some()
    };
    // Grains leave out what is between them, which two lattices everywhere do not.
    found.grains.is_empty() && found.evidence.as_ref().is_some_and(shows)
}

/// Whether waves beside it may have made a lattice, or hidden one.
fn is_doubtful(image: &Image, found: &MeasuredLattice) -> bool {
    let is_strong =
        || wave_beside(image, &found.reciprocal, bends(found)).is_some_and(|w| w.strength >= 1.0);
    found.patch.is_some() || disagrees(found) || is_strong()
}

fn disagrees(found: &MeasuredLattice) -> bool {
    found.fit.as_ref().is_none_or(LatticeFit::disagrees)
}

/// A lattice and the grains beside it.
fn parts(found: &MeasuredLattice) -> Vec<Part<'_>> {
    let own = Part {
        pair: found.reciprocal,
        bends: bends(found),
        holds: Box::new(|place| found.patch.as_ref().is_none_or(|patch| patch.holds(place))),
    };
    let beside = found.beside.iter().flat_map(parts);
    std::iter::once(own).chain(beside).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::Vector2;

    use super::*;
    use crate::lattice::find::measure;
    use crate::numbers::rng::normals;
    use crate::numbers::three::three;

    const SIZE: usize = 128;
    const SEEDS: u64 = 12;
    const STRIPED: u64 = 20;

    /// Eight to ten periods of a lattice.
    fn pair() -> Matrix2<f64> {
        Matrix2::new(0.45, -0.02, 0.21, 0.52)
    }

    fn lattice(at: Vector2<f64>) -> f64 {
        let waves = three(&pair());
        waves.iter().map(|q| (q.dot(&at) + 0.7).cos()).sum()
    }

    fn image(seed: u64, value: impl Fn(Vector2<f64>) -> f64) -> Image {
        let mut normal = normals(seed, "beside", 0);
        let values = (0..SIZE * SIZE).map(|i| {
            let at = Vector2::new((i % SIZE) as f64, (i / SIZE) as f64);
            value(at) + 0.3 * normal()
        });
        Image::new(SIZE, SIZE, values.collect())
    }

    fn geometry() -> Geometry {
        Geometry::of_pitch([SIZE, SIZE], [0.25, 0.25], 0.0, Vector2::zeros()).unwrap()
    }

    /// A wave one and a half times as strong as those of a lattice and two cycles of the frame from one of them, with an overtone: what is found is the
    /// lattice, in four images of five, and its waves are off by no more than the errors say. Sixteen images are 64 numbers, whose rms scatters by 9 %.
    #[test]
    fn stripes_close_to_a_lattice_are_told_from_it() {
        let (mut sum, mut answered) = (0.0, 0);
        for seed in 0..STRIPED {
            let turn = seed as f64 * 0.5;
            let away = Vector2::new(turn.cos(), turn.sin()) * (2.0 * TAU / SIZE as f64);
            let q = three(&pair())[seed as usize % 3] + away;
            let stripes = |at: Vector2<f64>| {
                let theta = q.dot(&at) + turn;
                1.5 * theta.cos() + 0.4 * (2.0 * theta).cos()
            };
            let striped = image(seed, |at| lattice(at) + stripes(at));
            let found = measure(&striped, &geometry(), Background::Plane, Method::Lattice);
            let Some(fit) = found.ok().and_then(|found| found.fit) else {
                continue;
            };
            let names = pair().try_inverse().unwrap() * fit.wave_vectors.basis;
            let whole = names.map(f64::round);
            assert_eq!(whole.determinant().abs(), 1.0, "{seed}: {names}");
            let error = fit.wave_vectors.basis - pair() * whole;
            sum += error.norm_squared() / fit.wave_vectors.covariance.trace();
            answered += 1;
        }
        let pull = (sum / f64::from(answered)).sqrt();
        assert!((0.75..1.25).contains(&pull), "{pull}");
        assert!(answered >= STRIPED as i32 * 3 / 4, "{answered}");
    }

    /// Nothing is taken off a lattice that is alone, covers a part of the frame, or changes across it.
    #[test]
    fn what_a_lattice_does_is_no_stripes() {
        let taken = |image: &Image| {
            let image = Arc::new(image.clone());
            let (geometry, background) = (geometry(), Background::Mean);
            let found = measure_levelled(&image, &geometry, background, Method::Lattice).unwrap();
            without_waves(&image, &found, &geometry, background)
        };
        for seed in 0..SEEDS / 3 {
            assert!(taken(&image(seed, lattice)).is_none(), "alone, {seed}");
            let turn = seed as f64 * 0.5;
            let across = Vector2::new(turn.cos(), turn.sin());
            let from_middle = |at: Vector2<f64>| (at - Vector2::repeat(64.0)).dot(&across);
            let half = |at| {
                if from_middle(at) < 10.0 {
                    lattice(at)
                } else {
                    0.0
                }
            };
            assert!(taken(&image(seed, half)).is_none(), "half, {seed}");
            let bent =
                |at: Vector2<f64>| lattice(at + across * (from_middle(at) / 64.0).powi(2) * 4.0);
            assert!(taken(&image(seed, bent)).is_none(), "bent, {seed}");
        }
    }
}
