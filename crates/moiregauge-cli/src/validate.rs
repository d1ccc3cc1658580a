//! `moiregauge validate`: are the errors true? Many simulated sets, analysed and compared.

mod conditions;
mod run;
mod words;

pub(crate) use conditions::given_conditions;
pub(crate) use run::{ValidateArgs, run};
