//! What is wanted of a plan.

use moiregauge::settings::{Settings, SettingsError};
use moiregauge::simulate::{SimulateError, Simulation, Simulator};
use serde::{Deserialize, Serialize};

use crate::job::Cancelled;

/// Errors that can be wished for, in any unit.
const WISH: [f64; 2] = [1e-9, 1e6];
/// Variance of a time in a header, which is rounded to whole seconds, s².
const ROUNDED_TIMES: f64 = 1.0 / 12.0;

/// Standard errors that are wanted, with calibration and model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Wishes {
    /// Of the twist.
    pub twist_deg: Option<f64>,
    /// Of each component of the strain vector.
    pub strain_percent: Option<f64>,
    /// Of each component of the drift.
    pub drift_nm_per_min: Option<f64>,
}

/// What is to be planned.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlanRequest {
    /// The errors.
    pub wishes: Wishes,
    /// Instrument and sample. The number of scans, their size and line rate are what is sought.
    pub conditions: Simulation,
    /// What is known of the scanner, of isotropic strain and of the times of frames; layers and convention are those
    /// of the conditions.
    pub settings: Settings,
    /// Largest side of a frame; without it twice that of the conditions.
    pub max_size_nm: Option<f64>,
    /// Largest line rate; without it twice that of the conditions.
    pub max_rate_hz: Option<f64>,
    /// The noise of a pixel does not depend on the time spent on it. Otherwise its square is taken to fall with that
    /// time, from the line rate of the conditions on.
    pub noise_per_pixel: bool,
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// It was stopped.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A number of the request.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// Conditions that cannot be simulated.
    #[error("these conditions are not possible")]
    Conditions(#[source] SimulateError),
    /// Nothing disturbs the images.
    #[error("the conditions have no noise (noise.pixel_deg), so every error would be zero")]
    NoNoise,
    /// No frame would do.
    #[error(
        "no frame within the largest size and line rate shows the lattice. Needed are at least four periods across the \
         frame, five pixels per period, and a signal above the noise"
    )]
    NoFrame,
}

impl PlanRequest {
    /// The request as it is calculated with: times of frames in the conditions, layers in the settings.
    pub(super) fn completed(&self) -> Self {
        let mut request = self.clone();
        let clock = self.settings.frame_time_sigma_s.powi(2) - ROUNDED_TIMES;
        request.conditions.noise.clock_s = clock.max(0.0).sqrt();
        let (settings, sample) = (&mut request.settings, &self.conditions.sample);
        settings.material = sample.material.clone();
        settings.strain_convention = sample.strain_convention;
        request
    }

    /// Refuses what cannot be planned.
    ///
    /// # Errors
    /// The first number that makes no sense, by its name.
    pub fn check(&self) -> Result<(), PlanError> {
        let request = self.completed();
        Simulator::new(request.conditions).map_err(PlanError::Conditions)?;
        // So is a noise that is no number.
        if !(self.conditions.noise.pixel_deg > 0.0) {
            return Err(PlanError::NoNoise);
        }
        request.settings.check()?;
        let wishes = &self.wishes;
        let [low, high] = WISH;
        for (setting, wish) in [
            ("twist_deg", wishes.twist_deg),
            ("strain_percent", wishes.strain_percent),
            ("drift_nm_per_min", wishes.drift_nm_per_min),
            ("max_size_nm", self.max_size_nm),
            ("max_rate_hz", self.max_rate_hz),
        ] {
            if let Some(wish) = wish.filter(|wish| !(low..=high).contains(wish)) {
                let reason =
                    format!("{setting}: expected a number from {low:e} to {high:e}, found {wish}");
                return Err(SettingsError { setting, reason }.into());
            }
        }
        Ok(())
    }
}
