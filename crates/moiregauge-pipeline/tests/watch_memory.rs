//! A long watch does not fill the memory.

mod small;

use moiregauge::settings::Settings;
use moiregauge_pipeline::Job;
use moiregauge_pipeline::watch::{Watch, WatchRequest};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Frames before memory is looked at, and frames until the end.
const FRAMES: [usize; 2] = [6, 18];
/// What is measured of both lines of a frame: lattices, frames and times (4.5 kB), the search for copies (4 kB), what the fits leave around
/// the waves (297 complex numbers in single precision a line, 5 kB), and 2 kB of harmonics, names and hashes: 15.8 kB. Single precision in the search would be
/// 4 kB more, the draws of a frame 64 kB, an image of 64² pixels 33 kB.
const OF_A_FRAME: usize = 17_000;

/// The only test of this program, as the memory of others would be counted as well.
#[test]
fn frames_leave_a_few_numbers_behind() {
    let (source, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let frames = small::scans(source.path(), FRAMES[1]);
    let settings = Settings {
        strain_draws: Settings::default().strain_draws,
        ..small::settings()
    };
    let mut watch = Watch::new(WatchRequest {
        folder: folder.path().to_owned(),
        settings: settings.clone(),
        ..WatchRequest::default()
    })
    .unwrap();
    let job = Job::quiet(Some(2)).unwrap();
    let mut before = 0;
    for (number, frame) in (1..).zip(&frames) {
        std::fs::copy(frame, folder.path().join(frame.file_name().unwrap())).unwrap();
        watch.look(&job).unwrap();
        let lines = watch.look(&job).unwrap();
        assert_eq!(lines.last().unwrap().frames, number);
        if number == FRAMES[0] {
            before = MEMORY.current_usage();
        }
    }
    let more = MEMORY.current_usage().saturating_sub(before) / (FRAMES[1] - FRAMES[0]);
    println!("{more} bytes a frame");
    assert!(more < OF_A_FRAME, "{more} bytes a frame");
    // All of it can be had again.
    let outcomes = watch.outcomes(&job).unwrap();
    let inputs = moiregauge_pipeline::find(&[folder.path().to_owned()])
        .frames()
        .0;
    let fresh = small::campaign(&inputs).with_settings(settings).unwrap();
    let fresh = fresh.clone().analyse(&job).unwrap();
    assert_eq!(small::document(&outcomes), small::document(&fresh));
}
