//! The two laboratory axes.

/// A laboratory axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Axis {
    /// To the right.
    X,
    /// Upwards.
    Y,
}
