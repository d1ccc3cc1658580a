//! The fit from its start to what it says: all harmonics that earn their place, and perfect waves beside the lattice taken off.

use heterostrain::lattice::{Lattice, Px};

use crate::frame::background::Background;
use crate::frame::image::Image;
use crate::lattice::fit::beside;
use crate::lattice::fit::fit_pixels::{FinalNoise, Fit};
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::fit::noise::{ForeignWave, ResidualNoise};
use crate::lattice::fit::straight::without_bend;
use crate::spectrum::harmonics::Harmonics;

/// Rounds of taking out places that do not show the lattice: each shows weaker ones.
const ROUNDS: usize = 4;

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
    measure_rest(image, start, background, ROUNDS)
}

/// The same with so many rounds of taking out what does not show the lattice.
fn measure_rest(
    image: &Image,
    start: &Harmonics,
    background: Background,
    rounds: usize,
) -> Option<Found> {
    let (fit, noise) = finished(image, start, background)?;
    let misfits = if rounds > 0 { fit.misfits() } else { None };
    // A lattice that bends leaves more where it is farthest from straight, and is left as it is.
    let misfits = misfits.filter(|misfits| misfits.are_few && !fit.bends(&noise));
    let rest = misfits.map(|misfits| misfits.taken_out(image));
    let again = rest.and_then(|rest| {
        let found = measure_rest(&rest, start, background, rounds - 1)?;
        Some(Found {
            rest: Some(found.rest.unwrap_or(rest)),
            ..found
        })
    });
    again.or_else(|| fit.found(&noise, start, background))
}

/// The fit with all harmonics that earn their place, and the noise that it leaves.
fn finished<'a>(
    image: &'a Image,
    start: &Harmonics,
    background: Background,
) -> Option<(Fit<'a>, FinalNoise)> {
    let mut fit = Fit::new(image, start, background)?;
    if fit.worth_a_sketch(start) && fit.sketch().is_none() {
        fit = Fit::new(image, start, background)?;
    }
    let noise = fit.choose()?;
    let noise = without_bend(&fit, noise);
    Some((fit, noise))
}

impl Fit<'_> {
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
        let (fit, left) = finished(&image, start, background)?;
        let k = strongest.wave_vector.component_mul(&frame.edge()) / std::f64::consts::PI;
        let quieter = noise.residual.noise_near(k) / left.residual.noise_near(k);
        let told = ForeignWave {
            significance: strongest.significance * quieter.max(1.0),
            ..*strongest
        };
        fit.told(&left, Some(told))
    }
}
