//! A set whose frames show the atoms of a layer: the moiré by that ruler.
//!
//! Every line has a ruler of its own, its map turned to the orientation that all have in common. Drift, gains and skew are in these maps,
//! so that the lattices are averaged as if nothing drifted.

use heterostrain::Estimate;
use heterostrain::lattice::{Lattice, Px, labelled_like};
use heterostrain::material::Material;
use heterostrain::strain::Ruler;
use nalgebra::{Matrix2, Matrix3, Matrix4, Vector2, Vector3};
use spmfile::LineDirection;

use crate::calibration::{Calibration, Coordinates, KnownLattice, shown};
use crate::campaign::analysis::{LineRuler, Ruled, ScanAnalysis};
use crate::campaign::means::SetMean;
use crate::campaign::motion::Drift;
use crate::drift::linear::{Observation, common_lattice};
use crate::lattice::several::atoms::is_of;
use crate::meaning::ruler::ByRuler;
use crate::meaning::strengths::WaveStrengths;
use crate::numbers::chi2::enlargement;
use crate::numbers::spread::mean_and_spread;
use crate::scan::measured::{MeasuredLine, MeasuredScan};
use crate::settings::knobs::{RulerLayer, Settings};

/// The upper layer is the ruler unless the size of the atoms says the other one by odds of ten to one more: `2 ln 10`.
const ODDS: f64 = 4.6;

/// A size of the atoms is excluded if its χ² by the calibration of the scanner is larger by this: as for lattices that cannot be one, since calibrations
/// may be worse than they are said to be.
const DECIDED: f64 = 50.0;

/// The atoms of one line.
struct Seen<'a> {
    scan: &'a MeasuredScan,
    line: &'a MeasuredLine,
    atoms: Lattice<Px>,
    /// The same, nm of the scanner; noise that trace and retrace have in common is counted once.
    shown: Lattice,
}

/// The lines that show atoms.
fn seen<'a>(used: &[&'a MeasuredScan]) -> Vec<Seen<'a>> {
    let of_scan = |scan: &&'a MeasuredScan| {
        let scan = *scan;
        scan.lines.iter().filter_map(move |line| {
            let atoms = line.lattice.atoms.as_ref()?.pixels;
            let mut shown = atoms.in_nm(&line.geometry.pixel_to_nm);
            shown.covariance *= scan.lines.len() as f64;
            Some(Seen {
                scan,
                line,
                atoms,
                shown,
            })
        })
    };
    used.iter().flat_map(of_scan).collect()
}

/// The mean of the lines that show the atoms of a layer; `None` where none does. `shared`: the covariance (nm²) that they have in common;
/// `drift`: what is known of it, nm/s.
pub(crate) fn ruled(
    used: &[&MeasuredScan],
    reference: &Matrix2<f64>,
    shared: &Matrix4<f64>,
    drift: Option<&Drift>,
    settings: &Settings,
    strengths: &WaveStrengths,
) -> Option<Ruled> {
    let seen = seen(used);
    let atoms: Vec<Lattice> = seen.iter().map(|seen| seen.shown).collect();
    let (layer, other_layer) = layer(&atoms, settings)?;
    let bilayer = settings.bilayer();
    let material = if layer == 1 {
        bilayer.reference
    } else {
        bilayer.stretched
    };
    let fast = seen.first()?.line.geometry.fast_step().normalize();
    let angle = Ruler::angle(atoms.first()?, material, &fast)?;
    let rulers: Vec<Ruler> = (atoms.iter())
        .map(|atoms| Ruler::new(atoms, material, angle))
        .collect::<Option<_>>()?;
    let observations: Vec<Observation> = (rulers.iter().zip(&seen))
        .map(|(ruler, Seen { line, .. })| {
            let seen = line.lattice.pixels.in_nm(&line.geometry.pixel_to_nm);
            Observation {
                lattice: labelled_like(&ruler.measured(&seen), reference),
                time_gradient: Vector2::zeros(),
                speed_error: [0.0; 2],
                sensor: Matrix4::zeros(),
            }
        })
        .collect();
    let (lattice, chi2, freedom) =
        common_lattice(&observations, &Vector2::zeros(), &Matrix2::zeros()).ok()?;
    let scale = enlargement(chi2, freedom);
    let lattice = Lattice::new(lattice.basis, lattice.covariance * scale + shared);
    let all = ByRuler::new(&rulers[0], layer, &lattice, settings)?;
    let singles: Vec<_> = (rulers.iter().zip(&observations))
        .filter_map(|(ruler, seen)| ByRuler::new(ruler, layer, &seen.lattice, settings))
        .map(|single| single.twist_strain)
        .collect();
    let spread = |of: &dyn Fn(usize) -> f64| {
        let values: Vec<f64> = (0..singles.len()).map(of).collect();
        mean_and_spread(&values).sigma
    };
    let [first, second] = [0, 1].map(|i| spread(&|n| singles[n].strain_vector[i]));
    let scanner = seen.iter().zip(&rulers);
    let scanner = scanner.map(|(seen, ruler)| Scanner::of(seen.line, ruler));
    let scanner: Vec<Scanner> = scanner.collect();
    let strain = settings.ruler_strain_percent / 100.0;
    let mean =
        |of: &dyn Fn(&Scanner) -> f64| scanner.iter().map(of).sum::<f64>() / scanner.len() as f64;
    let of_line = |(seen, ruler): (&Seen, &Ruler)| {
        let ruler = LineRuler {
            layer,
            ruler: *ruler,
            atoms: seen.atoms,
            twist: all.twist_strain.twist,
        };
        (seen.scan.file.clone(), seen.line.line, ruler)
    };
    Some(Ruled {
        layer,
        rulers: seen.iter().zip(&rulers).map(of_line).collect(),
        used: false,
        other_layer,
        fast_gain: Estimate::new(mean(&|s| s.fast_gain), strain),
        calibration: calibration(&seen, material, drift, settings),
        drift: scanner.iter().all(|s| s.drift.is_some()).then(|| {
            let per_speed = mean(&|s| s.slow_speed);
            let priors = &settings.calibration;
            let priors = [priors.mismatch_percent, priors.orthogonality_mrad];
            let [mismatch, orthogonality] = settings.scanner.as_ref().map_or(priors, |scanner| {
                let [_, mismatch, orthogonality] = scanner.estimates();
                [mismatch.sigma, orthogonality.sigma]
            });
            [
                Estimate::new(
                    mean(&|s| s.drift.map_or(0.0, |d| d.x)),
                    per_speed * orthogonality / 1000.0,
                ),
                Estimate::new(
                    mean(&|s| s.drift.map_or(0.0, |d| d.y)),
                    per_speed * (mismatch / 100.0).hypot(strain),
                ),
            ]
        }),
        mean: SetMean {
            assumed: None,
            twist_scatter: spread(&|n| singles[n].twist),
            strain_scatter: first.hypot(second) / std::f64::consts::SQRT_2,
            chi2_per_dof: (freedom > 0).then(|| chi2 / freedom as f64),
            enlargement: scale,
            within_one_percent: true,
            readings: all.readings(&lattice, strengths, settings),
            lattice,
            twist_strain: all.twist_strain,
            budget: all.budget,
        },
    })
}

/// Whether the calibration of the scanner excludes that these atoms are those of the layer: they may be another lattice of about this size.
pub(crate) fn is_contradicted(ruler: &Ruled, settings: &Settings) -> bool {
    chi2(ruler.fast_gain.value - 1.0, settings) > DECIDED
}

/// χ² of a relative error of the scale, by the calibration of the scanner.
fn chi2(off: f64, settings: &Settings) -> f64 {
    let sigma = (settings.calibration.gain_percent / 100.0).max(1e-3);
    (off / sigma).powi(2)
}

/// Tells the lines of a set that their atoms are its ruler.
pub(crate) fn tell(scans: &mut [ScanAnalysis], ruled: &Ruled) {
    for scan in scans {
        for line in &mut scan.lines {
            let own = |(file, of, _): &&(String, LineDirection, LineRuler)| {
                *file == scan.file && *of == line.line
            };
            line.ruler = ruled.rulers.iter().find(own).map(|(_, _, ruler)| *ruler);
        }
    }
}

/// The scanner that goes with the drift: as by images of a known lattice.
fn calibration(
    seen: &[Seen],
    material: &Material,
    drift: Option<&Drift>,
    settings: &Settings,
) -> Option<[Estimate; 3]> {
    let cell = KnownLattice::of_layer(material).cell()?;
    let (velocity, covariance) = drift.map(|drift| (drift.velocity, drift.covariance))?;
    let constant = material.lattice_constant_sigma_nm / material.lattice_constant_nm;
    let strain = (settings.ruler_strain_percent / 100.0).powi(2);
    let own = Matrix3::from_diagonal(&Vector3::new(
        strain / 2.0 + constant * constant,
        2.0 * strain,
        2.0 * strain,
    ));
    let lines = seen.len() as f64;
    let mut values = Vector3::zeros();
    let mut errors = Matrix3::zeros();
    for Seen { line, shown: l, .. } in seen {
        let gradient = line.geometry.time_gradient(&line.timing?)?;
        let seen = Observation {
            lattice: *l,
            time_gradient: gradient,
            speed_error: [0.0; 2],
            sensor: Matrix4::zeros(),
        };
        let found = shown(&seen.corrected(&velocity, &covariance), &cell)?;
        values += found.values / lines;
        // What the drift leaves open is the same in all.
        errors += found.covariance / lines;
    }
    let found = Calibration::new(&values, &(errors + own), Coordinates::Nominal);
    Some(found.estimates())
}

/// The scanner in a frame, by a ruler.
struct Scanner {
    /// What the scanner shows over what it is, along the fast axis: drift does not touch it.
    fast_gain: f64,
    /// Along the fast and the slow axis, true lengths in nm/s, if both axes have this gain and stand at a right angle.
    drift: Option<Vector2<f64>>,
    /// nm/s.
    slow_speed: f64,
}

impl Scanner {
    fn of(line: &MeasuredLine, ruler: &Ruler) -> Self {
        let fast = line.geometry.fast_step().normalize();
        let fast_gain = (ruler.map * fast).norm().recip();
        let gradient = line
            .timing
            .and_then(|timing| line.geometry.time_gradient(&timing));
        // With the gain g the map is I/g − v uᵀ: see heterostrain::strain::Ruler.
        let turn = ruler.map * fast * fast_gain;
        let turn = Matrix2::new(
            turn.dot(&fast),
            fast.perp(&turn),
            -fast.perp(&turn),
            turn.dot(&fast),
        );
        let still = Matrix2::identity() / fast_gain;
        let velocity = |u: Vector2<f64>| (still - turn * ruler.map) * u / u.norm_squared();
        Self {
            fast_gain,
            drift: gradient.map(velocity),
            slow_speed: gradient.map_or(f64::NAN, |u| u.norm().recip()),
        }
    }
}

/// Which layer the atoms are of, and the other one where that is open.
fn layer(atoms: &[Lattice], settings: &Settings) -> Option<(u8, Option<u8>)> {
    let bilayer = settings.bilayer();
    let materials = [bilayer.reference, bilayer.stretched];
    let is_one = |layer: u8| {
        let material = materials[usize::from(layer) - 1];
        !atoms.is_empty() && atoms.iter().all(|atoms| is_of(atoms, material))
    };
    let told = |layer: u8| is_one(layer).then_some((layer, None));
    match settings.ruler {
        RulerLayer::Off => return None,
        RulerLayer::First => return told(1),
        RulerLayer::Second => return told(2),
        RulerLayer::Auto if bilayer.is_equal() || !is_one(1) => return told(2),
        RulerLayer::Auto if !is_one(2) => return told(1),
        RulerLayer::Auto => {}
    }
    let off = |layer: u8| {
        let free = materials[usize::from(layer) - 1]
            .atomic_pair()
            .determinant();
        let sizes = atoms
            .iter()
            .map(|atoms| (atoms.basis.determinant() / free).abs().sqrt() - 1.0);
        chi2(sizes.sum::<f64>() / atoms.len() as f64, settings)
    };
    let (layer, other) = if off(2) - off(1) < ODDS {
        (2, 1)
    } else {
        (1, 2)
    };
    Some((layer, (off(other) - off(layer) < DECIDED).then_some(other)))
}
