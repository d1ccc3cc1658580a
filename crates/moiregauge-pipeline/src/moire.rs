//! The moiré that layers make, and the layers behind a moiré.

use std::fmt::Write as _;

use heterostrain::lattice::{CellError, Lattice, MoireCell, WavelengthMeaning, from_wavelengths};
use heterostrain::strain::{
    KnownOrientation, LatticeDirection, Orientation, Stacking, StrainError, TwistStrain, moire_of,
    twist_strain,
};
use moiregauge::drift::Statistical;
use moiregauge::meaning::{Budget, Readings, WaveStrengths};
use moiregauge::settings::{Calibration, Settings, SettingsError};
use moiregauge_report::{CellResult, Drawing, MoireDocument, cell_figure};
use nalgebra::{Matrix2, Matrix4};
use serde::{Deserialize, Serialize};

/// Lengths, nm, angles, degrees, and strains, per cent, beyond these are no layers'.
const LARGEST: f64 = 1e7;

/// What is asked about a moiré.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MoireQuestion {
    /// What is given.
    pub given: Given,
    /// Layers, conventions, priors, and what is known of their orientation where vectors are read. The uncertainty of
    /// the scanner counts beside that of what is given; by default there is none.
    #[serde(default = "exact")]
    pub settings: Settings,
    /// Electrons per cell at full filling: 4 in graphene (two spins, two valleys).
    #[serde(default = "graphene_band")]
    pub band_degeneracy: f64,
}

/// What is given of a moiré: how layers lie on each other, or how it looks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum Given {
    /// Layer 2 lies on layer 1, is stretched and then turned by the twist.
    Layers(GivenLayers),
    /// Three wavelengths, whose meanings differ as soon as there is strain.
    Wavelengths {
        /// The wavelengths.
        lengths_nm: [f64; 3],
        /// Standard uncertainty of each.
        #[serde(default)]
        sigma_nm: f64,
        /// Whether they are lengths of vectors between neighbouring spots of the image, or `4π/(√3|K|)` of wave
        /// vectors.
        k_space: bool,
    },
    /// Two vectors between neighbouring spots of the image, each x and y.
    Vectors {
        /// The vectors.
        vectors_nm: [[f64; 2]; 2],
        /// Standard uncertainty of each component.
        #[serde(default)]
        sigma_nm: f64,
    },
}

/// How layer 2 lies on layer 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GivenLayers {
    /// Twist of layer 2 against layer 1.
    pub twist_deg: f64,
    /// Uniaxial strain of layer 2: that much along the axis, −ν times as much across.
    #[serde(default)]
    pub strain_percent: Option<f64>,
    /// Axis of the strain, counted from the reciprocal vectors of layer 1.
    #[serde(default)]
    pub strain_axis_deg: Option<f64>,
    /// Strain of layer 2 that is the same in all directions, on top.
    #[serde(default)]
    pub biaxial_percent: Option<f64>,
    /// Orientation of layer 1: of its reciprocal vectors along x where it is not given.
    #[serde(default)]
    pub lattice_angle: Option<Direction>,
}

/// The direction of a vector of layer 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Direction {
    /// Counter-clockwise from x.
    pub angle_deg: f64,
    /// Which vector.
    #[serde(default)]
    pub of: LatticeDirection,
}

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MoireError {
    /// A number of the question.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The layers make no moiré, or no layers make this one.
    #[error(transparent)]
    Strain(#[from] StrainError),
    /// The wavelengths make no cell.
    #[error(transparent)]
    Cell(#[from] CellError),
    /// Two vectors that enclose no area.
    #[error("the two vectors are parallel")]
    Parallel,
    /// An orientation beside wavelengths.
    #[error("three wavelengths do not give the direction of the moiré in laboratory axes")]
    NoOrientation,
}

/// The answer.
#[derive(Clone, Debug)]
pub struct Moire {
    /// The cell of the moiré.
    pub cell: MoireCell,
    /// Where a moiré was read: the default reading and all of them.
    pub read: Option<(TwistStrain, Readings)>,
    /// All of it, to be written.
    pub document: MoireDocument,
}

impl Default for MoireQuestion {
    /// Graphene on graphene at the first magic angle.
    fn default() -> Self {
        Self::new(Given::Layers(GivenLayers {
            twist_deg: 1.1,
            strain_percent: None,
            strain_axis_deg: None,
            biaxial_percent: None,
            lattice_angle: None,
        }))
    }
}

fn graphene_band() -> f64 {
    4.0
}

/// What is typed in has the uncertainty that is typed in.
fn exact() -> Settings {
    Settings {
        calibration: Calibration {
            gain_percent: 0.0,
            mismatch_percent: 0.0,
            orthogonality_mrad: 0.0,
            sensor_bend_percent: 0.0,
            scanner_bend_percent: 0.0,
        },
        ..Settings::default()
    }
}

impl MoireQuestion {
    /// A question with all else as usual: two layers of graphene, nothing known of their orientation.
    #[must_use]
    pub fn new(given: Given) -> Self {
        Self {
            given,
            settings: exact(),
            band_degeneracy: graphene_band(),
        }
    }

    /// Refuses what no layers can be like.
    ///
    /// # Errors
    /// The first number that makes no sense, by its name.
    pub fn check(&self) -> Result<(), SettingsError> {
        self.settings.check()?;
        let (setting, numbers): (&'static str, Vec<f64>) = match self.given {
            Given::Layers(layers) => ("layers", layers.numbers().collect()),
            Given::Wavelengths {
                lengths_nm,
                sigma_nm,
                ..
            } => {
                check_sigma(sigma_nm)?;
                ("lengths_nm", lengths_nm.to_vec())
            }
            Given::Vectors {
                vectors_nm,
                sigma_nm,
            } => {
                check_sigma(sigma_nm)?;
                ("vectors_nm", vectors_nm.concat())
            }
        };
        if let Some(wrong) = numbers.into_iter().find(|n| !(n.abs() <= LARGEST)) {
            let reason = format!("{setting}: expected numbers up to {LARGEST:e}, found {wrong}");
            return Err(SettingsError { setting, reason });
        }
        if !(self.band_degeneracy > 0.0 && self.band_degeneracy.is_finite()) {
            return Err(SettingsError {
                setting: "band_degeneracy",
                reason: format!(
                    "band_degeneracy: expected a number above 0, found {}",
                    self.band_degeneracy
                ),
            });
        }
        Ok(())
    }

    /// The lattice that is asked about.
    fn lattice(&self) -> Result<Lattice, MoireError> {
        let settings = &self.settings;
        Ok(match self.given {
            Given::Layers(layers) => {
                let convention = settings.strain_convention;
                Lattice::exact(moire_of(
                    &layers.stacking(settings),
                    settings.bilayer(),
                    convention,
                )?)
            }
            Given::Wavelengths {
                lengths_nm,
                sigma_nm,
                k_space,
            } => {
                let meaning = if k_space {
                    WavelengthMeaning::KSpace
                } else {
                    WavelengthMeaning::RealSpace
                };
                from_wavelengths(lengths_nm, [sigma_nm; 3], meaning)?
            }
            Given::Vectors {
                vectors_nm: [a, b],
                sigma_nm,
            } => Lattice::new(
                Matrix2::new(a[0], b[0], a[1], b[1]),
                Matrix4::identity() * (sigma_nm * sigma_nm),
            ),
        })
    }
}

impl GivenLayers {
    /// All numbers that are given.
    fn numbers(&self) -> impl Iterator<Item = f64> {
        let others = [
            self.strain_percent,
            self.strain_axis_deg,
            self.biaxial_percent,
        ];
        let angle = self.lattice_angle.map(|a| a.angle_deg);
        let others = others.into_iter().flatten();
        others.chain(angle).chain([self.twist_deg])
    }

    /// The same in rad and as shares.
    fn stacking(&self, settings: &Settings) -> Stacking {
        let angle = self.lattice_angle;
        Stacking {
            twist: self.twist_deg.to_radians(),
            lattice_angle: angle.map_or(0.0, |of| reference_angle(of, settings)),
            strain: self.strain_percent.unwrap_or(0.0) / 100.0,
            axis_lattice: self.strain_axis_deg.unwrap_or(0.0).to_radians(),
            biaxial: self.biaxial_percent.unwrap_or(0.0) / 100.0,
        }
    }
}

fn check_sigma(sigma_nm: f64) -> Result<(), SettingsError> {
    if (0.0..=LARGEST).contains(&sigma_nm) {
        return Ok(());
    }
    Err(SettingsError {
        setting: "sigma_nm",
        reason: format!("sigma_nm: expected a length from 0 to {LARGEST:e} nm, found {sigma_nm}"),
    })
}

/// α, of the reciprocal vectors of layer 1, rad.
fn reference_angle(direction: Direction, settings: &Settings) -> f64 {
    let known = KnownOrientation {
        angle_deg: direction.angle_deg,
        sigma_deg: 0.0,
        layer: 1,
        of: direction.of,
    };
    let reference = settings.substrate.as_ref().unwrap_or(&settings.material);
    Orientation::of(&known, reference.into()).angle
}

/// The cell of a moiré and, where that is what was given, what it means: all solutions, and what isotropic strain does
/// to them.
///
/// # Errors
/// [`MoireError`].
///
/// ```
/// use moiregauge_pipeline::moire::{Given, MoireQuestion, moire};
///
/// let magic = moire(&MoireQuestion::default())?;
/// assert!((magic.document.cell.wavelengths_nm[0] - 12.8).abs() < 0.1);
/// let lengths = Given::Wavelengths { lengths_nm: [13.72, 12.7, 10.18], sigma_nm: 0.05, k_space: false };
/// let read = moire(&MoireQuestion::new(lengths))?;
/// let twist = read.document.twist_strain.and_then(|found| found.twist_deg.value);
/// assert!(twist.is_some_and(|twist| (twist - 1.19).abs() < 0.001));
/// # Ok::<(), moiregauge_pipeline::moire::MoireError>(())
/// ```
pub fn moire(asked: &MoireQuestion) -> Result<Moire, MoireError> {
    asked.check()?;
    let settings = &asked.settings;
    let lattice = asked.lattice()?;
    let cell = MoireCell::new(&lattice.basis).ok_or(MoireError::Parallel)?;
    // Names of waves are those of the vectors that are shown.
    let lattice = cell.pair_of(&lattice);
    let read = match asked.given {
        Given::Layers(_) => None,
        Given::Wavelengths { .. } if settings.lattice_angle.is_some() => {
            return Err(MoireError::NoOrientation);
        }
        _ => Some(read(&lattice, settings)?),
    };
    let document = MoireDocument::new(
        asked.given.in_words(),
        CellResult::new(&cell, asked.band_degeneracy),
        read.as_ref().map(|(found, readings)| (found, readings)),
        settings,
    );
    Ok(Moire {
        cell,
        read,
        document,
    })
}

impl Moire {
    /// A drawing of the cell.
    pub fn figure(&self) -> Drawing {
        cell_figure(&self.cell, "moire", &self.document.layers)
    }
}

/// All solutions of a lattice whose covariance is all that is not known of it.
fn read(lattice: &Lattice, settings: &Settings) -> Result<(TwistStrain, Readings), StrainError> {
    let found = twist_strain(lattice, settings.bilayer(), settings.strain_convention)?;
    let statistical = Statistical {
        image: lattice.covariance,
        drift: Matrix4::zeros(),
        sensor: Matrix4::zeros(),
    };
    let budget = Budget::new(lattice, &found, &statistical, settings);
    let readings = Readings::new(
        lattice,
        &found,
        &budget,
        &WaveStrengths::default(),
        settings,
    );
    Ok((found, readings))
}

impl Given {
    /// What is given, in words.
    pub fn in_words(&self) -> String {
        // Numbers as they are typed, with true minus signs.
        let typed = |value: f64| value.to_string().replace('-', "−");
        match self {
            Self::Wavelengths {
                lengths_nm: [a, b, c],
                k_space,
                ..
            } => {
                let meaning = if *k_space {
                    "4π/(√3|K|) of the wave vectors"
                } else {
                    "lengths of the real-space vectors"
                };
                format!("wavelengths {a}, {b}, {c} nm, {meaning}")
            }
            Self::Vectors { vectors_nm, .. } => {
                let [a, b] = vectors_nm.map(|[x, y]| format!("({},{})", typed(x), typed(y)));
                format!("vectors {a} and {b} nm")
            }
            Self::Layers(GivenLayers {
                twist_deg,
                strain_percent,
                strain_axis_deg,
                biaxial_percent,
                ..
            }) => {
                // Writing into a string cannot fail.
                let mut text = format!("twist {}°", typed(*twist_deg));
                if let Some(strain) = strain_percent.map(typed) {
                    let axis = typed(strain_axis_deg.unwrap_or(0.0));
                    let _ = write!(text, ", strain {strain} % along {axis}° from layer 1");
                }
                if let Some(biaxial) = biaxial_percent.map(typed) {
                    let _ = write!(text, ", biaxial strain {biaxial} %");
                }
                text
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn questions_are_checked_and_kept_as_json() {
        let asked = MoireQuestion::default();
        let text = serde_json::to_string(&asked).unwrap();
        assert_eq!(serde_json::from_str::<MoireQuestion>(&text).unwrap(), asked);
        let vectors = |b| Given::Vectors {
            vectors_nm: [[12.0, 0.0], b],
            sigma_nm: 0.0,
        };
        assert!(matches!(
            moire(&MoireQuestion::new(vectors([24.0, 0.0]))),
            Err(MoireError::Parallel)
        ));
        let nan = moire(&MoireQuestion::new(vectors([f64::NAN, 1.0])));
        assert!(matches!(nan, Err(MoireError::Settings(e)) if e.setting == "vectors_nm"));
    }

    #[test]
    fn what_is_given_is_told_in_words() {
        let layers = Given::Layers(GivenLayers {
            twist_deg: -1.1,
            strain_percent: Some(0.3),
            strain_axis_deg: Some(20.0),
            biaxial_percent: Some(-0.1),
            lattice_angle: None,
        });
        assert_eq!(
            layers.in_words(),
            "twist −1.1°, strain 0.3 % along 20° from layer 1, biaxial strain −0.1 %"
        );
    }
}
