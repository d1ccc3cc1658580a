//! Errors of inputs, with the options that help against them.

use moiregauge::caveat::Caveat;
use moiregauge::scan::MeasureError;
use moiregauge::spectrum::LatticeError;
use moiregauge_pipeline::campaign::{AnalyseError, Place};
use moiregauge_pipeline::{InputError, KnownError};
use moiregauge_report::FailedInput;
use moiregauge_report::screen::failures;

use crate::config;
use crate::hints;
use crate::nearest::nearest;

/// What helps against an error: an option of this program.
pub(crate) fn advice(error: &InputError) -> Option<String> {
    let option = match error {
        InputError::Known(error) => return of_known(error).map(str::to_owned),
        InputError::Measure(MeasureError::NoChannel { wanted, present }) => {
            let meant = nearest(wanted, present.split(", "));
            return (!meant.is_empty()).then(|| format!("--channel {wanted:?}{meant}"));
        }
        InputError::Measure(MeasureError::NoSize) => {
            "give the size, as in --size 70nm (one length is a square)"
        }
        InputError::Measure(MeasureError::Lattice { error, .. }) => match error {
            LatticeError::OneOfMany { .. } | LatticeError::NowhereTogether => {
                "say which lattice to measure, or where it is: --near WAVELENGTH, --lattice, --region or --mask"
            }
            LatticeError::NotThere => "leave out what hides it: --mask or --region",
            LatticeError::NoPeaks { .. } => "try --method fourier",
            LatticeError::FewerLattices { found, .. } => {
                return Some(format!("--moires {found} measures those that were found"));
            }
            _ => return None,
        },
        _ => return None,
    };
    Some(option.to_owned())
}

/// Says why scans are refused whose numbers are written all the same.
pub(crate) fn refused(why: &Caveat) {
    eprintln!("error: {}: {}", why.place, why.message());
    if let Some(option) = hints::of(why.code()) {
        eprintln!("try {option}");
    }
}

/// The option that an error is about.
pub(crate) fn of_known(error: &KnownError) -> Option<&'static str> {
    match error {
        KnownError::Sensors { .. } => Some("--sensors"),
        KnownError::NoChannel { .. } => Some("--x-sensor and --y-sensor"),
        KnownError::Rows { .. } | KnownError::Crop(_) => Some("--crop"),
        KnownError::Read(_) => None,
    }
}

/// The error with what helps against it.
pub(crate) fn with_advice(error: InputError) -> anyhow::Error {
    let advice = advice(&error);
    let error = anyhow::Error::new(error);
    match advice {
        Some(advice) => error.context(advice),
        None => error,
    }
}

/// The error of an analysis with the options that it is about; what failed is printed.
pub(crate) fn in_words(error: AnalyseError) -> anyhow::Error {
    match error {
        AnalyseError::Cancelled(cancelled) => cancelled.into(),
        AnalyseError::Nothing { failed } => {
            eprint!("{}", failures(&failed));
            anyhow::anyhow!("nothing could be analysed")
        }
        AnalyseError::NoCommonRegion { mut failed } => {
            failed.push(FailedInput {
                file: "--overlap".to_owned(),
                error: "the scans have no region in common".to_owned(),
            });
            in_words(AnalyseError::Nothing { failed })
        }
        AnalyseError::Beside {
            place,
            file,
            source,
        } => {
            let option = match place {
                Place::Survey => "--survey-image",
                _ => "--atomic",
            };
            with_advice(source).context(format!("{option} {file}"))
        }
        AnalyseError::NoPicture { .. } => anyhow::anyhow!("--survey-image {error}"),
        AnalyseError::Atomic(_) | AnalyseError::NoOrientation => {
            anyhow::Error::new(error).context("--atomic")
        }
        AnalyseError::Settings(error) => config::with_option(error),
        other => other.into(),
    }
}
