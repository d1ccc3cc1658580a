//! Wanted errors and an instrument → how to scan, how long, and what limits.

mod found;
mod request;
mod search;

pub use found::{Expected, Limit, OutOfReach, Plan, Plans};
pub use request::{PlanError, PlanRequest, Wishes};
pub use search::plan;
