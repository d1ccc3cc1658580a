//! Errors of maps, with the options that they are about.

use moiregauge_pipeline::maps::{NoBands, NoStripes, NotMapped};
use moiregauge_report::screen::failures;

use crate::config;
use crate::errors::{self, with_advice};
use crate::input::with_option;
use crate::outputs::hinted;

/// The error with the options that it is about; what failed is printed.
pub(super) fn in_words(error: NotMapped) -> anyhow::Error {
    match error {
        NotMapped::Cancelled(cancelled) => cancelled.into(),
        NotMapped::Settings(error) => config::with_option(error),
        NotMapped::NameTwice(twice) => anyhow::anyhow!("{} {twice}", place(twice.is_line, ":")),
        NotMapped::Outside(outside) => {
            anyhow::anyhow!("{} {outside}", place(outside.is_line, ""))
        }
        NotMapped::SeveralMoires(count) => {
            anyhow::anyhow!(
                "a map is made of one moiré; --moires {count} belongs to `moiregauge analyze`"
            )
        }
        NotMapped::NoLattice { why, stripes } => {
            let words = errors::in_words(*why);
            stripes.map_or(words, |stripes| of_stripes(*stripes))
        }
        NotMapped::Analyse(why) => errors::in_words(*why),
        NotMapped::Nothing { failed } => {
            eprint!("{}", failures(&failed));
            anyhow::anyhow!("no image gave a map")
        }
        NotMapped::SetsInBands => anyhow::anyhow!("--set: {error}"),
        NotMapped::Band { file, source } => of_bands(*source).context(file.display().to_string()),
        NotMapped::Sink(error) => hinted(error),
        other => other.into(),
    }
}

fn place(is_line: bool, colon: &str) -> String {
    let option = if is_line { "--profile" } else { "--region" };
    format!("{option}{colon}")
}

fn of_bands(error: NoBands) -> anyhow::Error {
    match error {
        NoBands::Input(error) => with_advice(error),
        NoBands::Known(error) => with_option(error),
        NoBands::Sensors => {
            anyhow::anyhow!("--sensors, --x-sensor and --y-sensor: {error}")
        }
        NoBands::NoSize => anyhow::anyhow!("{error}; give it with --size"),
        other => other.into(),
    }
}

fn of_stripes(error: NoStripes) -> anyhow::Error {
    match error {
        NoStripes::NoTwist(file) => anyhow::anyhow!(
            "{} shows stripes and no lattice. --region, --profile, --device, --wanted and --map-method tiles need \
             twist and strain, which one wave vector does not determine",
            file.display()
        ),
        NoStripes::Input(error) => with_advice(error),
        other => other.into(),
    }
}
