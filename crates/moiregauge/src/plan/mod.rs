//! Errors before anything is measured: the bound, and what a plan of scans will reach.

pub(crate) mod bound;
pub(crate) mod predict;

pub use bound::{Bound, cramer_rao};
pub use predict::{FOUND, Prediction, Quantity, predict};
