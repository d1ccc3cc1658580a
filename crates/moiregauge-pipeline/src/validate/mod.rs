//! Are the errors true? Many simulated sets, analysed and compared with their truth.

mod compare;
mod error;
mod found;
mod like;
mod request;
mod run;
mod samples;

pub use compare::{Compared, Comparison};
pub use error::ValidateError;
pub use found::{QuantityFound, VALIDATION_FILES, Validation};
pub(crate) use like::conditions_of;
pub use like::{LikeError, conditions_like};
pub use request::ValidateRequest;
pub use run::validate;
pub use samples::{
    Answer, Outcome, SAMPLES_FILE, SamplesRequest, Tallies, Tally, validate_samples,
};
