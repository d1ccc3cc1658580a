//! A folder that fills: the numbers at every moment, what is foreseen, what is told.

use moiregauge::simulate::{Simulation, Simulator};
use moiregauge_pipeline::Job;
use moiregauge_pipeline::watch::{Happened, Line, Until, WatchRequest, line_schema};
use moiregauge_report::Results;

use crate::scene::{Scene, codes, names};
use crate::schema::problems;

/// A watch draws nothing at random for its lines, and an analysis of the folder has the same numbers with all draws.
#[test]
fn lines_tell_the_numbers_of_an_analysis_with_draws() {
    let mut scene = Scene::with(8, |mut request| {
        request.settings.drift_draws = 200;
        request.settings.strain_draws = 100;
        request
    });
    (0..8).for_each(|frame| scene.arrive(frame));
    let lines = scene.settle();
    let outcomes = scene.watch.outcomes(&scene.job).unwrap();
    let all = Results::new(&outcomes[0].analysis, &outcomes[0].provenance);
    let set = &all.sets[0];
    let (mean, drift) = (set.mean.as_ref().unwrap(), set.drift.as_ref().unwrap());
    assert!(drift.monte_carlo.is_some() && set.scans[0].monte_carlo.is_some());
    assert!(!outcomes[0].analysis.sets[0].scans[0].draws.is_empty());
    let line = lines.last().unwrap();
    let pairs = [
        (line.twist_deg, mean.twist_strain.twist_deg),
        (
            line.heterostrain_percent,
            mean.twist_strain.heterostrain_percent,
        ),
        (line.drift.x_nm_per_min, drift.x_nm_per_min),
        (line.drift.y_nm_per_min, drift.y_nm_per_min),
    ];
    for (told, found) in pairs {
        assert!(told.sigma.is_some());
        assert_eq!(told, found.into());
    }
}

#[test]
fn frames_in_any_order_come_to_the_numbers_of_an_analysis() {
    let mut scene = Scene::new(6);
    scene.arrive(4);
    let lines = scene.settle();
    let [start] = lines.as_slice() else {
        panic!("one line: {lines:?}");
    };
    // One frame tells no drift.
    assert_eq!(
        (start.event, start.frames, names(start)),
        (Happened::Start, 1, vec!["scan.004.spm"])
    );
    assert_eq!(
        (start.twist_deg.value, start.heterostrain_percent.sigma),
        (None, None)
    );
    assert!(start.uncorrected.is_some());
    assert!(start.caveats.iter().any(|c| c.code == "drift-undetermined"));
    assert!(start.advice.contains("no drift yet"), "{}", start.advice);
    let json = serde_json::to_value(start).unwrap();
    assert!(
        json["twist_deg"]["value"].is_null() && json["drift"]["x_nm_per_min"]["value"].is_null()
    );
    scene.arrive(1);
    let lines = scene.settle();
    assert_eq!(
        (lines.len(), lines[0].frames, lines[0].event),
        (1, 2, Happened::New)
    );
    assert!(lines[0].twist_deg.sigma_total.unwrap() > lines[0].twist_deg.sigma.unwrap());
    // Several at once are one result, in order of time.
    for frame in [5, 0, 3] {
        scene.arrive(frame);
    }
    let lines = scene.settle();
    assert_eq!((lines.len(), lines[0].frames), (1, 5));
    assert_eq!(
        names(&lines[0]),
        ["scan.000.spm", "scan.003.spm", "scan.005.spm"]
    );
    assert_eq!(lines[0].file.as_ref(), lines[0].files.last());
    // Frame 2 is missing still: 1 and 3 went the same way, but the last two did not.
    assert!(codes(&lines[0]).is_empty(), "{:?}", lines[0].warnings);
    scene.arrive(2);
    let lines = scene.settle();
    assert_eq!((lines.len(), lines[0].frames, lines[0].sets), (1, 6, 1));
    scene.is_as_analysed();
    assert!(scene.settle().is_empty());
    assert_eq!(scene.watch.history().len(), 4);
    let next = lines[0].next.unwrap();
    assert!(next.twist_sigma_deg.unwrap() < lines[0].twist_deg.sigma.unwrap());
    assert!(next.twist_sigma_total_deg.unwrap() <= lines[0].twist_deg.sigma_total.unwrap());
}

/// What two more frames would bring is what they bring.
#[test]
fn the_outlook_comes_true() {
    let mut scene = Scene::new(6);
    let mut lines = Vec::new();
    for frame in 0..6 {
        scene.arrive(frame);
        lines.extend(scene.settle());
    }
    for frames in [2, 4] {
        let foreseen = lines[frames - 1].next.unwrap().twist_sigma_deg.unwrap();
        let found = lines[frames + 1].twist_deg.sigma.unwrap();
        assert!(
            (foreseen / found - 1.0).abs() < 0.3,
            "{frames}: {foreseen} {found}"
        );
    }
}

/// The line is of the set that got the frame, and says what changed.
#[test]
fn a_change_of_the_way_of_scanning_is_told() {
    let mut scene = Scene::new(3);
    (0..3).for_each(|frame| scene.arrive(frame));
    scene.settle();
    let mut other = Simulation::default();
    other.raster.pixels = [96; 2];
    other.raster.scans = 4;
    other.raster.start_s = 600.0;
    other.raster.alternating = false;
    other.raster.nominal_size_nm = other.raster.nominal_size_nm.map(|s| 1.3 * s);
    let simulator = Simulator::new(other).unwrap();
    let made = |index: usize| spmfile::nanoscope::write(&simulator.frame(index)).unwrap();
    scene.write("big.000.spm", &made(0));
    let lines = scene.settle();
    assert_eq!(
        (lines.len(), lines[0].sets, lines[0].frames),
        (1, 2, 1),
        "{lines:?}"
    );
    let found = codes(&lines[0]);
    assert!(
        found.contains(&"size-changed") && found.contains(&"pixels-changed"),
        "{found:?}"
    );
    assert!(lines[0].twist_deg.value.is_none());
    scene.write("big.001.spm", &made(1));
    let lines = scene.settle();
    assert_eq!(codes(&lines[0]), ["directions-do-not-alternate"]);
    assert_eq!(lines[0].frames, 2);
    // Two sets that get frames at once make a line each.
    scene.write("big.002.spm", &made(2));
    let first = scene.bytes(1);
    scene.write("scan.009.spm", &first);
    std::fs::remove_file(scene.folder.path().join("scan.001.spm")).unwrap();
    let lines = scene.settle();
    assert!(
        lines
            .iter()
            .any(|l| l.frames == 3 && names(l) == ["big.002.spm"]),
        "{lines:?}"
    );
    scene.is_as_analysed();
}

#[test]
fn a_wish_is_reached_or_out_of_reach() {
    let wish = |twist| {
        move |request| WatchRequest {
            until: Until {
                twist_deg: Some(twist),
                strain_percent: None,
            },
            ..request
        }
    };
    let mut scene = Scene::with(2, wish(0.02));
    scene.arrive(0);
    let until = scene.settle()[0].until.unwrap();
    assert!(!until.reached && !scene.watch.is_reached());
    assert_eq!(until.frames_needed, Some(2));
    scene.arrive(1);
    let line = scene.settle().remove(0);
    assert!(line.until.unwrap().reached && scene.watch.is_reached());
    assert!(line.twist_deg.sigma_total.unwrap() <= 0.02 && line.advice.contains("stop now"));
    let mut scene = Scene::with(2, wish(1e-5));
    scene.arrive(0);
    scene.arrive(1);
    let line = scene.settle().remove(0);
    let until = line.until.unwrap();
    assert!(!until.reached && until.out_of_reach && until.frames_needed.is_none());
    assert!(!scene.watch.is_reached() && line.advice.contains("out of reach"));
}

/// A step that is stopped tells nothing, and the next one all of it.
#[test]
fn a_stopped_step_loses_nothing() {
    let mut scene = Scene::new(3);
    scene.arrive(0);
    scene.arrive(1);
    scene.settle();
    scene.arrive(2);
    scene.look();
    let stopped = Job::quiet(Some(1)).unwrap();
    stopped.cancel().cancel();
    assert!(scene.watch.look(&stopped).is_err());
    let lines = scene.settle();
    assert_eq!(
        (lines.len(), lines[0].frames, lines[0].event),
        (1, 3, Happened::New)
    );
    assert!(scene.source.path().is_dir());
}

/// The published schema is that of the lines, and lines with numbers, without any, and about the folder follow it.
#[test]
fn lines_follow_the_published_schema() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../moiregauge-report/schema/watch-1.schema.json"
    );
    let published: serde_json::Value =
        serde_json::from_slice(&std::fs::read(path).unwrap_or_default()).unwrap_or_default();
    assert_eq!(
        published,
        line_schema(),
        "renew it: cargo run -p moiregauge-pipeline --example schema watch > \
         crates/moiregauge-report/schema/watch-1.schema.json"
    );
    let mut scene = Scene::with(4, |request| WatchRequest {
        until: "twist=0.001".parse::<Until>().unwrap(),
        ..request
    });
    scene.write("bad.spm", b"\\*File list\r\n");
    (0..4).for_each(|frame| scene.arrive(frame));
    let mut lines: Vec<Line> = (0..6).flat_map(|_| scene.look()).collect();
    let away = scene.source.path().join("away");
    std::fs::rename(scene.folder.path(), &away).unwrap();
    let lost = scene.look();
    std::fs::rename(&away, scene.folder.path()).unwrap();
    let last = lines.iter().rev().find(|line| line.set.is_some()).unwrap();
    assert_eq!(
        (lost[0].event, lost[0].twist_deg, &lost[0].file),
        (Happened::Folder, last.twist_deg, &None)
    );
    lines.extend(lost);
    assert!(lines.iter().any(|line| line.event == Happened::Unreadable));
    for line in &lines {
        let line = serde_json::to_value(line).unwrap();
        let wrong = problems(&published, &line);
        assert!(wrong.is_empty(), "{wrong:?} in {line}");
    }
}
