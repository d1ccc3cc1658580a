//! What a window blurs, read off what a wider one changes.

/// χ² of two numbers that is more than chance (p < 0.01) enlarges the errors of a node: a convention.
const OF_TWO: f64 = 9.21;
/// The same of four.
const OF_FOUR: f64 = 13.3;
/// A good χ² exceeds the limit once in some 10⁵ nodes.
const IMPROBABLE: f64 = 4.26;
/// Blur that matters: a window wider by √2 changes a wave vector by this share of itself. On the scenes of docs/constants.md half and double change
/// results by at most 0.22 σ.
const BLURRED: f64 = 0.004;

/// What a window wider by √2 changes at a node.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Blur {
    /// χ² of the components of the change.
    pub(crate) chi2: f64,
    /// How many there are: two of each wave vector.
    pub(crate) components: usize,
    /// The change as a share of the wave vectors.
    pub(crate) share: f64,
    /// Variance that noise gives the change, in units of that of the node.
    pub(crate) of_noise: f64,
}

impl Blur {
    /// Factor on the variances of a node for what the window blurs, where that is more than chance (p < 0.01).
    pub(crate) fn factor(self) -> f64 {
        let more_than_chance = if self.components == 2 {
            OF_TWO
        } else {
            OF_FOUR
        };
        if self.chi2 > more_than_chance {
            1.0 + (self.chi2 / self.components as f64 - 1.0) * self.of_noise
        } else {
            1.0
        }
    }

    /// Whether a node is bent by it.
    pub(crate) fn matters(self) -> bool {
        is_improbable(self.chi2, self.components) && self.share > BLURRED
    }
}

/// Whether χ² is beyond chance: Wilson and Hilferty, PNAS 17, 684 (1931).
pub(crate) fn is_improbable(chi2: f64, freedom: usize) -> bool {
    if freedom == 0 {
        return false;
    }
    let n = freedom as f64;
    let a = 2.0 / (9.0 * n);
    chi2 > n * (1.0 - a + IMPROBABLE * a.sqrt()).powi(3)
}
