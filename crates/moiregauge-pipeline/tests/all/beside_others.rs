//! Jobs beside each other and beside pools of others in one process; files on the disk beside uploads.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use moiregauge_pipeline::{Cancel, Job, Places, Quiet};
use rayon::prelude::*;

use crate::small::{campaign, document, scans};

/// Jobs of one, two and three threads at once, while a pool of somebody else is busy; one of them is stopped.
#[test]
fn jobs_do_not_disturb_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let scans = scans(folder.path(), 4);
    let alone = campaign(&scans).analyse(&Job::quiet(Some(1)).unwrap());
    let alone = document(&alone.unwrap());
    let host = rayon::ThreadPoolBuilder::new()
        .num_threads(2)
        .build()
        .unwrap();
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let busy = scope.spawn(|| {
            let mut sum = 0u64;
            while !over.load(Ordering::Relaxed) {
                sum = host.install(|| (0..1000u64).into_par_iter().sum());
            }
            sum
        });
        let stopped = scope.spawn(|| {
            let cancel = Cancel::new();
            cancel.cancel();
            let job = Job::new(Some(2), cancel, &Quiet).unwrap();
            campaign(&scans).analyse(&job).is_err()
        });
        let work = |threads| {
            let scans = &scans;
            scope.spawn(move || {
                let job = Job::quiet(Some(threads)).unwrap();
                document(&campaign(scans).analyse(&job).unwrap())
            })
        };
        let all = [1, 2, 3].map(work);
        for one in all {
            assert_eq!(one.join().unwrap(), alone);
        }
        assert!(stopped.join().unwrap());
        over.store(true, Ordering::Relaxed);
        assert_eq!(busy.join().unwrap(), 499_500);
    });
    assert_eq!(host.current_num_threads(), 2);
}

/// Inside a pool of the host, too: the job takes its own threads.
#[test]
fn a_job_runs_inside_a_pool_of_the_host() {
    let folder = tempfile::tempdir().unwrap();
    let scans = scans(folder.path(), 2);
    let work = || {
        document(
            &campaign(&scans)
                .analyse(&Job::quiet(Some(2)).unwrap())
                .unwrap(),
        )
    };
    let host = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    assert_eq!(host.install(work), work());
}

/// An upload takes the road of a file: the same bytes under the same name give the same document.
#[test]
fn uploads_give_what_files_give() {
    let folder = tempfile::tempdir().unwrap();
    let files = scans(folder.path(), 4);
    let names: Vec<PathBuf> = (0..4).map(|n| format!("upload/{n}.spm").into()).collect();
    let (mut moved, mut held) = (Places::new(), Places::new());
    for (name, file) in names.iter().zip(&files) {
        moved.insert(name.clone(), file.clone());
        held.hold(name.clone(), std::fs::read(file).unwrap());
    }
    let job = Job::quiet(Some(2)).unwrap();
    let [on_disk, in_memory] = [moved, held].map(|places| {
        let mut campaign = campaign(&names).with_places(places);
        document(&campaign.analyse(&job).unwrap())
    });
    assert_eq!(on_disk, in_memory);
    // Without its place a name is that of a file.
    assert!(campaign(&names).analyse(&job).is_err());
}
