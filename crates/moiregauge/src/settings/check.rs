//! What is refused before any work: settings with which nothing sensible can come out.

use heterostrain::material::Material;

use crate::calibration::Calibration;
use crate::settings::knobs::Settings;
use crate::settings::ranges::OutOfRange;
use crate::spectrum::method::Method;

/// A setting that makes no sense.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{reason}")]
pub struct SettingsError {
    /// Its name, as in a settings file.
    pub setting: &'static str,
    /// What was expected and what was found.
    pub reason: String,
}

impl From<OutOfRange> for SettingsError {
    fn from(beyond: OutOfRange) -> Self {
        Self {
            setting: beyond.setting,
            reason: beyond.to_string(),
        }
    }
}

/// An error with this name unless the condition holds.
fn ensure(
    condition: bool,
    setting: &'static str,
    reason: impl FnOnce() -> String,
) -> Result<(), SettingsError> {
    if condition {
        return Ok(());
    }
    Err(SettingsError {
        setting,
        reason: reason(),
    })
}

/// An error with this name where something has a problem.
fn none(problem: Option<String>, setting: &'static str) -> Result<(), SettingsError> {
    problem.map_or(Ok(()), |reason| Err(SettingsError { setting, reason }))
}

impl Settings {
    /// Refuses settings with which nothing sensible can come out, wherever they come from.
    ///
    /// # Errors
    /// The first of them.
    pub fn check(&self) -> Result<(), SettingsError> {
        let substrate = self.substrate.as_ref().and_then(Material::problem);
        let substrate = substrate.map(|problem| format!("the substrate: {problem}"));
        none(substrate, "substrate")?;
        self.check_orientations()?;
        self.check_material()?;
        let moires = self.moires;
        ensure((1..=6).contains(&moires), "moires", || {
            format!("the number of moirés must lie between 1 and 6, found {moires}")
        })?;
        ensure(
            moires == 1 || self.method == Method::Lattice,
            "moires",
            || {
                format!(
                    "several moirés can be measured only with the method \"lattice\", found {moires} moirés and \
                     another method"
                )
            },
        )?;
        none(self.by_hand.problem(), "by_hand")?;
        ensure(moires == 1 || !self.by_hand.says_which(), "by_hand", || {
            format!("a lattice can be given by hand only for one moiré, found {moires} moirés")
        })?;
        none(self.material.problem(), "material")?;
        self.check_moire_layers()?;
        let clock = self.frame_time_sigma_s;
        ensure(
            clock >= 0.0 && clock.is_finite(),
            "frame_time_sigma_s",
            || format!("the uncertainty of the frame times cannot be negative, found {clock}"),
        )?;
        self.check_uncertainties()?;
        let scanner = self.scanner.as_ref().and_then(Calibration::problem);
        let scanner =
            scanner.map(|p| format!("the calibration of the scanner cannot be used: {p}"));
        none(scanner, "scanner")?;
        if let Some(beyond) = self.out_of_range() {
            return Err(beyond.into());
        }
        self.check_waves()?;
        self.check_drift()
    }

    fn check_material(&self) -> Result<(), SettingsError> {
        let (a, ratio) = (
            self.material.lattice_constant_nm,
            self.material.poisson_ratio,
        );
        ensure(
            a > 0.0 && a.is_finite(),
            "material.lattice_constant_nm",
            || format!("the lattice constant must be a positive length in nm, found {a}"),
        )?;
        ensure(
            ratio > -1.0 && ratio < 1.0,
            "material.poisson_ratio",
            || format!("the Poisson ratio must lie between −1 and 1, found {ratio}"),
        )
    }

    /// Uncertainties are no wild guesses.
    fn check_uncertainties(&self) -> Result<(), SettingsError> {
        let (material, calibration) = (&self.material, &self.calibration);
        let most = 0.1 * material.lattice_constant_nm;
        for (setting, value, largest) in [
            (
                "material.lattice_constant_sigma_nm",
                material.lattice_constant_sigma_nm,
                most,
            ),
            (
                "material.poisson_ratio_sigma",
                material.poisson_ratio_sigma,
                0.5,
            ),
            ("calibration.gain_percent", calibration.gain_percent, 50.0),
            (
                "calibration.mismatch_percent",
                calibration.mismatch_percent,
                50.0,
            ),
            (
                "calibration.orthogonality_mrad",
                calibration.orthogonality_mrad,
                500.0,
            ),
            (
                "calibration.sensor_bend_percent",
                calibration.sensor_bend_percent,
                50.0,
            ),
            (
                "calibration.scanner_bend_percent",
                calibration.scanner_bend_percent,
                50.0,
            ),
            (
                "isotropic_strain_percent",
                self.isotropic_strain_percent,
                10.0,
            ),
            ("ruler_strain_percent", self.ruler_strain_percent, 10.0),
            (
                "ruler_magnification_percent",
                self.ruler_magnification_percent,
                50.0,
            ),
        ] {
            ensure(value >= 0.0 && value <= largest, setting, || {
                format!("the uncertainty {setting} must lie between 0 and {largest}, found {value}")
            })?;
        }
        Ok(())
    }

    /// A drift that is given is two numbers and their uncertainty.
    fn check_drift(&self) -> Result<(), SettingsError> {
        let Some(drift) = &self.drift else {
            return Ok(());
        };
        let (x, y, sigma) = (
            drift.x_nm_per_min,
            drift.y_nm_per_min,
            drift.sigma_nm_per_min,
        );
        ensure(x.is_finite() && y.is_finite(), "drift", || {
            format!("the drift must be two numbers in nm/min, found {x} and {y}")
        })?;
        ensure(
            sigma >= 0.0 && sigma.is_finite(),
            "drift.sigma_nm_per_min",
            || format!("the uncertainty of the drift cannot be negative, found {sigma}"),
        )
    }

    /// Waves that name a moiré are numbers.
    fn check_waves(&self) -> Result<(), SettingsError> {
        let finite = |waves: &[[f64; 2]; 2]| waves.iter().flatten().all(|x| x.is_finite());
        ensure(
            self.moire_waves.as_ref().is_none_or(finite),
            "moire_waves",
            || {
                format!(
                    "the waves of the moiré must be two vectors in rad/nm, found {:?}",
                    self.moire_waves
                )
            },
        )
    }

    /// Orientations are angles of layers that there are.
    fn check_orientations(&self) -> Result<(), SettingsError> {
        let both = [&self.lattice_angle, &self.lattice_angle_2];
        for known in both.into_iter().flatten() {
            let (angle, sigma) = (known.angle_deg, known.sigma_deg);
            ensure(
                angle.is_finite() && sigma >= 0.0 && sigma.is_finite(),
                "lattice_angle",
                || {
                    format!(
                        "the orientation of a layer must be an angle in degrees and its uncertainty, found {angle} and \
                         {sigma}"
                    )
                },
            )?;
            ensure(
                known.layer == 1 || known.layer == 2,
                "lattice_angle.layer",
                || {
                    format!(
                        "the layer of an orientation must be 1 (the lower one) or 2, found {}",
                        known.layer
                    )
                },
            )?;
        }
        if let [Some(first), Some(second)] = both {
            ensure(first.layer != second.layer, "lattice_angle_2", || {
                format!(
                    "the two orientations (lattice_angle and lattice_angle_2) must be those of layers 1 and 2, found \
                     layer {} twice",
                    first.layer
                )
            })?;
        }
        Ok(())
    }

    /// As many pairs of layers as moirés, none of them nonsense, and nothing beside them that is of one pair only.
    fn check_moire_layers(&self) -> Result<(), SettingsError> {
        let (layers, moires) = (&self.moire_layers, self.moires);
        if layers.is_empty() {
            return Ok(());
        }
        ensure(layers.len() == moires, "moire_layers", || {
            format!(
                "expected one pair of layers for all moirés or one for each of the {moires}, found {}",
                layers.len()
            )
        })?;
        ensure(
            self.lattice_angle.is_none() && self.lattice_angle_2.is_none(),
            "moire_layers",
            || {
                "the orientation of a layer needs one pair of layers for all moirés, but layer 1 of the moirés \
                 differs. Analyse each moiré in a run of its own"
                    .to_owned()
            },
        )?;
        let both = layers
            .iter()
            .flat_map(|layers| std::iter::once(&layers.material).chain(&layers.substrate));
        none(both.into_iter().find_map(Material::problem), "moire_layers")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::knobs::{GivenDrift, MoireLayers};

    fn refused(change: impl Fn(&mut Settings)) -> &'static str {
        let mut settings = Settings::default();
        change(&mut settings);
        settings.check().unwrap_err().setting
    }

    #[test]
    fn nonsense_is_refused_by_its_name() {
        assert_eq!(Settings::default().check(), Ok(()));
        let nan = f64::NAN;
        assert_eq!(
            refused(|s| s.material.lattice_constant_nm = nan),
            "material.lattice_constant_nm"
        );
        assert_eq!(
            refused(|s| s.material.poisson_ratio = 1.0),
            "material.poisson_ratio"
        );
        assert_eq!(
            refused(|s| s.frame_time_sigma_s = -1.0),
            "frame_time_sigma_s"
        );
        assert_eq!(
            refused(|s| s.isotropic_strain_percent = nan),
            "isotropic_strain_percent"
        );
        assert_eq!(
            refused(|s| s.moire_waves = Some([[nan, 0.0], [0.0, 1.0]])),
            "moire_waves"
        );
        assert_eq!(refused(|s| s.moires = 7), "moires");
        assert_eq!(refused(|s| s.drift_draws = usize::MAX), "drift_draws");
        let drift = GivenDrift {
            x_nm_per_min: 0.0,
            y_nm_per_min: 0.0,
            sigma_nm_per_min: -1.0,
        };
        assert!(refused(|s| s.drift = Some(drift)).starts_with("drift"));
        let layers = MoireLayers::new(Material::graphene(), None);
        assert_eq!(
            refused(|s| s.moire_layers = vec![layers.clone(); 2]),
            "moire_layers"
        );
    }
}
