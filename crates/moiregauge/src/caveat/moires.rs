//! Doubts about whether a lattice is a moiré of the layers, and what its strain is worth.

use crate::caveat::explained::explain;

/// Whether the lattice is a moiré of the layers, and what its strain is worth.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MoireDoubt {
    /// More strain than layers have.
    #[error(
        "a heterostrain of {:.1} % is more than layers on each other are known to have: an image that drift or the \
         scanner distorts, other layers than {layers}, or a lattice that is no moiré would give the same numbers",
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
        "periods of {:.4}, {:.4} and {:.4} nm are no moiré of {layers}: its twist would be {:.0}°, and layers of this \
         symmetry have none beyond 30°. This is the lattice of the atoms, or another one; its vectors are given, twist \
         and strain are not",
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
    #[error("{0}. Its vectors are given, twist and strain are not")]
    LayersCannotMakeIt(Impossible),
    /// The lattice may be that of atoms or of a surface.
    #[error(transparent)]
    Doubtful(PeriodDoubt),
    /// The strain may be noise.
    #[error(
        "the heterostrain is not significant (p = {p_value:.2}); it is below {:.4} % with 95 % confidence and has no axis",
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
        "the heterostrain stands out of the noise of the scans but not of the calibration of the scanner (p = \
         {p_value:.2}): with everything in the budget it is below {:.4} % with 95 % confidence; scans of the sample \
         turned by 90° would tell",
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
        "the period is {period:.1} nm; {layers} makes at most {longest:.1} nm. Only layers strained by at least {:.1} % \
         in all directions could make it: it is a moiré of other layers, or none",
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
        "the period, {period:.3} nm, is that of {surface} ({constant} nm): if the images show that, there is no twist; \
         the numbers take it for a moiré of {layers}"
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
        "a period of {period:.3} nm is short for a moiré: if the images show atoms or a surface, there is no twist; the \
         numbers take it for a moiré of {layers}"
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
        "The strain is larger than layers on each other are known to have. A distorted image, other layers, or a lattice \
         that is no moiré are more likely than such a strain."
        "Make sure of the layers, of the scan size and of the drift. Look at the image: is it a moiré?"
    NoMoire "no-moire" Serious
        "The periods are too short for a moiré of the layers. Vectors are given, twist and strain are not."
        "Name the layers that the sample has. If the image shows atoms, take a larger frame of the moiré."
    LayersCannotMakeIt "layers-cannot-make-it" Serious
        "No twist and strain of the layers that were named or assumed make this lattice. Vectors are given, twist and \
         strain are not."
        "Name the layers that the sample has, and check the scan size."
    Doubtful "moire-doubtful" Warning
        "The period is that of atoms or of a known surface, or very short for a moiré. If that is what the images show, \
         twist and strain mean nothing."
        "Look at the image. If it is a moiré, name its layers."
    StrainNotSignificant "strain-not-significant" Note
        "The heterostrain cannot be told from none. Its upper limit is the result, and it has no axis."
        "Quote the upper limit. More scans make it smaller."
    StrainWithinCalibration "strain-within-calibration" Warning
        "The images agree on a strain, but the scanner may have made it: gains of its axes that differ look the same. With \
         everything in the budget only an upper limit is left."
        "Calibrate the scanner with a known lattice, or scan the place again with the sample turned by 90°."
}
