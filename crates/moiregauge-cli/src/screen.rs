//! Help that fits a screen: commands in groups, and of each command the options that are used most. `--help` has all.

use std::fmt::Write as _;

use clap::Command;
use clap::builder::Styles;

/// The commands, by what they are for.
const GROUPS: [(&str, &[&str]); 5] = [
    ("Measure", &["analyze", "map", "calibrate"]),
    ("Look", &["serve", "info", "watch", "explain"]),
    ("Prepare", &["plan", "simulate", "validate", "demo"]),
    ("Many samples", &["campaign", "merge"]),
    (
        "Reference and files",
        &["moire", "convert", "config", "completions", "man"],
    ),
];

/// The options that `-h` shows, of commands that have more than a screen of them.
const SHOWN: [(&str, &[&str]); 9] = [
    (
        "analyze",
        &[
            "out",
            "config",
            "quiet",
            "force",
            "channel",
            "exclude",
            "moires",
            "layers",
            "near",
            "calibration",
            "size",
            "line_rate",
            "frame_direction",
        ],
    ),
    (
        "map",
        &[
            "out",
            "quiet",
            "force",
            "channel",
            "layers",
            "calibration",
            "window",
            "step",
            "region",
            "profile",
            "device",
            "wanted",
            "size",
        ],
    ),
    (
        "watch",
        &[
            "until",
            "keep",
            "exec",
            "serve",
            "poll",
            "json",
            "quiet",
            "channel",
            "layers",
            "size",
            "frame_direction",
        ],
    ),
    (
        "campaign",
        &[
            "samples",
            "shard",
            "out",
            "config",
            "quiet",
            "force",
            "channel",
            "layers",
            "calibration",
        ],
    ),
    (
        "plan",
        &[
            "twist_sigma",
            "strain_sigma",
            "drift_sigma",
            "config",
            "like",
            "max_size",
            "max_rate",
            "calibration",
            "out",
            "force",
        ],
    ),
    (
        "calibrate",
        &[
            "material",
            "lattice",
            "out",
            "channel",
            "size",
            "line_rate",
            "frame_direction",
            "force",
            "quiet",
        ],
    ),
    (
        "convert",
        &["to", "channel", "rotate_to_lab", "force", "quiet", "size"],
    ),
    (
        "moire",
        &[
            "layers",
            "twist",
            "strain",
            "strain_axis",
            "biaxial",
            "wavelengths",
            "meaning",
            "vectors",
            "sigma",
            "lattice_angle",
            "figure",
            "json",
            "list",
        ],
    ),
    (
        "simulate",
        &[
            "out",
            "name",
            "force",
            "print_config",
            "list_samples",
            "sample",
            "vary",
            "layers",
            "twist",
            "strain",
            "seed",
            "drift",
            "noise",
            "scans",
            "pixels",
            "size",
        ],
    ),
];

/// The help of the program: its commands in groups.
pub(crate) fn grouped(command: Command) -> Command {
    let header = *Styles::default().get_header();
    let literal = *Styles::default().get_literal();
    let mut groups = String::new();
    for (title, names) in GROUPS {
        let _ = writeln!(groups, "{header}{title}:{header:#}");
        for name in names {
            let about = command.find_subcommand(name).and_then(Command::get_about);
            let about = about.map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(groups, "  {literal}{name:<11}{literal:#}  {about}");
        }
        groups.push('\n');
    }
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{groups}\
         `moiregauge COMMAND -h` shows a command on one screen, `--help` all of it.\n\n\
         {header}Options:{header:#}\n{{options}}"
    );
    command.help_template(template)
}

/// The short help of a command: what it takes, and the options that are used most.
pub(crate) fn short(command: Command) -> Command {
    let name = command.get_name().to_owned();
    let Some((_, shown)) = SHOWN.iter().find(|(of, _)| *of == name) else {
        return command;
    };
    let all = command.get_opts().count();
    command
        .mut_args(|arg| {
            let is_shown = arg.is_positional() || shown.contains(&arg.get_id().as_str());
            arg.hide_short_help(!is_shown)
        })
        .after_help(format!(
            "`moiregauge {name} --help` has all {all} options and examples."
        ))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_command_is_in_one_group() {
        let command = crate::arguments();
        let all = command.get_subcommands().map(|c| c.get_name().to_owned());
        let grouped = GROUPS.iter().flat_map(|(_, names)| *names);
        let grouped: Vec<String> = grouped.map(|name| (*name).to_owned()).collect();
        assert_eq!(grouped.len(), grouped.iter().collect::<BTreeSet<_>>().len());
        assert_eq!(
            all.collect::<BTreeSet<_>>(),
            grouped.into_iter().collect::<BTreeSet<_>>()
        );
    }

    #[test]
    fn short_help_fits_a_screen() {
        let program = crate::arguments();
        let names: Vec<String> = program
            .get_subcommands()
            .map(|c| c.get_name().to_owned())
            .collect();
        for name in names {
            let mut program = crate::arguments();
            let command = program.find_subcommand_mut(&name).expect("a command");
            let options: BTreeSet<String> = command
                .get_arguments()
                .map(|a| a.get_id().to_string())
                .collect();
            let shown = SHOWN.iter().find(|(of, _)| *of == name);
            for option in shown.iter().flat_map(|(_, shown)| *shown) {
                assert!(options.contains(*option), "{name} has no {option}");
            }
            let lines = command.render_help().to_string().lines().count();
            assert!(lines <= 40, "{name} -h has {lines} lines");
        }
        let lines = crate::arguments().render_help().to_string().lines().count();
        assert!(lines <= 40, "-h has {lines} lines");
    }
}
