//! Doubts about how scans and sets agree.

use crate::caveat::explained::explain;

/// How scans and sets agree.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SetDoubt {
    /// Two images, of one scan or of a set, show a lattice and a harmonic shell of it.
    #[error(
        "the set has vectors only, no twist and strain. Its images show two lattices, and the cell of one is {times} \
         times that of the other. Where noise hides the first-order peaks, a harmonic shell looks like a lattice of \
         its own. Give the approximate wavelength of the right lattice"
    )]
    ShellForLattice {
        /// How many times the cell.
        times: i32,
    },
    /// The lattice changes by no more than the scanner may bend.
    #[error(
        "do not read the variation of the lattice across the frame as strain: it is {:.1} % (standard deviation), and \
         a scanner that no position sensor recorded makes {:.1} % by the bends that the settings assume",
        100.0 * .change, 100.0 * .bends
    )]
    ChangeOfScanner {
        /// Standard deviation of wavelength or direction, as a share.
        change: f64,
        /// What bends make of it.
        bends: f64,
    },
    /// The drift would be faster than the slow scan.
    #[error(
        "the set has vectors only, no twist and strain. Its scans fit together only with a drift of {share:.1} times \
         the speed of the slow scan, and no sample drifts like this: at least one scan shows another lattice, or its \
         header has the wrong direction or rate. Look at the figures of the scans"
    )]
    DriftOutrunsScan {
        /// Drift over the slow speed of the tip.
        share: f64,
    },
    /// Grains of the same scans drift differently.
    #[error(
        "this grain has vectors only, no twist and strain. Its drift and that of {other} differ by {nm_per_min:.2} \
         nm/min, more than their errors allow. Grains of the same frames drift alike, so at least one shows another \
         lattice. Analyse each grain by itself"
    )]
    GrainsContradict {
        /// How far apart.
        nm_per_min: f64,
        /// The other.
        other: String,
    },
    /// Scans scatter by more than their errors.
    #[error("{}", scattered(*.of, *.chi2_per_dof, *.share))]
    Scatter {
        /// Which scans.
        of: Scattered,
        /// χ² per degree of freedom.
        chi2_per_dof: f64,
        /// By how much a length differs between scans at most, as a share of it.
        share: Option<f64>,
    },
    /// A scan is far from the mean.
    #[error(
        "a single scan may be wrong: one of its wavelengths differs by more than 1 % from that of the set. Look at the \
         scan"
    )]
    OutsideOnePercent,
    /// A scan does not fit the others.
    #[error(
        "the mean includes a scan that does not fit the others. Look at it, and exclude it if it shows a jump, a tip \
          change or another place (χ² = {chi_squared:.0} for {degrees_of_freedom} degrees of freedom, p = \
          {p_value:.0e}{}; {})",
        .displacement.map_or_else(String::new, |d| format!(", {d:.3} nm from where the others have it")),
        if *.by_rule {
            "the rule never leaves out more than a fifth of the scans"
        } else {
            "it is used nevertheless"
        }
    )]
    OutlyingScan {
        /// χ² of the scan against the others.
        chi_squared: f64,
        /// Its degrees of freedom.
        degrees_of_freedom: usize,
        /// The chance of more.
        p_value: f64,
        /// Its distance from where the others have it, nm.
        displacement: Option<f64>,
        /// Whether outliers are left out by rule.
        by_rule: bool,
    },
    /// A scan was left out by rule.
    #[error("the scan was left out by the rule for outliers: {reason}")]
    ScanLeftOut {
        /// Why.
        reason: String,
    },
    /// Leaving out single scans changes results by more than their errors.
    #[error("trust the larger errors that leaving out one scan at a time gives: {larger}")]
    ScatterOfScans {
        /// Which numbers, and how many times.
        larger: String,
    },
    /// Scans of different lattices were put into one set by hand.
    #[error(
        "the mean of the set belongs to no sample. Its scans were put into one set by hand, but {0}"
    )]
    SamplesMixed(DifferentSamples),
    /// Scans of different lattices were taken apart.
    #[error("each lattice became a set of its own, and there is no mean over them, since {0}")]
    SamplesSeparated(DifferentSamples),
    /// Sets show different lattices.
    #[error(
        "there is no mean over the sets, since their lattices differ by up to {:.1} %. They come from different places \
         or samples: analyse each by itself",
        100.0 * .share
    )]
    DifferentLattices {
        /// The largest difference, as a share.
        share: f64,
    },
    /// Sets differ by more than their errors. Distances are in standard deviations.
    #[error(
        "the errors of the combined values were enlarged, since the sets are {drift:.1} σ apart in drift, {twist:.1} σ \
         in twist and {strain:.1} σ in strain. Possible causes: a drift that changes in time, or a scanner whose axes \
         have different gains"
    )]
    SetsDisagree {
        /// Of their drifts.
        drift: f64,
        /// Of their twists.
        twist: f64,
        /// Of their strains.
        strain: f64,
    },
}

/// Which scans scatter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Scattered {
    /// Those of a set of moirés.
    Moires,
    /// Those of a known lattice.
    KnownLattice,
}

/// Scans that show different lattices.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "the scans show {count} different lattices ({names}), which differ {}; drift cannot change a lattice in this way. \
     The scans come from different samples or places, or some of them show something else than the lattice",
    by_how_much(*.apart)
)]
#[non_exhaustive]
pub struct DifferentSamples {
    /// How many lattices.
    pub count: usize,
    /// What tells them apart.
    pub names: String,
    /// By how much they differ along the fast axis, as a share; infinite where it is along the slow axis.
    pub apart: f64,
}

fn by_how_much(apart: f64) -> String {
    if apart.is_finite() {
        format!("by {:.1} % or more along the fast axis", 100.0 * apart)
    } else {
        "by more than any plausible drift along the slow axis".to_owned()
    }
}

fn scattered(of: Scattered, chi2_per_dof: f64, share: Option<f64>) -> String {
    let times = chi2_per_dof.sqrt();
    let lengths = share.map_or_else(String::new, |share| {
        format!(
            ", and lengths differ by up to {:.1} % between scans",
            100.0 * share
        )
    });
    match of {
        Scattered::Moires => format!(
            "the errors of the set were enlarged, since the scans scatter {times:.1} times more than their errors allow \
             (χ²/dof = {chi2_per_dof:.1}){lengths}. Possible causes: a drift that changes, an inhomogeneous lattice, errors of \
             the sensors"
        ),
        Scattered::KnownLattice => format!(
            "the errors were enlarged, since the images scatter {times:.1} times more than their errors allow{lengths}. \
             Possible causes: a drift that changes, creep (along the slow axis it passes for drift), or an inhomogeneous \
             lattice"
        ),
    }
}

explain! { SetDoubt:
    ChangeOfScanner "change-of-scanner" Note
        "No position sensor says how the scanner bends, and hysteresis of a usual size makes as large a change of the lattice. The mean over a whole frame \
         hardly changes; the budget has the effect on a part of the frame."
        "Record the position sensors, or scan the place again turned by 90°: a change that turns with the frame is the scanner's."
    ShellForLattice "shell-for-lattice" Serious
        "One image shows a lattice whose cell is two to four times that of the others. The first-order peaks of the lattice \
         are weak. Where noise hides them, a harmonic shell is taken for the lattice. There is no result for the set."
        "Look at the figures of both line directions. Give the approximate wavelength of the right lattice, or choose \
         the channel with the stronger first-order peaks."
    DriftOutrunsScan "drift-outruns-scan" Serious
        "The scans fit together only with a drift that is faster than the slow scan. No sample drifts like this. At least \
         one scan shows another lattice, or its header is wrong. There is no result for the set."
        "Look at the figures of the scans, and compare the headers with the notebook. Give the approximate wavelength of \
         the lattice, or exclude the scan that shows another one."
    GrainsContradict "grains-contradict" Serious
        "Two grains of the same frames seem to drift differently. This cannot be: in one of them something else was taken \
         for the lattice, or the scans of one show different lattices. There is no result for the grain that is less \
         certain, or for both."
        "Look at the outlines in the figures of the scans. Analyse each grain by itself, with a region or a mask."
    Scatter "scatter" Warning
        "The scans of a set differ from each other by more than their errors say. The errors of the set were enlarged to \
         match."
        "Look for the scan that stands out, and for a drift that changes. Take more frames."
    OutsideOnePercent "outside-one-percent" Note
        "A wavelength of at least one scan is more than 1 % away from that of the set."
        "Look at that scan: few periods, a jump or another place."
    OutlyingScan "outlying-scan" Warning
        "One scan does not fit the others, by more than chance. It is used nevertheless and affects the mean."
        "Look at the scan. If it shows a jump, a tip change or another place, exclude it."
    ScanLeftOut "scan-left-out" Note
        "A scan did not fit the others and was left out by the rule that was asked for."
        "Look at the scan to find the reason. State the rule together with the result."
    ScatterOfScans "scatter-of-scans" Warning
        "Results change by more than their errors when single scans are left out. The errors from leaving out scans \
         are more reliable."
        "Use the larger errors. If the scatter is chance, more scans up and down make both errors agree."
    SamplesMixed "samples-mixed" Serious
        "A set that was made by hand holds scans of different lattices. Its mean belongs to no sample."
        "Make one set for each sample or place."
    SamplesSeparated "samples-separated" Warning
        "The scans show different lattices. Each lattice became a set of its own, and there is no mean over all scans."
        "Nothing, if the scans come from several samples or places. Otherwise look at the figures: in some scans \
         something else was taken for the lattice."
    DifferentLattices "different-lattices" Serious
        "The sets show different lattices, so there is no mean over them. They come from different places or samples, \
         or one set is wrong."
        "Analyse each place by itself, or find the set whose scale or line rate is wrong."
    SetsDisagree "sets-disagree" Warning
        "Two sets differ in drift, twist or strain by more than three standard deviations. The errors of their mean \
         were enlarged to match."
        "If the drifts differ, the drift changed in time. If the strains differ, the axes of the scanner may have \
         different gains: calibrate the scanner."
}
