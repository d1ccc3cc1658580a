//! A set once its drift is known.

use heterostrain::lattice::Lattice;

use crate::campaign::motion::Drift;
use crate::caveat::drifting::AssumedDrift;
use crate::drift::shares::Statistical;

/// The drift of a set and the lattice that goes with it.
pub(crate) struct Solved {
    pub(crate) drift: Drift,
    pub(crate) lattice: Lattice,
    pub(crate) statistical: Statistical,
    /// Where nothing tells the drift: what was assumed of it.
    pub(crate) assumed: Option<AssumedDrift>,
    pub(crate) chi2: f64,
    pub(crate) freedom: usize,
    /// By which the variances were enlarged for the scatter of the scans.
    pub(crate) enlargement: f64,
}
