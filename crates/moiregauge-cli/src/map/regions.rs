//! What is asked of a map: regions, lines, areas for devices, a wanted twist.

use std::fmt::Write as _;

use moiregauge::caveat::Caveat;
use moiregauge::map::TwistStrainMap;
use moiregauge::region::{
    DeviceSearch, Profile, Region, RegionStatistics, WantedArea, WantedTwist, uniform_areas,
};
use moiregauge_report::results::{MapDetailsResult, RegionMeanResult};
use moiregauge_report::{MapDetails, plus_minus, two_digits};
use nalgebra::Vector2;
use spmfile::length_nm;

use crate::input::parse_size;

/// Questions about a map. Places are those of the map: x right, y up, nm.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Regions of the map")]
pub(super) struct RegionArgs {
    /// Mean, spread and errors within a box: lower left corner, width, height; nm, or with a unit
    /// (bar=0.1um,0.2um,1um,500nm); may be repeated
    #[arg(long, value_name = "NAME=X,Y,W,H", value_parser = parse_region, allow_hyphen_values = true)]
    region: Vec<Region>,
    /// The same within a polygon, its corners apart by blanks
    #[arg(long, value_name = "NAME=X1,Y1 X2,Y2 …", value_parser = parse_polygon, allow_hyphen_values = true)]
    polygon: Vec<Region>,
    /// Twist, strain and wavelength along a line
    #[arg(long, value_name = "NAME=X1,Y1 X2,Y2", value_parser = parse_line, allow_hyphen_values = true)]
    profile: Vec<Line>,
    /// The most uniform areas of this size: where the twist varies least
    #[arg(long, value_name = "W×H", value_parser = parse_size)]
    device: Option<[f64; 2]>,
    /// Orientations of the device to try, evenly over half a turn; 1: along x only
    #[arg(long, value_name = "N", default_value_t = 1, requires = "device",
        value_parser = clap::value_parser!(u16).range(1..=180))]
    device_angles: u16,
    /// How many areas to list
    #[arg(long, value_name = "N", default_value_t = 10, requires = "device",
        value_parser = clap::value_parser!(u16).range(1..=1000))]
    device_count: u16,
    /// How much of the map has this twist, degrees: 1.05±0.02 or 1.05+-0.02
    #[arg(long, value_name = "TWIST±DEG", value_parser = parse_wanted)]
    wanted: Option<WantedTwist>,
}

/// A line with a name.
#[derive(Clone, Debug)]
struct Line {
    name: String,
    ends: [Vector2<f64>; 2],
}

impl RegionArgs {
    /// The answers, and doubts about them.
    pub(super) fn answer(&self, map: &TwistStrainMap) -> (MapDetails, Vec<Caveat>) {
        let mut doubts = Vec::new();
        let regions = self.region.iter().chain(&self.polygon);
        let regions: Vec<RegionStatistics> =
            regions.map(|r| RegionStatistics::new(map, r)).collect();
        for found in &regions {
            let name = found.region.name.as_str();
            if found.good == 0 {
                doubts.push(Caveat::new(
                    "region-empty",
                    name,
                    "the region has no good node: it has no values",
                ));
            } else if found.covered < 0.95 || found.masked_share() > 0.05 {
                doubts.push(Caveat::new(
                    "region-in-part",
                    name,
                    format!(
                        "the map reaches {:.0} % of the region, and {:.0} % of the nodes there are not to be \
                         believed: its numbers are those of the rest",
                        100.0 * found.covered,
                        100.0 * found.masked_share()
                    ),
                ));
            }
        }
        let devices = self.device.map(|size| {
            let search = DeviceSearch {
                orientations: usize::from(self.device_angles),
                most: usize::from(self.device_count),
                ..DeviceSearch::new(size)
            };
            let [w, h] = size.map(two_digits);
            let place = format!("device {w} nm × {h} nm");
            if size[0].min(size[1]) < 2.355 * map.window_nm {
                doubts.push(Caveat::new(
                    "device-below-resolution",
                    place.as_str(),
                    "the device is narrower than the map resolves: the twist may vary more within it than the \
                     map shows",
                ));
            }
            let found = uniform_areas(map, &search);
            if found.is_empty() {
                doubts.push(Caveat::new(
                    "device-fits-nowhere",
                    place,
                    "no area of this size lies within the map with 95 % of its nodes to be believed",
                ));
            }
            found
        });
        let wanted = self
            .wanted
            .map(|w| (w, WantedArea::new(map, 0..map.grid.len(), &w)));
        let profiles = self
            .profile
            .iter()
            .map(|l| Profile::new(map, &l.name, l.ends));
        let details = MapDetails {
            regions,
            profiles: profiles.collect(),
            devices: devices.unwrap_or_default(),
            wanted,
            domains: None,
            regime: None,
        };
        (details, doubts)
    }
}

/// What is said of them on the screen.
pub(super) fn summary(details: &MapDetailsResult) -> String {
    let mut text = String::new();
    let twist = |found: Option<RegionMeanResult>| {
        let Some(t) = found else {
            return "no good node".to_owned();
        };
        let known = |v: Option<f64>| v.unwrap_or(f64::NAN);
        let mean = moiregauge::estimate::Estimate::new(known(t.mean), known(t.sigma));
        format!(
            "twist {}°, varies by {}° (below {}°, 95 %)",
            plus_minus(mean),
            two_digits(known(t.spread_corrected)),
            two_digits(known(t.spread_below_95))
        )
    };
    for region in &details.regions {
        let _ = writeln!(text, "region {}: {}", region.name, twist(region.twist_deg));
    }
    for device in &details.devices {
        let [x, y] = device.centre_nm;
        let _ = writeln!(
            text,
            "area {} at ({x:.1}, {y:.1}) nm, {:.0}°: {}",
            device.rank,
            device.angle_deg,
            twist(device.area.twist_deg)
        );
    }
    if let Some(d) = &details.domains {
        let known = |v: Option<f64>| v.unwrap_or(f64::NAN);
        let _ = writeln!(
            text,
            "domains: {} {} nodes, {} triangles, {} missing, {} extra, {} dislocations; median twist {:.4}°, spread \
             {}° (noise {}°)",
            d.nodes,
            d.nodes_are,
            d.triangles,
            d.missing_nm.len(),
            d.extra_nm.len(),
            d.dislocations.len(),
            known(d.median_twist_deg),
            two_digits(known(d.twist_spread_deg)),
            two_digits(known(d.twist_noise_deg))
        );
    }
    if let Some(r) = &details.regime {
        let _ = writeln!(text, "use the {}: {}", r.use_of, r.reasons.join("; "));
    }
    if let Some(w) = &details.wanted {
        let percent = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| format!("{v:.1}"));
        let _ = writeln!(
            text,
            "twist {} ± {}°: {} % of the good area ({} to {} % at 2 σ)",
            w.twist_deg,
            w.within_deg,
            percent(w.corrected_percent),
            percent(w.certain_percent),
            percent(w.possible_percent)
        );
    }
    text
}

/// A length in nm, with or without a unit.
fn length(text: &str) -> Option<f64> {
    let text = text.trim();
    let nm = text.parse().ok().or_else(|| length_nm(text))?;
    f64::is_finite(nm).then_some(nm)
}

fn named(text: &str) -> Option<(&str, &str)> {
    let (name, rest) = text.split_once('=')?;
    (!name.trim().is_empty()).then_some((name.trim(), rest))
}

fn parse_region(text: &str) -> Result<Region, String> {
    let parsed = || {
        let (name, rest) = named(text)?;
        let numbers: Vec<f64> = rest.split(',').map(length).collect::<Option<_>>()?;
        let [x, y, w, h] = numbers[..] else {
            return None;
        };
        (w > 0.0 && h > 0.0).then(|| Region::rectangle(name, Vector2::new(x, y), [w, h]))
    };
    parsed().ok_or_else(|| {
        "expected a name, the lower left corner, width and height in nm, as in bar=10,20,80,40"
            .to_owned()
    })
}

fn places(text: &str) -> Option<Vec<Vector2<f64>>> {
    let place = |text: &str| {
        let (x, y) = text.split_once(',')?;
        Some(Vector2::new(length(x)?, length(y)?))
    };
    text.split([' ', ';'])
        .filter(|t| !t.is_empty())
        .map(place)
        .collect()
}

fn parse_polygon(text: &str) -> Result<Region, String> {
    let parsed = || {
        let (name, rest) = named(text)?;
        let region = Region {
            name: name.to_owned(),
            corners: places(rest)?,
        };
        (region.corners.len() >= 3 && region.area() > 0.0).then_some(region)
    };
    parsed().ok_or_else(|| {
        "expected a name and three corners or more in nm, as in 'flake=0,0 100,10 60,80'".to_owned()
    })
}

fn parse_line(text: &str) -> Result<Line, String> {
    let parsed = || {
        let (name, rest) = named(text)?;
        let [a, b] = places(rest)?[..] else {
            return None;
        };
        (a != b).then(|| Line {
            name: name.to_owned(),
            ends: [a, b],
        })
    };
    parsed()
        .ok_or_else(|| "expected a name and two places in nm, as in 'cut=0,0 100,80'".to_owned())
}

fn parse_wanted(text: &str) -> Result<WantedTwist, String> {
    let parsed = || {
        let (twist, within) = text.split_once('±').or_else(|| text.split_once("+-"))?;
        let degrees = |text: &str| text.trim().trim_end_matches('°').trim().parse::<f64>().ok();
        let (twist, within) = (degrees(twist)?, degrees(within)?);
        let good = twist.is_finite() && within > 0.0 && within.is_finite();
        good.then(|| WantedTwist {
            twist: twist.to_radians(),
            within: within.to_radians(),
        })
    };
    parsed()
        .ok_or_else(|| "expected a twist and a tolerance in degrees, as in 1.05±0.02".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn questions_in_words() {
        let region = parse_region("a b=1um,-20nm,3,4.5").expect("a box");
        assert_eq!(region.name, "a b");
        assert!((region.area() - 13.5).abs() < 1e-9);
        assert!((region.corners[0] - Vector2::new(1000.0, -20.0)).norm() < 1e-9);
        let triangle = parse_polygon("t=0,0 4,0 0,2").expect("a triangle");
        assert!((triangle.area() - 4.0).abs() < 1e-12);
        let line = parse_line("cut=0,0 3,4").expect("a line");
        assert!(((line.ends[1] - line.ends[0]).norm() - 5.0).abs() < 1e-12);
        for text in ["1.05±0.02", "1.05 +- 0.02", "1.05° ± 0.02°"] {
            let wanted = parse_wanted(text).expect(text);
            assert!((wanted.twist.to_degrees() - 1.05).abs() < 1e-12);
            assert!((wanted.within.to_degrees() - 0.02).abs() < 1e-12);
        }
        for wrong in [
            "1,2,3,4",
            "a=1,2,3",
            "a=1,2,0,4",
            "=1,2,3,4",
            "a=1,2,x,4",
            "a=1,2,1V,4",
        ] {
            assert!(parse_region(wrong).is_err(), "{wrong}");
        }
        assert!(parse_polygon("t=0,0 1,1").is_err() && parse_polygon("t=0,0 1,1 2,2").is_err());
        assert!(parse_line("l=0,0 0,0").is_err() && parse_line("l=0,0").is_err());
        assert!(parse_wanted("1.05").is_err() && parse_wanted("1±0").is_err());
    }
}
