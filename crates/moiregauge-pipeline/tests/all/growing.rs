//! A campaign that grows, is written, read again, cancelled, on any number of threads.

use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use moiregauge::settings::{ByHand, Settings};
use moiregauge_pipeline::campaign::{AnalyseError, Campaign};
use moiregauge_pipeline::{Cancel, Event, Events, Job, Quiet};

use crate::schema::problems;
use crate::small::{campaign, document, scans, settings};

/// Counts the files that were measured, or cancels at one of them.
struct Watch {
    seen: Mutex<usize>,
    cancel: Option<(usize, Cancel)>,
}

impl Events for Watch {
    fn tell(&self, event: &Event<'_>) {
        if *event == Event::Step {
            let mut seen = self.seen.lock().unwrap();
            *seen += 1;
            if let Some((_, cancel)) = self.cancel.as_ref().filter(|(at, _)| at == &*seen) {
                cancel.cancel();
            }
        }
    }
}

#[test]
fn what_is_measured_is_written_and_read_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let scans = scans(folder.path(), 4);
    let job = Job::quiet(Some(2)).unwrap();
    let mut first = campaign(&scans);
    let alone = document(&first.analyse(&job).unwrap());
    let written = serde_json::to_string(&first).unwrap();
    let mut read: Campaign = serde_json::from_str(&written).unwrap();
    assert_eq!(serde_json::to_string(&read).unwrap(), written);
    assert_eq!(read.kept().len(), 4);
    assert_eq!(document(&read.analyse(&job).unwrap()), alone);
    // Another number of threads in the same process.
    let mut other = campaign(&scans);
    assert_eq!(
        document(&other.analyse(&Job::quiet(Some(1)).unwrap()).unwrap()),
        alone
    );
    let wrong = written.replace("moiregauge/measured/1", "moiregauge/measured/0");
    assert!(serde_json::from_str::<Campaign>(&wrong).is_err());
    let wrong = written.replace("\"frame_time_sigma_s\":0.6", "\"frame_time_sigma_s\":-1.0");
    assert!(wrong != written && serde_json::from_str::<Campaign>(&wrong).is_err());
}

/// What is kept is as its schema says, also where nothing was found and where nothing is known.
#[test]
fn what_is_kept_fits_its_schema() {
    let folder = tempfile::tempdir().unwrap();
    let mut scans = scans(folder.path(), 2);
    let blank = folder.path().join("blank.npy");
    let mut array = b"\x93NUMPY\x01\0\x76\0".to_vec();
    let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (64, 64), }";
    array.extend(format!("{header:<117}\n").bytes());
    array.extend((0..64 * 64).map(|n: u32| (n.wrapping_mul(2_654_435_761) >> 24) as u8));
    std::fs::write(&blank, array).unwrap();
    scans.push(blank);
    let schema = include_str!("../../../moiregauge-report/schema/measured-1.schema.json");
    let schema = serde_json::from_str(schema).unwrap();
    for method in [moiregauge::Method::Lattice, moiregauge::Method::Paper] {
        let settings = Settings {
            method,
            ..settings()
        };
        let mut campaign = campaign(&scans).with_settings(settings).unwrap();
        campaign.analyse(&Job::quiet(None).unwrap()).unwrap();
        let kept = serde_json::to_value(campaign.kept()).unwrap();
        assert_eq!(problems(&schema, &kept), Vec::<String>::new());
        let text = kept.to_string();
        assert!(text.contains("\"moires\"") && text.contains("\"failed\""));
    }
}

/// Scans come and go, settings change: the results are those of a new campaign, and nothing is measured twice.
#[test]
fn a_growing_campaign_is_a_new_one() {
    let folder = tempfile::tempdir().unwrap();
    let scans = scans(folder.path(), 5);
    let job = Job::quiet(None).unwrap();
    let fresh = |scans: &[PathBuf], settings: &Settings| {
        let fresh = campaign(scans).with_settings(settings.clone());
        document(&fresh.unwrap().analyse(&job).unwrap())
    };
    let mut growing = campaign(&scans[..4]);
    assert_eq!(
        document(&growing.analyse(&job).unwrap()),
        fresh(&scans[..4], &settings())
    );
    growing.add([scans[4].clone()]);
    assert_eq!(
        document(&growing.analyse(&job).unwrap()),
        fresh(&scans, &settings())
    );
    assert_eq!(growing.kept().len(), 5);
    assert!(growing.remove(&scans[0]) && !growing.remove(&scans[0]));
    assert_eq!(
        document(&growing.analyse(&job).unwrap()),
        fresh(&scans[1..], &settings())
    );
    let other = Settings {
        seed: 7,
        frame_time_sigma_s: 0.1,
        ..settings()
    };
    let mut growing = growing.with_settings(other.clone()).unwrap();
    assert_eq!(
        document(&growing.analyse(&job).unwrap()),
        fresh(&scans[1..], &other)
    );
    assert_eq!(growing.kept().len(), 5);
    // What changes the measurement is measured.
    let method = Settings {
        method: moiregauge::Method::Fourier,
        ..settings()
    };
    let mut growing = growing.with_settings(method.clone()).unwrap();
    assert_eq!(
        document(&growing.analyse(&job).unwrap()),
        fresh(&scans[1..], &method)
    );
    assert_eq!(growing.kept().len(), 9);
    // So is what was told by hand: where the lattice is.
    let left = vec![
        [-500.0, -500.0],
        [40.0, -500.0],
        [40.0, 500.0],
        [-500.0, 500.0],
    ];
    let region = Settings {
        by_hand: ByHand {
            regions_nm: vec![left],
            ..ByHand::default()
        },
        ..method.clone()
    };
    let mut told = growing.clone().with_settings(region.clone()).unwrap();
    assert_eq!(
        document(&told.analyse(&job).unwrap()),
        fresh(&scans[1..], &region)
    );
    assert_eq!(told.kept().len(), 13);
    // A file that was replaced is another one.
    std::fs::copy(&scans[2], &scans[1]).unwrap();
    assert_eq!(
        document(&growing.analyse(&job).unwrap()),
        fresh(&scans[1..], &method)
    );
    let nonsense = Settings {
        frame_time_sigma_s: f64::NAN,
        ..settings()
    };
    let error = growing.with_settings(nonsense).unwrap_err();
    assert_eq!(error.setting, "frame_time_sigma_s");
}

/// Cancelled at every scan: what was measured is not measured again, and the results are the same.
#[test]
fn a_cancelled_campaign_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let scans = scans(folder.path(), 5);
    let alone = document(
        &campaign(&scans)
            .analyse(&Job::quiet(None).unwrap())
            .unwrap(),
    );
    for at in 1..=5 {
        let cancel = Cancel::new();
        let watch = Watch {
            seen: Mutex::new(0),
            cancel: Some((at, cancel.clone())),
        };
        let job = Job::new(Some(1), cancel, &watch).unwrap();
        let mut stopped = campaign(&scans);
        let error = stopped.analyse(&job).unwrap_err();
        assert!(matches!(error, AnalyseError::Cancelled(_)), "{error}");
        assert_eq!(stopped.kept().len(), at);
        let job = Job::quiet(Some(1)).unwrap();
        assert_eq!(document(&stopped.analyse(&job).unwrap()), alone);
    }
}

/// A cancel after any time ends the work soon.
#[test]
fn a_cancel_is_noticed_soon() {
    let folder = tempfile::tempdir().unwrap();
    let scans = scans(folder.path(), 6);
    for milliseconds in [0, 3, 10, 30, 100] {
        let cancel = Cancel::new();
        let job = Job::new(Some(2), cancel.clone(), &Quiet).unwrap();
        let noticed = std::thread::scope(|scope| {
            let mut campaign = campaign(&scans);
            let running = scope.spawn(move || (campaign.analyse(&job).is_ok(), Instant::now()));
            std::thread::sleep(Duration::from_millis(milliseconds));
            let asked = Instant::now();
            cancel.cancel();
            let (whole, ended) = running.join().unwrap();
            (!whole).then(|| ended.saturating_duration_since(asked))
        });
        // Ten times what is promised: the processors may be busy.
        assert!(
            noticed.is_none_or(|time| time < Duration::from_secs(3)),
            "{noticed:?}"
        );
    }
}

/// One scan more for a hundred that are measured.
#[test]
fn a_hundred_measured_scans_are_analysed_again_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let scans = scans(folder.path(), 101);
    let job = Job::quiet(None).unwrap();
    let mut growing = campaign(&scans[..100]);
    let started = Instant::now();
    growing.analyse(&job).unwrap();
    let first = started.elapsed();
    growing.add([scans[100].clone()]);
    let watch = Instant::now();
    growing.analyse(&job).unwrap();
    let again = watch.elapsed();
    println!("100 scans: {first:?}; one more: {again:?}");
    assert_eq!(growing.kept().len(), 101);
    // 0.5 s on one processor for a release; tests are compiled for debugging, and the processors may be busy.
    assert!(
        again < first.max(Duration::from_secs(5)),
        "{again:?} after {first:?}"
    );
}
