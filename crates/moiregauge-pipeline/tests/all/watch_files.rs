//! Files of a folder that is watched: they come in pieces, anew, damaged, or do not concern it.

use moiregauge_pipeline::watch::{Happened, Line, Watch};

use crate::scene::{Scene, codes, names};
use crate::small::document;

#[test]
fn what_is_half_written_waits() {
    let mut scene = Scene::new(3);
    scene.arrive(0);
    scene.arrive(1);
    assert_eq!(scene.settle().len(), 1);
    // In pieces, with pauses that are longer than a step.
    let bytes = scene.bytes(2);
    for end in [0, 100, bytes.len() / 2, bytes.len() - 1] {
        scene.write("scan.002.spm", &bytes[..end]);
        assert!(scene.look().is_empty() && scene.look().is_empty(), "{end}");
    }
    scene.write("scan.002.spm", &bytes);
    let lines = scene.settle();
    assert_eq!(
        (lines.len(), lines[0].frames, lines[0].error.as_ref()),
        (1, 3, None)
    );
    scene.is_as_analysed();
    // Truncated and written again, with other results between: the frame is away until it is whole.
    scene.write("scan.002.spm", b"");
    assert!(scene.look().is_empty());
    let first = scene.bytes(0);
    scene.write("copy.spm", &first);
    let lines: Vec<Line> = (0..2).flat_map(|_| scene.look()).collect();
    assert_eq!((lines.len(), lines[0].frames), (1, 2));
    assert_eq!(codes(&lines[0]), ["not-whole-yet"]);
    scene.write("scan.002.spm", &bytes);
    let lines = scene.settle();
    assert_eq!(
        (lines.len(), lines[0].frames, lines[0].event),
        (1, 3, Happened::New)
    );
    scene.is_as_analysed();
}

#[test]
fn a_file_written_anew_is_another_frame_and_a_deleted_one_none() {
    let mut scene = Scene::new(5);
    (0..4).for_each(|frame| scene.arrive(frame));
    scene.settle();
    let kept = scene.watch.kept().len();
    // As long as before: the date tells.
    let other = scene.bytes(4);
    assert_eq!(other.len(), scene.bytes(3).len());
    scene.write("scan.003.spm", &other);
    let lines = scene.settle();
    assert_eq!(
        (lines.len(), lines[0].event, lines[0].frames),
        (1, Happened::Again, 4)
    );
    scene.is_as_analysed();
    // Nothing else was measured again.
    assert_eq!(scene.watch.kept().len(), kept + 1);
    std::fs::remove_file(scene.folder.path().join("scan.003.spm")).unwrap();
    let lines = scene.settle();
    assert_eq!(
        (lines.len(), lines[0].event, lines[0].frames),
        (1, Happened::Gone, 3)
    );
    scene.is_as_analysed();
    // It comes back and is known.
    scene.write("scan.003.spm", &other);
    assert_eq!(scene.settle()[0].frames, 4);
    assert_eq!(scene.watch.kept().len(), kept + 1);
    // A scan that becomes a note is gone, too.
    let bytes = scene.bytes(3);
    scene.write("frame", &bytes);
    assert_eq!(scene.settle()[0].frames, 5);
    scene.write("frame", b"dear diary");
    let lines = scene.settle();
    assert_eq!(
        (lines.len(), lines[0].event, lines[0].frames),
        (1, Happened::Gone, 4)
    );
    scene.is_as_analysed();
}

#[test]
fn what_is_no_scan_is_left_alone_and_what_is_bad_is_told_once() {
    let mut scene = Scene::new(3);
    scene.write("bad.spm", b"x");
    let damaged = scene.bytes(2)[..5000].to_vec();
    scene.write("cut.spm", &damaged);
    scene.write("notes.txt", b"dear diary");
    scene.write("scan.png", b"\x89PNG\r\n\x1a\n");
    let lines: Vec<Line> = (0..8).flat_map(|_| scene.look()).collect();
    assert_eq!(lines.len(), 2, "{lines:?}");
    for line in &lines {
        assert_eq!(
            (line.event, line.frames, line.set.as_ref()),
            (Happened::Unreadable, 0, None)
        );
        assert!(line.error.is_some() && line.twist_deg.value.is_none());
    }
    assert_eq!(names(&lines[0]), ["bad.spm"]);
    scene.arrive(0);
    scene.arrive(1);
    let lines = scene.settle();
    assert_eq!(
        (lines.len(), lines[0].frames, lines[0].failed.len()),
        (1, 2, 2)
    );
    scene.is_as_analysed();
    // Now it is a scan after all.
    let bytes = scene.bytes(2);
    scene.write("bad.spm", &bytes);
    let lines = scene.settle();
    assert_eq!(
        (lines.len(), lines[0].frames, lines[0].failed.len()),
        (1, 3, 1)
    );
    scene.is_as_analysed();
}

/// A file that is a scan and shows no lattice gives no number, and takes none away.
#[test]
fn frames_without_a_lattice_say_why() {
    let mut scene = Scene::new(2);
    scene.arrive(0);
    scene.arrive(1);
    scene.settle();
    // A flat image, read and refused.
    let mut flat = b"Gwyddion Simple Field 1.0\nXRes = 64\nYRes = 64\nXReal = 7e-08\nYReal = 7e-08\nTitle = TR Phase\n".to_vec();
    // At least one zero byte, up to a multiple of four.
    flat.resize((flat.len() / 4 + 1) * 4, 0);
    flat.resize(flat.len() + 4 * 64 * 64, 0);
    scene.write("flat.gsf", &flat);
    let lines = scene.settle();
    let line = lines
        .iter()
        .find(|line| names(line) == ["flat.gsf"])
        .unwrap();
    assert!(
        line.error.is_some() && line.frames == 2 && line.twist_deg.value.is_some(),
        "{line:?}"
    );
}

/// Results in a subfolder, and what the watch kept, do not concern it.
#[test]
fn own_results_are_left_alone_and_a_new_watch_goes_on() {
    let mut scene = Scene::new(4);
    (0..3).for_each(|frame| scene.arrive(frame));
    scene.settle();
    let results = scene.folder.path().join("results");
    std::fs::create_dir(&results).unwrap();
    std::fs::copy(&scene.frames[3], results.join("aligned.spm")).unwrap();
    assert!(scene.settle().is_empty());
    let kept = serde_json::to_string(scene.watch.kept()).unwrap();
    let before = document(&scene.watch.outcomes(&scene.job).unwrap());
    let mut again = Watch::new(scene.watch.request().clone()).unwrap();
    again.take(serde_json::from_str(&kept).unwrap());
    let count = again.kept().len();
    scene.watch = again;
    let lines = scene.settle();
    assert_eq!(
        (lines.len(), lines[0].event, lines[0].frames),
        (1, Happened::Start, 3)
    );
    assert_eq!(document(&scene.watch.outcomes(&scene.job).unwrap()), before);
    assert_eq!(scene.watch.kept().len(), count);
    assert!(!serde_json::to_string(&lines).unwrap().contains("aligned"));
}
