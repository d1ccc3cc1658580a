//! Scans that were analysed → maps: where frames of a drifting sample are put, and what cannot be mapped.

use moiregauge::campaign::Analysis;
use moiregauge::campaign::analyse;
use moiregauge::frame::Geometry;
use moiregauge::scan::{MeasuredScan, measure_scan};
use moiregauge::settings::Settings;
use moiregauge::simulate::{Simulation, Simulator};
use moiregauge::survey::{MapError, MapMethod, SurveyError, SurveyPlan, map_scan};
use moiregauge::window::{Resolution, ResolutionError};
use nalgebra::Vector2;
use spmfile::Scan;

/// Settings without draws.
fn quick() -> Settings {
    Settings {
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    }
}

fn analysed(frames: &[Scan]) -> Analysis {
    let settings = quick();
    let measured: Vec<MeasuredScan> = frames
        .iter()
        .enumerate()
        .map(|(i, scan)| measure_scan(&format!("scan.{i:03}"), scan, &settings, None).unwrap())
        .collect();
    analyse(measured, &settings)
}

/// 128 × 128 pixels at 2 lines a second: frames of a minute.
fn slow_frames(scans: usize) -> Simulation {
    let mut simulation = Simulation::default();
    simulation.raster.pixels = [128, 128];
    simulation.raster.line_rate_hz = 2.0;
    simulation.raster.scans = scans;
    simulation
}

/// A drift that speeds up takes the later frames farther than its velocity times the time, by more than a lattice vector:
/// they are put where the sample is, to a small part of one.
#[test]
fn frames_land_where_a_changing_drift_took_them() {
    let mut simulation = slow_frames(20);
    simulation.drift.acceleration_nm_per_min2 = [0.04, -0.03];
    let (velocity, acceleration) = (
        Vector2::from(simulation.drift.velocity_nm_per_min) / 60.0,
        Vector2::from(simulation.drift.acceleration_nm_per_min2) / 3600.0,
    );
    let simulator = Simulator::new(simulation).unwrap();
    let frames: Vec<Scan> = (0..20).map(|i| simulator.frame(i)).collect();
    let analysis = analysed(&frames);
    let scans = &analysis.sets[0].scans;
    let truth = simulator.truth();
    let period = truth.wavelengths_nm[0];
    let middle = |i: usize| f64::midpoint(truth.frames[i].start_s, truth.frames[i].end_s);
    let place = |t: f64| (velocity + 0.5 * acceleration * t) * t;
    let first = scans[0].motion.unwrap().middle;
    let (mut steady, mut farthest) = (0.0_f64, 0.0_f64);
    for (i, scan) in scans.iter().enumerate() {
        let motion = scan.motion.unwrap();
        let expected = place(middle(i)) - place(middle(0));
        let found = motion.path.between(first, motion.middle);
        farthest = farthest.max((found - expected).norm());
        let at_its_velocity = scan.drift.unwrap() * (motion.middle - first);
        steady = steady.max((at_its_velocity - expected).norm());
    }
    assert!(farthest < 0.05 * period, "{farthest} of {period}");
    assert!(steady > 0.5 * period, "{steady} of {period}");
    // That is where its map goes.
    let (method, resolution) = (MapMethod::Demodulation, Resolution::default());
    let map = |origin| {
        let settings = quick();
        map_scan(
            &frames[19],
            &scans[19],
            origin,
            &settings,
            method,
            &resolution,
        )
        .unwrap()
    };
    let moved = map(None)[0].map.grid.origin - map(Some(first))[0].map.grid.origin;
    let expected = place(middle(19)) - place(middle(0));
    assert!(
        (moved - expected).norm() < 0.05 * period,
        "{moved} {expected}"
    );
}

/// Windows wider than the image and steps beyond it are refused with both numbers; those that just fit are not.
#[test]
fn windows_have_to_fit_into_the_image() {
    let simulator = Simulator::new(slow_frames(2)).unwrap();
    let frames: Vec<Scan> = (0..2).map(|i| simulator.frame(i)).collect();
    let analysis = analysed(&frames);
    let scan = &analysis.sets[0].scans[0];
    let map = |method, window_nm, step_nm| {
        let resolution = Resolution {
            window_nm,
            step_nm,
            margin: None,
        };
        map_scan(&frames[0], scan, None, &quick(), method, &resolution)
    };
    for window in [
        40.0,
        5000.0,
        4_294_967_296.0,
        1e18,
        1e308,
        -1.0,
        0.0,
        f64::NAN,
    ] {
        let found = map(MapMethod::Demodulation, Some(window), None);
        let Err(MapError::Resolution(ResolutionError::Window { side_nm, .. })) = found else {
            panic!("{window}: {found:?}");
        };
        assert!((50.0..60.0).contains(&side_nm));
    }
    for step in [100.0, 1e18, f64::INFINITY, -1.0, 0.0] {
        let found = map(MapMethod::Demodulation, None, Some(step));
        assert!(
            matches!(
                found,
                Err(MapError::Resolution(ResolutionError::Step { .. }))
            ),
            "{step}: {found:?}"
        );
    }
    assert!(map(MapMethod::Tiles, Some(1e18), None).is_err());
    assert!(map(MapMethod::Demodulation, Some(22.0), Some(50.0)).is_ok());
}

/// The same for images that are mapped in bands, before a line of them is read.
#[test]
fn windows_have_to_fit_into_a_survey() {
    let geometry = Geometry::of_pitch([4096, 4096], [0.5; 2], 0.0, Vector2::zeros()).unwrap();
    let settings = quick();
    for (window_nm, step_nm) in [(Some(1e18), None), (None, Some(1e18)), (Some(900.0), None)] {
        let resolution = Resolution {
            window_nm,
            step_nm,
            margin: None,
        };
        let read = |_: [std::ops::Range<usize>; 2]| Err("nothing is read".to_owned());
        let plan = SurveyPlan::new(&geometry, None, &settings, &resolution, None, &read);
        assert!(matches!(plan, Err(SurveyError::Resolution(_))));
    }
}
