//! The table of classes of samples: all of it can be simulated, drawn, written and read.

use moiregauge::simulate::{CLASSES, SampleFeature, Simulation, Simulator, TRIED, vary};
use spmfile::LineDirection;

/// A few small frames without noise.
fn quiet(sample: &str) -> Simulation {
    let mut set = Simulation {
        features: SampleFeature::parse(sample).unwrap(),
        ..Simulation::default()
    };
    set.raster.pixels = [24, 20];
    set.raster.scans = 2;
    set.noise.pixel_deg = 0.0;
    set.noise.line_deg = 0.0;
    set.noise.flicker_deg = 0.0;
    set.noise.plane_deg = [0.0; 2];
    set
}

/// Every class makes frames and a truth, with usual and with drawn numbers; all numbers have a usual value that is allowed.
#[test]
fn every_class_can_be_simulated() {
    let classes = CLASSES.iter().map(|class| class.name);
    for (sample, seed) in classes.chain(TRIED).zip(1..) {
        let mut set = quiet(sample);
        if seed % 2 == 0 {
            vary(&mut set, seed);
        }
        let simulator = Simulator::new(set).unwrap();
        let frame = simulator.frame(1);
        let seen = |c: &&spmfile::Channel| {
            c.name == "TR Phase" && c.line_direction == Some(LineDirection::Retrace)
        };
        let image = frame.channels.iter().find(seen).expect("an image").values();
        let spread = image.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        assert!(
            spread.is_finite() && (sample == "bare" || spread > 0.1),
            "{sample}: {spread}"
        );
        let truth = simulator.truth();
        let Some(seen) = &truth.sample else {
            assert_eq!(sample, "clean");
            continue;
        };
        assert_eq!(seen.mean.is_none(), sample.starts_with("bare"), "{sample}");
    }
    for class in &CLASSES {
        for key in class.keys {
            let [least, most] = key.allowed;
            assert!(
                (least..=most).contains(&key.usual),
                "{} {}",
                class.name,
                key.name
            );
            let [low, high] = key.drawn;
            assert!(
                least <= low && low <= high && high <= most,
                "{} {}",
                class.name,
                key.name
            );
        }
    }
}

#[test]
fn what_is_not_known_is_named() {
    for (text, word) in [
        ("edges", "one of clean, edge, fade, hole"),
        ("edge:shar=0.4", "one of share, angle, height"),
        ("edge:share=1.4", "0.02 to 0.98"),
        ("edge:share", "numbers like share=0.4"),
        ("bare:share=1", "no numbers"),
    ] {
        let error = SampleFeature::parse(text).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn same_seed_same_bytes_with_everything_on() {
    let mut set = Simulation {
        features: SampleFeature::parse(
            "grains+hole:count=5+twist-wave+bump+step+terrain+hum+scars+glitches+lag+walls+atoms",
        )
        .unwrap(),
        ..Simulation::default()
    };
    set.raster.pixels = [33, 50];
    vary(&mut set, 5);
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let simulator = Simulator::new(set.clone()).unwrap();
        pool.install(|| spmfile::nanoscope::write(&simulator.frame(2)).unwrap())
    };
    assert_eq!(bytes(1), bytes(3));
    // What is given is kept, and changes nothing else that is drawn.
    let mut given = set.clone();
    given.features = SampleFeature::parse("edge:share=0.6").unwrap();
    let mut free = given.clone();
    free.features = SampleFeature::parse("edge").unwrap();
    vary(&mut given, 9);
    vary(&mut free, 9);
    assert_eq!(given.features[0].values["share"], 0.6);
    assert_eq!(
        given.features[0].values["angle"],
        free.features[0].values["angle"]
    );
    assert_ne!(free.features[0].values["share"], 0.6);
}

/// A settings file says the classes as tables; without any, nothing is written of them.
#[test]
fn classes_go_through_a_settings_file() {
    let set = quiet("edge:share=0.6+lag");
    let text = serde_json::to_string(&set).unwrap();
    assert!(
        text.contains("\"features\":[{\"class\":\"edge\",\"share\":0.6}"),
        "{text}"
    );
    assert_eq!(serde_json::from_str::<Simulation>(&text).unwrap(), set);
    let plain = serde_json::to_string(&Simulation::default()).unwrap();
    assert!(!plain.contains("features"));
}
