//! Patterns of one wave: which there are, one wave fitted to each, and maps of them.

pub(crate) mod find;
pub(crate) mod fit;
pub(crate) mod maps;
pub(crate) mod nodes;
pub(crate) mod pilot;
pub(crate) mod sample;
pub(crate) mod types;
pub(crate) mod wave;

pub use fit::FittedWave;
pub use maps::{find_stripes, stripe_maps};
pub use sample::{SampledPattern, SampledStripes};
pub use types::{NoStripes, StripeMap, StripeNode, StripePattern};
