//! A command for each result, run beside the watch.

use std::io::Write as _;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Between two looks whether a command has ended.
const STEP: Duration = Duration::from_millis(20);
/// A watch that is stopped leaves a command that is under way so long.
const GRACE: Duration = Duration::from_secs(2);

/// Commands that wait for their turn, and the thread that runs them.
pub(super) struct Exec {
    lines: Sender<String>,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Exec {
    /// Nothing to run yet.
    pub(super) fn new(command: &str, limit: Duration) -> Self {
        let (lines, waiting) = channel::<String>();
        let stop = Arc::new(AtomicBool::new(false));
        let command = command.to_owned();
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            for line in waiting {
                if stopped.load(Ordering::Relaxed) {
                    break;
                }
                if let Err(why) = run(&command, &line, limit, &stopped) {
                    eprintln!("--exec: {why}");
                }
            }
        });
        Self {
            lines,
            stop,
            thread,
        }
    }

    /// One more line, when its turn comes.
    pub(super) fn give(&self, line: &str) {
        // The thread ends after the watch only.
        let _ = self.lines.send(format!("{line}\n"));
    }

    /// Waits for what is to be run; where the watch was stopped, only for what is under way, and not for long.
    pub(super) fn end(self, stopped: bool) {
        self.stop.store(stopped, Ordering::Relaxed);
        drop(self.lines);
        let _ = self.thread.join();
    }
}

/// Runs the command to its end, or to the end of its time.
fn run(command: &str, line: &str, limit: Duration, stop: &AtomicBool) -> Result<(), String> {
    let mut shell = shell(command);
    shell
        .stdin(Stdio::piped())
        // Standard output is for results.
        .stdout(Stdio::from(std::io::stderr()))
        .stderr(Stdio::inherit());
    let mut child = shell
        .spawn()
        .map_err(|why| format!("the shell does not start: {why}"))?;
    if let Some(mut input) = child.stdin.take() {
        let line = line.to_owned();
        // A command need not read.
        std::thread::spawn(move || input.write_all(line.as_bytes()));
    }
    let ended = wait(&mut child, limit, stop).map_err(|why| why.to_string())?;
    match ended {
        Some(status) if status.success() => Ok(()),
        Some(status) => Err(format!("the command failed: {status}")),
        None => {
            kill(&mut child);
            Err(format!(
                "the command was killed after {:.1} s",
                limit.as_secs_f64()
            ))
        }
    }
}

/// Until it ends by itself; `None` where its time is over.
fn wait(
    child: &mut Child,
    limit: Duration,
    stop: &AtomicBool,
) -> std::io::Result<Option<ExitStatus>> {
    let started = Instant::now();
    let mut stopped: Option<Instant> = None;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if stop.load(Ordering::Relaxed) {
            stopped.get_or_insert_with(Instant::now);
        }
        if started.elapsed() >= limit || stopped.is_some_and(|at| at.elapsed() >= GRACE) {
            return Ok(None);
        }
        std::thread::sleep(STEP);
    }
}

#[cfg(unix)]
fn shell(command: &str) -> Command {
    use std::os::unix::process::CommandExt as _;
    let mut shell = Command::new("sh");
    // A group of its own: Ctrl-C is for the watch, and what the command starts ends with it.
    shell.arg("-c").arg(command).process_group(0);
    shell
}

#[cfg(windows)]
fn shell(command: &str) -> Command {
    use std::os::windows::process::CommandExt as _;
    let mut shell = Command::new("cmd");
    shell.arg("/C").raw_arg(command);
    shell
}

/// Ends a command and what it has started.
fn kill(child: &mut Child) {
    let number = child.id();
    let mut others = if cfg!(windows) {
        let mut others = Command::new("taskkill");
        others.args(["/T", "/F", "/PID", &number.to_string()]);
        others
    } else {
        let mut others = Command::new("sh");
        others.arg("-c").arg(format!("kill -s KILL -- -{number}"));
        others
    };
    let quiet = others
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let _ = quiet.status();
    let _ = child.kill();
    let _ = child.wait();
}
