//! What is asked of a map: regions, lines, areas for devices, a wanted twist.

use moiregauge::caveat::{Caveat, MapDoubt};
use moiregauge::map::TwistStrainMap;
use moiregauge::numbers::two_digits;
use moiregauge::region::{
    Device, DeviceSearch, Profile, RegionStatistics, WantedArea, uniform_areas,
};
use moiregauge_report::MapDetails;
use nalgebra::Vector2;

use super::asked::Questions;

/// A region or line that does not touch the map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "{name}: x from {:.1} to {:.1} nm, y from {:.1} to {:.1} nm lies outside the map, which reaches from {:.1} to \
     {:.1} nm in x and from {:.1} to {:.1} nm in y",
    asked[0][0], asked[0][1], asked[1][0], asked[1][1], map[0][0], map[0][1], map[1][0], map[1][1]
)]
pub struct OutsideOfMap {
    /// Its name.
    pub name: String,
    /// Whether it is a line.
    pub is_line: bool,
    /// From where to where it reaches in x and y, nm.
    pub asked: [[f64; 2]; 2],
    /// From where to where the map reaches.
    pub map: [[f64; 2]; 2],
}

/// Two regions or two lines of one name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the name {name:?} is used twice")]
pub struct NameTwice {
    /// The name.
    pub name: String,
    /// Whether they are lines.
    pub is_line: bool,
}

impl Questions {
    /// Refuses names that are used twice.
    ///
    /// # Errors
    /// The first of them.
    pub fn check(&self) -> Result<(), NameTwice> {
        let regions: Vec<&String> = self.regions.iter().map(|r| &r.name).collect();
        let lines: Vec<&String> = self.profiles.iter().map(|l| &l.name).collect();
        for (is_line, names) in [(false, regions), (true, lines)] {
            let twice = |n: usize| names[..n].contains(&names[n]);
            if let Some(n) = (0..names.len()).find(|&n| twice(n)) {
                let name = names[n].clone();
                return Err(NameTwice { name, is_line });
            }
        }
        Ok(())
    }

    /// Whether nothing is asked.
    pub fn is_empty(&self) -> bool {
        let places = self.regions.is_empty() && self.profiles.is_empty();
        places && self.device.is_none() && self.wanted.is_none()
    }

    /// The answers, and doubts about them.
    ///
    /// # Errors
    /// Regions and lines beyond the map.
    pub fn ask(&self, map: &TwistStrainMap) -> Result<(MapDetails, Vec<Caveat>), OutsideOfMap> {
        let mut doubts = Vec::new();
        for region in &self.regions {
            within(map, &region.name, false, &region.corners)?;
        }
        for line in &self.profiles {
            within(map, &line.name, true, &line.ends)?;
        }
        let regions = self.regions.iter();
        let regions: Vec<RegionStatistics> =
            regions.map(|r| RegionStatistics::new(map, r)).collect();
        doubts.extend(regions.iter().filter_map(about_region));
        let devices = self.device.as_ref();
        let devices = devices.map(|search| areas(map, search, &mut doubts));
        let wanted = self
            .wanted
            .map(|w| (w, WantedArea::new(map, 0..map.grid.len(), &w)));
        let profiles = self.profiles.iter();
        let numbers = 1..=map.grain.iter().copied().max().unwrap_or(0);
        let grains = numbers.filter_map(|number| RegionStatistics::of_grain(map, number));
        let details = MapDetails {
            grains: grains.collect(),
            regions,
            profiles: profiles
                .map(|l| Profile::new(map, &l.name, l.ends))
                .collect(),
            devices: devices.unwrap_or_default(),
            wanted,
            ..MapDetails::default()
        };
        Ok((details, doubts))
    }
}

/// The most uniform areas of a size.
fn areas(map: &TwistStrainMap, search: &DeviceSearch, doubts: &mut Vec<Caveat>) -> Vec<Device> {
    let [w, h] = search.size.map(two_digits);
    let place = format!("device {w} nm × {h} nm");
    if search.size[0].min(search.size[1]) < 2.355 * map.window_nm {
        doubts.push(Caveat::new(MapDoubt::DeviceBelowResolution, place.as_str()));
    }
    let found = uniform_areas(map, search);
    if found.is_empty() {
        doubts.push(Caveat::new(MapDoubt::DeviceFitsNowhere, place));
    }
    found
}

/// Says where a region is not as it was asked for.
fn about_region(found: &RegionStatistics) -> Option<Caveat> {
    let name = found.region.name.as_str();
    if found.good == 0 {
        return Some(Caveat::new(MapDoubt::RegionEmpty, name));
    }
    let in_part = found.covered < 0.95 || found.masked_share > 0.05;
    let doubt = MapDoubt::RegionInPart {
        covered: found.covered,
        masked: found.masked_share,
    };
    in_part.then(|| Caveat::new(doubt, name))
}

/// An error if none of the places, nor anything between them, can lie in the map.
fn within(
    map: &TwistStrainMap,
    name: &str,
    is_line: bool,
    places: &[Vector2<f64>],
) -> Result<(), OutsideOfMap> {
    let extent @ [x, y] = map.grid.extent();
    let asked @ [u, v] = [0, 1].map(|axis| {
        let along = places.iter().map(|p| p[axis]);
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| {
            [l.min(v), h.max(v)]
        })
    });
    if u[0] <= x[1] && u[1] >= x[0] && v[0] <= y[1] && v[1] >= y[0] {
        return Ok(());
    }
    Err(OutsideOfMap {
        name: name.to_owned(),
        is_line,
        asked,
        map: extent,
    })
}
