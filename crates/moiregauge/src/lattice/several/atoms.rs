//! The moirés and the atoms of a layer in one image.
//!
//! The atoms are looked for by their cell, the moirés in what is left without them. Where the moiré changes the height of the atoms
//! there are waves at `b ± m` as well, b of the atoms and m of the moiré: a few periods away from b, so that a fit of the atoms alone
//! is drawn to them. They are taken off, and both lattices are measured once more in what the other and these waves leave.

use heterostrain::ComplexPair;
use heterostrain::lattice::{Lattice, reciprocal, shortest_pair};
use heterostrain::material::Material;
use heterostrain::strain::named_like;
use nalgebra::{Complex, DMatrix, DVector, Matrix2, Vector2};

use crate::explain::evidence::weakest;
use crate::frame::background::Background;
use crate::frame::blur::blurred;
use crate::frame::departure::Departure;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::fit::waves::{projected, sum};
use crate::lattice::measured::{Atoms, MeasuredLattice};
use crate::lattice::predicted::with_evidence;
use crate::lattice::several::together::take_off;
use crate::lattice::start::Start;
use crate::numbers::three::three;
use crate::spectrum::error::LatticeError;
use crate::spectrum::method::Method;
use crate::spectrum::prepare::levelled;
use crate::spectrum::shells::shells;
use crate::spectrum::transform::Spectrum;

/// Atoms are those of a layer if their size is off by less than this share: what scanners without calibration may be wrong by.
const SIZE: f64 = 0.1;
/// ..., and their shape `|q|/|p|` by less than this: drift of a fifth of the slow speed.
const SHAPE: f64 = 0.1;
/// Width of the Gaussian mean that has no part of the atoms any more, in lattice constants.
const COARSE: f64 = 0.6;
/// Pixels per distance of the rows of atoms, at least: two, and some room for the errors of the size.
const PIXELS: f64 = 2.2;
/// The waves of atoms predict held-out blocks by at least this number of standard errors: as a lattice that is taken for that alone.
const PLAIN: f64 = 5.0;
/// This number of the strongest peaks is tried for the atoms: their waves are the strongest where they are plain, but for those of both
/// layers.
const PEAKS: usize = 12;
/// A moiré has at least this many times the period of the atoms: of equal layers, at a twist of 15°.
const LARGER: f64 = 3.0;
/// The moiré that is measured in the end is that which was found at first if its cell differs by less than this share: far less than
/// that of a cell of twice or half the area.
const SAME_CELL: f64 = 0.1;
/// Atoms whose waves are this near to whole numbers of waves of the moiré are harmonics of it: cycles per frame, below half a bin.
const SAME: f64 = 0.3;

/// How the lattices of an image are found and measured; at least one.
pub(crate) type Find<'a> =
    &'a dyn Fn(Image, &Geometry) -> Result<Vec<MeasuredLattice>, LatticeError>;

/// An image and how its moirés are found.
pub(crate) struct Scene<'a> {
    pub(crate) image: &'a Image,
    pub(crate) geometry: &'a Geometry,
    pub(crate) background: Background,
    /// Finds the moirés in an image without atoms.
    pub(crate) find: Find<'a>,
}

/// Whether pixels are fine enough to show the atoms of a layer.
pub(crate) fn may_show(geometry: &Geometry, material: &Material) -> bool {
    let rows = material.atomic_pair();
    let distance = rows.determinant().abs() / rows.column(0).norm().max(rows.column(1).norm());
    let steps = [geometry.fast_step().norm(), geometry.slow_step().norm()];
    steps.iter().all(|step| step * PIXELS < distance)
}

/// Whether a lattice (nm of the scanner) is that of a layer, distorted by no more than a scanner and drift do it.
pub(crate) fn is_of(lattice: &Lattice, material: &Material) -> bool {
    let free = material.atomic_pair();
    let shape = named_like(lattice, &free)
        .and_then(|named| Some(ComplexPair::from(named.basis * free.try_inverse()?)));
    shape.is_some_and(|f| (f.p.norm() - 1.0).abs() < SIZE && f.distortion() < SHAPE)
}

impl Scene<'_> {
    /// The moirés, with the atoms of one of the layers; `None` where the image does not show both.
    pub(crate) fn moires_with_atoms(&self, layers: &[&Material]) -> Option<Vec<MeasuredLattice>> {
        let flat = levelled(self.image.clone(), self.background).ok()?;
        let first = layers.iter().find_map(|layer| self.atoms(&flat, layer))?;
        let displacement = self.geometry.displacement();
        let without = |image: &Image, lattice: &MeasuredLattice| {
            without(image, lattice, displacement.as_ref())
        };
        let rest = without(&flat, &first);
        let moires = self.coarse(&rest, &first, displacement.as_ref())?;
        let mut others = moires
            .iter()
            .fold(flat.clone(), |rest, moire| without(&rest, moire));
        let beside = satellites(&others, &first, &moires, displacement.as_ref())?;
        take_off(&mut others, &beside);
        let atoms = self.again(&others, &first.reciprocal)?;
        let (atoms, _) = with_evidence(atoms, &others, self.geometry);
        let predicts = atoms.evidence.as_ref().and_then(|e| e.predicts);
        let of_layer =
            |layer: &&&Material| is_of(&atoms.pixels.in_nm(&self.geometry.pixel_to_nm), layer);
        layers.iter().find(of_layer)?;
        let harmonic = moires.iter().any(|moire| self.is_harmonic(&atoms, moire));
        if predicts.is_none_or(|least| least < PLAIN) || harmonic {
            return None;
        }
        let mut rest = without(&flat, &atoms);
        take_off(&mut rest, &beside);
        let known = |again: &MeasuredLattice| {
            moires.iter().any(|moire| {
                let ratio = again.pixels.basis.determinant() / moire.pixels.basis.determinant();
                (ratio.abs() - 1.0).abs() < SAME_CELL
            })
        };
        let same = |again: &Vec<MeasuredLattice>| again.iter().all(known);
        let again = (self.find)(rest, self.geometry).ok().filter(same);
        let mut found = match again {
            // Several have the errors that they have beside each other.
            None if moires.len() > 1 => return None,
            again => again.unwrap_or(moires),
        };
        for moire in &mut found {
            moire.atoms = Some(Box::new(Atoms {
                pixels: atoms.pixels,
                predicts,
                signal_to_noise: atoms.signal_to_noise,
            }));
        }
        Some(found)
    }

    /// A lattice of about the cell of a layer.
    fn atoms(&self, flat: &Image, layer: &Material) -> Option<MeasuredLattice> {
        // Without the moiré and the ground, which are stronger and far coarser.
        let steps = [self.geometry.fast_step(), self.geometry.slow_step()];
        let width = steps.map(|step| COARSE * layer.lattice_constant_nm / step.norm());
        let coarse = blurred(flat, width);
        let fine = flat.values.iter().zip(&coarse).map(|(v, mean)| v - mean);
        let fine = Image::new(flat.rows, flat.columns, fine.collect());
        let pair = self.strongest(&Spectrum::new(&fine), layer)?;
        let start = Start::near(&fine, self.geometry, self.background, &pair)?;
        let found = start.measure(Method::Lattice).ok()?;
        let predicts = weakest(&fine, &found.reciprocal, false);
        predicts.is_some_and(|least| least > PLAIN).then_some(found)
    }

    /// The two strongest waves of a spectrum that are those of a layer, rad per pixel.
    fn strongest(&self, spectrum: &Spectrum, layer: &Material) -> Option<Matrix2<f64>> {
        let to_nm = &self.geometry.pixel_to_nm;
        let to_physical = to_nm.try_inverse()?.transpose();
        let free = reciprocal(&layer.atomic_pair())?;
        let lengths = three(&free).map(|wave| wave.norm());
        let within = |q: &Vector2<f64>| {
            let length = (to_physical * q).norm();
            lengths
                .iter()
                .any(|free| (length / free - 1.0).abs() < SIZE + SHAPE)
        };
        let mut peaks = summits(spectrum, within);
        peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
        peaks.truncate(PEAKS);
        let pairs = (0..peaks.len()).flat_map(|j| (0..j).map(move |i| [i, j]));
        // The later of the two is the weaker one: the first pair that fits is the strongest.
        pairs
            .map(|[i, j]| Matrix2::from_columns(&[peaks[i].1, peaks[j].1]))
            .filter_map(|pair| Some(pair * shortest_pair(&(to_physical * pair))?))
            .find(|pair| {
                reciprocal(pair).is_some_and(|basis| is_of(&Lattice::exact(to_nm * basis), layer))
            })
    }

    /// The moirés in what is left without the atoms, found in bins of their size.
    fn coarse(
        &self,
        rest: &Image,
        atoms: &MeasuredLattice,
        displacement: Option<&Departure>,
    ) -> Option<Vec<MeasuredLattice>> {
        let longest = three(&atoms.reciprocal).map(|q| std::f64::consts::TAU / q.norm());
        let bin = longest.iter().fold(1.0f64, |a, b| a.max(*b)).ceil();
        let bins = rest.binned(bin as usize);
        let found = (self.find)(bins, &self.geometry.in_bins(bin as usize)).ok()?;
        let area = |lattice: &MeasuredLattice| lattice.pixels.basis.determinant().abs();
        let large = |moire: &MeasuredLattice| area(moire) > LARGER * LARGER * area(atoms);
        let mut left = rest.clone();
        let mut measured = |moire: MeasuredLattice| {
            let found = self.again(&left, &(moire.reciprocal / bin)).filter(large)?;
            left = without(&left, &found, displacement);
            Some(found)
        };
        found.into_iter().map(&mut measured).collect()
    }

    fn again(&self, image: &Image, pair: &Matrix2<f64>) -> Option<MeasuredLattice> {
        let start = Start::at(image, self.geometry, self.background, pair)?;
        start.measure(Method::Lattice).ok()
    }

    /// Whether the waves of the atoms are harmonics of the moiré.
    fn is_harmonic(&self, atoms: &MeasuredLattice, moire: &MeasuredLattice) -> bool {
        let Some(inverse) = moire.reciprocal.try_inverse() else {
            return true;
        };
        let miss =
            atoms.reciprocal - moire.reciprocal * (inverse * atoms.reciprocal).map(f64::round);
        let frame = Vector2::new(self.image.columns as f64, self.image.rows as f64);
        let cycles = Matrix2::from_diagonal(&(frame / std::f64::consts::TAU)) * miss;
        cycles.column(0).norm().max(cycles.column(1).norm()) < SAME
    }
}

/// An image less the waves of a lattice.
fn without(image: &Image, lattice: &MeasuredLattice, displacement: Option<&Departure>) -> Image {
    let mut rest = image.clone();
    if let Some(fit) = &lattice.fit {
        take_off(&mut rest, &fit.waves(image, displacement));
    }
    rest
}

/// Power and wave vector (rad per pixel) of the local maxima of a spectrum among some waves.
fn summits(spectrum: &Spectrum, among: impl Fn(&Vector2<f64>) -> bool) -> Vec<(f64, Vector2<f64>)> {
    let (half, rows) = (spectrum.half() as i64, spectrum.rows as i64);
    let power = |x: i64, y: i64| spectrum.at(x, y).norm_sqr();
    let mut found = Vec::new();
    for y in -rows / 2..rows / 2 {
        for x in 0..half {
            let q = Vector2::new(x as f64, y as f64).component_mul(&spectrum.step());
            // On the axis the lower half repeats the upper one.
            if !among(&q) || (x == 0 && y <= 0) {
                continue;
            }
            let own = power(x, y);
            let mut around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| [x + dx, y + dy]));
            if around.all(|[x, y]| power(x, y) <= own) {
                found.push((own, q));
            }
        }
    }
    found
}

/// The waves `b ± m` of two shells of each moiré about each first wave of the atoms: `Σ Re c e^{iq·n}` on the pixels, amplitudes by
/// least squares with those of the atoms.
fn satellites(
    image: &Image,
    atoms: &MeasuredLattice,
    moires: &[MeasuredLattice],
    displacement: Option<&Departure>,
) -> Option<Vec<f64>> {
    let centres = three(&atoms.reciprocal);
    let shells = shells(2);
    let of_moire = |moire: &MeasuredLattice| {
        let pair = moire.reciprocal;
        let wave = move |index: &[i32; 2]| pair * Vector2::from(index.map(f64::from));
        shells.iter().map(wave)
    };
    let around = moires.iter().flat_map(of_moire).flat_map(|m| [m, -m]);
    let around: Vec<Vector2<f64>> = around.collect();
    let beside = centres
        .iter()
        .flat_map(|b| around.iter().map(move |m| b + m));
    let waves: Vec<Vector2<f64>> = centres.iter().copied().chain(beside).collect();
    let n = waves.len();
    let middle = Vector2::new(image.columns as f64 - 1.0, image.rows as f64 - 1.0) / 2.0;
    let sums = waves
        .iter()
        .map(|q| projected(image, *q, middle, displacement));
    let sums = DVector::from_iterator(n, sums);
    let size = [image.columns as f64, image.rows as f64];
    let gram = DMatrix::from_fn(n, n, |k, l| {
        let d = waves[l] - waves[k];
        Complex::from(dirichlet(d.x, size[0]) * dirichlet(d.y, size[1]))
    });
    let amplitudes = gram.lu().solve(&sums)? * Complex::from(2.0);
    // The first waves are those of the atoms themselves, which stay in the image.
    let beside = waves.into_iter().zip(amplitudes.iter().copied());
    let beside = beside.skip(centres.len());
    Some(sum(image, beside, middle, displacement))
}

/// `Σ e^{iq(n − (size − 1)/2)}` over the pixels of a side.
fn dirichlet(q: f64, size: f64) -> f64 {
    let sine = (q / 2.0).sin();
    if sine.abs() < 1e-12 {
        size
    } else {
        (q * size / 2.0).sin() / sine
    }
}
