//! The results as a document, `moiregauge/results/1`: degrees, per cent, nm and nm/min.
//!
//! In: an analysis in nm, s and rad and its provenance. Out: [`Results`], which serialises to
//! `results.json` and is described by [`schema`]. A number that is not known is `null`, never NaN.

mod budget;
mod caveat;
mod checks;
mod conventions;
mod convert;
mod document;
mod domains;
mod estimate;
mod joint;
mod lattice;
mod map;
mod pattern;
mod profile;
mod provenance;
mod quantity;
mod readings;
mod region;
mod run;
mod scan;
mod schema;
mod set_lattice;
mod stripes;

pub(crate) use budget::source_name;
pub use budget::{BudgetColumn, BudgetResult};
pub use caveat::ResultCaveat;
pub use checks::{ChecksResult, ResidualResult, ScatterResult};
pub use conventions::Conventions;
pub use document::{
    CombinedResult, ConsistencyResult, DriftFitResult, DriftMonteCarloResult, DriftResult,
    InputProvenance, MeanResult, Results, SCHEMA, SetResult,
};
pub use domains::{DislocationResult, DomainsResult, RegimeResult};
pub use estimate::ResultEstimate;
pub use joint::{JointResult, TestedResult};
pub use lattice::{LatticeVector, StrainMonteCarlo, TwistStrainResult};
pub use map::{
    AgreementResult, DriftChangeResult, HarmonicResult, MapResults, MappedImage, MappedRuler,
    MaskCount, mask_counts, quantities,
};
pub use pattern::{MeanCellResult, PatternResult, RegistryResult, UndistortedResult};
pub use profile::{ProfilePointResult, ProfileResult};
pub use provenance::Provenance;
pub use quantity::{QuantityResult, TrendResult};
pub use readings::{
    AtomicResult, IsotropicStrainResult, NameResult, NamesResult, OtherSenseResult, ReadingsResult,
    ShiftResult, SolutionResult, SplitResult, StrainTensorResult, TensorNumbers, TensorSigmas,
};
pub use region::{
    DeviceResult, MapDetailsResult, MaskShare, RegionMeanResult, RegionResult, WantedResult,
};
pub use run::{AtomicImages, Crop, FrameOrder, NamedSet, Run, UserSpecified};
pub use scan::{
    CandidateResult, LineResult, ScanResult, ScanTwistStrain, ScanVector, TipVelocity, Window,
};
pub use schema::{map_schema, schema};
pub use set_lattice::{AssumedDriftResult, SetLatticeResult};
pub use stripes::{StripeHarmonicResult, StripePatternResult, StripesResult};
