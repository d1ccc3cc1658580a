//! Doubts about what else a lattice can mean.

use crate::caveat::explained::explain;

/// What else the lattice can mean.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReadingDoubt {
    /// Layers of different size: isotropic strain and twist cannot be told apart.
    #[error(
        "the layers of {layers} differ in size, so that twist and strain trade at first order: the moiré is as well one \
         of {}; {}{}. The orientation of a layer would tell",
        all_choices(.choices), by_shift(*.shift), in_all(*.interval)
    )]
    TwistTradesWithStrain {
        /// The layers.
        layers: String,
        /// Twist (rad) and strain of each reading.
        choices: Vec<[f64; 2]>,
        /// What 0.1 % of isotropic strain does to the twist; `None` where it was not asked.
        shift: Option<TwistShift>,
        /// From which twist to which, rad.
        interval: Option<[f64; 2]>,
    },
    /// Larger than aligned layers make it.
    #[error(
        "no twist and uniaxial strain of {layers} make a moiré as large as this one (up to {longest:.3} nm): it is read \
         as aligned layers, θ = 0; isotropic strain, the lattice constants or the gain of the scanner account for the \
         rest"
    )]
    LargerThanAligned {
        /// The layers.
        layers: String,
        /// The longest wavelength, nm.
        longest: f64,
    },
    /// The twist may be zero.
    #[error(
        "the twist cannot be told from zero: near alignment the moiré depends on θ², and σ of a small θ means little; \
         θ < {} (95 %, statistical errors alone)",
        degrees(*.limit)
    )]
    AlignmentWithinErrors {
        /// Upper limit, 95 %, rad.
        limit: f64,
    },
    /// The layers differ in size by more than uniaxial strain does.
    #[error(
        "with the orientation of layer {layer} the layers differ in size by {}, more than uniaxial strain brings with it: \
         `twist_deg` assumes that there is none, and differs by {} from the magnitude of the twist of `strain_tensor`, \
         which does not",
        all_sizes(.sizes), degrees(*.difference)
    )]
    IsotropicStrainFound {
        /// The layer whose orientation is known.
        layer: u8,
        /// The two biaxial parts, for either sense of the twist that is open.
        sizes: Vec<[f64; 2]>,
        /// Between the twists, rad.
        difference: f64,
    },
    /// Other pairs of vectors are as plausible.
    #[error(
        "the same lattice has other pairs of vectors, and the strain that these need is plausible, too: {reported} is \
         the reading that is reported, but it can as well be {}. {} The orientation of a layer may tell; all readings \
         with up to {:.2} % are under `readings.solutions`",
        joined(.open, ", or "),
        if *.by_image {
            "The image speaks against others, not against these."
        } else {
            "The image does not tell them apart: no three waves in it are equally strong while one of each other reading \
             is weak, or they were not measured."
        },
        100.0 * .complete_to
    )]
    NamesCompete {
        /// The one that is reported.
        reported: NumbersOfName,
        /// The others.
        open: Vec<NumbersOfName>,
        /// Whether the image chose among more.
        by_image: bool,
        /// No reading up to this strain is missing.
        complete_to: f64,
    },
    /// The reading that is reported needs more strain than others.
    #[error(
        "the reported pair of waves, ({:.4}, {:.4}) and ({:.4}, {:.4}) rad/nm, is not the one that needs the least \
         strain: {reported} in place of {}. {}",
        .waves[0][0], .waves[0][1], .waves[1][0], .waves[1][1], joined(.less, " or "), decided_by(*.chosen_by)
    )]
    NotTheLeastStrain {
        /// The two waves, rad/nm.
        waves: [[f64; 2]; 2],
        /// Their reading.
        reported: NumbersOfName,
        /// Those with less strain.
        less: Vec<NumbersOfName>,
        /// What chose it.
        chosen_by: ChosenBy,
    },
}

/// Twist and strain of a lattice under one name of its vectors.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{} with {:.3} % of strain", degrees(*.twist), 100.0 * .strain)]
#[non_exhaustive]
pub struct NumbersOfName {
    /// The twist, rad.
    pub twist: f64,
    /// The strain.
    pub strain: f64,
}

/// What 0.1 % of isotropic strain does to the twist.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TwistShift {
    /// It leaves none.
    #[error("no twist at all goes with 0.1 % of isotropic strain")]
    NoTwist,
    /// It moves it, rad.
    #[error("0.1 % of isotropic strain moves it by {}", degrees(*.0))]
    By(f64),
}

pub(super) fn degrees(angle: f64) -> String {
    format!("{:.3}°", angle.to_degrees())
}

fn all_choices(all: &[[f64; 2]]) -> String {
    let words = |[twist, strain]: &[f64; 2]| {
        format!(
            "{} with a strain of {:+.3} %",
            degrees(*twist),
            100.0 * strain
        )
    };
    let all: Vec<String> = all.iter().map(words).collect();
    all.join(" as of ")
}

fn by_shift(shift: Option<TwistShift>) -> String {
    shift.map_or_else(String::new, |shift| shift.to_string())
}

fn in_all(ends: Option<[f64; 2]>) -> String {
    ends.map_or_else(String::new, |[low, high]| {
        format!("; {} to {} in all", degrees(low), degrees(high))
    })
}

fn all_sizes(of_senses: &[[f64; 2]]) -> String {
    let words = |[a, b]: &[f64; 2]| format!("{:+.3} or {:+.3} %", 100.0 * a, 100.0 * b);
    let all: Vec<String> = of_senses.iter().map(words).collect();
    all.join(", or for the other sense of the twist by ")
}

fn joined(all: &[NumbersOfName], by: &str) -> String {
    let all: Vec<String> = all.iter().map(ToString::to_string).collect();
    all.join(by)
}

fn decided_by(what: ChosenBy) -> &'static str {
    match what {
        ChosenBy::Image => {
            "The image decided: these waves and their sum are strong, and each of the others has a weak one in its first \
             shell"
        }
        ChosenBy::Orientation => {
            "The orientation of a layer decided: the others need isotropic strain on top"
        }
        ChosenBy::User | ChosenBy::LeastStrain => "It was given",
    }
}

explain! { ReadingDoubt:
    TwistTradesWithStrain "twist-trades-with-strain" Warning
        "The layers differ in lattice constant, so that a moiré is explained by more than one pair of twist and strain. \
         Isotropic strain moves the twist on top of that."
        "Measure the orientation of a layer, by an image of its atoms or by its edges."
    LargerThanAligned "larger-than-aligned" Warning
        "The moiré is larger than aligned layers make it, and is read as θ = 0. Isotropic strain, the lattice constants or \
         the gain of the scanner make up for the rest."
        "Calibrate the scanner, and make sure of the lattice constants."
    AlignmentWithinErrors "alignment-within-errors" Warning
        "The twist cannot be told from zero. Near alignment the upper limit of the twist means more than its error."
        "Quote the upper limit."
    IsotropicStrainFound "isotropic-strain-found" Warning
        "With the orientation of a layer the strain has an isotropic part. The twist of the usual reading assumes that \
         there is none."
        "Use twist and strain of the tensor. Make sure of the gain of the scanner, which looks like isotropic strain."
    NamesCompete "names-compete" Warning
        "The same lattice, read with another pair of vectors, gives another twist and strain that are as plausible."
        "Quote all open readings, or measure the orientation of a layer."
    NotTheLeastStrain "not-the-least-strain" Note
        "The reading that is reported is not the one with the least strain. The image, an orientation or the user chose \
         it."
        "Nothing, if you trust what chose it. The other readings are in the results."
}

/// What chose the reported name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChosenBy {
    /// It needs the least strain, and nothing speaks against it.
    LeastStrain,
    /// The image speaks against the others that are plausible.
    Image,
    /// The orientation of a layer does.
    Orientation,
    /// The user.
    User,
}
