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
mod joint;
mod lattice;
mod map;
mod readings;
mod region;
mod run;
mod scan;
mod stripes;

pub(crate) use budget::source_name;
pub use budget::{BudgetColumn, BudgetResult};
pub use caveat::ResultCaveat;
pub use checks::{ChecksResult, ResidualResult, ScatterResult};
pub use conventions::Conventions;
pub use document::{
    CombinedResult, ConsistencyResult, DriftFitResult, DriftMonteCarloResult, DriftResult,
    InputProvenance, MeanResult, Results, SetResult,
};
pub use domains::{DislocationResult, DomainsResult, RegimeResult};
pub use joint::{JointResult, TestedResult};
pub use lattice::{LatticeVector, ResultEstimate, StrainMonteCarlo, TwistStrainResult};
pub use map::{
    AgreementResult, DriftChangeResult, HarmonicResult, MapResults, MappedImage, MaskCount,
    QuantityResult, TrendResult, mask_counts, quantities,
};
pub use readings::{
    AtomicResult, IsotropicStrainResult, NameResult, NamesResult, OtherSenseResult, ReadingsResult,
    ShiftResult, SolutionResult, SplitResult, StrainTensorResult, TensorNumbers, TensorSigmas,
};
pub use region::{
    DeviceResult, MapDetailsResult, MaskShare, RegionMeanResult, RegionResult, WantedResult,
};
pub use run::{AtomicImages, Crop, FrameOrder, NamedSet, Run, Told};
pub use scan::{LineResult, ScanResult, ScanTwistStrain, ScanVector, TipVelocity, Window};
pub use stripes::{StripeHarmonicResult, StripePatternResult, StripesResult};

/// Name and version of the document.
pub const SCHEMA: &str = "moiregauge/results/1";

/// The JSON Schema (draft 2020-12) of [`Results`].
pub fn schema() -> serde_json::Value {
    schema_of::<Results>()
}

/// The JSON Schema (draft 2020-12) of [`MapResults`], `map.json`.
pub fn map_schema() -> serde_json::Value {
    schema_of::<MapResults>()
}

fn schema_of<T: schemars::JsonSchema>() -> serde_json::Value {
    let settings = schemars::generate::SchemaSettings::draft2020_12().for_serialize();
    settings.into_generator().into_root_schema_for::<T>().into()
}
