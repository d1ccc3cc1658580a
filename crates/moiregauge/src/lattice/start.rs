//! Where the lattice of an image is, roughly, and the lattice measured from there.

mod parts;

use std::sync::Arc;

use heterostrain::lattice::{Lattice, Px, Waves, labelled_like, reciprocal};
use nalgebra::{Matrix2, Vector2};

use crate::coverage::bend::Mean;
use crate::coverage::find::{pitch, same};
use crate::coverage::grains::Grains;
use crate::coverage::patch::{Patch, WHOLE};
use crate::coverage::settle::{Settled, settle, settle_in_bins};
use crate::frame::background::{Background, remove_background};
use crate::frame::clip::cut_off;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::common::Common;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::fit::measure as fit;
use crate::lattice::measured::{Grain, MeasuredLattice};
use crate::lattice::{autocorrelation, fourier, paper};
use crate::numbers::three::three;
use crate::spectrum::error::{LatticeError, THIRD};
use crate::spectrum::harmonics::{Harmonics, Windowed};
use crate::spectrum::look::bins_for;
use crate::spectrum::method::Method;
use crate::spectrum::phases::Phases;
use crate::spectrum::prepare::{Prepared, binned, middle, phases, prepare, prepare_levelled};
use crate::spectrum::shells::shells;
use crate::spectrum::transform::Spectrum;
use crate::spectrum::verdict::{Verdict, refine, signal_to_noise, verdict};
use crate::spectrum::{known, rescue, select};

/// A lattice whose waves bend so much that a transform of the whole patch does not show them has at least so many unit
/// cells: it is seen by what windows show. Chosen by eye.
pub(crate) const FEWEST_CELLS: f64 = 12.0;

/// What a Hann window leaves of the power over noise of a wave: (Σw)² / (N Σw²), along both axes.
pub(crate) const HANN: f64 = 4.0 / 9.0;

/// Where the lattice of an image is, roughly: what every method starts from.
pub struct Start {
    prepared: Prepared,
    geometry: Geometry,
    background: Background,
    /// (columns, rows).
    size: [usize; 2],
    /// The part of the frame that carries the lattice; `None` for all of it.
    patch: Option<Patch>,
    /// The mean lattice, where it changes.
    mean: Option<Mean>,
    /// Other grains.
    others: Vec<Grain>,
    /// Where their lattices are, of those that can be measured.
    beside: Vec<Start>,
}

impl Start {
    /// Looks for the lattice in the spectrum.
    ///
    /// # Errors
    /// As [`measure`](crate::lattice::measure), but for [`LatticeError::NoPeaks`].
    pub fn find(
        image: &Image,
        geometry: &Geometry,
        background: Background,
    ) -> Result<Self, LatticeError> {
        let prepared = prepare(image, geometry, background)?;
        Ok(Self::new(prepared, image, geometry, background))
    }

    /// The same in an image without its background.
    pub(crate) fn find_in_levelled(
        image: &Arc<Image>,
        geometry: &Geometry,
        background: Background,
    ) -> Result<Self, LatticeError> {
        let prepared = prepare_levelled(Arc::clone(image), geometry, background)?;
        Ok(Self::new(prepared, image, geometry, background))
    }

    /// Looks for a lattice of about the cell `known` (real-space pair, nm), at any orientation.
    ///
    /// # Errors
    /// As [`Start::find`]: [`LatticeError::NoLattice`] where there is none of that size and shape.
    pub fn find_known(
        image: &Image,
        geometry: &Geometry,
        background: Background,
        known: &Matrix2<f64>,
    ) -> Result<Self, LatticeError> {
        let prepared = known::prepare(image, geometry, background, known)
            .or_else(|_| rescue::prepare_known_again(image, geometry, background, known))?;
        Ok(Self::new(prepared, image, geometry, background))
    }

    /// The same for an image whose lattice hides under tip events and line noise.
    pub(crate) fn find_again(
        image: &Image,
        geometry: &Geometry,
        background: Background,
    ) -> Result<Self, LatticeError> {
        let prepared = rescue::prepare_again(image, geometry, background)?;
        Ok(Self::new(prepared, image, geometry, background))
    }

    /// The reciprocal pairs (rad per pixel) that the spectrum proposes, whether they stand out or not.
    pub(crate) fn proposals(
        image: &Image,
        geometry: &Geometry,
        background: Background,
    ) -> Vec<Matrix2<f64>> {
        let flat = remove_background(image, background);
        let proposed = select::candidates(&Spectrum::new(&flat), &geometry.pixel_to_nm);
        proposed.into_iter().map(|c| c.pair).collect()
    }

    /// Starts from a reciprocal pair (rad per pixel) that is known to within half a cycle over the frame.
    /// `None` where it cannot be measured.
    pub(crate) fn near(
        image: &Image,
        geometry: &Geometry,
        background: Background,
        pair: &Matrix2<f64>,
    ) -> Option<Self> {
        Self::around(image, geometry, background, pair, |binned, pair| {
            refine(binned, pair, background)
        })
    }

    /// Starts from a reciprocal pair (rad per pixel) that is known better than its first waves can show.
    pub(crate) fn at(
        image: &Image,
        geometry: &Geometry,
        background: Background,
        pair: &Matrix2<f64>,
    ) -> Option<Self> {
        Self::around(image, geometry, background, pair, |binned, pair| {
            let harmonics = Windowed::new(binned).fit(binned, pair, background, shells(3))?;
            Some((harmonics, three(pair)))
        })
    }

    /// `seen`: the harmonics in an image of bins, and the three first wave vectors, from a pair.
    fn around(
        image: &Image,
        geometry: &Geometry,
        background: Background,
        pair: &Matrix2<f64>,
        seen: impl Fn(&Image, &Matrix2<f64>) -> Option<(Harmonics, [Vector2<f64>; 3])>,
    ) -> Option<Self> {
        let flat = remove_background(image, background);
        let (binning, binned) = binned(&flat, pair);
        let (harmonics, peaks) = seen(&binned, &(pair * binning as f64))?;
        drop(binned);
        let prepared = Prepared {
            start: reciprocal(&harmonics.pair)?,
            image: Arc::new(flat),
            binning,
            look: None,
            harmonics,
            peaks,
        };
        Some(Self::new(prepared, image, geometry, background))
    }

    fn new(prepared: Prepared, image: &Image, geometry: &Geometry, background: Background) -> Self {
        Self {
            prepared,
            geometry: geometry.clone(),
            background,
            size: [image.columns, image.rows],
            patch: None,
            mean: None,
            others: Vec::new(),
            beside: Vec::new(),
        }
    }

    /// Whether its harmonics cannot be chance.
    pub(crate) fn stands_out(&self) -> bool {
        verdict(&self.prepared.harmonics) == Verdict::Lattice
    }

    /// The reciprocal pair, rad per pixel.
    fn pair(&self) -> Matrix2<f64> {
        self.prepared.harmonics.pair / self.prepared.binning as f64
    }

    /// The same if the lattice is everywhere in the frame, as far as noise lets that be seen; otherwise its pair and why
    /// it is none of the whole frame.
    pub(crate) fn on_the_whole_frame(
        self,
        image: &Image,
    ) -> Result<Self, (Option<Matrix2<f64>>, LatticeError)> {
        let pair = self.pair();
        let Some(settled) = self.settled() else {
            return Ok(self);
        };
        let patch = &settled.patch;
        let refused = (Some(pair), LatticeError::NowhereTogether);
        if patch.share > WHOLE && settled.is_plain() && same(self.size, &patch.pair, &pair) {
            return self.on_patch(image, settled).ok_or(refused);
        }
        Err(refused)
    }

    /// Where its waves are.
    fn settled(&self) -> Option<Settled> {
        let (pair, pitch) = (self.pair(), pitch(&self.geometry));
        let Some(look) = &self.prepared.look else {
            return settle(&cut_off(&self.prepared.image), &pair, pitch);
        };
        let bins = bins_for(&pair);
        let image = look.in_bins(&self.prepared.image, bins);
        settle_in_bins(&cut_off(&image), bins, &pair, pitch)
    }

    /// The mean of a lattice that bends more than the fit to the pixels can describe.
    fn bent(&self, fit: &LatticeFit) -> Option<MeasuredLattice> {
        if self.patch.is_some() || !fit.may_bend_more() {
            return None;
        }
        let mean = self.settled()?.refined()?;
        let bends = mean.change.is_some() && !mean.is_poor();
        bends.then(|| self.mean_lattice(&mean)).flatten()
    }

    /// The lattice of a patch, of the largest grain in it, or its mean.
    ///
    /// Where it is everywhere and the same the fit to the pixels measures it, which uses all harmonics.
    fn on_patch(self, image: &Image, settled: Settled) -> Option<Self> {
        let everywhere = settled.patch.share > WHOLE;
        let mean = settled.mean();
        let changes = mean.as_ref().is_some_and(|mean| mean.change.is_some());
        let poor = mean.as_ref().is_some_and(Mean::is_poor);
        let grains = if changes || poor {
            settled.grains()
        } else {
            None
        };
        let grain = grains.and_then(|grains| self.grain(image, grains));
        if grain.is_some() {
            return grain;
        }
        // A cell with many harmonics is none of three waves: on the whole frame the fit to the pixels judges.
        let told = mean.as_ref().is_some_and(|mean| !mean.is_poor());
        if !told && !everywhere {
            return None;
        }
        let changes = changes && told;
        // Where waves change little and in proportion to the place, the fit to the pixels gives their mean.
        let cells = settled.patch.unit_cells;
        let gentle = mean.as_ref().is_some_and(|mean| mean.is_gentle(cells));
        let mean = mean.filter(|_| !everywhere || (changes && !gentle));
        let mean = mean.map(|rough| settled.refined().unwrap_or(rough));
        if mean.as_ref().is_some_and(Mean::is_poor) {
            return None;
        }
        Some(Self {
            mean,
            patch: (!everywhere).then_some(settled.patch),
            ..self
        })
    }

    /// The lattice of the first of two grains; the other is beside it.
    fn grain(&self, image: &Image, grains: Grains) -> Option<Self> {
        let [largest, other] = grains.patches;
        let mut found = self.of_grain(image, &largest)?;
        let mut beside = self.of_grain(image, &other);
        let waves = beside.as_ref().map_or(other.pair, Self::waves);
        found.others.push(Grain {
            share: other.share,
            waves,
            boundary: grains.boundary,
        });
        if let Some(beside) = &mut beside {
            found.others.append(&mut beside.others);
            found.beside.append(&mut beside.beside);
        }
        found.beside.extend(beside);
        Some(found)
    }

    /// The lattice of one grain.
    fn of_grain(&self, image: &Image, grain: &Patch) -> Option<Self> {
        let (geometry, background) = (&self.geometry, self.background);
        let flat = remove_background(&grain.of(image), background);
        let mut again = settle(&flat, &grain.pair, pitch(geometry))?;
        again.patch.share *= grain.share;
        let part = again.patch.of(image);
        let start = Self::near(&part, geometry, background, &again.patch.pair)?;
        start.on_patch(image, again)
    }

    /// The waves of its lattice, rad per pixel.
    fn waves(&self) -> Matrix2<f64> {
        let mean = self.mean.as_ref().map(|mean| mean.waves.basis);
        mean.unwrap_or_else(|| self.pair())
    }

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
        let mean = self.mean.as_ref().filter(|_| method == Method::Lattice);
        let of_mean = |mean| {
            let found = self.mean_lattice(mean);
            found.ok_or(LatticeError::NoPeaks { method })
        };
        if let Some(mean) = mean.filter(|mean| mean.change.is_some()) {
            return of_mean(mean);
        }
        let (prepared, size) = (&self.prepared, self.prepared.size());
        let refined = match method {
            Method::Lattice => None,
            _ => prepared.refined(self.background),
        };
        let (harmonics, peaks) = match &refined {
            Some((harmonics, peaks)) => (harmonics, peaks),
            None => (&prepared.harmonics, &prepared.peaks),
        };
        let start = &prepared.start;
        let pixels_per_bin = prepared.binning as f64;
        let in_pixels = |l: Lattice<Px>| l.mapped(&(Matrix2::identity() * pixels_per_bin));
        let fourier = || fourier::measure(harmonics, peaks, size).map(in_pixels);
        let autocorrelation = || {
            let found =
                autocorrelation::measure(&prepared.binned(), self.background, harmonics, start);
            found.map(in_pixels)
        };
        let (mut fit, mut rest, mut published) = (None, None, None);
        let (pixels, comparison) = match method {
            Method::Autocorrelation => (autocorrelation(), fourier()),
            Method::Fourier => (fourier(), autocorrelation()),
            Method::Lattice => {
                let found = fitted(&self.prepared, self.background);
                if let Some(mean) = mean
                    && !found
                        .as_ref()
                        .is_some_and(|found| is_better(&found.fit, mean))
                {
                    return of_mean(mean);
                }
                rest = found.as_ref().and_then(|found| found.rest.clone());
                fit = found.map(|found| (found.lattice, found.fit));
                let bent = fit.as_ref().and_then(|(_, fit)| self.bent(fit));
                if let Some(bent) = bent {
                    return Ok(bent);
                }
                (fit.as_ref().map(|(lattice, _)| *lattice), fourier())
            }
            Method::Paper => {
                let image = &self.prepared.image;
                let found = paper::measure(image, &self.geometry, &(start * pixels_per_bin));
                published = found.map(|(_, peaks)| peaks);
                (found.map(|(lattice, _)| lattice), fourier())
            }
        };
        let fit = fit.map(|(_, fit)| fit);
        let pixels = pixels.ok_or(LatticeError::NoPeaks { method })?;
        let label = |l: Lattice<Px>| labelled_like(&l, &pixels.basis);
        let bin_to_nm = self.geometry.pixel_to_nm * pixels_per_bin;
        Ok(MeasuredLattice {
            patch: match &rest {
                Some(rest) => self.part(rest, &pixels),
                None => self.patch.clone(),
            },
            grains: self.others.clone(),
            beside: Vec::new(),
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
            shortcut_wavelengths: fourier::shortcut_wavelengths(peaks, &bin_to_nm),
            periods: self.periods(&pixels),
            signal_to_noise: fit.as_ref().map_or_else(
                || signal_to_noise(harmonics)[2],
                LatticeFit::weakest_signal_to_noise,
            ),
            published,
            fit,
        })
    }
}

/// Whether a fit to the pixels says more than what windows show: the lattice is the same everywhere, and its errors are smaller.
fn is_better(fit: &LatticeFit, mean: &Mean) -> bool {
    let size = |waves: &Waves<Px>| waves.covariance.trace();
    fit.change().is_none() && size(&fit.wave_vectors) < size(&mean.waves)
}

impl Start {
    /// The part of the frame that shows the lattice, where of its bins only `rest` does; `None` for all of it but for a little.
    fn part(&self, rest: &Image, lattice: &Lattice<Px>) -> Option<Patch> {
        let Prepared { image, binning, .. } = &self.prepared;
        let whole = || Patch::whole(image, &lattice.waves()?.basis, pitch(&self.geometry));
        let patch = self.patch.clone().or_else(whole)?;
        let part = patch.left_by(&self.prepared.binned(), rest, *binning);
        (self.patch.is_some() || part.share < WHOLE).then_some(part)
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
            change: mean.change,
            common: Common::of(mean, &pixels),
            reciprocal: mean.waves.basis,
            phases: Phases {
                values: mean.phases,
                covariance: mean.phase_covariance,
            },
            middle: mean.middle,
            shortcut_wavelengths: fourier::shortcut_wavelengths(peaks, &bin_to_nm),
            periods: self.periods(&pixels),
            signal_to_noise: mean.signal_to_noise,
            published: None,
            fit: None,
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
        let longest = (0..3)
            .map(|i| pixels.vector(i))
            .map(|v| (v.x / size.x).hypot(v.y / size.y));
        1.0 / longest.fold(0.0, f64::max)
    }
}

/// Power over noise of all harmonics that stand out, in sum.
pub(crate) fn evidence(harmonics: &Harmonics) -> f64 {
    let all = harmonics.list.iter();
    let powers = all.map(|harmonic| harmonic.significance(harmonics.window_sums));
    powers.filter(|power| *power > THIRD).sum()
}

/// The lattice fitted to the pixels, in pixels; what is left of the image in bins.
pub(crate) fn fitted(prepared: &Prepared, background: Background) -> Option<fit::Found> {
    let binning = prepared.binning;
    let found = fit::measure(&prepared.binned(), &prepared.harmonics, background)?;
    let to_pixels = Matrix2::identity() * binning as f64;
    Some(fit::Found {
        lattice: found.lattice.mapped(&to_pixels),
        fit: found.fit.in_pixels(binning),
        rest: found.rest,
    })
}
