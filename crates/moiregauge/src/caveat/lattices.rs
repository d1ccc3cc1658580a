//! Doubts about the lattice of one image.

use crate::caveat::explained::explain;
use crate::coverage::choose::BETTER;
use crate::lattice::measured::Candidate;

/// The lattice of one image.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LatticeDoubt {
    /// The frame holds few periods.
    #[error(
        "each spot that differs moves the result, since only {periods:.1} lattice periods fit across the frame. Scan a \
         larger frame: {enough} periods or more"
    )]
    FewPeriods {
        /// How many across the shorter side.
        periods: f64,
        /// The power that suffices.
        enough: f64,
    },
    /// Trace and retrace do not show the same.
    #[error(transparent)]
    LinesDisagree(LineDifference),
    /// The lattice changes across the frame.
    #[error(
        "the results are means over the frame, since the lattice varies across it: its wavelength by up to {:.2} % and \
         its direction by up to {:.2}° from corner to corner. Creep or a changing drift causes the same pattern along \
         the slow axis. Map the lattice to see where it varies (χ² {chi_squared:.0} for 14 numbers; up to \
         {threshold:.0} is consistent with noise)",
        100.0 * .wavelength, .angle.to_degrees()
    )]
    Inhomogeneous {
        /// Largest change of the wavelength, as a share of it.
        wavelength: f64,
        /// Largest change of the direction, rad.
        angle: f64,
        /// χ² of the change.
        chi_squared: f64,
        /// What can be chance.
        threshold: f64,
    },
    /// The lattice covers a part of the frame.
    #[error(
        "the results are those of a part of the frame: the lattice covers {:.0} % of it, {unit_cells:.0} unit cells. \
         The figure of the scan shows where",
        100.0 * .share
    )]
    PartlyCovered {
        /// Share of the frame.
        share: f64,
        /// Unit cells of the lattice in it.
        unit_cells: f64,
    },
    /// Ground was taken off.
    #[error(
        "the lattice was measured after a background was subtracted that is stronger than it (steps, bumps, slopes): a \
         running median over {window:.1} nm of the image without the lattice"
    )]
    GroundTakenOff {
        /// Side of the window, nm.
        window: f64,
    },
    /// The lattice changes, and the result is its mean.
    #[error(
        "the results are means over {part}, since the lattice varies across it: its wavelength by {:.2} % and its \
         direction by {:.2}° (standard deviation over the area), {}. Creep or a changing drift causes the same pattern \
         along the slow axis. Map the lattice to see where it varies ({})",
        100.0 * .wavelength, .angle.to_degrees(), if *.evenly { "evenly" } else { "smoothly" }, how_sure(*.evidence)
    )]
    Changes {
        /// The frame, or the part of it that the lattice covers.
        part: &'static str,
        /// Standard deviation of the wavelength, as a share of it.
        wavelength: f64,
        /// Standard deviation of the direction, rad.
        angle: f64,
        /// Whether the wave vectors change in proportion to the place.
        evenly: bool,
        /// By how much its evidence exceeds that for a lattice that is the same everywhere.
        evidence: f64,
    },
    /// Several lattices lie side by side.
    #[error(
        "each grain that could be measured has its own results, and there is no mean of all: the frame shows {} \
         lattices side by side. Beside the largest: {}",
        1 + .others.len(), listed(.others)
    )]
    SeveralGrains {
        /// The other grains, as they compare with the largest.
        others: Vec<OtherGrain>,
    },
    /// The harmonics are not those of one lattice.
    #[error(
        "the errors of the vectors were enlarged {times:.1} times, since the harmonics of the image do not agree on \
         one lattice. Often the lattice varies across the frame: map it, or analyse a smaller part (χ² \
         {chi_squared:.0} for {degrees_of_freedom} degrees of freedom)"
    )]
    HarmonicsDisagree {
        /// χ² of the harmonics against one lattice.
        chi_squared: f64,
        /// Its degrees of freedom.
        degrees_of_freedom: usize,
        /// By how much the errors are enlarged.
        times: f64,
    },
    /// Other waves are as strong.
    #[error(
        "the lattice may be the wrong one: {rivals} Fourier peaks of about its period do not belong to it and are as \
         strong as its weakest first-order peak (stripes, or a second moiré). Look at the Fourier transform of the \
         image, and give the approximate wavelength of the right lattice"
    )]
    Rivals {
        /// How many they are.
        rivals: usize,
    },
    /// Another lattice predicts the image about as well.
    #[error(
        "{} {:.0} % of the image where this one predicts {:.0} %, which is {} by {:.1} standard errors",
        other_lattice(.other), 100.0 * .other.share, 100.0 * .whole.share, if .other.behind < 0.0 { "better" } else { "worse" }, .other.behind.abs()
    )]
    OtherLattice {
        /// The lattice that was measured.
        whole: Candidate,
        /// The other one.
        other: Candidate,
    },
    /// The lattice may be that of a part of the cell.
    #[error(
        "all wavelengths may be too long by √{}, if the lattice is a superlattice of the right one. Look at the \
         Fourier transform of the image, and give the approximate wavelength of the right lattice. The harmonics of \
         the smaller cell ({}) alone predict {:.0} % of the image, all together {:.0} %; the rest may be a second \
         moiré",
        .part.cells, nanometres(&.part.wavelengths), 100.0 * .part.share, 100.0 * .whole.share
    )]
    PartOfCell {
        /// The lattice that was measured.
        whole: Candidate,
        /// That of a part of its cell.
        part: Candidate,
    },
    /// A second lattice was measured with it.
    #[error(
        "the image shows a second lattice ({}) on top of the one that was measured, and the two were measured \
         together. Ask for two moirés to get the results of both",
        nanometres(.second)
    )]
    TwoLattices {
        /// Wavelengths of the second lattice, nm.
        second: [f64; 3],
    },
    /// There is another wave.
    #[error(
        "a wave with a period of {period:.2} nm does not belong to the lattice: a second moiré, or interference. If the \
         image shows two moirés, measure both (its amplitude is {strength:.2} of that of the weakest wave of the lattice; \
         it predicts held-out parts of the image by {predicts:.1} standard errors)"
    )]
    SecondLattice {
        /// Its period, nm.
        period: f64,
        /// Its amplitude over that of the weakest first-order wave of the lattice.
        strength: f64,
        /// By how many standard errors it improves the prediction of held-out blocks.
        predicts: f64,
    },
    /// The published method was asked for.
    #[error(
        "lattice vectors are too short by about one per cent at four to five periods, and the twist is too large by \
         the same fraction. The published method does not divide the autocorrelation by the overlap, and takes peaks \
         at whole pixels. Use it for comparison only"
    )]
    MethodPaperBias,
    /// Lines were levelled one by one.
    #[error(
        "lattice vectors may be biased, since each line was levelled by itself. This damages harmonics whose crests \
         run along the fast axis. Subtract a plane instead"
    )]
    LineLevelling,
}

/// A grain beside the one that is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct OtherGrain {
    /// Its share of the frame.
    pub share: f64,
    /// Its wavelengths, nm.
    pub wavelengths: [f64; 3],
    /// By how much its moiré is turned against that of the largest, rad counter-clockwise.
    pub turned: f64,
    /// Length of the boundary at which it was told apart, nm.
    pub boundary: f64,
}

fn listed(all: &[OtherGrain]) -> String {
    let of = |grain: &OtherGrain| {
        let [a, b, c] = grain.wavelengths;
        format!(
            "{a:.2}, {b:.2}, {c:.2} nm on {:.0} % of the frame, rotated by {:.1}°, behind a boundary of {:.0} nm",
            100.0 * grain.share,
            grain.turned.to_degrees(),
            grain.boundary
        )
    };
    all.iter().map(of).collect::<Vec<_>>().join("; ")
}

/// What another lattice means for the result and what to do, up to the figures.
fn other_lattice(other: &Candidate) -> String {
    let own = nanometres(&other.wavelengths);
    other.second.map_or_else(
        || {
            format!(
                "the image does not decide between two lattices. Look at its Fourier transform, and give the \
                 approximate wavelength of the right one. The other lattice ({own}) predicts"
            )
        },
        |second| {
            format!(
                "the lattice may lie between two that the image shows on top of each other. Measure two moirés. Both \
                 together ({own} and {}) predict",
                nanometres(&second)
            )
        },
    )
}

/// Three lengths, nm.
fn nanometres([a, b, c]: &[f64; 3]) -> String {
    format!("{a:.2}, {b:.2}, {c:.2} nm")
}

/// How sure it is that a lattice changes.
fn how_sure(by_windows: f64) -> String {
    if by_windows > BETTER {
        format!("evidence {by_windows:.0}; up to {BETTER:.0} is consistent with noise")
    } else {
        "the residual of the fit to the pixels shows it".to_owned()
    }
}

/// How trace and retrace differ. Wavelengths are in nm.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LineDifference {
    /// They show different lattices.
    #[error(
        "the scan is not used: {} ({}). At least one of them is not the lattice of the sample",
        Self::OTHER_LATTICES, wavelengths(.trace, .retrace)
    )]
    OtherLattices {
        /// Of the trace.
        trace: [f64; 3],
        /// Of the retrace.
        retrace: [f64; 3],
    },
    /// They differ by more than their errors.
    #[error(
        "the vectors are less certain than their errors say, since trace and retrace differ by {:.2} %. Possible \
         causes: creep or hysteresis of the scanner, a lag of the sensors, or a drift that is not small against the \
         speed of the tip. Look at both images (χ² {chi_squared:.0} for 4 numbers; {})",
        100.0 * .share, wavelengths(.trace, .retrace)
    )]
    BeyondErrors {
        /// As a share of the vectors.
        share: f64,
        /// χ² of the difference.
        chi_squared: f64,
        /// Of the trace.
        trace: [f64; 3],
        /// Of the retrace.
        retrace: [f64; 3],
    },
}

impl LineDifference {
    /// Why a scan is not used.
    pub const OTHER_LATTICES: &str = "trace and retrace show different lattices";
}

fn wavelengths(trace: &[f64; 3], retrace: &[f64; 3]) -> String {
    let of = |[a, b, c]: &[f64; 3]| format!("{a:.4}, {b:.4}, {c:.4} nm");
    format!("{} in trace, {} in retrace", of(trace), of(retrace))
}

explain! { LatticeDoubt:
    FewPeriods "few-periods" Note
        "The frame holds only a few periods. Lattice, harmonics and background are then hard to separate, and each spot \
         that differs moves the result."
        "Scan a larger frame."
    LinesDisagree "lines-disagree" Warning
        "Trace and retrace of one scan give lattices that differ by more than their errors. The usual causes are \
         creep, hysteresis or a lag of the sensors. If the two show different lattices, the scan is not used."
        "Look at both images, and use the line direction that is right. Slower lines and more overscan make the \
         difference smaller."
    Inhomogeneous "inhomogeneous-lattice" Note
        "The lattice changes across the frame by more than chance. The results are means over the frame. A part of the \
         change may come from creep or from a drift that changed."
        "Map the lattice to see where it changes. Compare frames up and down: a change that has opposite signs in the \
         two is drift or creep."
    PartlyCovered "partly-covered" Note
        "The lattice covers only a part of the frame, as at an edge, around a hole or on an island. It was measured in \
         this part, and the rest was left out."
        "Look at the figure of the scan: the outline shows where the lattice was measured."
    GroundTakenOff "ground-taken-off" Note
        "Steps, bumps, a rough background, spikes, line offsets or inverted contrast hide the lattice. It was found and \
         measured in the image without them. A part of a background that is as short as the lattice is left, alike in all frames."
        "Look at the figure of the scan. A channel that shows less topography, as the phase, serves better."
    Changes "changing-lattice" Note
        "The lattice changes across the frame by more than chance. The results are means over the area that it covers. \
         Their errors include how far the means depend on where this area ends."
        "Map the lattice to see where it changes. Compare frames up and down: a change that has opposite signs in the \
         two is drift or creep."
    SeveralGrains "several-grains" Note
        "Two or more lattices lie side by side in the frame. Each of them that could be measured is a set of its own, \
         together with the other scans that show it. There is no mean of all."
        "Look at the outlines in the figures of the scans, or map the frame."
    HarmonicsDisagree "harmonics-disagree" Warning
        "The harmonics of the image do not agree on one lattice. This happens where the lattice is not the same \
         everywhere. The errors of the vectors were enlarged to match."
        "Map the lattice, or analyse a smaller part of the frame."
    OtherLattice "other-lattice" Serious
        "Another lattice predicts the image about as well, within four standard errors, or better with waves that may belong to something else. The image does not decide which one it shows: a second moiré, holes or a rough \
         background may have made either. Or two lattices on top of each other predict it better, and the one that was measured lies between them."
        "Look at the Fourier transform of the image. Give the approximate wavelength of the right lattice, or measure two moirés."
    PartOfCell "part-of-cell" Serious
        "Most of the image is predicted by a lattice of a third or a fourth of the cell, and the other harmonics do not agree with it: they may be a second \
         moiré that comes near the points of a superlattice. Then all wavelengths are too long by √3 or 2, and the twist of two equal layers is too small by as much."
        "Look at the Fourier transform of the image. Give the approximate wavelength of the right lattice, or measure two moirés."
    Rivals "rival-waves" Serious
        "One or two waves of about the period of the lattice, and none of its own, are as strong as its weakest one: stripes, or a second moiré. With three the \
         image would be refused, since these could be a lattice as well."
        "Look at the Fourier transform of the image. Give the approximate wavelength of the right lattice, or measure two moirés."
    TwoLattices "two-lattices" Note
        "The image shows a second lattice on top of the one that makes most of it. Both were measured together, which \
         predicts the image better than one alone, and the results are those of the stronger one."
        "Ask for two moirés to get the results of both."
    SecondLattice "second-lattice" Note
        "The image shows a wave, well above the noise, that does not belong to the lattice. It may come from a second \
         moiré or from interference."
        "Look at the Fourier transform of the image. If the image shows two moirés, measure both."
    MethodPaperBias "method-paper-bias" Warning
        "The published method gives lattice vectors that are about one per cent too short, and a twist that is too \
         large by the same fraction. It is meant for comparison."
        "Use the fit of the lattice (the default method) for results."
    LineLevelling "line-levelling" Warning
        "Each line was levelled by itself. This removes a part of the harmonics whose crests run along the fast axis. \
         The vectors may be biased."
        "Subtract a plane, and level single lines only if the image cannot be measured otherwise."
}
