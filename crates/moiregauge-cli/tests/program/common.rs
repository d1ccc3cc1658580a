//! Running the program and reading what it wrote.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// How a run of the program ended.
pub(crate) struct Run {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

/// The program, to be given its arguments.
pub(crate) fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_moiregauge"))
}

/// The program where files are limited to a number of blocks of 512 bytes, as where a disk is full.
#[cfg(unix)]
pub(crate) fn with_files_up_to(blocks: usize) -> Command {
    let mut command = Command::new("sh");
    let limited = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
    command.args(["-c", &limited, "sh", env!("CARGO_BIN_EXE_moiregauge")]);
    command
}

/// Runs it to the end.
pub(crate) fn run(command: &mut Command) -> Run {
    let output = command.output().expect("the program starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    Run {
        code: output.status.code(),
        stdout: text(output.stdout),
        stderr: text(output.stderr),
    }
}

/// Runs it, and insists on success.
pub(crate) fn succeed(command: &mut Command) -> Run {
    let run = run(command);
    assert_eq!(run.code, Some(0), "{command:?}\n{}", run.stderr);
    run
}

/// Writes a simulated set below `folder` and returns the folder of its scans.
pub(crate) fn simulate(folder: &Path, options: &[&str]) -> PathBuf {
    succeed(
        program()
            .arg("simulate")
            .arg("--out")
            .arg(folder)
            .args(options),
    );
    folder.join("simulated")
}

/// A set quick enough to be analysed many times: four frames of 128 × 128.
pub(crate) fn small_set(folder: &Path) -> PathBuf {
    simulate(folder, &["--pixels", "128", "--scans", "4"])
}

/// `analyze` without figures, to be given more options.
pub(crate) fn analyze(input: &Path, out: &Path) -> Command {
    let mut command = program();
    command.arg("analyze").arg(input).arg("--out").arg(out);
    command.arg("--no-report");
    command
}

/// The numbers that an analysis wrote.
pub(crate) fn results(out: &Path) -> Value {
    json(&out.join("results.json"))
}

/// A JSON file.
pub(crate) fn json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The number at a JSON pointer.
pub(crate) fn number(value: &Value, pointer: &str) -> f64 {
    let found = value.pointer(pointer).and_then(Value::as_f64);
    found.unwrap_or_else(|| panic!("no number at {pointer} in {value}"))
}

/// Value and σ of the estimate at a JSON pointer.
pub(crate) fn estimate(value: &Value, pointer: &str) -> (f64, f64) {
    let part = |name: &str| number(value, &format!("{pointer}/{name}"));
    (part("value"), part("sigma"))
}

/// The codes of all caveats.
pub(crate) fn caveats(results: &Value) -> Vec<&str> {
    let all = results["caveats"].as_array().expect("a list");
    all.iter().filter_map(|c| c["code"].as_str()).collect()
}

/// The difference of two axes, degrees in (−90, 90].
pub(crate) fn between_axes(a: f64, b: f64) -> f64 {
    let difference = (a - b).rem_euclid(180.0);
    if difference > 90.0 {
        difference - 180.0
    } else {
        difference
    }
}

/// The folder of shared test data, or `None` with a note where it is absent.
///
/// # Panics
/// If it is absent although `MOIREGAUGE_REQUIRE_TESTDATA=1` asks for it.
pub(crate) fn testdata(test: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("MOIREGAUGE_TESTDATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    if folder.is_dir() {
        return Some(folder);
    }
    let required = std::env::var_os("MOIREGAUGE_REQUIRE_TESTDATA").is_some_and(|v| v == "1");
    assert!(!required, "{test}: no test data in {}", folder.display());
    println!("{test} DID NOT RUN: no test data in {}", folder.display());
    None
}
