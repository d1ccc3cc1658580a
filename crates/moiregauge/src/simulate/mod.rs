//! Twisted layers, a drifting sample and a noisy instrument → scans whose answer is known.
//!
//! In: [`Simulation`], every knob in the units of the laboratory. Out: [`spmfile::Scan`]s as an
//! instrument would have recorded them, and a [`Truth`] to check an analysis against. The same
//! settings give the same bytes on any number of threads.
//!
//! A feature of the sample at R is found at `R + d(t)`; a pixel at position r, recorded at time t,
//! shows the sample at `r − d(t)`. Nothing is approximated: every pixel has its own time.

pub(crate) mod bend;
pub(crate) mod calendar;
pub(crate) mod classes;
pub(crate) mod domains;
pub(crate) mod error;
pub(crate) mod feature;
pub(crate) mod field;
pub(crate) mod frame;
pub(crate) mod grain;
pub(crate) mod ground;
pub(crate) mod instrument;
pub(crate) mod local;
pub(crate) mod motion;
pub(crate) mod raster;
pub(crate) mod reference;
pub(crate) mod scanner;
pub(crate) mod scene;
pub(crate) mod seen;
pub(crate) mod settings;
pub(crate) mod simulator;
pub(crate) mod surface;
pub(crate) mod tried;
pub(crate) mod truth;
pub(crate) mod vary;

pub use classes::{CLASSES, Key, SampleClass, sample_class};
pub use domains::DomainScene;
pub use error::SimulateError;
pub use feature::SampleFeature;
pub use field::{Feature, FieldScene, Ripple};
pub use seen::{GrainTruth, MeanTruth, PlaceTruth, SampleTruth};
pub use settings::{
    Drift, FirstDirection, MOST_PIXELS, Noise, Pattern, Raster, Sample, Simulation, Window,
};
pub use simulator::Simulator;
pub use tried::TRIED;
pub use truth::{FrameTruth, Truth};
pub use vary::vary;
