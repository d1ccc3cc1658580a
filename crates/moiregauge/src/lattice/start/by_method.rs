//! The lattice of an image measured from its start, by any method.

use heterostrain::lattice::{Lattice, Px, Waves, labelled_like};
use nalgebra::{Matrix2, Vector2};

use crate::coverage::bend::Mean;
use crate::lattice::common::Common;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::fit::measure as fit;
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::paper::PublishedPeaks;
use crate::lattice::start::{Start, fitted};
use crate::lattice::{autocorrelation, fourier, paper};
use crate::spectrum::error::LatticeError;
use crate::spectrum::harmonics::Harmonics;
use crate::spectrum::method::Method;
use crate::spectrum::phases::Phases;
use crate::spectrum::prepare::{Prepared, middle, phases};
use crate::spectrum::select::periods;
use crate::spectrum::verdict::signal_to_noise;

/// What a method sees.
struct Seen {
    pixels: Lattice<Px>,
    /// The same by another method.
    comparison: Option<Lattice<Px>>,
    fit: Option<LatticeFit>,
    published: Option<PublishedPeaks>,
}

impl Start {
    /// Measures the lattice.
    ///
    /// # Errors
    /// [`LatticeError::NoPeaks`]: the method gets no hold of it.
    pub fn measure(&self, method: Method) -> Result<MeasuredLattice, LatticeError> {
        let mut found = self.measure_this(method)?;
        let beside = self.beside.iter().map(|start| start.measure(method));
        found.beside = beside.filter_map(Result::ok).collect();
        Ok(found)
    }

    /// The same without the grains beside it.
    fn measure_this(&self, method: Method) -> Result<MeasuredLattice, LatticeError> {
        let by_fit = method == Method::Lattice;
        let mean = self.mean.as_ref().filter(|_| by_fit);
        let of_mean = |mean| {
            let found = self.mean_lattice(mean);
            found.ok_or(LatticeError::NoPeaks { method })
        };
        if let Some(mean) = mean.filter(|mean| mean.change.is_some()) {
            return of_mean(mean);
        }
        let (prepared, size) = (&self.prepared, self.prepared.size());
        let refined = || prepared.refined(self.background);
        let refined = (!by_fit).then(refined).flatten();
        let (harmonics, peaks) = match &refined {
            Some((harmonics, peaks)) => (harmonics, peaks),
            None => (&prepared.harmonics, &prepared.peaks),
        };
        let pixels_per_bin = prepared.binning as f64;
        let in_pixels = |l: Lattice<Px>| l.mapped(&(Matrix2::identity() * pixels_per_bin));
        let fourier = || fourier::measure(harmonics, peaks, size).map(in_pixels);
        let autocorrelation = || {
            let (image, start) = (prepared.binned(), &prepared.start);
            let found = autocorrelation::measure(&image, self.background, harmonics, start);
            found.map(in_pixels)
        };
        let (mut fit, mut published) = (None, None);
        let (pixels, comparison) = match method {
            Method::Autocorrelation => (autocorrelation(), fourier()),
            Method::Fourier => (fourier(), autocorrelation()),
            Method::Lattice => {
                let found = fitted(&self.prepared, &self.geometry, self.background);
                if let Some(mean) = mean
                    && !found.as_ref().is_some_and(|found| is_better(found, mean))
                {
                    let fit = found.as_ref().map(|found| &found.fit);
                    let changing = fit.and_then(|fit| self.changing(fit));
                    return of_mean(changing.as_ref().unwrap_or(mean));
                }
                fit = found.map(|found| (found.lattice, found.fit));
                (fit.as_ref().map(|(lattice, _)| *lattice), fourier())
            }
            Method::Paper => {
                let image = &self.prepared.image;
                let found =
                    paper::measure(image, &self.geometry, &(prepared.start * pixels_per_bin));
                published = found.map(|(_, peaks)| peaks);
                (found.map(|(lattice, _)| lattice), fourier())
            }
        };
        let pixels = pixels.ok_or(LatticeError::NoPeaks { method })?;
        let seen = Seen {
            pixels,
            comparison,
            fit: fit.map(|(_, fit)| fit),
            published,
        };
        Ok(self.told(seen, harmonics, peaks))
    }

    /// All that is known of a lattice that was measured in the bins of `harmonics` and `peaks`.
    fn told(
        &self,
        seen: Seen,
        harmonics: &Harmonics,
        peaks: &[Vector2<f64>; 3],
    ) -> MeasuredLattice {
        let Seen {
            pixels,
            comparison,
            fit,
            published,
        } = seen;
        let size = self.prepared.size();
        let pixels_per_bin = self.prepared.binning as f64;
        let label = |l: Lattice<Px>| labelled_like(&l, &pixels.basis);
        let bin_to_nm = self.geometry.pixel_to_nm * pixels_per_bin;
        MeasuredLattice {
            patch: self.patch.clone(),
            grains: self.others.clone(),
            beside: Vec::new(),
            larger: [None; 3],
            ground: None,
            change: None,
            common: fit.as_ref().and_then(|fit| Common::of_fit(fit, &pixels)),
            pixels,
            comparison: comparison.map(label),
            reciprocal: fit.as_ref().map_or(harmonics.pair / pixels_per_bin, |fit| {
                fit.wave_vectors.basis
            }),
            phases: fit
                .as_ref()
                .map_or_else(|| phases(harmonics, size), LatticeFit::first_phases),
            middle: fit.as_ref().map_or_else(
                || middle(size) * pixels_per_bin + Vector2::repeat((pixels_per_bin - 1.0) / 2.0),
                LatticeFit::middle,
            ),
            evidence: None,
            shortcut_wavelengths: fourier::shortcut_wavelengths(peaks, &bin_to_nm),
            periods: self.periods(&pixels),
            signal_to_noise: fit.as_ref().map_or_else(
                || signal_to_noise(harmonics)[2],
                LatticeFit::weakest_signal_to_noise,
            ),
            published,
            fit,
            atoms: None,
        }
    }

    /// The mean in a part of the frame where the fit to the pixels says that the lattice changes, and what windows show does not pay for it.
    fn changing(&self, fit: &LatticeFit) -> Option<Mean> {
        fit.change()?;
        let mean = self.settled()?.refined_change()?;
        (!mean.is_poor()).then_some(mean)
    }

    /// The mean of a lattice that changes.
    fn mean_lattice(&self, mean: &Mean) -> Option<MeasuredLattice> {
        let Prepared {
            harmonics, peaks, ..
        } = &self.prepared;
        let bins = self.prepared.binning as f64;
        let pixels = mean.waves.lattice()?;
        let fourier = fourier::measure(harmonics, peaks, self.prepared.size());
        let bin_to_nm = self.geometry.pixel_to_nm * bins;
        Some(MeasuredLattice {
            comparison: fourier
                .map(|l| labelled_like(&l.mapped(&(Matrix2::identity() * bins)), &pixels.basis)),
            pixels,
            patch: self.patch.clone(),
            grains: self.others.clone(),
            beside: Vec::new(),
            larger: [None; 3],
            ground: None,
            change: mean.change,
            common: Common::of(mean, &pixels),
            reciprocal: mean.waves.basis,
            phases: Phases {
                values: mean.phases,
                covariance: mean.phase_covariance,
            },
            middle: mean.middle,
            evidence: None,
            shortcut_wavelengths: fourier::shortcut_wavelengths(peaks, &bin_to_nm),
            periods: self.periods(&pixels),
            signal_to_noise: mean.signal_to_noise,
            published: None,
            fit: None,
            atoms: None,
        })
    }

    /// Periods across the shorter side of the frame, or of the patch.
    fn periods(&self, pixels: &Lattice<Px>) -> f64 {
        let size = match &self.patch {
            Some(patch) => {
                let [low, high] = patch.corners();
                high - low
            }
            None => Vector2::new(self.size[0] as f64, self.size[1] as f64),
        };
        let real = Matrix2::from_diagonal(&size.map(f64::recip)) * pixels.basis;
        real.try_inverse()
            .and_then(|cycles| periods(&cycles.transpose()))
            .unwrap_or(0.0)
    }
}

/// Whether a fit to the pixels says more than what windows show: the lattice is the same everywhere, and its errors are smaller.
fn is_better(found: &fit::Found, mean: &Mean) -> bool {
    let fit = &found.fit;
    let size = |waves: &Waves<Px>| waves.covariance.trace();
    fit.change().is_none() && size(&fit.wave_vectors) < size(&mean.waves)
}
