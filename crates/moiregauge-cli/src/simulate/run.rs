//! The run: settings → sets of scans, written.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail, ensure};
use moiregauge::simulate::{CLASSES, Simulation, Simulator};
use moiregauge_pipeline::sink::{FolderSink, Manifest, Target};
use moiregauge_pipeline::{Job, Stage};

use super::args::SimulateArgs;
use crate::outputs;

/// Writes the set, or the paper's three.
pub(crate) fn run(args: &SimulateArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let mut out = std::io::stdout().lock();
    if args.print_config {
        write!(out, "{}", toml::to_string(&args.settings()?)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    if args.list_samples {
        write!(out, "{}", list_of_samples())?;
        return Ok(ExitCode::SUCCESS);
    }
    let Some(folder) = &args.out else {
        bail!("no folder to write to: give --out DIR");
    };
    let sets = if args.paper {
        paper_sets(args.seed.unwrap_or(Simulation::default().seed))
    } else {
        vec![args.settings()?]
    };
    for (set, folder) in sets.iter().zip(write_sets(&sets, folder, args.force, job)?) {
        writeln!(
            out,
            "{}: {} scans, twist {}°, strain {} %, drift ({}, {}) nm/min",
            folder.display(),
            set.raster.scans,
            set.sample.twist_deg,
            set.sample.strain_percent,
            set.drift.velocity_nm_per_min[0],
            set.drift.velocity_nm_per_min[1],
        )?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The classes and their numbers, with the usual values.
fn list_of_samples() -> String {
    let mut text = String::from(
        "Classes for --sample, with the usual values of their numbers. Heights and amplitudes are in degrees of phase\n\
         (the moiré has an amplitude of 1°), shares are of the frame, angles counter-clockwise.\n",
    );
    for class in &CLASSES {
        let _ = writeln!(text, "\n{:16} {}", class.name, class.what);
        for key in class.keys {
            let value = format!("{}={}", key.name, key.usual);
            let _ = writeln!(text, "  {value:18} {}", key.what);
        }
    }
    text
}

/// The three sets of arXiv 2406.08681 on one sample, one after the other: slow y at 8 Hz, slow x at
/// 8 Hz, slow x at 4 Hz.
pub(crate) fn paper_sets(seed: u64) -> Vec<Simulation> {
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

/// Writes every set into `out/NAME` and returns these folders. Nothing is written unless all of it
/// can be.
pub(crate) fn write_sets(
    sets: &[Simulation],
    out: &Path,
    force: bool,
    job: &Job,
) -> anyhow::Result<Vec<PathBuf>> {
    let mut ready = Vec::new();
    for set in sets {
        let name = &set.name;
        let plain = !name.starts_with('.') && !name.contains(['/', '\\', ':', '\0']);
        ensure!(
            !name.trim().is_empty() && plain,
            "the name of a set becomes a folder: expected a plain name, found {name:?}"
        );
        let simulator = Simulator::new(set.clone())
            .with_context(|| format!("set {name:?} cannot be simulated"))?;
        let folder = out.join(name);
        let sink = sink(&folder, simulator.frames(), force)?;
        ready.push((simulator, folder, sink));
    }
    let mut written = Vec::new();
    let frames = ready.iter().map(|(simulator, ..)| simulator.frames());
    let stage = job.stage("simulating", "scans", frames.sum());
    for (simulator, folder, sink) in ready {
        write_set(&simulator, &sink, &stage)?;
        outputs::commit(sink)?;
        written.push(folder);
    }
    Ok(written)
}

fn write_set(simulator: &Simulator, sink: &FolderSink, stage: &Stage) -> anyhow::Result<()> {
    for index in 0..simulator.frames() {
        let bytes = spmfile::nanoscope::write(&simulator.frame(index))?;
        sink.write(&Simulator::file_name(index), &bytes)?;
        stage.step();
    }
    let mut truth = serde_json::to_vec_pretty(&simulator.truth())?;
    truth.push(b'\n');
    Ok(sink.write(TRUTH, &truth)?)
}

const TRUTH: &str = "truth.json";

/// Makes the folder of a set ready, and refuses to put the set among scans of others, which an analysis would take for
/// part of it.
fn sink(folder: &Path, frames: usize, force: bool) -> anyhow::Result<FolderSink> {
    let mut names: Vec<String> = (0..frames).map(Simulator::file_name).collect();
    names.push(TRUTH.to_owned());
    let sink = outputs::folder(&Target {
        folder,
        kind: "simulate",
        names: &names,
        inputs: &[],
        force,
    })?;
    let earlier = Manifest::read(folder)?;
    let listed = earlier.iter().flat_map(|m| &m.files).map(|f| &f.path);
    let ours: Vec<&String> = names.iter().chain(listed).collect();
    let entries =
        std::fs::read_dir(folder).with_context(|| format!("cannot list {}", folder.display()))?;
    for entry in entries {
        let path = entry
            .with_context(|| format!("cannot list {}", folder.display()))?
            .path();
        let is_scan = path.extension().is_some_and(|extension| extension == "spm");
        let name = path.file_name().unwrap_or_default();
        ensure!(
            !is_scan || ours.iter().any(|ours| name == ours.as_str()),
            "{} is no part of the new set: remove it or choose another --name",
            path.display()
        );
    }
    Ok(sink)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On threads of its own.
    fn written(sets: &[Simulation], out: &Path, force: bool) -> anyhow::Result<Vec<PathBuf>> {
        write_sets(sets, out, force, &Job::quiet(None)?)
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
        assert!(error.to_string().contains("--force"), "{error}");
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
