//! Ranges of all numeric settings: what lies outside of them makes no sense, or takes memory and time without end.

use crate::settings::knobs::Settings;

/// More draws than this tell nothing more: errors of a thousandth of σ.
pub const MOST_DRAWS: usize = 1_000_000;
/// An image shows no more moirés than this: those of four layers.
pub const MOST_MOIRES: usize = 6;

/// A file holds no more images than this: a guard against headers that are wrong.
pub const MOST_IMAGES: usize = 1024;

/// A scan shows no more grains than this: a guard against numbers that are meant for something else.
pub const MOST_GRAINS: usize = 16;

/// A setting beyond its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the setting {setting} must lie between {low} and {high}, found {found}")]
pub struct OutOfRange {
    /// Its name, as in a settings file.
    pub setting: &'static str,
    /// The least it can be.
    pub low: f64,
    /// The most it can be.
    pub high: f64,
    /// What it is.
    pub found: f64,
}

impl Settings {
    /// The first setting that is beyond its range; `None` where all can be used. Materials and calibrations of scanners
    /// check themselves.
    pub fn out_of_range(&self) -> Option<OutOfRange> {
        let calibration = &self.calibration;
        let mut ranges = vec![
            ("moires", self.moires as f64, 1.0, MOST_MOIRES as f64),
            (
                "drift_draws",
                self.drift_draws as f64,
                0.0,
                MOST_DRAWS as f64,
            ),
            (
                "strain_draws",
                self.strain_draws as f64,
                0.0,
                MOST_DRAWS as f64,
            ),
            ("ruler_strain_percent", self.ruler_strain_percent, 0.0, 10.0),
            (
                "ruler_magnification_percent",
                self.ruler_magnification_percent,
                0.0,
                100.0,
            ),
            (
                "drift_prior_nm_per_min",
                self.drift_prior_nm_per_min,
                0.0,
                1e6,
            ),
            ("frame_time_sigma_s", self.frame_time_sigma_s, 0.0, 86_400.0),
            (
                "calibration.gain_percent",
                calibration.gain_percent,
                0.0,
                50.0,
            ),
            (
                "calibration.mismatch_percent",
                calibration.mismatch_percent,
                0.0,
                50.0,
            ),
            (
                "calibration.orthogonality_mrad",
                calibration.orthogonality_mrad,
                0.0,
                500.0,
            ),
            (
                "calibration.sensor_bend_percent",
                calibration.sensor_bend_percent,
                0.0,
                50.0,
            ),
            (
                "calibration.scanner_bend_percent",
                calibration.scanner_bend_percent,
                0.0,
                50.0,
            ),
            (
                "isotropic_strain_percent",
                self.isotropic_strain_percent,
                0.0,
                10.0,
            ),
        ];
        if let Some(image) = self.image {
            ranges.push(("image", image as f64, 1.0, MOST_IMAGES as f64));
        }
        if let Some(grain) = self.grain {
            ranges.push(("grain", grain as f64, 1.0, MOST_GRAINS as f64));
        }
        if let Some(drift) = &self.drift {
            ranges.extend([
                ("drift.x_nm_per_min", drift.x_nm_per_min, -1e6, 1e6),
                ("drift.y_nm_per_min", drift.y_nm_per_min, -1e6, 1e6),
                ("drift.sigma_nm_per_min", drift.sigma_nm_per_min, 0.0, 1e6),
            ]);
        }
        for known in self.lattice_angle.iter().chain(&self.lattice_angle_2) {
            ranges.extend([
                ("lattice_angle.angle_deg", known.angle_deg, -3600.0, 3600.0),
                ("lattice_angle.sigma_deg", known.sigma_deg, 0.0, 180.0),
                ("lattice_angle.layer", f64::from(known.layer), 1.0, 2.0),
            ]);
        }
        let beyond =
            |&(_, found, low, high): &(&str, f64, f64, f64)| !(low..=high).contains(&found);
        let (setting, found, low, high) = ranges.into_iter().find(beyond)?;
        Some(OutOfRange {
            setting,
            low,
            high,
            found,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::knobs::GivenDrift;
    use heterostrain::strain::{KnownOrientation, LatticeDirection};

    fn usual() -> Settings {
        Settings {
            drift: Some(GivenDrift {
                x_nm_per_min: 0.5,
                y_nm_per_min: -0.2,
                sigma_nm_per_min: 0.0,
            }),
            lattice_angle: Some(KnownOrientation {
                angle_deg: 12.0,
                sigma_deg: 0.2,
                layer: 1,
                of: LatticeDirection::Atomic,
            }),
            image: Some(1),
            ..Settings::default()
        }
    }

    /// Every number of the settings as JSON, set to nonsense: it is named, unless any number will do.
    #[test]
    fn every_number_has_a_range() {
        assert_eq!(usual().out_of_range(), None);
        let json = serde_json::to_value(usual()).unwrap();
        let mut numbers = Vec::new();
        leaves(&json, "", &mut numbers);
        assert!(numbers.len() > 15, "{numbers:?}");
        let free = |name: &str| name == "/seed" || name.starts_with("/material");
        for name in numbers.iter().filter(|name| !free(name)) {
            let mut changed = json.clone();
            // Beyond every range, and a whole number that all types hold.
            *changed.pointer_mut(name).unwrap() = if name.ends_with("layer") {
                255.into()
            } else {
                1_000_000_000_000_u64.into()
            };
            let settings: Settings = serde_json::from_value(changed).unwrap();
            let problem = settings
                .out_of_range()
                .unwrap_or_else(|| panic!("{name} is free"));
            assert_eq!(problem.setting.replace('.', "/"), name[1..]);
        }
    }

    #[test]
    fn what_is_no_number_is_beyond() {
        let settings = Settings {
            frame_time_sigma_s: f64::NAN,
            ..usual()
        };
        let words = settings.out_of_range().unwrap().to_string();
        assert_eq!(
            words,
            "the setting frame_time_sigma_s must lie between 0 and 86400, found NaN"
        );
    }

    fn leaves(value: &serde_json::Value, name: &str, found: &mut Vec<String>) {
        if value.is_number() {
            found.push(name.to_owned());
        }
        for (key, inner) in value.as_object().into_iter().flatten() {
            leaves(inner, &format!("{name}/{key}"), found);
        }
    }
}
