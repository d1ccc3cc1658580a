//! Frames that are simulated and recorded.

use std::path::Path;

use heterostrain::material::Material;
use moiregauge::calibration::KnownLattice;
use moiregauge::campaign::atomic_orientation;
use moiregauge::campaign::calibrate;
use moiregauge::frame::Image;
use moiregauge::scan::{MeasuredScan, measure_known};
use moiregauge::settings::{Grouping, Settings};
use moiregauge::simulate::{
    DomainScene, Feature, FieldScene, Pattern, SampleFeature, Simulation, Simulator, vary,
};
use nalgebra::Vector2;
use spmfile::{Channel, Samples, Scan, Span};

use crate::Scene;
use crate::lines::{line, number, said};

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
pub(crate) fn sets() -> Vec<Scene> {
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

/// Samples that are covered in part, change, have grains, bumps, stripes, a weak first shell, or no moiré: with the seed of each.
pub(crate) fn samples(wanted: impl Fn(&str) -> bool) -> Vec<Scene> {
    let classes = [
        ("edge", 1, 160),
        ("hole:count=8", 2, 160),
        ("island", 3, 160),
        ("grains", 4, 160),
        ("grains", 5, 160),
        ("twist-wave", 6, 160),
        ("second-shell", 13, 160),
        ("bump", 1, 160),
        ("bump", 4, 160),
        ("hole:count=8", 78, 160),
        ("clean+stripes", 1, 160),
        ("clean+stripes", 4, 160),
        ("clean+stripes:amplitude=5", 2, 160),
        ("clean+stripes:amplitude=5", 4, 160),
        ("second-shell", 2, 160),
        ("second-shell:first=0.02", 1, 160),
        ("second-shell:first=0.02", 3, 160),
        ("step", 1, 160),
        ("step", 4, 160),
        ("bare+terrain", 1, 160),
        ("bare+terrain", 2, 160),
        ("bare+terrain", 3, 160),
        // A line that knows nothing of its first shell, and a wave of one along the slow axis; stripes that pass for waves of a coarse lattice; a
        // grain that is two lattices, and one that a single line shows.
        ("second-shell", 33, 192),
        ("second-shell", 242, 192),
        ("stripes", 45, 192),
        ("grains", 55, 192),
        ("grains", 42, 192),
    ];
    // They take longer to make than all others together.
    let one = |(class, seed, side): (&str, u64, usize)| {
        let name = format!("sample: {class} {seed}");
        let frames = || {
            simulation(|s| {
                s.raster.pixels = [side, side];
                s.features = SampleFeature::parse(class).expect("a class");
                vary(s, seed);
            })
        };
        wanted(&name).then(|| Scene::new(&name, frames()))
    };
    classes.into_iter().filter_map(one).collect()
}

/// One frame with less and less contrast: where it is found no more.
pub(crate) fn faint() -> Vec<Scene> {
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
pub(crate) fn two_moires() -> Vec<Scene> {
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
pub(crate) fn fields() -> Vec<Scene> {
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
pub(crate) fn nodes() -> Vec<Scene> {
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
pub(crate) fn stripes() -> Vec<Scene> {
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
pub(crate) fn atoms() {
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
pub(crate) fn recorded(data: &Path) -> Vec<Scene> {
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
