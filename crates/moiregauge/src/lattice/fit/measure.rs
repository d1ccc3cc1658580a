//! The fit from its start to what it says: all harmonics that earn their place, and perfect waves beside the lattice taken off.

use heterostrain::lattice::{Lattice, Px};

use crate::frame::background::Background;
use crate::frame::image::Image;
use crate::lattice::fit::beside;
use crate::lattice::fit::fit_pixels::{FinalNoise, Fit};
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::fit::levelled::Levelled;
use crate::lattice::fit::misfits::Misfits;
use crate::lattice::fit::noise::{ForeignWave, ResidualNoise};
use crate::lattice::fit::straight::without_bend;
use crate::lattice::fit::uneven::Ground;
use crate::spectrum::harmonics::Harmonics;

/// Rounds of taking out places that do not show the lattice: each shows weaker ones.
const ROUNDS: usize = 4;
/// Ground is taken off where that leaves less than this share of the variance of the wave vectors: what it makes of the edges of holes is no better than
/// leaving it.
pub(crate) const CLEARER: f64 = 0.7;

/// A lattice fitted to an image.
pub(crate) struct Found {
    pub(crate) lattice: Lattice<Px>,
    pub(crate) fit: LatticeFit,
    /// The image without the places that do not show the lattice, where there are some.
    pub(crate) rest: Option<Image>,
}

/// Fits the lattice, starting from what the spectrum of `image` says.
///
/// `None` where the fit does not settle within half a cycle over the frame of its start, or the
/// harmonics cannot be told apart on this frame. Everything counts in pixels of `image`.
pub(crate) fn measure(image: &Image, start: &Harmonics, background: Background) -> Option<Found> {
    measure_rest(image, start, background, None, ROUNDS)
}

/// The same of an image from which `ground` was taken off, with so many rounds of taking out what does not show the lattice.
fn measure_rest(
    image: &Image,
    start: &Harmonics,
    background: Background,
    ground: Option<&Ground>,
    rounds: usize,
) -> Option<Found> {
    let levelled = ground.map(|ground| ground.levelled);
    let (fit, noise) = finished(image, start, background, levelled)?;
    let misfits = if rounds > 0 { fit.misfits() } else { None };
    let Some(misfits) = misfits else {
        return fit.found(&noise, start, background);
    };
    let again = |(rest, ground): (Image, Option<Ground>)| {
        let found = measure_rest(&rest, start, background, ground.as_ref(), rounds - 1)?;
        Some(Found {
            rest: Some(found.rest.unwrap_or(rest)),
            ..found
        })
    };
    let even = if rounds == ROUNDS {
        fit.levelled().and_then(again)
    } else {
        None
    };
    let rest = fit.rest(&misfits, &noise, ground).and_then(again);
    let plain = rest.or_else(|| fit.found(&noise, start, background));
    match (plain, even) {
        (Some(plain), Some(mut even)) if is_clearer(&even, &plain) => {
            // The waves of a first shell are in the ground that was taken off.
            even.fit.hidden = plain.fit.hidden;
            Some(even)
        }
        (plain, even) => plain.or(even),
    }
}

/// Whether one says much more than another, which is no second shell.
fn is_clearer(one: &Found, other: &Found) -> bool {
    let variance = |found: &Found| found.fit.wave_vectors.covariance.trace();
    !other.fit.hidden.is_first_shell() && variance(one) < CLEARER * variance(other)
}

/// The fit with all harmonics that earn their place, and the noise that it leaves.
fn finished<'a>(
    image: &'a Image,
    start: &Harmonics,
    background: Background,
    levelled: Option<Levelled>,
) -> Option<(Fit<'a>, FinalNoise)> {
    let mut fit = Fit::new(image, start, background, levelled)?;
    if fit.worth_a_sketch(start) && fit.sketch().is_none() {
        fit = Fit::new(image, start, background, levelled)?;
    }
    let noise = fit.choose()?;
    let noise = without_bend(&fit, noise);
    Some((fit, noise))
}

impl Fit<'_> {
    /// The image without the ground below the lattice; `None` where that is even, or rough throughout.
    fn levelled(&self) -> Option<(Image, Option<Ground>)> {
        let levelled = Levelled::for_cell(self.unit_cell()?);
        let ground = self.ground(levelled, self.frame.image, None);
        let ground = ground.filter(Ground::is_in_places)?;
        Some((ground.off(self.frame.image), Some(ground)))
    }

    /// The image without the places that do not show the lattice, and its ground without them. `None` where they are too many. A lattice that bends
    /// leaves more where it is farthest from straight, and is left as it is.
    fn rest(
        &self,
        misfits: &Misfits,
        noise: &FinalNoise,
        ground: Option<&Ground>,
    ) -> Option<(Image, Option<Ground>)> {
        if !misfits.are_few || self.bends(noise) {
            return None;
        }
        let rest = misfits.taken_out(self.frame.image);
        let Some(before) = ground else {
            return Some((rest, None));
        };
        // What was below the places that are gone spread into the ground beside them.
        let rest = before.put_back(&rest);
        let ground = self.ground(before.levelled, &rest, Some(before));
        let rest = match &ground {
            Some(ground) => ground.off(&rest),
            None => rest,
        };
        Some((rest, ground))
    }

    /// What it found, without perfect waves beside the lattice.
    fn found(
        &self,
        noise: &FinalNoise,
        start: &Harmonics,
        background: Background,
    ) -> Option<Found> {
        let foreign = noise.residual.foreign_wave(&self.frame, &self.model);
        let again = foreign.and_then(|wave| self.again_without(&wave, noise, start, background));
        let (lattice, fit) = again.or_else(|| self.told(noise, None))?;
        Some(Found {
            lattice,
            fit,
            rest: None,
        })
    }

    /// What it says, with contrast that changes where it does. `strongest`: of the waves that were taken off.
    fn told(
        &self,
        noise: &FinalNoise,
        strongest: Option<ForeignWave>,
    ) -> Option<(Lattice<Px>, LatticeFit)> {
        let result = |fit: &Fit, noise: &FinalNoise| {
            let beside = || noise.residual.foreign_wave(&fit.frame, &fit.model);
            fit.result(noise, strongest.or_else(beside))
        };
        let Some(faded) = self.faded(noise) else {
            return result(self, noise);
        };
        let (image, contrast) = (self.evened(&faded), faded.contrast);
        let (mut fit, contrast) = match self.of_even(faded, &image) {
            Some(even) => (result(&even.fit, &even.noise)?.1, even.contrast),
            None => (result(self, noise)?.1, contrast.untold()),
        };
        Some((fit.add(contrast)?, fit))
    }

    /// The same in the image without perfect waves beside the lattice, of which `strongest` is one; `None` where there are none, or where they are
    /// those of a first shell. What is told of it is how it stands out of the noise that is then left.
    fn again_without(
        &self,
        strongest: &ForeignWave,
        noise: &FinalNoise,
        start: &Harmonics,
        background: Background,
    ) -> Option<(Lattice<Px>, LatticeFit)> {
        if !beside::is_strong(strongest) || self.hidden(noise).is_first_shell() {
            return None;
        }
        let (frame, model) = (&self.frame, &self.model);
        let seen = |seen: &ResidualNoise| seen.foreign_wave(frame, model);
        let image = beside::without_waves(frame, &model.pair, self.left(), seen)?;
        let (fit, left) = finished(&image, start, background, frame.levelled)?;
        let k = strongest.wave_vector.component_mul(&frame.edge()) / std::f64::consts::PI;
        let quieter = noise.residual.noise_near(k) / left.residual.noise_near(k);
        let told = ForeignWave {
            significance: strongest.significance * quieter.max(1.0),
            ..*strongest
        };
        fit.told(&left, Some(told))
    }
}
