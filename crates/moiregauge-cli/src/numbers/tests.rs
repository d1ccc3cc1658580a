//! Every numeric option of every command with numbers that make no sense.

use std::any::TypeId;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use clap::{Arg, FromArgMatches as _};
use moiregauge_pipeline::Job;

use super::*;
use crate::{Cli, arguments, run};

/// No option takes these.
const NONSENSE: [&str; 4] = ["NaN", "inf", "-inf", "1e308"];
/// Some do, and then the command has to end.
const EXTREME: [&str; 5] = ["0", "-1", "1e-308", "18446744073709551615", "4294967296"];
/// A command that is given one of them ends within this time.
const SOON: Duration = Duration::from_secs(120);

/// What options are given: text with `{}` for the number, words apart by `|`.
fn templates(command: &str, option: &str) -> Vec<&'static str> {
    match (command, option) {
        ("simulate", "size" | "drift" | "acceleration") => vec!["{}|50", "50|{}"],
        ("simulate", "pixels") => vec!["{}", "{}x32", "32x{}"],
        (_, "size" | "device") => vec!["{}nm×12nm", "12nm×{}nm"],
        (_, "crop") => vec!["{},0,32,32", "0,{},32,32", "0,0,{},32", "0,0,32,{}"],
        (_, "at") => vec!["{},0", "0,{}"],
        (_, "region") => vec!["a={},0,20,20", "a=0,0,{},20", "a=0,0 20,0 20,{}"],
        (_, "profile") => vec!["a={},0 20,20", "a=0,0 20,{}"],
        (_, "wanted") => vec!["{}±0.1", "1±{}"],
        ("campaign", "shard") => vec!["{}/3", "1/{}"],
        ("serve", "address") => vec!["127.0.0.{}"],
        ("watch", "until") => vec!["twist={}", "twist=1,strain={}"],
        (
            "analyze" | "map" | "campaign" | "watch" | "moire",
            "lattice_angle" | "lattice_angle_2",
        ) => {
            vec!["{}±0.1", "10±{}"]
        }
        ("analyze" | "map" | "campaign" | "watch", "lattice") => {
            vec!["{},0.4,6,10.5", "12,0.4,6,{}"]
        }
        (_, "lattice") => vec!["{}nm,0.5nm,90", "0.5nm,{}nm,90", "0.5nm,0.5nm,{}"],
        (_, "wavelengths") => vec!["{},12,11", "13,12,{}"],
        (_, "vectors") => vec!["{},0.4|6,11", "13,0|6,{}"],
        (_, "drift") => vec!["{}|0", "0|{}"],
        _ => vec!["{}"],
    }
}

/// A number that the option takes.
fn usual(option: &str) -> &'static str {
    match option {
        "pixels" | "twist" | "lattice" => "40",
        "lattice_constant" | "sharpness" | "poisson_ratio" | "poisson_ratio_sigma" => "0.3",
        "wavelengths" | "vectors" => "12",
        "size" | "device" => "10",
        "sets" | "scans" => "2",
        _ => "1",
    }
}

/// What has to be there for the option to mean anything.
fn beside(command: &str, option: &str) -> Vec<&'static str> {
    match option {
        "exec_timeout" => vec!["--exec", "true"],
        "port" if command == "watch" => vec!["--serve"],
        "drift_sigma" if ["analyze", "map", "campaign", "watch"].contains(&command) => {
            vec!["--drift", "0", "0"]
        }
        "strain_axis" => vec!["--strain", "0.1"],
        "device_angles" | "device_count" => vec!["--device", "12nm×12nm"],
        "wavelengths" => vec!["--meaning", "real-space"],
        "lattice_angle_2" if command == "moire" => {
            vec!["--lattice-angle", "3±0.1", "--vectors", "13,0.4", "6,11"]
        }
        of if command == "plan"
            && (of.starts_with("calibration") || of.starts_with("isotropic")) =>
        {
            vec!["--twist-sigma", "0.02"]
        }
        _ => Vec::new(),
    }
}

/// A quick run of a command; `None` where there is none, and arguments are read only.
fn base(command: &str, option: &str, folder: &Path) -> Option<Vec<OsString>> {
    let scans = folder.join("simulated");
    let scan = scans.join("scan.000.spm");
    let out = |name: &str| folder.join(format!("{option}-{name}")).into_os_string();
    let words = |text: &str| text.split(' ').map(OsString::from).collect::<Vec<_>>();
    let mut base = words("moiregauge");
    base.push(command.into());
    match command {
        "analyze" => {
            base.extend([scans.into(), "--out".into(), out("analyze")]);
            base.extend(words("--no-report --force -q"));
            let draws = ["drift_draws", "strain_draws"];
            for draws in draws.iter().filter(|draws| **draws != option) {
                base.extend([format!("--{}", draws.replace('_', "-")).into(), "10".into()]);
            }
        }
        "campaign" => {
            base.extend([scans.into(), "--out".into(), out("campaign"), "-q".into()]);
            for draws in ["drift_draws", "strain_draws"] {
                if draws != option {
                    base.extend([format!("--{}", draws.replace('_', "-")).into(), "10".into()]);
                }
            }
        }
        "map" => {
            base.extend([scan.into(), "--out".into(), out("map")]);
            base.extend(words("--no-report --force -q"));
        }
        "calibrate" => {
            base.extend([scan.into(), "-q".into()]);
            if !["lattice", "lattice_constant"].contains(&option) {
                base.extend(words("--material graphite"));
            }
        }
        "convert" => base.extend([scan.into(), out("scan.gwy"), "--force".into(), "-q".into()]),
        "moire" if !["twist", "wavelengths", "vectors", "lattice_angle_2"].contains(&option) => {
            base.extend(words("--twist 1.1"));
        }
        "info" => base.push(scan.into()),
        "simulate" => {
            base.extend(["--out".into(), out("again"), "--force".into()]);
            for (name, value) in [("scans", "1"), ("pixels", "32")] {
                if name != option {
                    base.extend([format!("--{name}").into(), value.into()]);
                }
            }
        }
        "validate" => {
            base.push("-q".into());
            for (name, value) in [("sets", "2"), ("pixels", "32"), ("scans", "2")] {
                if name != option {
                    base.extend([format!("--{name}").into(), value.into()]);
                }
            }
        }
        // The options of the budget are those of `analyze`.
        "plan" if option.starts_with("calibration") || option.starts_with("isotropic") => {
            return None;
        }
        "plan" if option != "twist_sigma" => base.extend(words("--twist-sigma 0.02")),
        "plan" | "moire" => {}
        _ => return None,
    }
    Some(base)
}

/// Whether the option takes something other than a text, a path or a word of a list.
fn is_numeric(option: &Arg) -> bool {
    let kind = option.get_value_parser().type_id();
    let texts = [
        TypeId::of::<String>(),
        TypeId::of::<PathBuf>(),
        TypeId::of::<bool>(),
        TypeId::of::<heterostrain::material::Material>(),
    ];
    let in_text =
        ["vectors", "lattice_angle", "lattice_angle_2"].contains(&option.get_id().as_str());
    // Classes of samples have numbers of their own, which are checked where they are read.
    let classes = option.get_id().as_str() == "sample";
    option.get_action().takes_values()
        && !classes
        && option.get_possible_values().is_empty()
        && (in_text || !texts.iter().any(|text| kind == *text))
}

fn parsed(words: &[OsString]) -> Result<Cli, String> {
    let matches = arguments().try_get_matches_from(words);
    matches
        .and_then(|matches| Cli::from_arg_matches(&matches))
        .map_err(|error| error.to_string())
}

/// Runs the command on a thread of its own; whether it ended well.
fn ended(words: &[OsString], cli: Cli) -> Result<bool, String> {
    let (send, receive) = mpsc::channel();
    thread::spawn(move || {
        let job = Job::quiet(None).expect("threads");
        send.send(run(&cli.command, &job).is_ok())
    });
    receive.recv_timeout(SOON).map_err(|why| match why {
        mpsc::RecvTimeoutError::Timeout => format!("{words:?} does not end"),
        mpsc::RecvTimeoutError::Disconnected => format!("{words:?} panics"),
    })
}

#[test]
fn every_numeric_option_has_a_range() {
    let folder = tempfile::tempdir().unwrap();
    let set = ["moiregauge", "simulate", "--out"].map(OsString::from);
    let small = ["--pixels", "32", "--scans", "2"].map(OsString::from);
    let set: Vec<OsString> = set
        .into_iter()
        .chain([folder.path().into()])
        .chain(small)
        .collect();
    assert!(ended(&set, parsed(&set).unwrap()).unwrap());
    let commands = arguments();
    let all = commands.get_subcommands().flat_map(|command| {
        let numeric = command.get_arguments().filter(|option| is_numeric(option));
        numeric.map(|option| (command.get_name(), option))
    });
    // They wait for the disk more than they compute.
    let (folder, all) = (folder.path(), all.collect::<Vec<_>>());
    let wrong: Vec<String> = thread::scope(|scope| {
        let each = all.chunks(all.len().div_ceil(8)).map(|part| {
            let try_one =
                move |(command, option): &(&str, &Arg)| try_option(command, option, folder);
            scope.spawn(move || part.iter().flat_map(try_one).collect::<Vec<_>>())
        });
        let running: Vec<_> = each.collect();
        let ended = running.into_iter().map(|part| part.join().unwrap());
        ended.flatten().collect()
    });
    let tried = all.len();
    assert!(tried > 80, "{tried}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// What goes wrong with an option.
fn try_option(command: &str, option: &Arg, folder: &Path) -> Vec<String> {
    let id = option.get_id().as_str();
    let long = format!("--{}", option.get_long().unwrap_or_default());
    let runs = base(command, id, folder);
    let start = runs.clone().unwrap_or_else(|| {
        let mut start = vec!["moiregauge".into(), command.into()];
        // It does not end by itself.
        if command == "watch" {
            start.push(folder.into());
        }
        start
    });
    let mut wrong = Vec::new();
    for template in templates(command, id) {
        let with = |number: &str| {
            let mut words = start.clone();
            words.extend(beside(command, id).into_iter().map(OsString::from));
            words.push(long.clone().into());
            words.extend(
                template
                    .replace("{}", number)
                    .split('|')
                    .map(OsString::from),
            );
            words
        };
        if let Err(error) = parsed(&with(usual(id))) {
            wrong.push(format!("{command} {long} {template}: {error}"));
        }
        for number in NONSENSE.into_iter().chain(EXTREME) {
            let words = with(number);
            let nonsense = NONSENSE.contains(&number);
            match (parsed(&words), &runs) {
                (Err(error), _)
                    if nonsense && !number.starts_with('-') && !error.contains(&long) =>
                {
                    wrong.push(format!("{words:?}: no {long} in {error}"));
                }
                (Err(_), _) | (Ok(_), None) => {}
                (Ok(cli), Some(_)) => match ended(&words, cli) {
                    Ok(true) if nonsense => wrong.push(format!("{words:?} is accepted")),
                    Err(error) => wrong.push(error),
                    Ok(_) => {}
                },
            }
        }
    }
    wrong
}

#[test]
fn ranges_are_told() {
    let error = number(LENGTH_NM)("-1").unwrap_err();
    assert_eq!(error, "expected a number from 0.001 to 1e7");
    assert_eq!(number(ANGLE_DEG)(" -7.5 "), Ok(-7.5));
    assert_eq!(count(1, 6)("6"), Ok(6));
    assert!(count(1, 6)("7").unwrap_err().contains("from 1 to 6"));
    assert!(sides([70.0, 35.0]).is_ok());
    assert!(sides([1e7, 70.0]).unwrap_err().contains("10000 times"));
    assert!(
        sides([4_294_967_296.0, 70.0])
            .unwrap_err()
            .contains("4294967296 nm")
    );
}
