//! Questions to a map, and how they are kept: in nm and degrees, places as pairs.

use moiregauge::region::{DeviceSearch, Region, WantedTwist};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// Questions to a map. Places are those of the map: x right, y up, nm.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Asked", into = "Asked")]
pub struct Questions {
    /// Mean, spread and errors within these.
    pub regions: Vec<Region>,
    /// Twist, strain and wavelength along these.
    pub profiles: Vec<Line>,
    /// The most uniform areas.
    pub device: Option<DeviceSearch>,
    /// How much of the map has this twist.
    pub wanted: Option<WantedTwist>,
}

/// A line with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Its name.
    pub name: String,
    /// Its ends, nm.
    pub ends: [Vector2<f64>; 2],
}

/// All questions as they are kept.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Asked {
    #[serde(skip_serializing_if = "Vec::is_empty")]
    regions: Vec<AskedRegion>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    profiles: Vec<AskedLine>,
    #[serde(skip_serializing_if = "Option::is_none")]
    device: Option<AskedDevice>,
    #[serde(skip_serializing_if = "Option::is_none")]
    wanted: Option<AskedTwist>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct AskedRegion {
    name: String,
    corners_nm: Vec<[f64; 2]>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct AskedLine {
    name: String,
    ends_nm: [[f64; 2]; 2],
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct AskedDevice {
    size_nm: [f64; 2],
    orientations: Option<usize>,
    most: Option<usize>,
    good_share: Option<f64>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct AskedTwist {
    twist_deg: f64,
    within_deg: f64,
}

impl From<Asked> for Questions {
    fn from(asked: Asked) -> Self {
        let regions = asked.regions.into_iter().map(|r| Region {
            name: r.name,
            corners: r.corners_nm.into_iter().map(Vector2::from).collect(),
        });
        let profiles = asked.profiles.into_iter().map(|l| Line {
            name: l.name,
            ends: l.ends_nm.map(Vector2::from),
        });
        let search = |d: AskedDevice| {
            let usual = DeviceSearch::new(d.size_nm);
            DeviceSearch {
                size: d.size_nm,
                orientations: d.orientations.unwrap_or(usual.orientations),
                most: d.most.unwrap_or(usual.most),
                good: d.good_share.unwrap_or(usual.good),
            }
        };
        Self {
            regions: regions.collect(),
            profiles: profiles.collect(),
            device: asked.device.map(search),
            wanted: asked.wanted.map(|w| WantedTwist {
                twist: w.twist_deg.to_radians(),
                within: w.within_deg.to_radians(),
            }),
        }
    }
}

impl From<Questions> for Asked {
    fn from(questions: Questions) -> Self {
        let regions = questions.regions.into_iter().map(|r| AskedRegion {
            name: r.name,
            corners_nm: r.corners.into_iter().map(Into::into).collect(),
        });
        let profiles = questions.profiles.into_iter().map(|l| AskedLine {
            name: l.name,
            ends_nm: l.ends.map(Into::into),
        });
        Self {
            regions: regions.collect(),
            profiles: profiles.collect(),
            device: questions.device.map(|d| AskedDevice {
                size_nm: d.size,
                orientations: Some(d.orientations),
                most: Some(d.most),
                good_share: Some(d.good),
            }),
            wanted: questions.wanted.map(|w| AskedTwist {
                twist_deg: w.twist.to_degrees(),
                within_deg: w.within.to_degrees(),
            }),
        }
    }
}
