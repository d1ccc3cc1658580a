//! The simulator against its definition, pixel by pixel, and against its own record of the truth.

use std::f64::consts::PI;

use moiregauge::simulate::{FirstDirection, SampleFeature, SimulateError, Simulation, Simulator};
use nalgebra::{Matrix2, Matrix3, Rotation2, Vector2, Vector3};
use spmfile::{Channel, FrameDirection, LineDirection, Scan};

use crate::noiseless::noiseless;

/// Small, noiseless, everything else as far from symmetric as it gets.
fn quiet() -> Simulation {
    let mut settings = Simulation::default();
    settings.raster.pixels = [24, 17];
    settings.raster.scans = 4;
    settings.raster.nominal_size_nm = [70.0, 43.0];
    settings.raster.start_s = 37.0;
    settings.drift.velocity_nm_per_min = [1.3, -4.7];
    settings.drift.acceleration_nm_per_min2 = [0.31, 0.17];
    settings.window.shear_mrad = 11.0;
    noiseless(&mut settings);
    settings
}

fn channel<'a>(scan: &'a Scan, name: &str, line: LineDirection) -> &'a Channel {
    let is_it = |c: &&Channel| c.name == name && c.line_direction == Some(line);
    scan.channels.iter().find(is_it).expect(name)
}

/// Position and time of a pixel, in the words of the instrument and none of the simulator's.
fn position_and_time(
    settings: &Simulation,
    frame: usize,
    [column, row]: [usize; 2],
    line: LineDirection,
) -> (Vector2<f64>, f64, FrameDirection) {
    let raster = &settings.raster;
    let [columns, rows] = raster.pixels;
    let up = (raster.first_direction == FirstDirection::Up) == (frame.is_multiple_of(2));
    let period = 1.0 / raster.line_rate_hz;
    let frame_time = rows as f64 * period;
    let start = raster.start_s + frame as f64 * (frame_time + raster.gap_s);
    // Lines in the order of acquisition; within the half line the tip covers the overscan too.
    let lines_before = if up { row } else { rows - 1 - row };
    let across = column as f64 / (columns - 1) as f64;
    let travelled = match line {
        LineDirection::Trace => across,
        LineDirection::Retrace => 1.0 - across,
    };
    let share = (raster.rounding / 2.0 + travelled) / (1.0 + raster.rounding);
    let late = if line == LineDirection::Trace {
        0.0
    } else {
        0.5
    };
    let time = start + (lines_before as f64 + late + share / 2.0) * period;

    let nominal = Vector2::new(
        (across - 0.5) * raster.nominal_size_nm[0],
        (row as f64 / (rows - 1) as f64 - 0.5) * raster.nominal_size_nm[1],
    );
    let wanted = Rotation2::new(raster.rotation_deg.to_radians()) * nominal;
    let window = &settings.window;
    let lean = window.shear_mrad / 1000.0;
    let along_y = wanted.y * window.gain[1];
    let reached = Vector2::new(
        wanted.x * window.gain[0] + along_y * lean.sin(),
        along_y * lean.cos(),
    );
    let minutes = (start + frame_time / 2.0) / 60.0;
    let side = if up { 0.5 } else { -0.5 };
    let centre = Vector2::from(window.centre_nm)
        + Vector2::from(window.creep_nm_per_min) * minutes
        + Vector2::from(window.alternation_nm) * side;
    let direction = if up {
        FrameDirection::Up
    } else {
        FrameDirection::Down
    };
    (centre + reached, time, direction)
}

/// r = R + d(t): the pixel at r shows the feature at R, three cosines about the origin.
#[test]
fn every_pixel_shows_what_was_there_at_its_time() {
    for rotation in [0.0, 90.0, -33.0] {
        for first in [FirstDirection::Up, FirstDirection::Down] {
            let mut settings = quiet();
            settings.raster.rotation_deg = rotation;
            settings.raster.first_direction = first;
            let simulator = Simulator::new(settings.clone()).unwrap();
            let truth = simulator.truth();
            let [g1, g2] = truth.reciprocal_vectors_rad_per_nm.map(Vector2::from);
            let origin = Vector2::from(settings.sample.origin_nm);
            for frame in [0, 3] {
                let scan = simulator.frame(frame);
                for line in [LineDirection::Trace, LineDirection::Retrace] {
                    let phase = channel(&scan, "TR Phase", line).values();
                    let x = channel(&scan, "Xsensor", line).values();
                    let y = channel(&scan, "Ysensor", line).values();
                    for (index, found) in phase.iter().enumerate() {
                        let pixel = [index % 24, index / 24];
                        let (r, time, direction) = position_and_time(&settings, frame, pixel, line);
                        assert_eq!(scan.frame_direction, Some(direction));
                        let minutes = time / 60.0;
                        let drift = Vector2::new(1.3, -4.7) * minutes
                            + Vector2::new(0.31, 0.17) * (minutes * minutes / 2.0);
                        let feature = r - drift - origin;
                        let expected: f64 = [g1, g2, g1 + g2]
                            .iter()
                            .map(|g| settings.sample.contrast_deg * g.dot(&feature).cos())
                            .sum();
                        // A count is 8e-8° of phase and 2e-5 nm of position.
                        assert!(
                            (found - expected).abs() < 1e-7,
                            "{pixel:?}: {found} {expected}"
                        );
                        assert!((x[index] - r.x).abs() < 2e-5 && (y[index] - r.y).abs() < 2e-5);
                    }
                }
            }
        }
    }
}

/// A scanner that bows, creeps and swings shows the sample where it is, and its sensors say the share of it that they record.
#[test]
fn scanners_show_the_sample_where_they_are() {
    let mut settings = quiet();
    settings.raster.rotation_deg = -33.0;
    settings.drift.velocity_nm_per_min = [0.0; 2];
    settings.drift.acceleration_nm_per_min2 = [0.0; 2];
    let classes = "hysteresis:fast=2,slow=-1,skew=0.4,recorded=0.5+creep:fast=0.7,slow=1.1,begin=2+ringing:size=0.4,frequency=90,time=6";
    settings.features = SampleFeature::parse(classes).unwrap();
    let simulator = Simulator::new(settings.clone()).unwrap();
    let [g1, g2] = simulator
        .truth()
        .reciprocal_vectors_rad_per_nm
        .map(Vector2::from);
    let origin = Vector2::from(settings.sample.origin_nm);
    let raster = &settings.raster;
    let frame_time = raster.pixels[1] as f64 / raster.line_rate_hz;
    for frame in [0, 3] {
        let scan = simulator.frame(frame);
        let start = raster.start_s + frame as f64 * (frame_time + raster.gap_s);
        for (line, way) in [(LineDirection::Trace, 1.0), (LineDirection::Retrace, -1.0)] {
            let of = |name| channel(&scan, name, line).values();
            let [phase, x, y] = ["TR Phase", "Xsensor", "Ysensor"].map(of);
            let at = |pixel| position_and_time(&settings, frame, pixel, line);
            let corner = at([0, 0]).0;
            let [along, across] = [at([23, 0]).0 - corner, at([0, 16]).0 - corner];
            for (index, found) in phase.iter().enumerate() {
                let pixel = [index % 24, index / 24];
                let (r, time, direction) = at(pixel);
                let up = if direction == FrameDirection::Up {
                    1.0
                } else {
                    -1.0
                };
                let [u, v] = [(0, 23.0), (1, 16.0)].map(|(i, n)| 2.0 * pixel[i] as f64 / n - 1.0);
                let bow = |w: f64| (1.0 - w * w) * (1.0 + 0.4 * w);
                let bowed = along * (way * 0.01 * bow(u)) - across * (up * 0.005 * bow(v));
                let crept = (along * 0.007 + across * 0.011) * (1.0 + (time - start) / 2.0).log10();
                // The time since the tip turned: the way so far, and the overscan before it.
                let rho = raster.rounding;
                let since = (f64::midpoint(1.0, way * u) + rho / 2.0)
                    / (1.0 + rho)
                    / 2.0
                    / raster.line_rate_hz;
                let swing = (-since / 0.006).exp() * (2.0 * PI * 90.0 * since).cos();
                let swung = along * (way * 0.004 * swing);
                let feature = r + bowed + crept + swung - origin;
                let waves = [g1, g2, g1 + g2];
                let expected: f64 = waves
                    .iter()
                    .map(|g| settings.sample.contrast_deg * g.dot(&feature).cos())
                    .sum();
                assert!(
                    (found - expected).abs() < 1e-7,
                    "{pixel:?}: {found} {expected}"
                );
                let told = r + bowed * 0.5 + crept + swung;
                assert!((x[index] - told.x).abs() < 2e-5 && (y[index] - told.y).abs() < 2e-5);
            }
        }
    }
}

/// The reference matrices of the drift: fast y, slow x, 54.7 nm × 56.8 nm, 8 Hz, 512 pixels,
/// `V_fast = 2 L_y f`, `V_slow = L_x f / N`, D = (0.48, −0.14) nm/min; computed by another program.
#[test]
fn times_reproduce_the_reference_drift_matrices() {
    let mut settings = Simulation::default();
    settings.raster.rotation_deg = 90.0;
    settings.raster.rounding = 0.0;
    settings.raster.nominal_size_nm = [56.8, 54.7 * 511.0 / 512.0];
    settings.window.gain = [1.0, 1.0];
    settings.window.shear_mrad = 0.0;
    let truth = Simulator::new(settings).unwrap().truth();
    let drift = Vector2::new(0.48, -0.14) / 60.0;
    // Rows climb towards −x: it is the frame from the top that moves along +x.
    let expected = [
        (
            "down",
            [
                1.009_448_561_91,
                8.885_97e-6,
                -0.002_755_830_56,
                0.999_997_408_26,
            ],
        ),
        (
            "up",
            [
                0.990_726_677_21,
                8.721_16e-6,
                0.002_704_719_15,
                0.999_997_456_33,
            ],
        ),
    ];
    for (direction, [a, b, c, d]) in expected {
        let frame = truth
            .frames
            .iter()
            .find(|f| f.frame_direction == direction)
            .unwrap();
        let [[j11, j12], [j21, j22]] = frame.pixel_to_nm;
        let j = Matrix2::new(j11, j12, j21, j22);
        let step = Vector2::from(frame.trace_time_per_pixel_s);
        let u = j.transpose().try_inverse().unwrap() * step;
        let t = Matrix2::identity() + drift * u.transpose() / (1.0 - u.dot(&drift));
        let difference = t - Matrix2::new(a, b, c, d);
        assert!(difference.norm() < 2e-11, "{direction} {t}");
    }
}

/// Least squares over all pixels of the noisy sensors against the truth. The error of a slope is
/// σ / √(pixels · variance of the index); five of those.
#[test]
fn sensor_planes_are_the_true_ones() {
    let mut settings = quiet();
    settings.raster.pixels = [64, 48];
    settings.raster.rotation_deg = 90.0;
    settings.noise.sensor_nm = 0.2;
    let simulator = Simulator::new(settings).unwrap();
    let truth = simulator.truth();
    for index in 0..2 {
        let scan = simulator.frame(index);
        let frame = &truth.frames[index];
        for (name, axis) in [("Xsensor", 0), ("Ysensor", 1)] {
            let values = channel(&scan, name, LineDirection::Retrace).values();
            let mut normal = Matrix3::zeros();
            let mut right = Vector3::zeros();
            for (index, value) in values.iter().enumerate() {
                let basis = Vector3::new(1.0, (index % 64) as f64, (index / 64) as f64);
                normal += basis * basis.transpose();
                right += basis * *value;
            }
            let inverse = normal.try_inverse().unwrap();
            let plane = inverse * right;
            let expected = [
                frame.origin_nm[axis],
                frame.pixel_to_nm[axis][0],
                frame.pixel_to_nm[axis][1],
            ];
            for k in 0..3 {
                let sigma = 0.2 * inverse[(k, k)].sqrt();
                assert!((plane[k] - expected[k]).abs() < 5.0 * sigma, "{name} {k}");
            }
            let residuals = values.iter().enumerate().map(|(index, value)| {
                value - plane[0] - plane[1] * (index % 64) as f64 - plane[2] * (index / 64) as f64
            });
            let scatter = (residuals.map(|r| r * r).sum::<f64>() / values.len() as f64).sqrt();
            // A standard deviation from 3,072 values scatters by 1.3 %.
            assert!((scatter / 0.2 - 1.0).abs() < 0.06, "{scatter}");
        }
        // Slow x: the long steps of the slow axis run along x, against it.
        assert!(frame.pixel_to_nm[0][1] < -0.5 && frame.pixel_to_nm[1][0] > 0.5);
    }
}

/// The centre of the frames creeps, and frames up lie apart from frames down.
#[test]
fn window_moves_as_set() {
    let settings = Simulation {
        raster: moiregauge::simulate::Raster {
            scans: 3,
            ..quiet().raster
        },
        ..quiet()
    };
    let truth = Simulator::new(settings.clone()).unwrap().truth();
    let centre = |k: usize| Vector2::from(truth.frames[k].window_centre_nm);
    let minutes = (truth.frames[1].start_s - truth.frames[0].start_s) / 60.0;
    let creep = Vector2::new(0.08, 0.12) * minutes;
    assert!((centre(2) - centre(0) - 2.0 * creep).norm() < 1e-12);
    assert!((centre(0) - centre(1) + creep - Vector2::new(0.4, 0.3)).norm() < 1e-12);
    let duration = truth.frames[0].end_s - truth.frames[0].start_s;
    assert!((duration - 17.0 / 8.0).abs() < 1e-12);
    assert!((truth.frames[1].start_s - truth.frames[0].end_s - 1.0).abs() < 1e-12);
}

/// Each kind of noise alone has the spread it was given.
#[test]
fn noise_has_its_size() {
    let mut blank = quiet();
    blank.sample.contrast_deg = 0.0;
    blank.raster.pixels = [128, 256];
    let pixels = |settings: &Simulation| {
        let scan = Simulator::new(settings.clone()).unwrap().frame(0);
        channel(&scan, "TR Phase", LineDirection::Trace).values()
    };
    let spread = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        (square / values.len() as f64).sqrt()
    };
    let mut white = blank.clone();
    white.noise.pixel_deg = 0.5;
    // 32,768 values: 0.4 % scatter.
    assert!((spread(&pixels(&white)) / 0.5 - 1.0).abs() < 0.02);

    let mut lines = blank.clone();
    lines.noise.line_deg = 0.15;
    let values = pixels(&lines);
    let by_line: Vec<f64> = values.chunks(128).map(|line| line[0]).collect();
    assert!(
        values
            .chunks(128)
            .all(|line| line.iter().all(|v| *v == line[0]))
    );
    // 256 values: 4.4 % scatter.
    assert!((spread(&by_line) / 0.15 - 1.0).abs() < 0.2);

    // 1/f: every octave of frequencies holds as much power; ten octaves of lines, many frames.
    let mut flicker = blank;
    flicker.noise.flicker_deg = 0.15;
    flicker.raster.scans = 60;
    flicker.raster.pixels = [2, 256];
    let simulator = Simulator::new(flicker).unwrap();
    let mut octaves = [0.0; 2];
    for frame in 0..60 {
        let values = channel(&simulator.frame(frame), "TR Phase", LineDirection::Trace).values();
        let line: Vec<f64> = values.chunks(2).map(|line| line[0]).collect();
        for (power, range) in octaves.iter_mut().zip([4..8, 16..32]) {
            for k in range {
                let (mut re, mut im) = (0.0, 0.0);
                for (n, v) in line.iter().enumerate() {
                    let angle = 2.0 * PI * f64::from(k) * n as f64 / 256.0;
                    re += v * angle.cos();
                    im += v * angle.sin();
                }
                *power += re * re + im * im;
            }
        }
    }
    let ratio = octaves[0] / octaves[1];
    // White noise would give 1/4, a random walk 4.
    assert!((0.6..1.7).contains(&ratio), "{ratio}");
}

#[test]
fn background_is_a_plane_across_the_frame() {
    let mut settings = quiet();
    settings.sample.contrast_deg = 0.0;
    settings.noise.plane_deg = [2.0, -1.0];
    let scan = Simulator::new(settings).unwrap().frame(1);
    let values = channel(&scan, "TR Phase", LineDirection::Trace).values();
    let corner = |column: usize, row: usize| values[row * 24 + column];
    for (found, expected) in [
        (corner(23, 0) - corner(0, 0), 2.0),
        (corner(0, 16) - corner(0, 0), -1.0),
        (corner(23, 16) + corner(0, 0), 0.0),
    ] {
        assert!((found - expected).abs() < 3e-7, "{found} {expected}");
    }
}

/// A sharper sample is the same lattice with brighter, narrower spots: Gaussians of width w on
/// every lattice point have harmonics e^{−|G|²w²/2}.
#[test]
fn sharp_spots_are_gaussians() {
    let mut settings = quiet();
    settings.sample.strain_percent = 0.0;
    settings.drift = moiregauge::simulate::Drift::default();
    settings.sample.sharpness = 0.3;
    let simulator = Simulator::new(settings.clone()).unwrap();
    let truth = simulator.truth();
    let scan = simulator.frame(0);
    let phase = channel(&scan, "TR Phase", LineDirection::Trace).values();
    let x = channel(&scan, "Xsensor", LineDirection::Trace).values();
    let y = channel(&scan, "Ysensor", LineDirection::Trace).values();
    let [g, _] = truth.reciprocal_vectors_rad_per_nm.map(Vector2::from);
    let width_square = -2.0 * 0.3_f64.ln() / g.norm_squared();
    let [a1, a2, _] = truth.lattice_vectors_nm.map(Vector2::from);
    let cell = Matrix2::from_columns(&[a1, a2]);
    let origin = Vector2::from(settings.sample.origin_nm);
    // Sum over harmonics ↔ sum over spots (Poisson): the constant term is left out of the image.
    let density = cell.determinant() / (2.0 * PI * width_square);
    for index in 0..phase.len() {
        let r = Vector2::new(x[index], y[index]) - origin;
        let near = cell.try_inverse().unwrap() * r;
        let mut spots = 0.0;
        for h in -6..=6 {
            for k in -6..=6 {
                let centre = cell
                    * Vector2::new(near.x.round() + f64::from(h), near.y.round() + f64::from(k));
                spots += (-(r - centre).norm_squared() / (2.0 * width_square)).exp();
            }
        }
        let expected = settings.sample.contrast_deg * (spots * density - 1.0) / (2.0 * 0.3);
        // Harmonics with |h|² = 12 and more are cut off: 6 · 0.3¹¹ · contrast.
        assert!(
            (phase[index] - expected).abs() < 2e-5,
            "{} {expected}",
            phase[index]
        );
    }
}

/// The file that is written is read back as what was simulated.
#[test]
fn frames_survive_the_file_format() {
    let mut settings = quiet();
    settings.raster.rotation_deg = 90.0;
    settings.noise.sensor_nm = 0.2;
    settings.noise.pixel_deg = 0.5;
    let scan = Simulator::new(settings).unwrap().frame(1);
    let bytes = spmfile::nanoscope::write(&scan).unwrap();
    let read = spmfile::read(&bytes).unwrap();
    assert_eq!(read.acquired, scan.acquired);
    assert_eq!(read.frame_direction, Some(FrameDirection::Down));
    assert_eq!(read.line_rate_hz, Some(8.0));
    assert!((read.rotation_rad - PI / 2.0).abs() < 1e-4);
    assert_eq!(read.channels.len(), 8);
    for (found, made) in read.channels.iter().zip(&scan.channels) {
        assert_eq!(
            (&found.name, found.line_direction),
            (&made.name, made.line_direction)
        );
        for (a, b) in found.values().iter().zip(made.values()) {
            assert!(
                (a - b).abs() <= 1e-9 * b.abs().max(1.0),
                "{}: {a} {b}",
                made.name
            );
        }
    }
    for line in [LineDirection::Trace, LineDirection::Retrace] {
        assert!(spmfile::position_sensors(&read, line).is_ok());
    }
}

#[test]
fn same_seed_same_bytes_on_any_number_of_threads() {
    let settings = Simulation {
        raster: moiregauge::simulate::Raster {
            pixels: [33, 50],
            ..quiet().raster
        },
        ..Simulation::default()
    };
    let bytes = |settings: &Simulation, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let simulator = Simulator::new(settings.clone()).unwrap();
        pool.install(|| spmfile::nanoscope::write(&simulator.frame(2)).unwrap())
    };
    assert_eq!(bytes(&settings, 1), bytes(&settings, 3));
    let other = Simulation {
        seed: 2,
        ..settings.clone()
    };
    assert_ne!(bytes(&settings, 1), bytes(&other, 1));
}

#[test]
fn channels_can_be_left_out() {
    let mut settings = quiet();
    settings.raster.sensors = false;
    settings.raster.retrace = false;
    let scan = Simulator::new(settings).unwrap().frame(0);
    let names: Vec<&str> = scan.channels.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["TR Phase", "TR Amplitude"]);
}

#[test]
fn impossible_settings_are_named() {
    let refuse = |change: fn(&mut Simulation)| {
        let mut settings = Simulation::default();
        change(&mut settings);
        Simulator::new(settings).expect_err("a refusal")
    };
    let named = |error: &SimulateError| match error {
        SimulateError::Setting { setting, .. } => *setting,
        _ => "",
    };
    assert_eq!(
        named(&refuse(|s| s.raster.pixels = [512, 1])),
        "raster.pixels"
    );
    assert_eq!(
        named(&refuse(|s| s.raster.line_rate_hz = 0.0)),
        "raster.line_rate_hz"
    );
    assert_eq!(
        named(&refuse(|s| s.noise.pixel_deg = f64::NAN)),
        "noise.pixel_deg"
    );
    assert_eq!(
        named(&refuse(|s| s.sample.sharpness = 1.0)),
        "sample.sharpness"
    );
    let flat = refuse(|s| (s.sample.twist_deg, s.sample.strain_percent) = (0.0, 0.0));
    assert!(matches!(flat, SimulateError::NoMoire(_)), "{flat}");
}

/// The truth file is complete: it can be read back, and its settings simulate the same again.
#[test]
fn truth_can_be_read_back() {
    let simulator = Simulator::new(quiet()).unwrap();
    let truth = simulator.truth();
    let text = serde_json::to_string(&truth).unwrap();
    let read: moiregauge::simulate::Truth = serde_json::from_str(&text).unwrap();
    assert_eq!(read.settings, quiet());
    assert_eq!(read.frames.len(), 4);
    assert!(serde_json::from_str::<Simulation>(r#"{"twist_deg": 1.1}"#).is_err());
    let partial: Simulation = serde_json::from_str(r#"{"sample": {"twist_deg": 1.3}}"#).unwrap();
    assert_eq!(partial.sample.twist_deg, 1.3);
    assert_eq!(
        partial.sample.strain_percent,
        Simulation::default().sample.strain_percent
    );
}
