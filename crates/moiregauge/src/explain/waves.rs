//! A lattice and waves beside it, such as stripes, as one description of an image.

use nalgebra::{Matrix2, Vector2};

use crate::explain::evidence::{Blocks, weakest_family};
use crate::explain::normal::{gains, total};
use crate::explain::phases::Phases;
use crate::explain::scene::Scene;
use crate::frame::image::Image;
use crate::spectrum::shells::{FIRST_SHELL, shells};

/// Waves count as strong with this share of the amplitude of the weakest first-order wave: those of one lattice differ by some tens of per cent.
const STRONG: f64 = 0.5;

/// A straight lattice and perfect waves beside it.
pub(crate) struct WithWaves {
    /// Per pixel.
    phases: Phases,
    /// By how many standard errors the weakest family of the lattice improves the prediction.
    pub(crate) weakest: f64,
    /// The strong waves have one direction.
    pub(crate) are_stripes: bool,
}

impl WithWaves {
    /// The lattice near `pair` (reciprocal, rad per pixel) with the waves beside it that are as strong as its first order; `None` where there are
    /// none, or where they are another lattice.
    pub(crate) fn of(image: &Image, pair: &Matrix2<f64>) -> Option<Self> {
        let (scene, indices) = (Scene::new(image, pair, pair)?, shells(3));
        let binning = scene.binning as f64;
        let (waves, _) = scene.waves_beside(&(pair * binning), None, indices)?;
        let fitted = waves.fitted(&scene, indices, 0)?;
        let normals = fitted.normals(&scene, indices);
        let amplitudes = Phases::amplitudes(&total(&normals))?;
        let (lattice, beside) = amplitudes.split_at(indices.len());
        let first = lattice[..FIRST_SHELL.len()].iter();
        let least = STRONG * first.fold(f64::INFINITY, |least, a| least.min(*a));
        let strong = fitted.others.iter().zip(beside);
        let strong: Vec<Vector2<f64>> = strong
            .filter(|(_, amplitude)| **amplitude > least)
            .map(|(q, _)| *q)
            .collect();
        (!scene.add_up(&strong)).then_some(())?;
        Some(Self {
            weakest: weakest_family(&scene, &normals, indices)?,
            are_stripes: scene.are_stripes(&strong),
            phases: Phases {
                pair: fitted.pair / binning,
                others: fitted.others.iter().map(|q| q / binning).collect(),
                ..fitted
            },
        })
    }

    /// The lattice, in all of the image.
    pub(crate) fn lattice(&self) -> Part<'static> {
        Part {
            pair: self.phases.pair,
            bends: false,
            holds: Box::new(|_| true),
        }
    }

    /// The image without the waves beside the lattice.
    pub(crate) fn taken_off(&self, image: &Image) -> Option<Image> {
        let (scene, indices) = (Scene::of(image)?, shells(3));
        let (amplitudes, _) = self.phases.rest(&scene, indices)?;
        let beside = &amplitudes.as_slice()[2 * indices.len()..];
        let value = |(i, value): (usize, &f64)| {
            let at = scene.unit(i).component_mul(&scene.half);
            let waves = self.phases.others.iter().zip(beside.chunks_exact(2));
            let of_wave = |(q, a): (&Vector2<f64>, &[f64])| {
                let (sin, cos) = q.dot(&at).sin_cos();
                a[0] * cos + a[1] * sin
            };
            value - waves.map(of_wave).sum::<f64>()
        };
        let values = image.values.iter().enumerate().map(value).collect();
        Some(Image::new(image.rows, image.columns, values))
    }
}

/// A lattice in a part of an image.
pub(crate) struct Part<'a> {
    /// Reciprocal pair, rad per pixel.
    pub(crate) pair: Matrix2<f64>,
    /// Its phases may be cubic polynomials.
    pub(crate) bends: bool,
    /// Whether the part holds a pixel (column, row).
    pub(crate) holds: Box<dyn Fn([usize; 2]) -> bool + 'a>,
}

/// By how many standard errors lattices in parts of an image predict it better with the waves that are missing in `rest` than others do without.
pub(crate) fn better_with_waves(
    image: &Image,
    rest: &Image,
    with: &[Part],
    without: &[Part],
) -> Option<f64> {
    let mut pairs: Vec<Matrix2<f64>> = with.iter().chain(without).map(|part| part.pair).collect();
    pairs.sort_by(|a, b| {
        let areas = [a, b].map(|pair| pair.determinant().abs());
        areas[0].total_cmp(&areas[1])
    });
    let (coarse, fine) = (*pairs.first()?, *pairs.last()?);
    let [scene, freed] = [image, rest].map(|image| Scene::new(image, &coarse, &fine));
    let (scene, freed) = (scene?, freed?);
    let mut gain = predicted(&freed, with)?;
    for (i, block) in scene.block.iter().enumerate() {
        if let Some(block) = *block {
            gain[block] += scene.values[i].powi(2) - freed.values[i].powi(2);
        }
    }
    let other = predicted(&scene, without)?;
    Some(Blocks::difference(&scene, &gain, &other).standard_errors())
}

/// What lattices in parts of an image predict of each block.
fn predicted(scene: &Scene, parts: &[Part]) -> Option<Vec<f64>> {
    let indices = shells(3);
    let all: Vec<usize> = (0..2 * indices.len()).collect();
    let mut sum = vec![0.0; Scene::blocks()];
    for part in parts {
        let scene = scene.clone().within(&part.holds);
        let phases = Phases::shown(&scene, part.pair * scene.binning as f64, part.bends);
        let gain = gains(&phases.normals(&scene, indices), &all)?;
        sum.iter_mut()
            .zip(gain)
            .for_each(|(sum, gain)| *sum += gain);
    }
    Some(sum)
}
