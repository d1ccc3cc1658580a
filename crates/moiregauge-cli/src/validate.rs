//! `moiregauge validate`: are the errors true? Many simulated sets, analysed and compared.

mod compare;
mod conditions;
mod like;
mod output;
mod run;
mod samples;

pub(crate) use conditions::given_conditions;
pub(crate) use run::{ValidateArgs, run};
