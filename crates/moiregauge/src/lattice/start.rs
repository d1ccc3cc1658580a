//! Where the lattice of an image is, roughly.

mod by_method;
mod parts;

use std::sync::Arc;

use heterostrain::lattice::{reciprocal, shortest_pair};
use nalgebra::{Matrix2, Vector2};

use crate::coverage::bend::Mean;
use crate::coverage::find::{pitch, same};
use crate::coverage::grains::Grains;
use crate::coverage::patch::{LatticeRegion, WHOLE};
use crate::coverage::settle::{Settled, settle, settle_in_bins};
use crate::frame::background::{Background, remove_background};
use crate::frame::clip::cut_off;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::fit::measure as fit;
use crate::lattice::measured::{Grain, MeasuredLattice};
use crate::numbers::three::three;
use crate::spectrum::error::{LatticeError, THIRD};
use crate::spectrum::harmonics::{Harmonics, Windowed};
use crate::spectrum::look::bins_for;
use crate::spectrum::method::Method;
use crate::spectrum::prepare::{Prepared, binned, levelled, prepare, prepare_levelled};
use crate::spectrum::shells::shells;
use crate::spectrum::transform::Spectrum;
use crate::spectrum::verdict::{is_lattice, refine};
use crate::spectrum::{known, rescue, select};

/// A lattice whose waves bend so much that a transform of the whole patch does not show them has at least this many unit
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
    patch: Option<LatticeRegion>,
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
        let find = |image: &Image, background| known::prepare(image, geometry, background, known);
        let prepared = find(image, background).or_else(|_| {
            let flat = Arc::new(levelled(image.clone(), background)?);
            rescue::prepare_again(&flat, background, find)
        })?;
        Ok(Self::new(prepared, image, geometry, background))
    }

    /// Looks for a lattice that hides under tip events and line noise in an image without its background.
    pub(crate) fn find_clipped(
        image: &Arc<Image>,
        geometry: &Geometry,
        background: Background,
    ) -> Result<Self, LatticeError> {
        let find = |image: &Image, background| prepare(image, geometry, background);
        let prepared = rescue::prepare_again(image, background, find)?;
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

    /// The same on a part of an image; `None` for all of it.
    pub(crate) fn at_on(
        part: Option<&LatticeRegion>,
        image: &Image,
        geometry: &Geometry,
        background: Background,
        pair: &Matrix2<f64>,
    ) -> Option<Self> {
        let Some(part) = part else {
            return Self::at(image, geometry, background, pair);
        };
        let start = Self::at(&part.of(image), geometry, background, pair)?;
        let patch = Some(LatticeRegion {
            pair: start.pair(),
            ..part.clone()
        });
        Some(Self { patch, ..start })
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
    pub(crate) fn is_significant(&self) -> bool {
        is_lattice(&self.prepared.harmonics)
    }

    /// The reciprocal pair, rad per pixel.
    fn pair(&self) -> Matrix2<f64> {
        self.prepared.harmonics.pair / self.prepared.binning as f64
    }

    /// The same if the lattice is everywhere in the frame, as far as noise lets that be seen; otherwise its pair and why
    /// it is not a lattice of the whole frame.
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
            let settled = settle(&cut_off(&self.prepared.image), &pair, pitch);
            return settled.map(|settled| settled.on(&self.geometry));
        };
        let bins = bins_for(&pair);
        let image = look.in_bins(&self.prepared.image, bins);
        let settled = settle_in_bins(&cut_off(&image), bins, &pair, pitch);
        settled.map(|settled| settled.on(&self.geometry))
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
        // A cell with many harmonics is not judged by three waves: on the whole frame the fit to the pixels decides.
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
        let within = |patch: &LatticeRegion| {
            let mut found = self.of_grain(image, patch)?;
            // Those in a grain have shares of that.
            for grain in &mut found.others {
                grain.share *= patch.share;
            }
            Some(found)
        };
        let mut found = within(&largest)?;
        let mut beside = within(&other);
        let waves = beside.as_ref().map_or(other.pair, Self::waves);
        found.others.push(Grain {
            share: grains.shares[1],
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
    fn of_grain(&self, image: &Image, grain: &LatticeRegion) -> Option<Self> {
        let (geometry, background) = (&self.geometry, self.background);
        let flat = remove_background(&grain.of(image), background);
        let mut again = settle(&flat, &grain.pair, pitch(geometry))?.on(geometry);
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
}

/// Power over noise of all harmonics that stand out, in sum.
pub(crate) fn evidence(harmonics: &Harmonics) -> f64 {
    let all = harmonics.list.iter();
    let powers = all.map(|harmonic| harmonic.significance(harmonics.window_sums));
    powers.filter(|power| *power > THIRD).sum()
}

/// The lattice fitted to the pixels, in pixels.
pub(crate) fn fitted(
    prepared: &Prepared,
    geometry: &Geometry,
    background: Background,
) -> Option<fit::Found> {
    let binning = prepared.binning;
    let displacement = geometry.in_bins(binning).displacement();
    let (image, start) = (&prepared.binned(), &prepared.harmonics);
    let found = fit::measure(image, start, background, displacement.as_ref())?;
    let to_pixels = Matrix2::identity() * binning as f64;
    Some(fit::Found {
        lattice: found.lattice.mapped(&to_pixels),
        fit: found.fit.in_pixels(binning),
    })
}

/// The lattice of some pair of waves (rad per pixel) in a part of an image, or in all of it; `None` where it cannot be measured.
pub(crate) fn measure_pair(
    pair: &Matrix2<f64>,
    part: Option<&LatticeRegion>,
    image: &Image,
    geometry: &Geometry,
    background: Background,
    method: Method,
) -> Option<MeasuredLattice> {
    let to_physical = geometry.pixel_to_nm.try_inverse()?.transpose();
    let pair = pair * shortest_pair(&(to_physical * pair))?;
    let start = Start::at_on(part, image, geometry, background, &pair)?;
    start.measure(method).ok()
}
