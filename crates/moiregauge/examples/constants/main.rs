//! A small corpus of scenes and all that is decided about them, one result a line: what `docs/constants.sh` compares when it
//! changes a constant.
//!
//! `cargo run --release -p moiregauge --example constants [DATA [WORD…]]`. DATA holds recorded frames (`sets`, `hard`); with
//! words only the scenes whose names have one of them. A line is `scene | what | value | σ`, or `scene | said | code`.

mod lines;
mod scenes;

use std::path::Path;

use lines::{line, local, masks, number, said};
use moiregauge::campaign::Analysis;
use moiregauge::campaign::analyse;
use moiregauge::domains::Contrast;
use moiregauge::domains::regime;
use moiregauge::map::TwistStrainMap;
use moiregauge::scan::{MeasuredScan, measure_moires, sorted_moires};
use moiregauge::settings::Settings;
use moiregauge::survey::{
    MapMethod, average_maps, change_of_drift, domains_of_scan, map_scan, stripes_in_short,
    stripes_of_scan,
};
use moiregauge::window::Resolution;
use spmfile::Scan;

/// A named scene: its frames, and how they are looked at.
struct Scene {
    name: String,
    scans: Vec<Scan>,
    settings: Settings,
    /// Whether maps are made, too.
    map: bool,
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let data = arguments.first().map_or("../shared/data", String::as_str);
    let words = arguments.get(1..).unwrap_or_default();
    let wanted = |name: &str| words.is_empty() || words.iter().any(|word| name.contains(word));
    let mut scenes = scenes::sets();
    scenes.extend(scenes::samples(wanted));
    scenes.extend(scenes::faint());
    scenes.extend(scenes::two_moires());
    scenes.extend(scenes::fields());
    scenes.extend(scenes::nodes());
    scenes.extend(scenes::stripes());
    scenes.extend(scenes::recorded(Path::new(data)));
    for scene in scenes.into_iter().filter(|s| wanted(&s.name)) {
        scene.report();
    }
    if wanted("set: atoms") {
        scenes::atoms();
    }
}

impl Scene {
    fn new(name: &str, scans: Vec<Scan>) -> Self {
        Self {
            name: name.to_owned(),
            scans,
            settings: Settings {
                drift_draws: 0,
                strain_draws: 0,
                ..Settings::default()
            },
            map: false,
        }
    }

    fn mapped(mut self) -> Self {
        self.map = true;
        self.name = self.name.replace("set:", "set with map:");
        self
    }

    fn with(mut self, change: impl FnOnce(&mut Settings)) -> Self {
        change(&mut self.settings);
        self
    }

    fn report(&self) {
        let name = &self.name;
        let mut found = Vec::new();
        for (i, scan) in self.scans.iter().enumerate() {
            match measure_moires(&format!("{i:03}"), scan, &self.settings, None) {
                Ok(moires) => found.push(moires),
                Err(error) => println!("{name} | said | frame {i} refused: {error}"),
            }
        }
        if found.is_empty() {
            return self.stripes();
        }
        let moires = sorted_moires(found);
        let several = moires.len() > 1;
        for (m, measured) in moires.into_iter().enumerate() {
            let name = if several {
                format!("{name}, moiré {m}")
            } else {
                name.clone()
            };
            self.analysed(&name, measured);
        }
    }

    fn analysed(&self, name: &str, measured: Vec<MeasuredScan>) {
        for scan in &measured {
            for line in &scan.lines {
                let harmonics = line
                    .lattice
                    .fit
                    .as_ref()
                    .map_or(0, |fit| fit.harmonics.len());
                number(
                    name,
                    &format!("frame {} harmonics", scan.file),
                    harmonics as f64,
                );
            }
        }
        let analysis = analyse(measured, &self.settings);
        lines::analysed(name, &analysis);
        if self.map {
            self.maps(name, &analysis);
        }
    }

    fn maps(&self, name: &str, analysis: &Analysis) {
        let scans: Vec<_> = analysis.sets.iter().flat_map(|set| &set.scans).collect();
        let how = (MapMethod::Demodulation, &Resolution::default());
        let mut maps = Vec::new();
        for (scan, analysed) in self.scans.iter().zip(&scans) {
            match map_scan(scan, analysed, None, &self.settings, how.0, how.1) {
                Ok(found) => maps.extend(found),
                Err(error) => println!("{name} | said | no map: {error}"),
            }
        }
        for map in &maps {
            number(name, "map harmonics", map.harmonics.len() as f64);
            number(
                name,
                "map noise measured",
                f64::from(u8::from(map.noise_measured)),
            );
        }
        let Some((average, agreement)) = average_maps(&maps) else {
            return;
        };
        if let Some(agreement) = agreement {
            number(name, "map error factor", agreement.factor);
        }
        let (layers, convention) = (self.settings.bilayer(), self.settings.strain_convention);
        let Ok(found) = average.twist_strain(&maps[0].whole, layers, convention) else {
            return println!("{name} | said | map without twist");
        };
        let map = TwistStrainMap::new(&average, &found);
        local(name, &map);
        let change = change_of_drift(&maps);
        println!(
            "{name} | said | change of drift looked for: {}",
            change.is_some()
        );
        let domains = domains_of_scan(
            &self.scans[0],
            scans[0],
            None,
            &self.settings,
            Contrast::Auto,
        );
        let domains = domains.first();
        let regime = regime(&map, domains);
        println!(
            "{name} | said | {:?}, in doubt: {}",
            regime.choice, regime.in_doubt
        );
        number(name, "regime blurred", regime.blurred);
        number(name, "regime variation", regime.variation);
        let Some(domains) = domains else { return };
        number(name, "nodes", domains.nodes.len() as f64);
        number(name, "cells", domains.cells.len() as f64);
        number(name, "missing nodes", domains.missing.len() as f64);
        number(name, "extra nodes", domains.extra.len() as f64);
        number(name, "dislocations", domains.dislocations.len() as f64);
        println!(
            "{name} | said | nodes are {:?}, clear: {}",
            domains.contrast, domains.contrast_is_clear
        );
        let twists = domains.cells.iter().filter_map(|c| c.twist_strain);
        let (sum, variance, count) = twists.fold((0.0, 0.0, 0.0), |(s, v, n), t| {
            (s + t.twist, v + t.twist().sigma.powi(2), n + 1.0)
        });
        line(
            name,
            "mean twist of cells (°)",
            (sum / count).to_degrees(),
            f64::sqrt(variance / count).to_degrees(),
        );
    }

    fn stripes(&self) {
        let (name, settings) = (&self.name, &self.settings);
        for [wavelength, along, log_chance] in stripes_in_short(&self.scans[0], settings) {
            number(name, "stripes: wavelength (nm)", wavelength);
            number(name, "stripes: direction (°)", along.to_degrees());
            number(name, "stripes: log₁₀ of the chance", log_chance);
        }
        match stripes_of_scan("000", &self.scans[0], settings, &Resolution::default()) {
            Ok(found) => {
                for pattern in &found.stripes.patterns {
                    number(name, "stripes: good nodes", pattern.good as f64);
                    if let Some([wavelength, along]) = pattern.fit {
                        line(
                            name,
                            "stripes: fitted wavelength (nm)",
                            wavelength.value,
                            wavelength.sigma,
                        );
                        line(
                            name,
                            "stripes: fitted direction (°)",
                            along.value.to_degrees(),
                            along.sigma.to_degrees(),
                        );
                    }
                }
                masks(name, &found.stripes.map);
                said(name, &found.caveats);
            }
            Err(error) => println!("{name} | said | no stripes: {error}"),
        }
    }
}
