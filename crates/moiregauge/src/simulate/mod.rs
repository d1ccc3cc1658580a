//! Twisted layers, a drifting sample and a noisy instrument → scans whose answer is known.
//!
//! In: [`Simulation`], every knob in the units of the laboratory. Out: [`spmfile::Scan`]s as an
//! instrument would have recorded them, and a [`Truth`] to check an analysis against. The same
//! settings give the same bytes on any number of threads.
//!
//! A feature of the sample at R is found at `R + d(t)`; a pixel at position r, recorded at time t,
//! shows the sample at `r − d(t)`. Nothing is approximated: every pixel has its own time.

pub(crate) mod calendar;
pub(crate) mod domains;
pub(crate) mod error;
pub(crate) mod field;
pub(crate) mod frame;
pub(crate) mod raster;
pub(crate) mod scene;
pub(crate) mod settings;
pub(crate) mod simulator;
pub(crate) mod truth;

pub use domains::DomainScene;
pub use error::SimulateError;
pub use field::{Feature, FieldScene, Ripple};
pub use settings::{
    Drift, FirstDirection, MOST_PIXELS, Noise, Pattern, Raster, Sample, Simulation, Window,
};
pub use simulator::Simulator;
pub use truth::{FrameTruth, Truth};
