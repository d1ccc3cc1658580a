//! What is wanted of a plan.

/// What is wanted, in the units of the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wishes {
    pub(super) twist_deg: Option<f64>,
    pub(super) strain_percent: Option<f64>,
    pub(super) drift_nm_per_min: Option<f64>,
}
