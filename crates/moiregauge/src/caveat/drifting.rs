//! Doubts about the drift and the clock.

use std::fmt;

use heterostrain::Estimate;

use crate::caveat::explained::explain;
use crate::numbers::words::{plus_minus, two_digits};

/// Drift and the clock.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DriftDoubt {
    /// The files do not tell their times.
    #[error(
        "nothing was corrected for drift, since at least one file has no line rate or no frame direction. Give both, \
         from the log of the measurement{}",
        told(assumed.as_ref())
    )]
    NoTiming {
        /// What the drift that was assumed makes of the result; `None` where there is none.
        assumed: Option<DriftShare>,
    },
    /// The scans do not tell the drift.
    #[error("nothing was corrected for drift: {reason}{}", told(assumed.as_ref()))]
    Undetermined {
        /// Why.
        reason: String,
        /// What the drift that was assumed makes of the result; `None` where there is none.
        assumed: Option<DriftShare>,
    },
    /// The user gave the drift.
    #[error(
        "twist and strain depend on the drift that the user gave. It was not measured, and it is correct only if the \
         sample still drifts in the same way"
    )]
    Given,
    /// With other headers the scans fit together, with theirs they do not.
    #[error(
        "the drift is probably wrong; twist and strain are not affected as long as it is constant. The scans do not \
         fit together with the line rate and slow direction of their headers, but they do {headers}. Compare the \
         headers with the log of the measurement"
    )]
    HeadersContradictImages {
        /// The headers with which they do.
        headers: String,
        /// How well they fit together with each of the headers that were tried.
        attempts: Vec<String>,
    },
    /// Positions from frame to frame are not those of the drift within frames.
    #[error(
        "the drift and its error are probably wrong, since the motion of the lattice from frame to frame contradicts \
         the drift within the frames. Check slow direction, line rate and dates in the headers, and look for a move of \
         the scan window between frames"
    )]
    FramesDoNotLink {
        /// How well they fit together with each of the headers that were tried.
        attempts: Vec<String>,
    },
    /// Dates and line rate contradict each other.
    #[error(transparent)]
    DatesContradictLineRate(FrameDates),
    /// The sets have no drift in common.
    #[error(
        "each set has its own drift, and the lattices of the sets are averaged, since no smooth drift describes all \
         sets: {reason}"
    )]
    NotJoined {
        /// Why.
        reason: String,
    },
    /// Frames up and down differ as if the drift changed within them.
    #[error(
        "a drift that changes within a frame may look like strain. Upward and downward frames differ along their slow \
         axis by ({}, {}) nm/min² of such a change, more upwards than downwards. The mean of both directions is free \
         of this difference, but not of a change that is the same in both. Wait until the instrument has settled",
        per_minute(.acceleration[0]), per_minute(.acceleration[1])
    )]
    Changes {
        /// Change of the velocity, nm/s².
        acceleration: [Estimate; 2],
    },
    /// The sample moves nearly as fast as the lines.
    #[error(
        "a drift that changes by a tenth during a frame leaves errors of {:.0} %, since the sample drifts at {:.0} % \
         of the speed at which lines follow each other. A constant drift is removed exactly. Scan faster lines or \
         smaller frames",
        10.0 * .share, 100.0 * .share
    )]
    Large {
        /// Drift over the slow speed of the tip.
        share: f64,
    },
}

/// A drift that nothing tells: none, with the error of a prior.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct AssumedDrift {
    /// Standard deviation of each component, nm/s.
    pub sigma: f64,
    /// Whether the line rate was assumed, too.
    pub no_rate: bool,
}

/// The part that an assumed drift has in the total error of a result.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct DriftShare {
    /// What was assumed.
    pub assumed: AssumedDrift,
    /// Of what: the twist, or a length.
    pub of: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The total error.
    pub total: f64,
    /// What it would be without the drift.
    pub without: f64,
}

impl fmt::Display for DriftShare {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let prior = two_digits(60.0 * self.assumed.sigma);
        let share = 100.0 * (1.0 - (self.without / self.total).powi(2));
        let [total, without] = [self.total, self.without].map(two_digits);
        let (of, unit) = (self.of, self.unit);
        write!(
            f,
            ". A drift of 0 ± {prior} nm/min along each axis is assumed"
        )?;
        if self.assumed.no_rate {
            f.write_str(", and a line rate between 0.5 and 10 Hz")?;
        }
        write!(
            f,
            ". It makes {share:.0} % of the squared total error of the {of}, ± {total}{unit}. One more frame in the other slow \
             direction would measure the drift and leave about ± {without}{unit}"
        )
    }
}

fn told(share: Option<&DriftShare>) -> String {
    share.map_or_else(String::new, DriftShare::to_string)
}

impl DriftDoubt {
    pub(super) fn attempts(&self) -> &[String] {
        match self {
            Self::HeadersContradictImages { attempts, .. } | Self::FramesDoNotLink { attempts } => {
                attempts
            }
            _ => &[],
        }
    }

    pub(crate) fn undetermined(reason: String) -> Self {
        Self::Undetermined {
            reason,
            assumed: None,
        }
    }

    /// The same with what an assumed drift makes of the result.
    #[must_use]
    pub(crate) fn with(self, assumed: Option<DriftShare>) -> Self {
        match self {
            Self::NoTiming { .. } => Self::NoTiming { assumed },
            Self::Undetermined { reason, .. } => Self::Undetermined { reason, assumed },
            other => other,
        }
    }
}

/// How dates contradict a line rate. Times are in s, rates in lines per second.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameDates {
    /// Frames follow each other faster than their lines.
    #[error(
        "the drift is wrong by a factor if the line rate is wrong. The dates of two frames are {interval:.0} s apart, \
         but the lines of one frame take {frame:.0} s at {rate} lines per second. Compare the line rate with the log \
         of the measurement: it is higher than the headers say, or the dates are wrong"
    )]
    TooClose {
        /// Between the dates.
        interval: f64,
        /// For the lines of a frame.
        frame: f64,
        /// Of the headers.
        rate: f64,
    },
    /// Frames follow each other after twice their time.
    #[error(
        "the drift may be half of what is given. The dates of the frames are {interval:.0} s apart, twice the \
         {frame:.0} s that the lines of one frame take at {rate} lines per second. Compare the line rate with the log \
         of the measurement: it is half of what the headers say, or there was a pause as long as a frame before each \
         frame"
    )]
    Doubled {
        /// Between the dates.
        interval: f64,
        /// For the lines of a frame.
        frame: f64,
        /// Of the headers.
        rate: f64,
    },
}

fn per_minute(acceleration: Estimate) -> String {
    plus_minus(acceleration.scaled(3600.0))
}

explain! { DriftDoubt:
    NoTiming "no-timing" Serious
        "The files do not say when their lines were scanned. Nothing was corrected for drift, which stretches and \
         shears a lattice and looks like strain. A drift of 0, with the error of a setting (1 nm/min by default), is \
         assumed, and where the line rate is not known one between 0.5 and 10 Hz. Both are in the errors."
        "Give line rate and frame direction, from the log of the measurement."
    Undetermined "drift-undetermined" Serious
        "The drift cannot be determined from these scans. Nothing was corrected for drift, which stretches and shears \
         a lattice and looks like strain. A drift of 0, with the error of a setting (1 nm/min by default), is assumed and \
         is in the errors."
        "Take frames up and down of the same place, one after the other. If the drift is known from another \
         measurement, give it; if it is known how much the instrument drifts at most, give that."
    Given "drift-given" Note
        "The drift was given by the user, not measured. If it is wrong by more than its stated uncertainty, twist and \
         strain are wrong too."
        "Take frames up and down: from these the program measures the drift."
    HeadersContradictImages "headers-contradict-images" Serious
        "The scans fit together far better with another line rate or slow direction than the headers state. Probably \
         an entry of the headers is wrong, and then the drift is wrong too."
        "Compare line rate and frame direction with the log of the measurement, and give the right ones."
    FramesDoNotLink "frames-do-not-link" Serious
        "The lattice moves from frame to frame in a way that the drift within the frames does not explain. The drift \
         and its error are probably wrong. Twist and strain are also wrong if the drift changed within frames."
        "Look for a move of the window, a jump or a pause between frames, and leave out the scans next to it. Check line \
         rate, dates and frame directions."
    DatesContradictLineRate "dates-contradict-line-rate" Warning
        "The dates of the frames and the line rate do not agree on how long a frame took. If the line rate is wrong, \
         the drift is wrong by the same factor."
        "Compare the line rate with the log of the measurement. Trace and retrace may have been counted as two lines."
    NotJoined "drift-not-joined" Warning
        "No smooth drift describes all sets. Each set has its own drift, and the lattices of the sets were averaged. \
         This is less accurate than one fit to all scans."
        "Nothing, if the sets are hours apart or the window was moved between them. Otherwise look for the set with a \
         different drift."
    Changes "drift-changes" Warning
        "Frames up and down differ as if the drift changed within a frame. The mean of both is free of this \
         difference. A change of the drift that is the same in both directions remains, and looks like strain."
        "Wait until the instrument has settled, or scan faster and smaller frames."
    Large "large-drift" Warning
        "The drift is not small against the speed of the slow scan. A constant drift is removed, but even a small \
         change of it within a frame makes large errors."
        "Scan faster lines or smaller frames, or wait until the drift is smaller."
}
