//! What is asked of a map: regions, lines, areas for devices, a wanted twist.

use std::fmt::Write as _;

use moiregauge::region::{DeviceSearch, Region, WantedTwist};
use moiregauge_pipeline::maps::{Line, Questions};
use moiregauge_report::results::{MapDetailsResult, RegionMeanResult};
use moiregauge_report::{plus_minus, two_digits};

use crate::input::parse_size;
use crate::places::{parse_line, parse_region};

/// Questions about a map. Places are those of the map: x right, y up, nm.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Regions of the map")]
pub(super) struct RegionArgs {
    /// Mean, spread and errors within a box or polygon
    ///
    /// A box is its lower left corner, width and height; a polygon its corners separated by blanks: flake='0,0 100,10
    /// 60,80'. In nm, or with a unit (bar=0.1um,0.2um,1um,500nm). May be repeated.
    #[arg(long, value_name = "NAME=X,Y,W,H", value_parser = parse_region, allow_hyphen_values = true)]
    region: Vec<Region>,
    /// Twist, strain and wavelength along a line
    ///
    /// In nm, or with a unit. May be repeated.
    #[arg(long, value_name = "NAME=X1,Y1 X2,Y2", value_parser = parse_line, allow_hyphen_values = true)]
    profile: Vec<Line>,
    /// The most uniform areas of this size, as in 200nm×100nm, ranked
    #[arg(long, value_name = "W×H", value_parser = parse_size)]
    device: Option<[f64; 2]>,
    /// Number of orientations of the device to try, evenly over half a turn; 1: along x only
    #[arg(long, value_name = "N", default_value_t = 1, requires = "device",
        value_parser = clap::value_parser!(u16).range(1..=180))]
    device_angles: u16,
    /// Number of areas to list
    #[arg(long, value_name = "N", default_value_t = 10, requires = "device",
        value_parser = clap::value_parser!(u16).range(1..=1000))]
    device_count: u16,
    /// How much of the map has this twist, as in 1.05±0.02 or 1.05+-0.02
    #[arg(long, value_name = "TWIST±DEG", value_parser = parse_wanted)]
    wanted: Option<WantedTwist>,
}

impl RegionArgs {
    /// What is asked.
    pub(super) fn questions(&self) -> Questions {
        let search = |size| DeviceSearch {
            orientations: usize::from(self.device_angles),
            most: usize::from(self.device_count),
            ..DeviceSearch::new(size)
        };
        Questions {
            regions: self.region.clone(),
            profiles: self.profile.clone(),
            device: self.device.map(search),
            wanted: self.wanted,
        }
    }
}

/// What the screen shows of them.
pub(super) fn summary(details: &MapDetailsResult) -> String {
    let mut text = String::new();
    let twist = |found: Option<RegionMeanResult>| {
        let Some(t) = found else {
            return "no good node".to_owned();
        };
        let known = |v: Option<f64>| v.unwrap_or(f64::NAN);
        let mean = heterostrain::Estimate::new(known(t.mean), known(t.sigma));
        format!(
            "twist {}°, varies by {}° (below {}°, 95 %)",
            plus_minus(mean),
            two_digits(known(t.spread_corrected)),
            two_digits(known(t.spread_below_95))
        )
    };
    for grain in &details.grains {
        let known = |v: Option<f64>| v.unwrap_or(f64::NAN);
        let strain = grain.mean.as_ref().map(|mean| mean.heterostrain_percent);
        let strain = strain.map_or_else(String::new, |e| {
            let strain = heterostrain::Estimate::new(known(e.value), known(e.sigma));
            format!(", heterostrain {} %", plus_minus(strain))
        });
        let _ = writeln!(
            text,
            "{}: {} good nodes, {}{strain}",
            grain.name,
            grain.good_nodes,
            twist(grain.twist_deg)
        );
    }
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
            "domains: {} {} nodes (± {} nm), {} triangles, {} missing, {} extra, {} dislocations; median twist \
             {:.4}°, spread {}° (noise {}°)",
            d.nodes,
            d.nodes_are,
            two_digits(known(d.node_sigma_nm)),
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
        let _ = writeln!(text, "regime: {} ({})", r.use_of, r.reasons.join("; "));
    }
    if let Some(w) = &details.wanted {
        let percent = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| format!("{v:.1}"));
        let _ = writeln!(
            text,
            "twist {} ± {}°: {} % of the good area (± {} % by smoothing; {} to {} % at 2 σ)",
            w.twist_deg,
            w.within_deg,
            percent(w.corrected_percent),
            percent(w.blur_percent),
            percent(w.certain_percent),
            percent(w.possible_percent)
        );
    }
    text
}

fn parse_wanted(text: &str) -> Result<WantedTwist, String> {
    let parsed = || {
        let (twist, within) = text.split_once('±').or_else(|| text.split_once("+-"))?;
        let degrees = |text: &str| {
            let number = text.trim().trim_end_matches("deg").trim_end_matches('°');
            number.trim().parse::<f64>().ok()
        };
        let (twist, within) = (degrees(twist)?, degrees(within)?);
        let good = twist.abs() <= 180.0 && within > 0.0 && within <= 180.0;
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
    fn a_wanted_twist_in_words() {
        for text in [
            "1.05±0.02",
            "1.05 +- 0.02",
            "1.05° ± 0.02°",
            "1.05deg±0.02deg",
        ] {
            let wanted = parse_wanted(text).expect(text);
            assert!((wanted.twist.to_degrees() - 1.05).abs() < 1e-12);
            assert!((wanted.within.to_degrees() - 0.02).abs() < 1e-12);
        }
        assert!(parse_wanted("1.05").is_err() && parse_wanted("1±0").is_err());
    }
}
