//! Evidence for a lattice: what it predicts, and what each family of its waves adds to that.

use heterostrain::Estimate;
use nalgebra::Matrix2;

use crate::explain::normal::{Normal, RIDGE, gains};
use crate::explain::phases::Phases;
use crate::explain::scene::{FOLDS, Scene};
use crate::frame::background::{Background, remove_background};
use crate::frame::image::Image;
use crate::numbers::chi2::enlargement;
use crate::numbers::spread::mean_and_spread;
use crate::spectrum::shells::{FIRST_SHELL, shells};

/// Standard errors by which a better description predicts more. Larger cells that were there gained 10 and more, those that were
/// not at most 2.7 (simulated frames of two generators, lines with gains among them): chance makes as much in one of 30,000 comparisons.
/// A faint first order gains 3 to 6 in an image, so that sets decide.
pub(crate) const BETTER: f64 = 4.0;

/// By how much more of the variance one description predicts than another, block by block, with the fold of each.
#[derive(Clone, Debug)]
pub(crate) struct Blocks(Vec<(usize, f64)>);

impl Blocks {
    /// Of the gains of two descriptions; blocks of which too little is there are left out.
    pub(crate) fn difference(scene: &Scene, one: &[f64], other: &[f64]) -> Self {
        let power = scene.values.iter().map(|v| v * v).sum::<f64>();
        let each = one.iter().zip(other).zip(scene.filled()).enumerate();
        let there = each.filter(|(_, (_, filled))| *filled);
        let share = |a: &f64, b: &f64| (a - b) / power.max(f64::MIN_POSITIVE);
        Self(
            there
                .map(|(block, ((a, b), _))| (Scene::fold(block), share(a, b)))
                .collect(),
        )
    }

    /// The mean over its standard error. That is the scatter of blocks, enlarged where bands of lines, which are held out together, scatter significantly
    /// more. It is no less than what the damping of amplitudes leaves of the variance, and rounding.
    pub(crate) fn standard_errors(&self) -> f64 {
        self.by_blocks() / self.enlargement().sqrt()
    }

    /// The same by the scatter of blocks alone: for a doubt, where too large an error would hide it.
    pub(crate) fn by_blocks(&self) -> f64 {
        let spread = self.spread();
        spread.value / (spread.sigma / (self.0.len() as f64).sqrt()).max(RIDGE * RIDGE)
    }

    fn spread(&self) -> Estimate {
        mean_and_spread(&self.0.iter().map(|(_, x)| *x).collect::<Vec<f64>>())
    }

    /// By what factor bands scatter more, as variances.
    fn enlargement(&self) -> f64 {
        let spread = self.spread();
        let mut bands = [[0.0; 2]; FOLDS];
        for (band, x) in &self.0 {
            bands[*band][0] += x - spread.value;
            bands[*band][1] += 1.0;
        }
        let bands = bands.into_iter().filter(|[_, blocks]| *blocks > 0.0);
        let bands = bands.map(|[sum, blocks]| sum * sum / (blocks * spread.sigma.powi(2)));
        let (chi2, bands) = bands.fold((0.0, 0), |(sum, n), band| (sum + band, n + 1_usize));
        enlargement(chi2, bands.saturating_sub(1))
    }
}

/// By how many standard errors over blocks the weakest of the three families of collinear waves of a lattice (reciprocal pair at 60°, rad per pixel)
/// improves the prediction of pixels that were held out, in an image without its background; `bends`: its phases may be cubic polynomials. Means of
/// lines are taken off where that shows more. `None` where the image is too small.
pub(crate) fn weakest(image: &Image, pair: &Matrix2<f64>, bends: bool) -> Option<f64> {
    let level = || remove_background(image, Background::LineMean);
    let (plain, level) = rayon::join(
        || of_image(image, pair, bends),
        || of_image(&level(), pair, bends),
    );
    plain.map(|plain| level.map_or(plain, |level| level.max(plain)))
}

fn of_image(image: &Image, pair: &Matrix2<f64>, bends: bool) -> Option<f64> {
    let scene = Scene::new(image, pair, pair)?;
    let indices = shells(3);
    let straight = Phases::straight(pair * scene.binning as f64);
    let scene = scene.without_waves_beside(&straight.pair, &straight.pair, indices);
    let normals = Phases::shown(&scene, straight.pair, bends).normals(&scene, indices);
    weakest_family(&scene, &normals, indices)
}

/// By how many standard errors the weakest family improves the prediction. `normals`: those of the harmonics `indices`, and of waves beside them.
pub(crate) fn weakest_family(
    scene: &Scene,
    normals: &[Normal],
    indices: &[[i32; 2]],
) -> Option<f64> {
    let all: Vec<usize> = (0..normals[0].moment.len()).collect();
    let gain = gains(normals, &all)?;
    FIRST_SHELL
        .into_iter()
        .try_fold(f64::INFINITY, |least, [h, k]| {
            let is_other = |[i, j]: &[i32; 2]| h * j != k * i;
            let others = |i: &usize| indices.get(i / 2).is_none_or(is_other);
            let kept: Vec<usize> = all.iter().copied().filter(others).collect();
            let lost = Blocks::difference(scene, &gain, &gains(normals, &kept)?);
            Some(least.min(lost.standard_errors()))
        })
}

/// Fraction of the variance (without slow background) that a lattice predicts; `bends`: its phases may be cubic polynomials.
pub(crate) fn gain(image: &Image, pair: &Matrix2<f64>, bends: bool) -> Option<f64> {
    let scene = Scene::new(image, pair, pair)?;
    let indices = shells(3);
    let all: Vec<usize> = (0..2 * indices.len()).collect();
    let phases = Phases::shown(&scene, pair * scene.binning as f64, bends);
    let gain = gains(&phases.normals(&scene, indices), &all)?;
    Some(gain.iter().sum::<f64>() / scene.values.iter().map(|v| v * v).sum::<f64>())
}

/// The lattice near a proposed one that fits best, and by how many standard errors its weakest family predicts. `pair`: reciprocal pair at 60°, rad per
/// pixel, to within a cycle per frame.
pub(crate) fn proposed(image: &Image, pair: &Matrix2<f64>) -> Option<(Matrix2<f64>, f64)> {
    let scene = Scene::new(image, pair, pair)?;
    let binning = scene.binning as f64;
    let straight = Phases::straight(pair * binning);
    // What predicts nothing near its place is not fitted.
    let predicts = weakest_family(&scene, &straight.normals(&scene, shells(3)), shells(3))?;
    (predicts > 0.0).then_some(())?;
    let fitted = straight.fitted(&scene, shells(2), 0)?;
    let fitted = fitted.pair / binning;
    let frame = Matrix2::from_diagonal(&scene.half) * (binning / std::f64::consts::PI);
    let moved = frame * (fitted - pair);
    if moved.column_iter().any(|off| off.norm() > 1.0) {
        return None;
    }
    Some((fitted, of_image(image, &fitted, false)?))
}
