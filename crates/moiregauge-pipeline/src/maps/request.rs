//! What map is wanted.

use moiregauge::domains::Contrast;
use moiregauge::survey::MapMethod;
use moiregauge::window::Resolution;
use serde::{Deserialize, Serialize};

use super::ask::NameTwice;
use super::asked::Questions;
use super::error::NotMapped;
use moiregauge::settings::SettingsError;

/// Lengths of windows and steps, nm.
const LENGTH_NM: [f64; 2] = [1e-3, 1e7];
/// Margins, in windows.
const MARGIN: [f64; 2] = [0.0, 10.0];

/// What map is wanted, and what is asked of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MapRequest {
    /// How local lattices are measured.
    #[serde(with = "Method")]
    pub method: MapMethod,
    /// Width of the Gaussian window (standard deviation), or the side of a tile; without it as wide as the lattice stays
    /// straight, or six periods.
    pub window_nm: Option<f64>,
    /// Distance of the nodes.
    pub step_nm: Option<f64>,
    /// Margin at the edges, in windows.
    pub margin: Option<f64>,
    /// Map in bands, side by side, as large images always are.
    pub in_bands: bool,
    /// Questions to the map.
    pub questions: Questions,
    /// Domain structure at small angles.
    pub domains: DomainSearch,
}

/// Whether nodes and the triangles between them are looked for, and how nodes look.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DomainSearch {
    /// Whether they are looked for.
    pub when: When,
    /// How nodes look.
    #[serde(with = "Nodes")]
    pub nodes: Contrast,
}

/// Whether something is looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum When {
    /// Only where maps of phases are in doubt: twist below 0.5°, fast changes, no good node.
    #[default]
    Auto,
    /// Always.
    On,
    /// Never.
    Off,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "MapMethod", rename_all = "kebab-case")]
enum Method {
    Demodulation,
    Tiles,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Contrast", rename_all = "kebab-case")]
enum Nodes {
    Auto,
    Bright,
    Dark,
}

impl MapRequest {
    /// Refuses what no map can be like.
    ///
    /// # Errors
    /// The first number that makes no sense, or a name of two places.
    pub fn check(&self) -> Result<(), NotMapped> {
        for (setting, value, [low, high]) in [
            ("window_nm", self.window_nm, LENGTH_NM),
            ("step_nm", self.step_nm, LENGTH_NM),
            ("margin", self.margin, MARGIN),
        ] {
            if let Some(value) = value.filter(|value| !(low..=high).contains(value)) {
                let reason = format!("{setting} must lie between {low} and {high}, found {value}");
                return Err(SettingsError { setting, reason }.into());
            }
        }
        let names: Result<(), NameTwice> = self.questions.check();
        Ok(names?)
    }

    /// How fine the map is.
    pub fn resolution(&self) -> Resolution {
        Resolution {
            window_nm: self.window_nm,
            step_nm: self.step_nm,
            margin: self.margin,
        }
    }

    /// How local lattices are measured, for the results.
    pub(super) fn method_name(&self) -> &'static str {
        match self.method {
            MapMethod::Demodulation => "demodulation",
            MapMethod::Tiles => "tiles",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_kept_as_json_in_units_of_people() {
        let text = r#"{
            "method": "tiles",
            "margin": 1.5,
            "domains": {"when": "on", "nodes": "dark"},
            "questions": {
                "regions": [{"name": "bar", "corners_nm": [[0, 0], [4, 0], [0, 2]]}],
                "profiles": [{"name": "cut", "ends_nm": [[0, 0], [3, 4]]}],
                "device": {"size_nm": [40, 20]},
                "wanted": {"twist_deg": 1.05, "within_deg": 0.02}
            }
        }"#;
        let request: MapRequest = serde_json::from_str(text).unwrap();
        request.check().unwrap();
        assert_eq!(request.method, MapMethod::Tiles);
        assert_eq!(request.questions.device.unwrap().orientations, 1);
        let again = serde_json::to_string(&request).unwrap();
        let again: MapRequest = serde_json::from_str(&again).unwrap();
        assert!((again.questions.wanted.unwrap().twist.to_degrees() - 1.05).abs() < 1e-12);
        let nan = MapRequest {
            window_nm: Some(f64::NAN),
            ..request.clone()
        };
        assert!(matches!(nan.check(), Err(NotMapped::Settings(e)) if e.setting == "window_nm"));
        let mut twice = request;
        twice
            .questions
            .regions
            .push(twice.questions.regions[0].clone());
        assert!(matches!(twice.check(), Err(NotMapped::NameTwice(n)) if n.name == "bar"));
    }
}
