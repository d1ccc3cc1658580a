//! Sets of scan files whose answer is known, and the answer beside them.

use std::path::{Path, PathBuf};

use moiregauge::numbers::interrupt;
use moiregauge::simulate::{SimulateError, Simulation, Simulator, Truth};
use spmfile::nanoscope::WriteError;

use crate::job::{Cancelled, Job, Stage};
use crate::sink::{FolderSink, Manifest, Sink, SinkError, Target};

const TRUTH: &str = "truth.json";

/// Why a set is not simulated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// It was stopped.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A setting makes no sense.
    #[error("set {name:?} cannot be simulated")]
    Set {
        /// Name of the set.
        name: String,
        /// Which setting.
        source: SimulateError,
    },
    /// The name is no name of a folder.
    #[error("the name of a set is also the name of its folder: expected a plain name, found {0:?}")]
    Name(String),
    /// A scan that would be taken for part of the set.
    #[error("{} is not part of the new set. Remove it or choose another name", .0.display())]
    InTheWay(PathBuf),
    /// The folder cannot be read.
    #[error("cannot list {}", folder.display())]
    List {
        /// The folder.
        folder: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A scan cannot be written as a file.
    #[error(transparent)]
    Scan(#[from] WriteError),
    /// The truth cannot be written.
    #[error(transparent)]
    Truth(#[from] serde_json::Error),
    /// The files cannot be written.
    #[error(transparent)]
    Sink(#[from] SinkError),
}

/// Writes the scans of a set, `scan.000.spm` and so on, and `truth.json`.
///
/// # Errors
/// [`SimulationError`].
///
/// ```
/// use moiregauge::simulate::Simulation;
/// use moiregauge_pipeline::sink::MemorySink;
/// use moiregauge_pipeline::{Job, simulate};
///
/// let mut set = Simulation::default();
/// (set.raster.scans, set.raster.pixels) = (2, [64, 64]);
/// let sink = MemorySink::new();
/// let truth = simulate(&set, &sink, &Job::quiet(None)?)?;
/// assert_eq!(truth.frames.len(), 2);
/// assert!(sink.commit("simulate")?.contains_key("scan.001.spm"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn simulate(set: &Simulation, sink: &dyn Sink, job: &Job) -> Result<Truth, SimulationError> {
    let simulator = simulator(set)?;
    let stage = job.stage("simulating", "scans", simulator.frames());
    job.run(|| write_set(&simulator, sink, &stage))??;
    Ok(simulator.truth())
}

/// The three sets of arXiv 2406.08681 on one sample, one after the other: slow y at 8 Hz, slow x at
/// 8 Hz, slow x at 4 Hz.
pub fn paper_sets(seed: u64) -> Vec<Simulation> {
    let mut start_s = 0.0;
    [
        ("slow-y-8hz", 0.0, 8.0, 10),
        ("slow-x-8hz", 90.0, 8.0, 10),
        ("slow-x-4hz", 90.0, 4.0, 6),
    ]
    .into_iter()
    .zip(0..)
    .map(|((name, rotation_deg, line_rate_hz, scans), index)| {
        let mut set = Simulation {
            name: name.to_owned(),
            // Noise of its own for each set, the same sample for all.
            seed: seed.wrapping_mul(3).wrapping_add(index),
            ..Simulation::default()
        };
        set.raster.rotation_deg = rotation_deg;
        set.raster.line_rate_hz = line_rate_hz;
        set.raster.scans = scans;
        set.raster.start_s = start_s;
        let frame_s = set.raster.pixels[1] as f64 / line_rate_hz + set.raster.gap_s;
        // A minute to turn the frame.
        start_s += scans as f64 * frame_s + 60.0;
        set
    })
    .collect()
}

/// Writes every set into `out/NAME` and returns these folders. Nothing is written unless all of it can be.
///
/// # Errors
/// [`SimulationError`].
pub fn simulate_sets(
    sets: &[Simulation],
    out: &Path,
    force: bool,
    job: &Job,
) -> Result<Vec<PathBuf>, SimulationError> {
    let mut ready = Vec::new();
    for set in sets {
        let name = &set.name;
        let plain = !name.starts_with('.') && !name.contains(['/', '\\', ':', '\0']);
        if name.trim().is_empty() || !plain {
            return Err(SimulationError::Name(name.clone()));
        }
        let simulator = simulator(set)?;
        let folder = out.join(name);
        let sink = sink(&folder, simulator.frames(), force)?;
        ready.push((simulator, folder, sink));
    }
    let mut written = Vec::new();
    let frames = ready.iter().map(|(simulator, ..)| simulator.frames());
    let stage = job.stage("simulating", "scans", frames.sum());
    for (simulator, folder, sink) in ready {
        job.run(|| write_set(&simulator, &sink, &stage))??;
        sink.commit()?;
        written.push(folder);
    }
    Ok(written)
}

fn simulator(set: &Simulation) -> Result<Simulator, SimulationError> {
    Simulator::new(set.clone()).map_err(|source| SimulationError::Set {
        name: set.name.clone(),
        source,
    })
}

fn write_set(simulator: &Simulator, sink: &dyn Sink, stage: &Stage) -> Result<(), SimulationError> {
    for index in 0..simulator.frames() {
        interrupt::check();
        let bytes = spmfile::nanoscope::write(&simulator.frame(index))?;
        sink.write(&Simulator::file_name(index), &bytes)?;
        stage.step();
    }
    let mut truth = serde_json::to_vec_pretty(&simulator.truth())?;
    truth.push(b'\n');
    Ok(sink.write(TRUTH, &truth)?)
}

/// Makes the folder of a set ready, and refuses to put the set among scans of others, which an analysis would take for
/// part of it.
fn sink(folder: &Path, frames: usize, force: bool) -> Result<FolderSink, SimulationError> {
    let mut names: Vec<String> = (0..frames).map(Simulator::file_name).collect();
    names.push(TRUTH.to_owned());
    let sink = FolderSink::open(&Target {
        folder,
        kind: "simulate",
        names: &names,
        inputs: &[],
        force,
    })?;
    let earlier = Manifest::read(folder)?;
    let listed = earlier.iter().flat_map(|m| &m.files).map(|f| &f.path);
    let ours: Vec<&String> = names.iter().chain(listed).collect();
    let list = |source| SimulationError::List {
        folder: folder.to_owned(),
        source,
    };
    for entry in std::fs::read_dir(folder).map_err(list)? {
        let path = entry.map_err(list)?.path();
        let is_scan = path.extension().is_some_and(|extension| extension == "spm");
        let name = path.file_name().unwrap_or_default();
        if is_scan && ours.iter().all(|ours| name != ours.as_str()) {
            return Err(SimulationError::InTheWay(path));
        }
    }
    Ok(sink)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(
        sets: &[Simulation],
        out: &Path,
        force: bool,
    ) -> Result<Vec<PathBuf>, SimulationError> {
        simulate_sets(sets, out, force, &Job::quiet(None).unwrap())
    }

    fn small(name: &str, scans: usize) -> Simulation {
        let mut set = Simulation {
            name: name.to_owned(),
            ..Simulation::default()
        };
        set.raster.pixels = [8, 6];
        set.raster.scans = scans;
        set
    }

    #[test]
    fn nothing_is_overwritten_without_force() {
        let out = tempfile::tempdir().unwrap();
        let folders = written(&[small("a b ü", 2)], out.path(), false).unwrap();
        let first = std::fs::read(folders[0].join("scan.000.spm")).unwrap();
        let truth = std::fs::read_to_string(folders[0].join(TRUTH)).unwrap();
        assert!(truth.contains("\"twist_deg\": 1.13"));

        let mut other = small("a b ü", 2);
        other.seed = 2;
        // A good set next to a refused one is not written either.
        let both = [small("new", 1), other.clone()];
        let error = written(&both, out.path(), false).unwrap_err();
        assert!(matches!(error, SimulationError::Sink(e) if e.can_be_forced()));
        assert!(!out.path().join("new").exists());
        assert_eq!(
            std::fs::read(folders[0].join("scan.000.spm")).unwrap(),
            first
        );

        written(&[other], out.path(), true).unwrap();
        assert_ne!(
            std::fs::read(folders[0].join("scan.000.spm")).unwrap(),
            first
        );
    }

    /// Those of the program go with the set that is replaced; those of others are in the way.
    #[test]
    fn scans_of_an_older_set_do_not_mix_with_the_new_ones() {
        let out = tempfile::tempdir().unwrap();
        let folders = written(&[small("set", 3)], out.path(), false).unwrap();
        written(&[small("set", 2)], out.path(), true).unwrap();
        let there = |name: &str| folders[0].join(name).exists();
        assert!(there("scan.001.spm") && !there("scan.002.spm"));
        std::fs::write(folders[0].join("mine.spm"), "a scan").unwrap();
        let error = written(&[small("set", 2)], out.path(), true).unwrap_err();
        assert!(error.to_string().contains("mine.spm"), "{error}");
    }

    #[test]
    fn names_stay_inside_the_folder() {
        let out = tempfile::tempdir().unwrap();
        for name in ["", "..", "a/b", "a\\b"] {
            assert!(
                written(&[small(name, 1)], out.path(), false).is_err(),
                "{name:?}"
            );
        }
    }

    /// One sample, one clock: a set starts after the one before it has ended.
    #[test]
    fn paper_sets_follow_each_other() {
        let sets = paper_sets(1);
        let scans: Vec<usize> = sets.iter().map(|s| s.raster.scans).collect();
        assert_eq!(scans, [10, 10, 6]);
        for pair in sets.windows(2) {
            assert_eq!(pair[0].sample, pair[1].sample);
            assert_ne!(pair[0].seed, pair[1].seed);
            let truth = Simulator::new(pair[0].clone()).unwrap().truth();
            let end = truth.frames.last().unwrap().end_s;
            assert!(pair[1].raster.start_s > end);
        }
        // Ten frames of 512 lines at 8 Hz, nine pauses and one more, a minute.
        assert!((sets[1].raster.start_s - (650.0 + 60.0)).abs() < 1e-9);
    }
}
