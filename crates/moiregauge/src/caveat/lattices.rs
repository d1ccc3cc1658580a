//! Doubts about the lattice of one image.

use crate::caveat::explained::explain;

/// The lattice of one image.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LatticeDoubt {
    /// The frame holds few periods.
    #[error(
        "only {periods:.1} lattice periods fit across the frame; vectors from fewer than {enough} are less accurate than \
         their errors say"
    )]
    FewPeriods {
        /// How many across the shorter side.
        periods: f64,
        /// So many would do.
        enough: f64,
    },
    /// Trace and retrace do not show the same.
    #[error(transparent)]
    LinesDisagree(LineDifference),
    /// The lattice changes across the frame.
    #[error(
        "the lattice is not the same everywhere in the frame: from corner to corner its wavelength changes by up to \
         {:.2} % and its direction by up to {:.2}° (χ² {chi_squared:.0} for 6 numbers; {threshold:.0} can be chance). \
         Results are means over the frame. Drift that got faster or slower, and creep, look like this along the slow \
         axis",
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
        "the lattice covers {:.0} % of the frame, {unit_cells:.0} unit cells; the rest shows none and is left out",
        100.0 * .share
    )]
    PartlyCovered {
        /// Share of the frame.
        share: f64,
        /// Unit cells of the lattice in it.
        unit_cells: f64,
    },
    /// The lattice changes, and the result is its mean.
    #[error(
        "the lattice changes across {part}: its wavelength by {:.2} % and its direction by {:.2}° (standard deviation over \
         the area), {} (evidence {evidence:.0}; 20 can be chance). Results are means over the area. Drift that got \
         faster or slower, and creep, look like this along the slow axis",
        100.0 * .wavelength, .angle.to_degrees(), if *.evenly { "evenly" } else { "smoothly" }
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
        "the frame shows {} lattices side by side; the numbers are those of the largest. The others: {}",
        1 + .others.len(), listed(.others)
    )]
    SeveralGrains {
        /// The other grains, as they compare with the largest.
        others: Vec<OtherGrain>,
    },
    /// The harmonics are not those of one lattice.
    #[error(
        "the harmonics of the image do not agree on one lattice (χ² {chi_squared:.0} for {degrees_of_freedom} degrees of \
         freedom): each of them is the mean over another part of a lattice that is not the same everywhere; the errors \
         of the vectors are enlarged {times:.1} times"
    )]
    HarmonicsDisagree {
        /// χ² of the harmonics against one lattice.
        chi_squared: f64,
        /// Its degrees of freedom.
        degrees_of_freedom: usize,
        /// By how much the errors are enlarged.
        times: f64,
    },
    /// There is another wave.
    #[error(
        "beside the lattice a wave with a period of {period:.2} nm stands out of what the fit leaves ({significance:.0} \
         times the noise around it; {threshold:.0} can be chance): a second lattice, interference, or a lattice that is \
         not the same everywhere in the frame"
    )]
    SecondLattice {
        /// Its period, nm.
        period: f64,
        /// Its power over that of the noise.
        significance: f64,
        /// What can be chance.
        threshold: f64,
    },
    /// The published method was asked for.
    #[error(
        "the published method sums the autocorrelation without dividing by the overlap: lattice vectors come out too \
         short by about a per cent at four to five periods (twist too large by the same fraction) and whole-pixel peaks \
         quantise them; it is meant for comparison"
    )]
    MethodPaperBias,
    /// Lines were levelled one by one.
    #[error(
        "each line was levelled on its own: harmonics near the fast axis are damaged and lattice vectors may be biased"
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
}

fn listed(all: &[OtherGrain]) -> String {
    let of = |grain: &OtherGrain| {
        let [a, b, c] = grain.wavelengths;
        format!(
            "{a:.2}, {b:.2}, {c:.2} nm on {:.0} % of the frame, turned by {:.1}°",
            100.0 * grain.share,
            grain.turned.to_degrees()
        )
    };
    all.iter().map(of).collect::<Vec<_>>().join("; ")
}

/// How trace and retrace differ. Wavelengths are in nm.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LineDifference {
    /// They show different lattices.
    #[error(
        "{} ({}): one of them is none of the sample's; the scan is not used",
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
        "trace and retrace differ by {:.2} %, more than their errors say (χ² {chi_squared:.0} for 4 numbers; {}): creep \
         or hysteresis of the scanner, sensors that lag behind, or a drift that is not small against the tip's speed",
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
    FewPeriods "few-periods" Warning
        "The frame holds so few periods that the lattice, harmonics and background are hard to tell apart. The vectors \
         are less accurate than their errors say."
        "Scan a larger frame."
    LinesDisagree "lines-disagree" Warning
        "Trace and retrace of one scan give lattices that differ by more than their errors; scans whose line directions \
         show different lattices are not used. Creep, hysteresis or a lag of the sensors do this."
        "Look at both images, and use the line direction that you believe. Slower lines and more overscan make the \
         difference smaller."
    Inhomogeneous "inhomogeneous-lattice" Warning
        "The lattice changes across the frame by more than chance. The numbers are means over the frame, and a drift that \
         changed or creep may be a part of the change."
        "Map the lattice to see where it changes. Compare frames up and down: what changes its sign with them is drift \
         or creep."
    PartlyCovered "partly-covered" Note
        "The lattice covers a part of the frame only: an edge, a hole, an island. It was measured there, and the rest was \
         left out."
        "Look at the figure of the scan: the outline shows where the lattice was measured."
    Changes "changing-lattice" Warning
        "The lattice changes across the frame by more than chance. The numbers are means over the area that it covers, \
         and their errors know how far these means depend on where the area ends."
        "Map the lattice to see where it changes. Compare frames up and down: what changes its sign with them is drift \
         or creep."
    SeveralGrains "several-grains" Warning
        "Two or more lattices lie side by side in the frame. The numbers are those of the largest grain."
        "Crop to each grain to measure it by itself, or map the frame."
    HarmonicsDisagree "harmonics-disagree" Warning
        "The harmonics of the image do not agree on one lattice, as where it is not the same everywhere. The errors of \
         the vectors were enlarged to match."
        "Map the lattice, or analyse a smaller part of the frame."
    SecondLattice "second-lattice" Warning
        "A wave that does not belong to the lattice stands out of the noise. It can be a second moiré, interference, or a \
         lattice that changes across the frame."
        "Look at the Fourier transform of the image. If there are two moirés, measure both."
    MethodPaperBias "method-paper-bias" Warning
        "The published method makes lattice vectors too short, and the twist too large, by about a per cent. It is there \
         for comparison."
        "Use the fit of the lattice for results."
    LineLevelling "line-levelling" Warning
        "Levelling of single lines takes off what varies along the slow axis alone, and with it a part of the harmonics \
         near the fast axis. The vectors may be biased."
        "Subtract a plane and not line means, unless the image cannot be measured otherwise."
}
