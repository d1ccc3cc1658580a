//! Doubts about whether a lattice is a moiré of the layers, and what its strain is worth.

use crate::caveat::explained::explain;

/// Whether the lattice is a moiré of the layers, and what its strain is worth.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MoireDoubt {
    /// More strain than layers have.
    #[error(
        "twist and strain are probably wrong: a heterostrain of {:.1} % is larger than any known between stacked \
         layers. An image distorted by drift or by the scanner, other layers than {layers}, or a lattice that is no \
         moiré would give the same numbers",
        100.0 * .strain
    )]
    LargeStrain {
        /// The heterostrain.
        strain: f64,
        /// The layers that were taken.
        layers: String,
    },
    /// The lattice would need more twist than the layers have.
    #[error(
        "only the vectors are given, no twist and strain. Periods of {:.4}, {:.4} and {:.4} nm cannot be a moiré of \
         {layers}: the twist would be {:.0}°, but layers of this symmetry have no twist beyond 30°. The image shows \
         the atoms or another lattice",
        .periods[0], .periods[1], .periods[2], .twist.to_degrees()
    )]
    NoMoire {
        /// The three wavelengths, nm.
        periods: [f64; 3],
        /// The twist that it would have, rad.
        twist: f64,
        /// The layers that were taken.
        layers: String,
    },
    /// No twist and strain of the layers make the lattice.
    #[error("only the vectors are given, no twist and strain: {0}")]
    LayersCannotMakeIt(Impossible),
    /// The lattice may be that of atoms or of a surface.
    #[error(transparent)]
    Doubtful(PeriodDoubt),
    /// The images leave much of the twist open.
    #[error(
        "an error of 1 % of the twist is likely: the images leave {:.1} % open (one standard deviation)",
        100.0 * .share
    )]
    TwistImprecise {
        /// Standard deviation of the twist by the images alone, as a share of it.
        share: f64,
    },
    /// The strain may be noise.
    #[error(
        "quote an upper limit of the heterostrain: it is below {:.4} % with 95 % confidence, and its axis is not \
         known. It is not significant (p = {p_value:.2})",
        .below * 100.0
    )]
    StrainNotSignificant {
        /// The chance of more without strain.
        p_value: f64,
        /// Upper limit, 95 %.
        below: f64,
    },
    /// The strain may be the scanner's.
    #[error(
        "only an upper limit of the heterostrain remains: with the whole budget it is below {:.4} % with 95 % \
         confidence. It is significant against the noise of the scans, but not against the calibration of the scanner \
         (p = {p_value:.2}). Scans of the sample turned by 90° can decide",
        .below * 100.0
    )]
    StrainWithinCalibration {
        /// The chance of more without strain, with everything in the budget.
        p_value: f64,
        /// Upper limit, 95 %.
        below: f64,
    },
}

/// Why layers make no such lattice.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Impossible {
    /// Its period is beyond that of aligned layers.
    #[error(
        "the period is {period:.1} nm; {layers} makes at most {longest:.1} nm. Only an isotropic strain of at least \
         {:.1} % could make it longer. It is a moiré of other layers, or no moiré",
        100.0 * .strain
    )]
    TooLong {
        /// Mean of the wavelengths, nm.
        period: f64,
        /// The layers.
        layers: String,
        /// That of aligned layers, nm.
        longest: f64,
        /// The isotropic strain that would make it.
        strain: f64,
    },
    /// No layers hold the strain that it takes.
    #[error(
        "it would take a heterostrain of {:.0} %, which no layers hold on each other. An image distorted by drift or by the scanner, a wrong \
         scan size, other layers than {layers}, or a lattice that is no moiré",
        100.0 * .strain
    )]
    Strain {
        /// The heterostrain.
        strain: f64,
        /// The layers.
        layers: String,
    },
    /// Another reason.
    #[error(
        "no twist and strain of {layers} explain a lattice with a period of {period:.1} nm: {reason}"
    )]
    NoSolution {
        /// Mean of the wavelengths, nm.
        period: f64,
        /// The layers.
        layers: String,
        /// Why.
        reason: String,
    },
}

/// Why a period may be that of something else.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PeriodDoubt {
    /// A surface has it.
    #[error(
        "twist and strain mean nothing if the images show {surface}: the period, {period:.3} nm, is that of this \
         surface ({constant} nm). The numbers assume a moiré of {layers}"
    )]
    OfSurface {
        /// Mean of the wavelengths, nm.
        period: f64,
        /// The surface.
        surface: String,
        /// Its period, nm.
        constant: f64,
        /// The layers that were taken.
        layers: String,
    },
    /// Few moirés are so short.
    #[error(
        "twist and strain mean nothing if the images show atoms or a surface: a period of {period:.3} nm is short for \
         a moiré. The numbers assume a moiré of {layers}"
    )]
    Short {
        /// Mean of the wavelengths, nm.
        period: f64,
        /// The layers that were taken.
        layers: String,
    },
}

explain! { MoireDoubt:
    LargeStrain "large-strain" Serious
        "The strain is larger than any known between stacked layers. A distorted image, other layers, or a lattice \
         that is no moiré are more likely than such a strain."
        "Check the layers, the scan size and the drift. Look at the image: does it show a moiré?"
    NoMoire "no-moire" Serious
        "The periods are too short for a moiré of the layers. Only the vectors are given, no twist and strain."
        "Name the layers of the sample. If the image shows atoms, scan a larger frame that shows the moiré."
    LayersCannotMakeIt "layers-cannot-make-it" Serious
        "No twist and strain of the named or assumed layers can make this lattice. Only the vectors are given, no \
         twist and strain."
        "Name the layers of the sample, and check the scan size."
    Doubtful "moire-doubtful" Warning
        "The period is that of a known surface, or very short for a moiré. If the images show atoms or a surface, \
         twist and strain mean nothing."
        "Look at the image. If it shows a moiré, name its layers."
    TwistImprecise "twist-imprecise" Warning
        "Noise, few periods, or spots that differ leave more than 1 % of the twist open, as one standard deviation."
        "Scan a larger frame, or take more frames of the place."
    StrainNotSignificant "strain-not-significant" Note
        "The heterostrain is not significantly different from zero. The result is its upper limit. Its axis is not \
         known."
        "Quote the upper limit. More scans make it smaller."
    StrainWithinCalibration "strain-within-calibration" Warning
        "The images agree on a strain, but the scanner may have caused it: a difference of the gains of its axes looks \
         the same. With the whole budget only an upper limit remains."
        "Calibrate the scanner with a known lattice, or scan the place again with the sample turned by 90°."
}
