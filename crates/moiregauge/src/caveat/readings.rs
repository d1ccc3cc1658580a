//! Caveats about other solutions (twist, strain) for the same lattice.

use crate::caveat::explained::explain;

/// Other solutions for the same lattice.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReadingDoubt {
    /// Layers with different lattice constants: isotropic strain and twist cannot be separated.
    #[error(
        "several pairs of twist and strain explain the moiré, since the layers of {layers} differ in lattice constant. \
         Another one is {}; {}{}. The orientation of a layer decides",
        all_choices(.choices), by_shift(*.shift), in_all(*.interval)
    )]
    TwistTradesWithStrain {
        /// The layers.
        layers: String,
        /// Twist (rad) and strain of each solution.
        choices: Vec<[f64; 2]>,
        /// Effect of 0.1 % of isotropic strain on the twist; `None` if not calculated.
        shift: Option<TwistShift>,
        /// Smallest and largest twist of all solutions, rad.
        interval: Option<[f64; 2]>,
    },
    /// A moiré larger than that of aligned layers.
    #[error(
        "the twist is given as 0: the moiré is larger than any that twist and uniaxial strain of {layers} can make \
         ({longest:.3} nm). Isotropic strain, the lattice constants or the gain of the scanner explain the rest"
    )]
    LargerThanAligned {
        /// The layers.
        layers: String,
        /// The longest wavelength, nm.
        longest: f64,
    },
    /// The twist may be zero.
    #[error(
        "quote the upper limit of the twist, θ < {} (95 %, statistical errors only), instead of σ: the twist is not \
         significantly different from zero, and near alignment the moiré depends on θ²",
        degrees(*.limit)
    )]
    AlignmentWithinErrors {
        /// Upper limit, 95 %, rad.
        limit: f64,
    },
    /// The lattice constants of the layers differ by more than uniaxial strain explains.
    #[error(
        "use the magnitude of the twist of `strain_tensor`: it differs by {} from `twist_deg`, which assumes no \
         isotropic strain. With the orientation of layer {layer} the layers differ in size by {}, more than uniaxial \
         strain explains",
        degrees(*.difference), all_sizes(.sizes)
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
        "other solutions are as plausible, for other pairs of vectors of the same lattice. Reported is {reported}; \
         another is {}. {} The orientation of a layer may decide. `readings.solutions` lists all solutions with up to \
         {:.2} %",
        joined(.open, ", or "),
        if *.by_image {
            "The image rules out other solutions, but not these."
        } else {
            "The peak amplitudes do not decide between them, or were not measured."
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
        /// No solution up to this strain is missing.
        complete_to: f64,
    },
    /// The solution that is reported needs more strain than others.
    #[error(
        "the reported solution is not the one with the least strain: {reported} instead of {}. {} (wave vectors \
         ({:.4}, {:.4}) and ({:.4}, {:.4}) rad/nm)",
        joined(.less, " or "), decided_by(*.chosen_by), .waves[0][0], .waves[0][1], .waves[1][0], .waves[1][1]
    )]
    NotTheLeastStrain {
        /// The two waves, rad/nm.
        waves: [[f64; 2]; 2],
        /// Their solution.
        reported: NumbersOfName,
        /// Those with less strain.
        less: Vec<NumbersOfName>,
        /// What chose it.
        chosen_by: ChosenBy,
    },
}

/// Twist and strain of a lattice for one choice of its primitive vectors (indexing).
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{} with {:.3} % of strain", degrees(*.twist), 100.0 * .strain)]
#[non_exhaustive]
pub struct NumbersOfName {
    /// The twist, rad.
    pub twist: f64,
    /// The strain.
    pub strain: f64,
}

/// Effect of 0.1 % of isotropic strain on the twist.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TwistShift {
    /// No twist explains the moiré with it.
    #[error("with 0.1 % of isotropic strain no twist explains the moiré")]
    NoTwist,
    /// Change of the twist, rad.
    #[error("0.1 % of isotropic strain changes the twist by {}", degrees(*.0))]
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
            "The image decided: the first-order peaks of this solution are strong, and every other solution has a weak one"
        }
        ChosenBy::Orientation => {
            "The orientation of a layer decided: the other solutions need isotropic strain as well"
        }
        ChosenBy::User | ChosenBy::LeastStrain => "The user chose it",
    }
}

explain! { ReadingDoubt:
    TwistTradesWithStrain "twist-trades-with-strain" Warning
        "The layers differ in lattice constant. Then more than one pair of twist and strain explains a moiré, and \
         isotropic strain changes the twist further."
        "Measure the orientation of a layer, from an image of its atoms or from its edges."
    LargerThanAligned "larger-than-aligned" Warning
        "The moiré is larger than that of aligned layers. It is read as θ = 0. Isotropic strain, the lattice constants \
         or the gain of the scanner explain the rest."
        "Calibrate the scanner, and check the lattice constants."
    AlignmentWithinErrors "alignment-within-errors" Warning
        "The twist is not significantly different from zero. Near alignment the upper limit of the twist means more \
         than its error."
        "Quote the upper limit."
    IsotropicStrainFound "isotropic-strain-found" Warning
        "According to the orientation of a layer, the strain has an isotropic part. The usual twist \
         assumes that there is none."
        "Use twist and strain of the tensor. Calibrate the scanner: a wrong gain looks like isotropic strain."
    NamesCompete "names-compete" Warning
        "With another pair of its vectors the same lattice gives another twist and strain, which are equally plausible."
        "Quote all open solutions, or measure the orientation of a layer."
    NotTheLeastStrain "not-the-least-strain" Note
        "The solution that is reported is not the one with the least strain. It was chosen by the image, by an \
         orientation or by the user."
        "Nothing, if you trust this choice. The results list the other solutions."
}

/// How the reported solution was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChosenBy {
    /// It has the least strain, and no evidence contradicts it.
    LeastStrain,
    /// The peak amplitudes of the image exclude the other plausible ones.
    Image,
    /// The orientation of a layer excludes the others.
    Orientation,
    /// The user specified it.
    User,
}
