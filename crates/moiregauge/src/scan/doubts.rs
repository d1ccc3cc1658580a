//! What the images of one scan make doubtful.

use heterostrain::lattice::{Px, Waves, labelled_like};

use crate::caveat::Caveat;
use crate::caveat::lattices::{LatticeDoubt, LineDifference, OtherGrain};
use crate::caveat::positions::PositionDoubt;
use crate::coverage::bend::Change;
use crate::coverage::choose::ChangeModel;
use crate::explain::beside::WaveBeside;
use crate::frame::geometry::Geometry;
use crate::lattice::fit::bend::Inhomogeneity;
use crate::lattice::fit::closure::Closure;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::measured::{Candidate, Grain, MeasuredLattice};
use crate::lattice::predicted::bends;
use crate::numbers::chi2;
use crate::numbers::three::three;
use crate::scan::measured::MeasuredLine;

/// Fewer periods than this across the shorter side deserve a word: of 100 pictures of 2.6 to 5 periods with spots that differ the errors were right (rms
/// pull 0.75 and 0.99), and fewer were not drawn. See docs/constants.md.
const FEW_PERIODS: f64 = 2.5;
/// Trace and retrace whose lattices differ by more than this share do not show the same one. Half and twice as much
/// change no result of docs/constants.md.
const ANOTHER_LATTICE: f64 = 0.1;
/// Differences that chance makes less often deserve a word: the scans of a session make none, ...
const NO_CHANCE: f64 = 1e-4;
/// ... if they are larger than this share: a tenth of the calibration that is assumed.
const NOTABLE: f64 = 1e-3;
/// Changes of a lattice below this share (or angle) across the frame harm nobody: a tenth of the calibration that is
/// assumed.
const HARMLESS: f64 = 1e-3;

/// Says that a frame without sensors was turned back by the angle that the file states.
pub(crate) fn turned(file: &str, rotation_rad: f64, caveats: &mut Vec<Caveat>) {
    if rotation_rad != 0.0 {
        caveats.push(Caveat::new(
            PositionDoubt::FrameTurned {
                rotation: rotation_rad,
            },
            file,
        ));
    }
}

/// Says where the lattice is measured on few periods.
pub(crate) fn few_periods(file: &str, lattice: &MeasuredLattice, caveats: &mut Vec<Caveat>) {
    if lattice.periods < FEW_PERIODS {
        caveats.push(Caveat::new(
            LatticeDoubt::FewPeriods {
                periods: lattice.periods,
                enough: FEW_PERIODS,
            },
            file,
        ));
    }
}

/// Compares trace and retrace, and says where they do not show the same; a reason not to use the scan where
/// they show different lattices.
///
/// Drift within a line makes a difference of drift over tip speed, which is small but for the slowest scans.
pub(crate) fn lines_disagree(
    file: &str,
    lines: &[MeasuredLine],
    caveats: &mut Vec<Caveat>,
) -> Option<String> {
    let [first, second] = lines else { return None };
    let first = first.in_sensor_coordinates();
    let second = labelled_like(&second.in_sensor_coordinates(), &first.basis);
    let share = (second.basis - first.basis).norm() / first.basis.norm();
    let lengths = |l: &heterostrain::lattice::Lattice| [0, 1, 2].map(|i| l.wavelength(i).value);
    let (trace, retrace) = (lengths(&first), lengths(&second));
    if share > ANOTHER_LATTICE {
        let difference = LineDifference::OtherLattices { trace, retrace };
        caveats.push(Caveat::new(LatticeDoubt::LinesDisagree(difference), file));
        return Some(LineDifference::OTHER_LATTICES.to_owned());
    }
    let difference = second.flat() - first.flat();
    let inverse = (first.covariance + second.covariance).try_inverse()?;
    let chi_squared = difference.dot(&(inverse * difference));
    if chi2::tail(chi_squared, 4) < NO_CHANCE && share > NOTABLE {
        let difference = LineDifference::BeyondErrors {
            share,
            chi_squared,
            trace,
            retrace,
        };
        caveats.push(Caveat::new(LatticeDoubt::LinesDisagree(difference), file));
    }
    None
}

/// What part of the frame shows the lattice, whether it is the same everywhere, and what lies beside it.
pub(crate) fn about_coverage(
    file: &str,
    lattice: &MeasuredLattice,
    geometry: &Geometry,
    caveats: &mut Vec<Caveat>,
) {
    if let Some(evidence) = &lattice.evidence {
        if evidence.rivals > 0 {
            let rivals = evidence.rivals;
            caveats.push(Caveat::new(LatticeDoubt::Rivals { rivals }, file));
        }
        let disagrees = lattice.fit.as_ref().is_some_and(LatticeFit::disagrees);
        // Bent phases fit any lattice to a part of an image: what predicts less is no rival.
        let is_rival = |[_, other]: &[Candidate; 2]| !bends(lattice) || other.behind < 0.0;
        let other = evidence.undecided().filter(is_rival);
        let part = evidence.part_of_cell().filter(|_| disagrees);
        let beside = evidence.beside.as_ref();
        let doubts = [
            evidence
                .second
                .map(|second| LatticeDoubt::TwoLattices { second }),
            beside.and_then(|wave| second_lattice(wave, geometry)),
            other.map(|[whole, other]| LatticeDoubt::OtherLattice { whole, other }),
            part.map(|[whole, part]| LatticeDoubt::PartOfCell { whole, part }),
        ];
        let doubts = doubts.into_iter().flatten();
        caveats.extend(doubts.map(|doubt| Caveat::new(doubt, file)));
    }
    if let Some(patch) = &lattice.patch {
        let doubt = LatticeDoubt::PartlyCovered {
            share: patch.share,
            unit_cells: patch.unit_cells,
        };
        caveats.push(Caveat::new(doubt, file));
    }
    if let Some(side) = lattice.ground {
        let window = side * (geometry.fast_step().norm() * geometry.slow_step().norm()).sqrt();
        caveats.push(Caveat::new(LatticeDoubt::GroundTakenOff { window }, file));
    }
    let harmful = |change: &Change| change.wavelength.max(change.angle) > HARMLESS;
    if let Some(change) = lattice.change.filter(harmful) {
        let doubt = LatticeDoubt::Changes {
            part: match lattice.patch {
                Some(_) => "the part of the frame that it covers",
                None => "the frame",
            },
            wavelength: change.wavelength,
            angle: change.angle,
            evenly: change.model == ChangeModel::Even,
            evidence: change.evidence,
        };
        caveats.push(Caveat::new(doubt, file));
    }
    let others: Vec<OtherGrain> = lattice
        .grains
        .iter()
        .filter_map(|grain| other_grain(lattice, grain, geometry))
        .collect();
    if !others.is_empty() {
        caveats.push(Caveat::new(LatticeDoubt::SeveralGrains { others }, file));
    }
}

/// The caveat of a wave that a lattice does not explain.
fn second_lattice(wave: &WaveBeside, geometry: &Geometry) -> Option<LatticeDoubt> {
    let inverse = geometry.pixel_to_nm.try_inverse()?;
    Some(LatticeDoubt::SecondLattice {
        period: std::f64::consts::TAU / (inverse.transpose() * wave.wave_vector).norm(),
        strength: wave.strength,
        predicts: wave.predicts,
    })
}

/// Length of a boundary that is told in sides of cells, nm: right for a straight line, a tenth too short for a circle.
fn boundary(grain: &Grain, geometry: &Geometry) -> f64 {
    let [along, across] = grain.boundary;
    (along * geometry.fast_step().norm()).hypot(across * geometry.slow_step().norm())
}

/// A grain as it compares with the one that is measured.
fn other_grain(
    lattice: &MeasuredLattice,
    grain: &Grain,
    geometry: &Geometry,
) -> Option<OtherGrain> {
    let waves = Waves::<Px>::exact(grain.waves).lattice()?;
    let to_nm = &geometry.pixel_to_nm;
    let here = to_nm * lattice.pixels.basis;
    let there = to_nm * labelled_like(&waves, &lattice.pixels.basis).basis;
    let change = there * here.try_inverse()?;
    Some(OtherGrain {
        share: grain.share,
        wavelengths: three(&there).map(|vector| vector.norm()),
        turned: (change[(1, 0)] - change[(0, 1)]).atan2(change[(0, 0)] + change[(1, 1)]),
        boundary: boundary(grain, geometry),
    })
}

/// How well the fit to the pixels describes the image.
pub(crate) fn about_fit(file: &str, fit: &LatticeFit, caveats: &mut Vec<Caveat>) {
    if let Some(change) = fit.inhomogeneity.filter(Inhomogeneity::is_significant) {
        caveats.push(Caveat::new(
            LatticeDoubt::Inhomogeneous {
                wavelength: change.wavelength,
                angle: change.angle,
                chi_squared: change.chi_squared,
                threshold: change.threshold,
            },
            file,
        ));
    }
    if let Some(closure) = fit.closure.filter(|c: &Closure| c.enlargement() > 1.0) {
        caveats.push(Caveat::new(
            LatticeDoubt::HarmonicsDisagree {
                chi_squared: closure.chi_squared,
                degrees_of_freedom: closure.degrees_of_freedom,
                times: closure.enlargement().sqrt(),
            },
            file,
        ));
    }
}
