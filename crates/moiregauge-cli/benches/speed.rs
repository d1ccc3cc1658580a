//! What whole runs of the program cost: the table of docs/speed.md, which docs/speed.sh writes.
//!
//! `cargo bench --workspace --bench speed [-- WORD]`: the rows with the word; those of `huge` (files of 1 GB) only when asked
//! for. Processor seconds (user and system) of the
//! process and all of its threads, the least of some runs, by the shell's `time`; memory as the system counts it (Linux).
//! Beside each row stands something known that is measured in the same run, in this process and on one thread: the textbook
//! autocorrelation of the same image, padded with zeros to twice its sides, in double precision; or a copy of the bytes.
//! Ratios to that hold on other machines, too.

use std::f64::consts::TAU;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use realfft::RealFftPlanner;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

const PROGRAM: &str = env!("CARGO_BIN_EXE_moiregauge");

/// Makes some rows.
type Rows = fn(&Work) -> Vec<Row>;

/// Runs of which the least counts.
const RUNS: usize = 5;
/// Shortest time over which work beside a row is measured.
const SHORTEST: Duration = Duration::from_millis(300);

/// A row of the table.
struct Row {
    work: String,
    /// Processor seconds.
    cost: Cost,
    /// What stands beside it, and its seconds.
    beside: Option<(&'static str, f64)>,
    goal: &'static str,
    remark: String,
}

/// Seconds of processors and of the clock.
#[derive(Clone, Copy)]
struct Cost {
    cpu: f64,
    wall: f64,
}

fn main() {
    // What cargo adds is no word.
    let word = std::env::args().skip(1).find(|a| !a.starts_with('-'));
    let wanted = |name: &str| match &word {
        Some(word) => name.contains(word.as_str()),
        None => name != "huge",
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let work = Work {
        folder: folder.path().to_owned(),
    };
    let all: [(&str, Rows); 8] = [
        ("scans", ten_scans),
        ("image", images),
        ("map", maps),
        ("set", sets),
        ("adding", adding),
        ("read", reading),
        ("validate", validate),
        ("huge", huge),
    ];
    println!(
        "| work | processor seconds | on two threads, seconds by the clock: ratio | beside it | ratio | goal |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    for (_, rows) in all.iter().filter(|(name, _)| wanted(name)) {
        for row in rows(&work) {
            println!("{}", row.line());
        }
    }
}

impl Row {
    fn line(&self) -> String {
        let (beside, ratio) = match self.beside {
            Some((what, seconds)) => (
                format!("{what}: {seconds:.4}"),
                format!("{:.1}", self.cost.cpu / seconds),
            ),
            None => (String::new(), String::new()),
        };
        let [work, remark, goal] = [&self.work, &self.remark, self.goal];
        format!(
            "| {work} | {:.2} | {remark} | {beside} | {ratio} | {goal} |",
            self.cost.cpu
        )
    }
}

struct Work {
    folder: PathBuf,
}

impl Work {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    fn run(&self, runs: usize, arguments: &[&str]) -> Cost {
        let mut least = Cost {
            cpu: f64::INFINITY,
            wall: f64::INFINITY,
        };
        for _ in 0..runs {
            let script = "TIMEFORMAT='%U %S %R'; time \"$@\" >/dev/null 2>\"$SAID\"";
            let output = Command::new("bash")
                .args(["-c", script, "bash", PROGRAM])
                .args(arguments)
                .env("SAID", self.path("said"))
                .current_dir(&self.folder)
                .output()
                .expect("bash starts");
            let said = String::from_utf8_lossy(&output.stderr);
            let times: Vec<f64> = (said.lines().last().unwrap_or_default().split(' '))
                .filter_map(|n| n.parse().ok())
                .collect();
            let [user, system, wall] = times[..] else {
                panic!("no times of {arguments:?}: {said}");
            };
            assert!(output.status.success(), "{arguments:?}: {}", self.said());
            least.cpu = least.cpu.min(user + system);
            least.wall = least.wall.min(wall);
        }
        least
    }

    fn said(&self) -> String {
        std::fs::read_to_string(self.path("said")).unwrap_or_default()
    }

    /// The most memory that a run takes, bytes.
    fn memory(&self, arguments: &[&str]) -> f64 {
        let mut child = Command::new(PROGRAM)
            .args(arguments)
            .current_dir(&self.folder)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        let status = format!("/proc/{}/status", child.id());
        let mut most = 0.0;
        while child.try_wait().expect("a child").is_none() {
            let text = std::fs::read_to_string(&status).unwrap_or_default();
            let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
            let kilobytes = line.and_then(|l| l.split_whitespace().next()?.parse().ok());
            most = f64::max(most, kilobytes.unwrap_or(0.0) * 1024.0);
            std::thread::sleep(Duration::from_millis(1));
        }
        most
    }

    fn simulate(&self, name: &str, scans: &str, pixels: &str) {
        let arguments = ["simulate", "--out", ".", "--name", name, "--force"];
        let more = ["--scans", scans, "--pixels", pixels];
        self.run(1, &[&arguments[..], &more].concat());
    }

    /// The scans in a folder, by name.
    fn scans(&self, folder: &str) -> Vec<PathBuf> {
        let all = std::fs::read_dir(self.path(folder)).expect("a folder");
        let all = all.flatten().map(|entry| entry.path());
        let mut all: Vec<PathBuf> = all.filter(|path| is_scan(path)).collect();
        all.sort();
        all
    }

    /// Four quantities, forward and backward, in single precision, most significant byte first.
    fn nanonis(&self, side: u32) -> PathBuf {
        let path = self.path("large.sxm");
        let mut file = BufWriter::new(File::create(&path).expect("a file"));
        let header = format!(
            ":NANONIS_VERSION:\n2\n:SCANIT_TYPE:\nFLOAT MSBFIRST\n:SCAN_PIXELS:\n{side} {side}\n\
             :SCAN_RANGE:\n1E-7 1E-7\n:SCAN_DIR:\ndown\n:DATA_INFO:\n\
             \tName\tUnit\tDirection\n\tZ\tm\tboth\n\tCurrent\tA\tboth\n\tPhase\tdeg\tboth\n\
             \tAmplitude\tm\tboth\n:SCANIT_END:\n\n\n"
        );
        file.write_all(header.as_bytes()).expect("a header");
        file.write_all(b"\x1a\x04").expect("a header");
        for n in 0..8 * side * side {
            let value = (n % 100_003) as f32;
            file.write_all(&value.to_be_bytes()).expect("a value");
        }
        path
    }

    /// Three waves of 25 pixels a period on a plane, with white noise of half their amplitude, as an array of single precision.
    fn image(&self, side: usize) -> String {
        let name = format!("image-{side}.npy");
        let file = File::create(self.path(&name)).expect("a file");
        let mut file = BufWriter::new(file);
        let shape =
            format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({side}, {side}), }}");
        let header = format!("{shape:<117}\n");
        file.write_all(b"\x93NUMPY\x01\x00\x76\x00")
            .expect("a header");
        file.write_all(header.as_bytes()).expect("a header");
        let size = 2.0 * TAU / (3f64.sqrt() * 25.0);
        let waves = [10.0, 70.0, 130.0_f64].map(|degrees| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            [size * cos, size * sin]
        });
        let mut noise = moiregauge::numbers::normals(1, "speed", 0);
        for row in 0..side {
            for column in 0..side {
                let (x, y) = (column as f64, row as f64);
                let moire: f64 = waves.iter().map(|k| (k[0] * x + k[1] * y).cos()).sum();
                let value = moire + 0.5 * noise() + 2.0 * (x - y) / side as f64;
                file.write_all(&(value as f32).to_le_bytes())
                    .expect("a value");
            }
        }
        name
    }
}

/// Without figures, on a number of threads, into a folder of the command's name.
fn plain<'a>(command: &'a str, input: &'a str, threads: &'a str) -> Vec<&'a str> {
    let mut all = vec![command, input, "--out", command, "--force", "--quiet"];
    all.extend(["--no-report", "--no-png", "--threads", threads]);
    all
}

fn ten_scans(work: &Work) -> Vec<Row> {
    work.simulate("ten", "10", "512");
    let one = work.run(RUNS, &plain("analyze", "ten", "1"));
    let two = work.run(RUNS, &plain("analyze", "ten", "2"));
    let ten = Row {
        work: "ten scans of 512 × 512, trace and retrace, files to results, all draws".to_owned(),
        cost: one,
        beside: Some((
            "20 autocorrelations of 512²",
            20.0 * autocorrelation(&work.path(&work.image(512)), 512),
        )),
        goal: "ratio 0.8",
        remark: faster(one, two),
    };
    work.simulate("one", "1", "512");
    let report = work.run(
        RUNS,
        &[
            "analyze",
            "one",
            "--out",
            "analyze",
            "--force",
            "--quiet",
            "--threads",
            "1",
        ],
    );
    let bare = work.run(RUNS, &plain("analyze", "one", "1"));
    let report = Row {
        work: "report with PNGs of one scan, beside measuring it".to_owned(),
        cost: Cost {
            cpu: report.cpu - bare.cpu,
            wall: report.wall - bare.wall,
        },
        beside: None,
        goal: "0.15",
        remark: String::new(),
    };
    vec![ten, report]
}

fn images(work: &Work) -> Vec<Row> {
    let sides = [
        (512, "ratio 1.2"),
        (2048, "ratio 0.9"),
        (4096, "ratio 0.75, 24 bytes"),
    ];
    sides
        .map(|(side, goal)| of_image(work, "analyze", side, goal))
        .into()
}

fn maps(work: &Work) -> Vec<Row> {
    let sides = [(2048, "ratio 2.0"), (4096, "ratio 1.5")];
    sides
        .map(|(side, goal)| of_image(work, "map", side, goal))
        .into()
}

fn of_image(work: &Work, command: &str, side: usize, goal: &'static str) -> Row {
    let (name, size) = (work.image(side), format!("{0}nm×{0}nm", side / 2));
    let with = |threads| [plain(command, &name, threads), vec!["--size", &size]].concat();
    let (one, two) = (work.run(RUNS, &with("1")), work.run(RUNS, &with("2")));
    let memory = work.memory(&with("1")) / (side * side) as f64;
    Row {
        work: format!("`{command}` of one image of {side}², {memory:.0} bytes a pixel"),
        cost: one,
        beside: Some((
            "one autocorrelation",
            autocorrelation(&work.path(&name), side),
        )),
        goal,
        remark: faster(one, two),
    }
}

/// 16384² in single precision, a file of 1 GB: analysed, and mapped in bands.
fn huge(work: &Work) -> Vec<Row> {
    let side = 16_384;
    let (name, size) = (work.image(side), format!("{0}nm×{0}nm", side / 2));
    let of = |command: &str, more: &[&str], goal: &'static str| {
        let with = [&plain(command, &name, "2"), &["--size", &size][..], more].concat();
        let cost = work.run(1, &with);
        let memory = work.memory(&with) / 1e6;
        let more = more.join(" ");
        Row {
            work: format!("`{command} {more}` of one image of {side}², {memory:.0} MB"),
            cost,
            beside: None,
            goal,
            remark: format!("{:.1}", cost.wall),
        }
    };
    vec![
        of("map", &["--in-bands"], "15 s on two threads, 600 MB"),
        of("analyze", &[], "4000 MB"),
    ]
}

fn sets(work: &Work) -> Vec<Row> {
    let mut first = None;
    let of = |scans: usize| {
        let name = format!("set-{scans}");
        work.simulate(&name, &scans.to_string(), "128");
        let cost = work.run(
            if scans > 100 { 1 } else { RUNS },
            &plain("analyze", &name, "1"),
        );
        let ten = *first.get_or_insert(cost.cpu);
        Row {
            work: format!("{scans} scans of 128² in one set"),
            cost,
            beside: Some(("ten of them", ten)),
            goal: if scans == 640 { "ratio 70" } else { "" },
            remark: String::new(),
        }
    };
    [10, 40, 160, 640].map(of).into()
}

/// One more scan in a folder of a hundred whose measurements are kept.
fn adding(work: &Work) -> Vec<Row> {
    work.simulate("hundred", "101", "128");
    let newest = work
        .scans("hundred")
        .pop()
        .expect("a hundred and one scans");
    let outside = work.path("newest.spm");
    std::fs::rename(&newest, &outside).expect("a folder");
    let watch = |keep: &str| -> Vec<String> {
        let all = ["watch", "hundred", "--poll", "0.1s", "--threads", "1"];
        let end = ["--until", "twist=90", "--keep", keep];
        all.iter().chain(&end).map(ToString::to_string).collect()
    };
    let run = |keep: &str| {
        let arguments = watch(keep);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        work.run(1, &arguments)
    };
    run("kept");
    std::fs::rename(&outside, &newest).expect("a folder");
    let again = |n: usize| {
        let keep = format!("kept-{n}");
        std::fs::copy(work.path("kept"), work.path(&keep)).expect("a file");
        run(&keep)
    };
    let cost = (0..RUNS).map(again).min_by(|a, b| a.cpu.total_cmp(&b.cpu));
    work.simulate("single", "1", "128");
    let alone = work.run(RUNS, &plain("analyze", "single", "1"));
    vec![Row {
        work: "one scan of 128² more, of a hundred that are measured".to_owned(),
        cost: cost.expect("some runs"),
        beside: Some(("that scan alone", alone.cpu)),
        goal: "0.2 more than the scan",
        remark: String::new(),
    }]
}

fn reading(work: &Work) -> Vec<Row> {
    work.simulate("large", "1", "2048");
    let nanoscope = work.scans("large").swap_remove(0);
    let nanonis = work.nanonis(4096);
    [
        (nanoscope, "NanoScope", "0.15"),
        (nanonis, "Nanonis", "0.8"),
    ]
    .map(|(file, format, goal)| read(work, &file, format, goal))
    .into()
}

fn read(work: &Work, file: &Path, format: &str, goal: &'static str) -> Row {
    let bytes = std::fs::read(file).expect("a scan");
    let copy = least(|| {
        std::hint::black_box(bytes.clone());
    });
    let cost = work.run(RUNS, &["info", "--json", &file.display().to_string()]);
    Row {
        work: format!(
            "`info` of a {format} file of {} MB with statistics",
            bytes.len() / 1_000_000
        ),
        cost,
        beside: Some(("a copy", copy)),
        goal,
        remark: String::new(),
    }
}

fn is_scan(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "spm")
}

fn validate(work: &Work) -> Vec<Row> {
    let cost = work.run(1, &["validate", "--sets", "200"]);
    vec![Row {
        work: "`validate`, 200 sets".to_owned(),
        cost,
        beside: None,
        goal: "10",
        remark: String::new(),
    }]
}

fn faster(one: Cost, two: Cost) -> String {
    format!("{:.2}: {:.1}", two.wall, one.wall / two.wall)
}

/// Seconds of the fastest of some runs: of the processor where the system tells (Linux), since others may use it as well. Short work is repeated, since
/// the system counts in steps of some milliseconds.
fn least(mut work: impl FnMut()) -> f64 {
    let processor = || {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        let nanoseconds: f64 = text.split(' ').next()?.parse().ok()?;
        Some(nanoseconds * 1e-9)
    };
    let once = |_| {
        let (clock, start, mut times) = (Instant::now(), processor(), 0.0);
        while clock.elapsed() < SHORTEST {
            work();
            times += 1.0;
        }
        let elapsed = clock.elapsed().as_secs_f64();
        let end = start.and_then(|start| Some(processor()? - start));
        end.unwrap_or(elapsed) / times
    };
    (0..RUNS).map(once).fold(f64::INFINITY, f64::min)
}

/// Seconds of one autocorrelation of an image of `side × side` pixels, a file of [`Work::image`].
fn autocorrelation(image: &Path, side: usize) -> f64 {
    let bytes = std::fs::read(image).expect("an image");
    let (values, _) = bytes[bytes.len() - 4 * side * side..].as_chunks::<4>();
    let (padded, half) = (2 * side, side + 1);
    let (mut real, mut complex) = (RealFftPlanner::<f64>::new(), FftPlanner::<f64>::new());
    let (along, back) = (real.plan_fft_forward(padded), real.plan_fft_inverse(padded));
    let (across, up) = (
        complex.plan_fft_forward(padded),
        complex.plan_fft_inverse(padded),
    );
    let mut spectrum = vec![Complex64::default(); padded * half];
    let mut columns = vec![Complex64::default(); 8 * padded];
    let mut line = along.make_input_vec();
    least(|| {
        spectrum[side * half..].fill(Complex64::default());
        for (row, out) in values
            .chunks_exact(side)
            .zip(spectrum.chunks_exact_mut(half))
        {
            for (value, bytes) in line.iter_mut().zip(row) {
                *value = f64::from(f32::from_le_bytes(*bytes));
            }
            line[side..].fill(0.0);
            along.process(&mut line, out).expect("buffers fit");
        }
        for first in (0..half).step_by(8) {
            let last = half.min(first + 8);
            for (y, row) in spectrum.chunks_exact(half).enumerate() {
                for (x, value) in row[first..last].iter().enumerate() {
                    columns[x * padded + y] = *value;
                }
            }
            across.process(&mut columns);
            for value in &mut columns {
                *value = value.norm_sqr().into();
            }
            up.process(&mut columns);
            for (y, row) in spectrum.chunks_exact_mut(half).enumerate() {
                for (x, value) in row[first..last].iter_mut().enumerate() {
                    *value = columns[x * padded + y];
                }
            }
        }
        for row in spectrum.chunks_exact_mut(half) {
            (row[0].im, row[side].im) = (0.0, 0.0);
            back.process(row, &mut line).expect("buffers fit");
            std::hint::black_box(&line);
        }
    })
}
