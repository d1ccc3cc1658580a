//! Doubts about the drift and the clock.

use heterostrain::Estimate;

use crate::caveat::explained::explain;
use crate::numbers::words::plus_minus;

/// Drift and the clock.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DriftDoubt {
    /// The files do not tell their times.
    #[error(
        "not every file tells its line rate and frame direction: nothing is corrected for drift"
    )]
    NoTiming,
    /// The scans do not tell the drift.
    #[error("{reason}")]
    Undetermined {
        /// Why.
        reason: String,
    },
    /// The user gave the drift.
    #[error(
        "the drift was given by the user and not measured; it is as right as the conditions are the same"
    )]
    Given,
    /// With other headers the scans fit together, with theirs they do not.
    #[error(
        "the scans of this set do not fit together as their headers say, but {headers} they do, so that an entry of the \
         headers is most likely wrong, and the drift with it ({evidence}). Twist and strain do not depend on it as long \
         as the drift does not change"
    )]
    HeadersContradictImages {
        /// The headers with which they do.
        headers: String,
        /// How well they fit together with each.
        evidence: String,
    },
    /// Positions from frame to frame are not those of the drift within frames.
    #[error(
        "the positions of the lattice from frame to frame contradict the drift within the frames: the drift changes, the \
         window moves in a way that the sensors do not see, or headers are wrong: slow direction, line rate or date \
         ({evidence}). Do not trust the drift and its error"
    )]
    FramesDoNotLink {
        /// How well they fit together with other headers.
        evidence: String,
    },
    /// Dates and line rate contradict each other.
    #[error(transparent)]
    DatesContradictLineRate(FrameDates),
    /// The sets have no drift in common.
    #[error(
        "no smooth drift describes all sets: {reason}; the lattices of the sets, each with its own drift, are averaged \
         instead"
    )]
    NotJoined {
        /// Why.
        reason: String,
    },
    /// Frames up and down differ as if the drift changed within them.
    #[error(
        "upward and downward frames differ along their slow axis as if the drift changed within a frame, by ({}, {}) \
         nm/min² more upwards than downwards: that is no strain, and the average of both is free of it. A change of \
         drift common to both directions looks like strain",
        per_minute(.acceleration[0]), per_minute(.acceleration[1])
    )]
    Changes {
        /// Change of the velocity, nm/s².
        acceleration: [Estimate; 2],
    },
    /// The sample moves nearly as fast as the lines.
    #[error(
        "the sample drifts at {:.0} % of the speed at which lines follow each other. A constant drift is taken out \
         exactly, but one that changes by a tenth during a frame makes errors of {:.0} %: faster lines or smaller \
         frames make them smaller",
        100.0 * .share, 10.0 * .share
    )]
    Large {
        /// Drift over the slow speed of the tip.
        share: f64,
    },
}

/// How dates contradict a line rate. Times are in s, rates in lines per second.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameDates {
    /// Frames follow each other faster than their lines.
    #[error(
        "two frames are dated {interval:.0} s apart, but the lines of one take {frame:.0} s at {rate} lines per second: \
         the line rate is higher than the headers say, or the dates are not those of the frames. The drift is wrong by \
         the same factor as the line rate"
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
        "the frames are dated {interval:.0} s apart, twice the {frame:.0} s that the lines of one take at {rate} lines \
         per second: either there was a pause as long as a frame before each of them, or the line rate is half of what \
         the headers say, and so is the drift"
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
        "The files do not tell when their lines were scanned, so that nothing is corrected for drift. Drift stretches and \
         shears a lattice and looks like strain."
        "Give line rate and frame direction, from the log of the measurement."
    Undetermined "drift-undetermined" Serious
        "The scans do not tell the drift, and nothing is corrected for it. Drift stretches and shears a lattice and looks \
         like strain."
        "Take frames up and down of the same place, one after the other. A drift that is known from elsewhere can be given."
    Given "drift-given" Note
        "The drift is the one that was given. Twist and strain are as right as it is: within its stated uncertainty, \
         which is in the errors."
        "Take frames up and down, which tell the drift of the scans themselves."
    HeadersContradictImages "headers-contradict-images" Serious
        "With another line rate or slow direction than the headers state, the scans fit together far better. An entry of \
         the headers is probably wrong, and the drift with it."
        "Compare line rate and frame direction with the log of the measurement, and give the right ones."
    FramesDoNotLink "frames-do-not-link" Serious
        "The lattice moves from frame to frame in a way that the drift within the frames does not explain. Drift and its \
         error are probably wrong; twist and strain suffer if the drift changed within frames."
        "Look for a move of the window, a jump or a pause between frames, and leave out the scans next to it. Check line \
         rate, dates and frame directions."
    DatesContradictLineRate "dates-contradict-line-rate" Warning
        "By their dates the frames took another time than their lines at the stated rate. If the line rate is wrong, the \
         drift is wrong by the same factor."
        "Compare the line rate with the log of the measurement. Trace and retrace may have been counted as two lines."
    NotJoined "drift-not-joined" Warning
        "No smooth drift goes through all sets. Their lattices, each with its own drift, were averaged, which tells less \
         than a fit to all."
        "Nothing, if hours or a move lie between the sets. Otherwise look for the set whose drift stands out."
    Changes "drift-changes" Warning
        "Frames up and down differ as if the drift changed within a frame. Their mean is free of what differs, but not of \
         what both have in common, and that looks like strain."
        "Wait until the instrument has settled, or scan faster and smaller frames."
    Large "large-drift" Warning
        "The sample moves at a good part of the speed at which lines follow each other. A constant drift is taken off, \
         but a small change of it within a frame makes large errors."
        "Scan faster lines or smaller frames, or wait until the drift is less."
}
