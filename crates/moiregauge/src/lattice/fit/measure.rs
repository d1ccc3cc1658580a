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

/// Fits the lattice, starting from what the spectrum of `image` says.
///
/// `None` where the fit does not settle within half a cycle over the frame of its start, or the
/// harmonics cannot be told apart on this frame. Everything counts in pixels of `image`.
pub(crate) fn measure(
    image: &Image,
    start: &Harmonics,
    background: Background,
) -> Option<(Lattice<Px>, LatticeFit)> {
    let (fit, noise) = finished(image, start, background)?;
    let foreign = noise.residual.foreign_wave(&fit.frame, &fit.model);
    let again = foreign.and_then(|wave| fit.again_without(&wave, &noise, start, background));
    again.or_else(|| fit.result(&noise, foreign))
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
    /// The same in the image without perfect waves beside the lattice, of which `strongest` is one; `None` where there are none. What is
    /// told of it is how it stands out of the noise that is then left.
    fn again_without(
        &self,
        strongest: &ForeignWave,
        noise: &FinalNoise,
        start: &Harmonics,
        background: Background,
    ) -> Option<(Lattice<Px>, LatticeFit)> {
        if !beside::is_strong(strongest) {
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
        fit.result(&left, Some(told))
    }
}
