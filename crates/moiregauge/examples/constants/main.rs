//! A small corpus of scenes and all that is decided about them, one result a line: what `docs/constants.sh` compares when it
//! changes a constant.
//!
//! `cargo run --release -p moiregauge --example constants [DATA [WORD…]]`. DATA holds recorded frames (`sets`, `hard`); with
//! words only the scenes whose names have one of them. A line is `scene | what | value | σ`, or `scene | said | code`.

use std::path::Path;

use heterostrain::material::Material;
use moiregauge::calibration::KnownLattice;
use moiregauge::campaign::calibrate;
use moiregauge::campaign::{Analysis, SetMean};
use moiregauge::campaign::{analyse, atomic_orientation};
use moiregauge::caveat::Caveat;
use moiregauge::domains::Contrast;
use moiregauge::domains::regime;
use moiregauge::frame::Image;
use moiregauge::map::TwistStrainMap;
use moiregauge::meaning::Readings;
use moiregauge::region::Trends;
use moiregauge::scan::{MeasuredScan, measure_known, measure_moires, sorted_moires};
use moiregauge::settings::{Grouping, Settings};
use moiregauge::simulate::{DomainScene, Feature, FieldScene, Pattern, Simulation, Simulator};
use moiregauge::survey::{
    MapMethod, average_maps, change_of_drift, domains_of_scan, map_scan, stripes_in_short,
    stripes_of_scan,
};
use moiregauge::window::{Mask, Resolution};
use nalgebra::Vector2;
use spmfile::{Channel, Samples, Scan, Span};

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
    let mut scenes = sets();
    scenes.extend(faint());
    scenes.extend(two_moires());
    scenes.extend(fields());
    scenes.extend(nodes());
    scenes.extend(stripes());
    scenes.extend(recorded(Path::new(data)));
    for scene in scenes.into_iter().filter(|s| wanted(&s.name)) {
        scene.report();
    }
    if wanted("set: atoms") {
        atoms();
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
        self::analysed(name, &analysis);
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

fn line(scene: &str, what: &str, value: f64, sigma: f64) {
    println!("{scene} | {what} | {value:.9e} | {sigma:.6e}");
}

/// A number without an error.
fn number(scene: &str, what: &str, value: f64) {
    println!("{scene} | {what} | {value:.9e} |");
}

fn said(scene: &str, caveats: &[Caveat]) {
    for caveat in caveats {
        println!("{scene} | said | {} ({})", caveat.code(), caveat.place);
    }
}

fn analysed(name: &str, analysis: &Analysis) {
    said(name, &analysis.caveats);
    number(name, "sets", analysis.sets.len() as f64);
    for (i, set) in analysis.sets.iter().enumerate() {
        let of = format!("{name}, set {i}");
        if let Some(drift) = &set.drift {
            for axis in 0..2 {
                let sigma = drift.covariance[(axis, axis)].sqrt();
                line(
                    &of,
                    &format!("drift {axis} (nm/min)"),
                    60.0 * drift.velocity[axis],
                    60.0 * sigma,
                );
            }
            if let Some(joint) = &drift.joint {
                println!("{of} | said | phases linked: {}", joint.phases);
                println!(
                    "{of} | said | acceleration: {}",
                    joint.acceleration.is_some()
                );
                println!("{of} | said | settling: {}", joint.settling_s.is_some());
                println!("{of} | said | fast gain: {}", joint.fast_gain.is_some());
                number(&of, "instability (nm)", joint.instability_nm);
            }
        }
        if let Some(mean) = set.mean.as_ref().or(set.uncorrected.as_ref()) {
            println!("{of} | said | corrected: {}", set.mean.is_some());
            of_mean(&of, mean);
        }
        for scan in &set.scans {
            if let Some(twist) = scan.twist_strain {
                let twist = twist.twist().scaled(180.0 / std::f64::consts::PI);
                line(
                    &of,
                    &format!("frame {} twist (°)", scan.file),
                    twist.value,
                    twist.sigma,
                );
            }
        }
    }
    if let Some(all) = &analysis.combined {
        let of = format!("{name}, all");
        println!("{of} | said | joint: {}", all.joint.is_some());
        let total = all.budget.applied_to(&all.twist_strain);
        twist_and_strain(&of, &all.twist_strain, &total);
        read(&of, &all.readings);
    }
}

fn of_mean(name: &str, mean: &SetMean) {
    twist_and_strain(
        name,
        &mean.twist_strain,
        &mean.budget.applied_to(&mean.twist_strain),
    );
    number(name, "enlargement", mean.enlargement);
    read(name, &mean.readings);
}

fn twist_and_strain(
    name: &str,
    found: &heterostrain::strain::TwistStrain,
    total: &heterostrain::strain::TwistStrain,
) {
    let degrees = 180.0 / std::f64::consts::PI;
    let twist = found.twist().scaled(degrees);
    line(name, "twist (°)", twist.value, twist.sigma);
    for i in 0..2 {
        let sigma = found.strain().covariance[(i, i)].sqrt();
        line(
            name,
            &format!("strain {i} (%)"),
            100.0 * found.strain_vector[i],
            100.0 * sigma,
        );
    }
    number(
        name,
        "σ of the twist with calibration (°)",
        total.twist().sigma * degrees,
    );
    println!("{name} | said | axis: {}", found.axis_lab().is_some());
}

fn read(name: &str, readings: &Readings) {
    number(name, "readings", readings.solutions.len() as f64);
    if let Some(naming) = &readings.naming {
        number(name, "names", naming.names.len() as f64);
    }
}

fn masks(name: &str, map: &TwistStrainMap) {
    for mask in Mask::ALL {
        number(
            name,
            &format!("nodes, {}", mask.name()),
            map.count(mask) as f64,
        );
    }
    number(name, "window (nm)", map.window_nm);
}

fn local(name: &str, map: &TwistStrainMap) {
    masks(name, map);
    if let Some(spread) = map.spread(&map.twist) {
        line(
            name,
            "map: mean twist (°)",
            spread.mean.to_degrees(),
            spread.mean_sigma.to_degrees(),
        );
        line(
            name,
            "map: spread of the twist (°)",
            spread.spread.to_degrees(),
            spread.noise.to_degrees(),
        );
    }
    if let Some(trend) = Trends::new(map).and_then(|trends| trends.of(&map.twist)) {
        line(
            name,
            "map: twist in the middle (°)",
            trend.middle.value.to_degrees(),
            trend.middle.sigma.to_degrees(),
        );
    }
}

/// Frames of one sample, 96 × 96 pixels, four of them.
fn simulation(change: impl FnOnce(&mut Simulation)) -> Vec<Scan> {
    let mut simulation = Simulation::default();
    simulation.raster.scans = 4;
    simulation.raster.pixels = [96, 96];
    change(&mut simulation);
    let simulator = Simulator::new(simulation).expect("possible settings");
    (0..simulator.frames())
        .map(|i| simulator.frame(i))
        .collect()
}

/// Whole sets, as an analysis meets them.
fn sets() -> Vec<Scene> {
    let of = |name: &str, change: fn(&mut Simulation)| {
        Scene::new(&format!("set: {name}"), simulation(change))
    };
    let odd = |s: &mut Simulation| {
        s.seed = 12;
        s.raster.start_s = 4000.0;
        s.drift.velocity_nm_per_min = [1.1, 0.5];
    };
    let other = |twist: f64, seed: u64| {
        simulation(|s| {
            (s.sample.twist_deg, s.seed, s.raster.scans) = (twist, seed, 2);
            s.raster.start_s = 300.0 * seed as f64;
        })
    };
    let mut outlier = simulation(|s| s.raster.scans = 5);
    outlier[2] = simulation(odd).swap_remove(0);
    let mut across = simulation(|s| s.raster.line_rate_hz = 4.0);
    across.extend(simulation(|s| {
        s.raster.rotation_deg = 90.0;
        (s.seed, s.raster.start_s) = (2, 600.0);
    }));
    let samples = |twist| [other(1.13, 1), other(twist, 3)].concat();
    vec![
        of("clean", |s| {
            (s.noise.pixel_deg, s.noise.line_deg, s.noise.flicker_deg) = (0.02, 0.0, 0.0);
        })
        .mapped(),
        of("noisy", |s| s.noise.pixel_deg = 4.0),
        of("lines", |s| {
            (s.noise.line_deg, s.noise.flicker_deg) = (1.0, 0.6);
        })
        .mapped(),
        of("few periods", |s| s.raster.nominal_size_nm = [36.0, 36.0]),
        of("many periods", |s| {
            (s.raster.nominal_size_nm, s.raster.pixels) = ([200.0, 200.0], [144, 144]);
            s.raster.scans = 2;
        })
        .mapped(),
        of("walls", |s| s.sample.sharpness = 0.7),
        of("speeding up", |s| {
            s.drift.acceleration_nm_per_min2 = [0.05, -0.03];
            s.raster.scans = 8;
        }),
        of("unsteady", |s| {
            s.drift.acceleration_nm_per_min2 = [0.6, -0.5];
            s.raster.scans = 5;
        }),
        Scene::new("set: both slow axes", across),
        of("graphene on hBN", |s| {
            (s.sample.substrate, s.sample.twist_deg) = (Material::named("hBN"), 0.8);
            s.sample.biaxial_percent = 0.1;
        })
        .with(|s| (s.substrate, s.layers_chosen) = (Material::named("hBN"), true)),
        of("strained", |s| {
            (s.sample.twist_deg, s.sample.strain_percent) = (0.5, 0.55);
            s.raster.nominal_size_nm = [150.0, 150.0];
        }),
        of("without sensors", |s| {
            (s.raster.sensors, s.raster.retrace) = (false, false);
        }),
        of("one frame", |s| s.raster.scans = 1).mapped(),
        of("nothing but noise", |s| {
            (s.sample.contrast_deg, s.raster.scans) = (0.0, 2);
        }),
        Scene::new("set: one odd frame", outlier).with(|s| s.exclude_outliers = true),
        Scene::new("set: two samples, 2 % apart", samples(1.153)),
    ]
}

/// One frame with less and less contrast: where it is found no more.
fn faint() -> Vec<Scene> {
    let one = |(i, contrast): (usize, f64)| {
        let frames = simulation(|s| {
            (s.sample.contrast_deg, s.raster.scans) = (contrast, 1);
            (s.noise.pixel_deg, s.noise.flicker_deg) = (1.0, 0.3);
            s.seed = 100 + i as u64;
        });
        Scene::new(&format!("set: contrast {contrast}"), frames)
    };
    let contrasts = [0.5, 0.35, 0.25, 0.18, 0.12, 0.09, 0.06, 0.04];
    contrasts.into_iter().enumerate().map(one).collect()
}

/// Two moirés in one image, asked for both and for one.
fn two_moires() -> Vec<Scene> {
    let large = |s: &mut Simulation| {
        (s.raster.nominal_size_nm, s.raster.scans) = ([110.0, 110.0], 2);
        s.raster.pixels = [128, 128];
    };
    let mut frames = simulation(large);
    let others = simulation(|s| {
        large(s);
        (s.sample.twist_deg, s.sample.contrast_deg, s.seed) = (1.75, 0.7, 2);
        s.sample.lattice_angle_deg = 22.0;
        (s.noise.pixel_deg, s.noise.line_deg, s.noise.flicker_deg) = (0.0, 0.0, 0.0);
    });
    for (frame, other) in frames.iter_mut().zip(&others) {
        for (channel, added) in frame.channels.iter_mut().zip(&other.channels) {
            if channel.name.contains("Phase") {
                let sum = channel.values().into_iter().zip(added.values());
                let sum: Vec<f64> = sum.map(|(a, b)| a + b).collect();
                (channel.samples, channel.scale, channel.offset) = (Samples::F64(sum), 1.0, 0.0);
            }
        }
    }
    vec![
        Scene::new("set: two moirés, one asked for", frames.clone()),
        Scene::new("set: two moirés", frames).with(|s| s.moires = 2),
    ]
}

/// An image as a file without anything but its size.
fn array(image: Image, pitch: f64) -> Scan {
    let [width, height] = [image.columns, image.rows].map(|n| n as f64 * pitch);
    Scan {
        format: "array".to_owned(),
        size_nm: Some([width, height]),
        channels: vec![Channel {
            name: "Phase".to_owned(),
            internal_name: String::new(),
            unit: "°".to_owned(),
            line_direction: None,
            scan_line: None,
            rows: image.rows,
            columns: image.columns,
            width_nm: Some(width),
            height_nm: Some(height),
            span: Span::PixelEdges,
            scale: 1.0,
            offset: 0.0,
            scaling: String::new(),
            plane_fit: None,
            samples: Samples::F64(image.values),
        }],
        ..Scan::default()
    }
}

/// Lattices that are not the same everywhere; 12.5 nm from spot to spot.
fn fields() -> Vec<Scene> {
    let at = Vector2::new(100.0, 90.0);
    let with = |name: &str, feature: Feature| {
        let mut scene = FieldScene::rippled(192, 12.0, 0.01);
        (scene.white, scene.line, scene.seed) = (0.8, 0.2, 5);
        scene.features.push(feature);
        (name.to_owned(), scene)
    };
    let gradient = |name: &str, share: f64| {
        let mut scene = FieldScene::rippled(192, 12.0, share);
        scene.white = 0.8;
        (name.to_owned(), scene)
    };
    let dislocation = Feature::Dislocation { at, turns: [1, 0] };
    let (normal, width) = (0.4, 30.0);
    let scenes = [
        gradient("gradient of 3 %", 0.03),
        gradient("gradient of 12 %", 0.12),
        with("dislocation", dislocation),
        with("wrinkle", Feature::Wrinkle { at, normal, width }),
        with(
            "grain boundary",
            Feature::Boundary {
                at,
                normal,
                turn: 0.05,
            },
        ),
    ];
    let scene = |(name, scene): (String, FieldScene)| {
        Scene::new(
            &format!("map: {name}"),
            vec![array(scene.image(), 12.5 / 16.0)],
        )
        .mapped()
    };
    scenes.into_iter().map(scene).collect()
}

/// Networks of walls with nodes; 60 nm from node to node.
fn nodes() -> Vec<Scene> {
    let base = || {
        let mut scene = DomainScene::hexagonal([192, 192], 24.0, 0.2);
        (scene.disorder, scene.white, scene.line) = (1.0, 0.15, 0.05);
        scene
    };
    let mut missing = base();
    missing.missing = vec![[0, 0], [2, 1]];
    let mut noisy = base();
    noisy.white = 0.7;
    let mut faint = base();
    (faint.node[0], faint.wall[0]) = (0.5, 0.5);
    let scenes = [
        ("network", base()),
        ("nodes missing", missing),
        ("noisy nodes", noisy),
        ("walls as strong as nodes", faint),
    ];
    let scene = |(name, scene): (&str, DomainScene)| {
        Scene::new(
            &format!("domains: {name}"),
            vec![array(scene.image(), 60.0 / 24.0)],
        )
        .mapped()
    };
    scenes.into_iter().map(scene).collect()
}

/// Images of one wave, of two in different places, and of none.
fn stripes() -> Vec<Scene> {
    let wave = |white: f64, share: f64, seed: u64| {
        let mut scene = FieldScene::rippled(256, 12.0, share);
        scene.harmonics = vec![([1, 0], 1.0)];
        (scene.white, scene.seed) = (white, seed);
        scene
    };
    let at = Vector2::new(128.0, 128.0);
    let mut two = wave(0.7, 0.0, 2);
    two.features.push(Feature::Boundary {
        at,
        normal: 0.3,
        turn: 1.0,
    });
    let mut ends = wave(0.7, 0.02, 3);
    ends.features.push(Feature::Wrinkle {
        at,
        normal: 0.5,
        width: 60.0,
    });
    let mut crossed = wave(0.7, 0.0, 4);
    crossed.harmonics.push(([0, 1], 0.6));
    let mut scenes = vec![
        ("straight".to_owned(), wave(0.7, 0.03, 1)),
        ("two directions".to_owned(), two),
        ("a gap".to_owned(), ends),
        ("crossed".to_owned(), crossed),
        ("noisy".to_owned(), wave(8.0, 0.0, 6)),
        ("hardly there".to_owned(), wave(20.0, 0.0, 7)),
    ];
    for seed in 20..24 {
        let mut nothing = wave(1.0, 0.0, seed);
        (nothing.harmonics[0].1, nothing.line) = (0.0, 0.3);
        scenes.push((format!("none, seed {seed}"), nothing));
    }
    let scene = |(name, scene): (String, FieldScene)| {
        Scene::new(&format!("stripes: {name}"), vec![array(scene.image(), 1.0)])
    };
    scenes.into_iter().map(scene).collect()
}

/// Atoms of known size: orientation of a layer and calibration of the scanner.
fn atoms() {
    let settings = Settings::default();
    let graphene = Material::graphene();
    let known = KnownLattice::of_layer(&graphene);
    let cell = known.cell().expect("a cell");
    for (name, drift, directions) in [
        ("set: atoms", 0.5, true),
        ("set: atoms, one direction", 0.5, false),
    ] {
        let frames = simulation(|s| {
            s.sample.pattern = Pattern::Layer1;
            s.raster.nominal_size_nm = [4.0, 4.0];
            s.drift.velocity_nm_per_min = [drift, -0.3 * drift];
            s.noise.sensor_nm = 0.01;
            s.raster.alternating = directions;
        });
        let measured = frames.iter().enumerate();
        let measured =
            measured.map(|(i, scan)| measure_known(&format!("{i:03}"), scan, &settings, &cell));
        let measured: Vec<MeasuredScan> = measured.filter_map(Result::ok).collect();
        number(name, "frames", measured.len() as f64);
        match atomic_orientation(&measured, &graphene, 1, &settings.calibration) {
            Ok(found) => {
                line(
                    name,
                    "orientation (°)",
                    found.angle.value.to_degrees(),
                    found.angle.sigma.to_degrees(),
                );
                said(name, &found.caveats);
            }
            Err(error) => println!("{name} | said | no orientation: {error}"),
        }
        match calibrate(measured, &known, 0.5 / 60.0, Grouping::Auto) {
            Ok(found) => {
                for (what, e) in ["gain", "mismatch", "right angle"]
                    .iter()
                    .zip(found.calibration.estimates())
                {
                    line(name, what, e.value, e.sigma);
                }
                said(name, &found.caveats);
            }
            Err(error) => println!("{name} | said | no calibration: {error}"),
        }
    }
}

/// The recorded frames, where they are: those of `hard` by their folders, of `sets` both together.
fn recorded(data: &Path) -> Vec<Scene> {
    let mut scenes = Vec::new();
    for folder in entries(&data.join("hard")) {
        // An image of a million pixels without a lattice takes as long as all others.
        let Some(name) = folder.file_name().filter(|name| *name != "bent") else {
            continue;
        };
        let scans = frames(&folder);
        if !scans.is_empty() {
            let scene = Scene::new(&format!("set: recorded, {}", name.to_string_lossy()), scans);
            scenes.push(scene);
        }
    }
    let sets: Vec<Scan> = entries(&data.join("sets"))
        .iter()
        .flat_map(|f| frames(f))
        .collect();
    if !sets.is_empty() {
        scenes.push(Scene::new("set: recorded on both axes", sets));
    }
    scenes
}

/// What a folder holds, by name; nothing where there is none.
fn entries(folder: &Path) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<_> = entries.map(|entry| entry.path()).collect();
    paths.sort();
    paths
}

/// The scans of a folder; those without a size are 200 nm wide.
fn frames(folder: &Path) -> Vec<Scan> {
    let is_one = |file: &std::path::PathBuf| {
        let kind = file.extension().and_then(|e| e.to_str());
        matches!(kind, Some("spm" | "npy"))
    };
    let files = entries(folder).into_iter().filter(is_one);
    let bytes = files.filter_map(|file| std::fs::read(file).ok());
    let mut scans: Vec<Scan> = bytes
        .filter_map(|bytes| spmfile::read(&bytes).ok())
        .collect();
    for scan in &mut scans {
        if scan.size_nm.is_none() {
            scan.size_nm = Some([200.0; 2]);
            for channel in &mut scan.channels {
                (channel.width_nm, channel.height_nm) = (Some(200.0), Some(200.0));
                channel.span = Span::PixelEdges;
            }
        }
    }
    scans
}
