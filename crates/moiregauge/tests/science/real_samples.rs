//! Simulated samples that are no perfect lattice, against closed forms and against counting.

use heterostrain::lattice::Lattice;
use heterostrain::strain::twist_strain;
use moiregauge::simulate::{SampleFeature, Simulation, Simulator, Truth};
use nalgebra::{Matrix2, Matrix4, Vector2};
use spmfile::{LineDirection, Scan};

use crate::noiseless::noiseless;

/// Noiseless frames of one channel whose window goes where it is told.
fn quiet(sample: &str) -> Simulation {
    let mut set = Simulation {
        features: SampleFeature::parse(sample).unwrap(),
        ..Simulation::default()
    };
    set.raster.pixels = [64, 48];
    set.raster.scans = 2;
    noiseless(&mut set);
    set
}

fn values(scan: &Scan, name: &str, line: LineDirection) -> Vec<f64> {
    let is_it = |c: &&spmfile::Channel| c.name == name && c.line_direction == Some(line);
    scan.channels.iter().find(is_it).expect(name).values()
}

fn truth_of(set: &Simulation) -> Truth {
    Simulator::new(set.clone()).unwrap().truth()
}

/// The places of the sample that the pixels of a frame show: sensors less drift.
fn places(set: &Simulation, truth: &Truth, index: usize) -> Vec<Vector2<f64>> {
    let scan = Simulator::new(set.clone()).unwrap().frame(index);
    let x = values(&scan, "Xsensor", LineDirection::Trace);
    let y = values(&scan, "Ysensor", LineDirection::Trace);
    let frame = &truth.frames[index];
    let [across, up] = frame.trace_time_per_pixel_s;
    let columns = set.raster.pixels[0];
    let drift = Vector2::from(set.drift.velocity_nm_per_min) / 60.0;
    let at = |n: usize| {
        let time =
            frame.trace_first_pixel_s + across * (n % columns) as f64 + up * (n / columns) as f64;
        Vector2::new(x[n], y[n]) - drift * time
    };
    (0..x.len()).map(at).collect()
}

/// The lattice of a frame with nothing to add is the one that is simulated without classes, up to rounding.
#[test]
fn a_sample_without_effect_is_the_plain_lattice() {
    let plain = quiet("clean");
    let mut other = quiet("bump:height=0,keep=1");
    other.sample.irregularity = 0.2;
    let mut same = plain.clone();
    same.sample.irregularity = 0.2;
    for sharpness in [0.0, 0.4] {
        same.sample.sharpness = sharpness;
        other.sample.sharpness = sharpness;
        let frame = |set: &Simulation| Simulator::new(set.clone()).unwrap().frame(1);
        for line in [LineDirection::Trace, LineDirection::Retrace] {
            let pairs = values(&frame(&same), "TR Phase", line);
            for (a, b) in pairs.iter().zip(values(&frame(&other), "TR Phase", line)) {
                assert!((a - b).abs() < 1e-6, "{a} {b}");
            }
        }
    }
}

/// Shares are those of the pixels: half planes, discs, and what they leave together.
#[test]
fn shares_are_counted() {
    for (sample, share) in [
        ("edge:share=0.37,angle=70", 0.37),
        ("fade:share=0.6,angle=200,width=0.1", 0.6),
        ("hole:share=0.2", 0.8),
        ("hole:share=0.12,count=6", 0.88),
        ("island:share=0.3,x=0.05", 0.3),
        ("edge:share=0.5,angle=0+edge:share=0.5,angle=90", 0.25),
        ("bare+hole", 0.0),
    ] {
        let mut set = quiet(sample);
        set.drift.velocity_nm_per_min = [0.0; 2];
        set.window.alternation_nm = [0.0; 2];
        set.window.creep_nm_per_min = [0.0; 2];
        let seen = truth_of(&set).sample.unwrap();
        // Pixels at the rim count whole: a line cuts some 60 of 3072.
        assert!(
            (seen.share_covered - share).abs() < 0.012,
            "{sample}: {}",
            seen.share_covered
        );
        // A tall part without moiré is where the image is tall.
        if sample.starts_with("hole:share=0.2") {
            let image = values(
                &Simulator::new(set).unwrap().frame(0),
                "TR Phase",
                LineDirection::Trace,
            );
            let holes = image.iter().filter(|v| (**v + 2.0).abs() < 1e-6).count();
            assert!((holes as f64 / image.len() as f64 - 0.2).abs() < 0.012);
        }
    }
}

/// One hole under drift: every frame, up or down, trace or retrace, has it at one place of the sample.
#[test]
fn all_frames_see_the_same_sample() {
    let mut set = quiet("hole:share=0.1,height=-9");
    set.raster.pixels = [96, 96];
    set.raster.line_rate_hz = 2.0;
    set.drift.velocity_nm_per_min = [3.0, -2.0];
    let simulator = Simulator::new(set.clone()).unwrap();
    let truth = simulator.truth();
    let centres: Vec<Vector2<f64>> = (0..2)
        .map(|index| {
            let image = values(&simulator.frame(index), "TR Phase", LineDirection::Trace);
            let hole = places(&set, &truth, index);
            let hole = hole
                .iter()
                .zip(&image)
                .filter(|(_, v)| **v < -8.0)
                .map(|p| p.0);
            let all: Vec<&Vector2<f64>> = hole.collect();
            all.iter().copied().sum::<Vector2<f64>>() / all.len() as f64
        })
        .collect();
    // The sample has moved by 4.4 nm between the frames; a pixel is 0.6 nm.
    assert!((centres[0] - centres[1]).norm() < 0.1, "{centres:?}");
}

/// `b_i · a_j = 2π δ_ij`.
fn dual(basis: Matrix2<f64>) -> Matrix2<f64> {
    std::f64::consts::TAU * basis.try_inverse().unwrap().transpose()
}

/// The phases of a bent lattice: what is seen is three cosines of them.
fn image_of(phases: Vector2<f64>) -> f64 {
    phases.x.cos() + phases.y.cos() + (phases.x + phases.y).cos()
}

/// The twist wave in closed form: layer 2 is displaced across the wave, and the local lattice, by finite differences of
/// the phases that the image shows, has the twist and strain that the truth says.
#[test]
fn the_twist_wave_is_its_closed_form() {
    let mut set = quiet("twist-wave:amplitude=0.04,wavelength=90,angle=35,phase=20");
    set.raster.pixels = [40, 40];
    let truth = truth_of(&set);
    let seen = truth.sample.clone().unwrap();
    let sample = &set.sample;
    // Waves of layer 2 and of the moiré, and the middle of what the frames see.
    let [lower, upper] = sample
        .stacking()
        .atoms(sample.bilayer(), sample.strain_convention)
        .unwrap()
        .map(dual);
    let moire = Matrix2::from_columns(&truth.reciprocal_vectors_rad_per_nm.map(Vector2::from));
    assert!((upper - lower - moire).norm() < 1e-9 * upper.norm());
    let places_seen = places(&set, &truth, 0);
    let middle = {
        let of = |index: usize| {
            let all = places(&set, &truth, index);
            all.iter().sum::<Vector2<f64>>() / all.len() as f64
        };
        (of(0) + of(1)) / 2.0
    };
    let (angle, k) = (35f64.to_radians(), std::f64::consts::TAU / 90.0);
    let along = Vector2::new(angle.cos(), angle.sin());
    let over = Vector2::new(-angle.sin(), angle.cos());
    let displaced = |at: Vector2<f64>| {
        let wave = (k * along.dot(&(at - middle)) + 20f64.to_radians()).sin();
        over * wave * 2.0 * 0.04f64.to_radians() / k
    };
    let origin = Vector2::from(sample.origin_nm);
    let phases = |at: Vector2<f64>| moire.tr_mul(&(at - origin)) - upper.tr_mul(&displaced(at));
    let image = values(
        &Simulator::new(set.clone()).unwrap().frame(0),
        "TR Phase",
        LineDirection::Trace,
    );
    for (at, found) in places_seen.iter().zip(&image) {
        // Places are known to 2·10⁻⁵ nm; the middle of a frame to its lines' times.
        assert!((image_of(phases(*at)) - found).abs() < 2e-3, "{at} {found}");
    }
    for place in seen.places.iter().step_by(7) {
        let at = Vector2::from(place.place_nm);
        let slope = |axis: usize| {
            let mut step = Vector2::zeros();
            step[axis] = 1e-3;
            (phases(at + step) - phases(at - step)) / 2e-3
        };
        let waves = Matrix2::from_rows(&[slope(0).transpose(), slope(1).transpose()]);
        let basis = dual(waves);
        let lattice = Lattice::new(basis, Matrix4::zeros());
        let local = twist_strain(&lattice, sample.bilayer(), sample.strain_convention).unwrap();
        assert!((local.twist.to_degrees() - place.twist_deg).abs() < 2e-6);
        let strain = local.strain_vector * 100.0 - Vector2::from(place.strain_lab_percent);
        assert!(strain.norm() < 1e-5, "{strain}");
        // To first order the twist is that of the set and half the curl of the displacement.
        let curl = 0.04 * (k * along.dot(&(at - middle)) + 20f64.to_radians()).cos();
        assert!((place.twist_deg - sample.twist_deg - curl).abs() < 1e-3);
    }
    let mean = seen.mean.unwrap();
    let [low, high] = mean.twist_range_deg;
    assert!(low < mean.twist_deg && mean.twist_deg < high && high - low > 0.02);
}

/// Gradients: the twist of a bent beam changes along and the strain across, as Hooke's law asks.
#[test]
fn gradients_are_what_they_say() {
    for (sample, twist, strain) in [
        (
            "twist-gradient:change=0.06,angle=0",
            [0.06, 0.0],
            [0.0, -0.06f64.to_radians() * 100.0],
        ),
        (
            "strain-gradient:change=0.1,angle=0",
            [0.0, -0.16 * 0.1f64.to_degrees() / 100.0],
            [0.1, 0.0],
        ),
    ] {
        let mut set = quiet(sample);
        set.sample.strain_percent = 0.3;
        set.sample.strain_axis_deg = -set.sample.lattice_angle_deg - set.sample.twist_deg;
        let seen = truth_of(&set).sample.unwrap();
        let side = {
            let frame = &truth_of(&set).frames[0];
            let [[a, b], [c, d]] = frame.pixel_to_nm;
            (63.0 * 47.0 * (a * d - b * c).abs()).sqrt()
        };
        // Least squares over the places: value = constant + slope · place.
        let slope = |value: &dyn Fn(&moiregauge::simulate::PlaceTruth) -> f64| {
            let mut normal = nalgebra::Matrix3::zeros();
            let mut right = nalgebra::Vector3::zeros();
            for place in &seen.places {
                let [x, y] = place.place_nm;
                let basis = nalgebra::Vector3::new(1.0, x, y);
                normal += basis * basis.transpose();
                right += basis * value(place);
            }
            let found = normal.try_inverse().unwrap() * right;
            Vector2::new(found.y, found.z) * side
        };
        let found = slope(&|place| place.twist_deg);
        assert!(
            (found - Vector2::from(twist)).norm() < 2e-3,
            "{sample}: {found}"
        );
        // ε along x adds to the strain that lies along x.
        let found = slope(&|place| place.strain_lab_percent[0]);
        assert!(
            (found - Vector2::from(strain)).norm() < 3e-3,
            "{sample}: {found}"
        );
    }
}

/// Two lattices on either side of a line, with their own twists; the phases of the second are shifted as asked.
#[test]
fn grains_are_two_lattices() {
    let mut set = quiet("grains:share=0.4,angle=0,twist=0.05,turn=3,shift=0");
    set.drift.velocity_nm_per_min = [0.0; 2];
    set.window.alternation_nm = [0.0; 2];
    set.window.creep_nm_per_min = [0.0; 2];
    let truth = truth_of(&set);
    let seen = truth.sample.clone().unwrap();
    assert!((seen.grains[0].share - 0.4).abs() < 0.02 && (seen.grains[1].share - 0.6).abs() < 0.02);
    let twists: Vec<f64> = seen
        .grains
        .iter()
        .map(|g| g.mean.unwrap().twist_deg)
        .collect();
    assert!((twists[0] - 1.13).abs() < 1e-9 && (twists[1] - 1.18).abs() < 1e-9);
    assert!(
        (seen.grains[1].lattice_angle_deg - seen.grains[0].lattice_angle_deg - 3.0).abs() < 1e-9
    );
    assert!((seen.mean.unwrap().twist_deg - (0.4 * 1.13 + 0.6 * 1.18)).abs() < 1e-3);
    // A turn of the layers by 3° turns the moiré by as much; on the left it is the plain one.
    let image = |set: &Simulation| {
        let frame = Simulator::new(set.clone()).unwrap().frame(0);
        values(&frame, "TR Phase", LineDirection::Trace)
    };
    let mut plain = set.clone();
    plain.features.clear();
    let (with, without) = (image(&set), image(&plain));
    let same = with
        .iter()
        .zip(&without)
        .filter(|(a, b)| (*a - *b).abs() < 1e-6);
    let share = same.count() as f64 / with.len() as f64;
    assert!((share - 0.4).abs() < 0.03, "{share}");
    let mut shifted = set.clone();
    shifted.features =
        SampleFeature::parse("grains:share=0.4,angle=0,twist=0,turn=0,shift=1").unwrap();
    // A whole period along the first wave and half of one along the second.
    let truth = truth_of(&shifted).sample.unwrap();
    assert_eq!(
        truth.grains[0].lattice_vectors_nm,
        truth.grains[1].lattice_vectors_nm
    );
    assert_ne!(image(&shifted), image(&plain));
}

/// Walls are the same lattice: what is at R is at R + L, too; the nodes are the brightest places.
#[test]
fn walls_are_periodic() {
    let mut set = quiet("walls:width=0.8");
    set.raster.pixels = [512, 4];
    set.raster.retrace = false;
    set.drift.velocity_nm_per_min = [0.0; 2];
    let truth = truth_of(&set);
    // One line along the first lattice vector, from spot to spot.
    let first = Vector2::from(truth.lattice_vectors_nm[0]);
    set.raster.rotation_deg = first.y.atan2(first.x).to_degrees();
    set.window = moiregauge::simulate::Window {
        gain: [1.0; 2],
        shear_mrad: 0.0,
        creep_nm_per_min: [0.0; 2],
        alternation_nm: [0.0; 2],
        centre_nm: (Vector2::from(set.sample.origin_nm) + first).into(),
    };
    set.raster.nominal_size_nm = [2.0 * first.norm(), 1e-6];
    let frame = Simulator::new(set).unwrap().frame(0);
    let line = &values(&frame, "TR Phase", LineDirection::Trace)[..512];
    // Along a wall: its height everywhere, at the nodes two more.
    assert!(
        (line[0] - 3.0).abs() < 1e-4 && (line[511] - 3.0).abs() < 1e-4,
        "{}",
        line[0]
    );
    assert!(line.iter().all(|v| *v > 0.999));
    for n in 0..255 {
        assert!((line[n] - line[511 - n]).abs() < 1e-5);
    }
}

/// Sensors that lag are behind by V T in the middle of a line; glitches are as many and as large as asked.
#[test]
fn sensors_lag_and_glitch_as_asked() {
    let mut set = quiet("lag:time=2");
    set.raster.pixels = [201, 40];
    let shown = |set: &Simulation, line| {
        values(
            &Simulator::new(set.clone()).unwrap().frame(0),
            "Xsensor",
            line,
        )
    };
    let mut plain = set.clone();
    plain.features.clear();
    for (line, sign) in [(LineDirection::Trace, 1.0), (LineDirection::Retrace, -1.0)] {
        let (late, right) = (shown(&set, line), shown(&plain, line));
        let row = 20 * 201;
        let width = right[row + 200] - right[row];
        let speed = width * 2.0 * 8.0 * 1.05;
        let behind = right[row + 100] - late[row + 100];
        assert!(
            (behind - sign * speed * 0.002).abs() < 2e-3 * speed * 0.002,
            "{behind}"
        );
        // Just after the turn-around it was ahead: run-up 5 % of a half line, half of it before the frame.
        let start = if sign > 0.0 { 0 } else { 200 };
        let run_up = 0.0625 * 0.05 / 2.1;
        let expected = 1.0 - 2.0 * (-run_up / 0.002f64).exp();
        let found = (right[row + start] - late[row + start]) / (sign * speed * 0.002);
        assert!((found - expected).abs() < 5e-3, "{found} {expected}");
    }
    let mut wild = quiet("glitches:share=0.03,size=500");
    wild.raster.pixels = [128, 128];
    let mut calm = wild.clone();
    calm.features.clear();
    let (wild, calm) = (
        shown(&wild, LineDirection::Trace),
        shown(&calm, LineDirection::Trace),
    );
    let off: Vec<f64> = wild
        .iter()
        .zip(&calm)
        .map(|(a, b)| a - b)
        .filter(|d| d.abs() > 1.0)
        .collect();
    assert!(off.iter().all(|d| (d.abs() - 500.0).abs() < 1e-3));
    // 16,384 samples: 492 ± 22.
    assert!((380..600).contains(&off.len()), "{}", off.len());
    let up = off.iter().filter(|d| **d > 0.0).count();
    assert!((180..320).contains(&up));
}

/// Ground has the height it is given, and moves with the sample.
#[test]
fn ground_has_its_height() {
    let mut set = quiet("bare+terrain:rms=2,exponent=2");
    set.raster.pixels = [96, 96];
    set.raster.scans = 12;
    let mut squares = 0.0;
    for seed in 1..=12 {
        set.sample.seed = seed;
        let image = values(
            &Simulator::new(set.clone()).unwrap().frame(0),
            "TR Phase",
            LineDirection::Trace,
        );
        squares += image.iter().map(|v| v * v).sum::<f64>() / image.len() as f64 / 12.0;
    }
    // Long waves: each image has its own height; twelve of them scatter by some tens of per cent.
    assert!((1.2..2.8).contains(&squares.sqrt()), "{squares}");
}
