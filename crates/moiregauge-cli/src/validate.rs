//! `moiregauge validate`: are the errors true? Many simulated sets, analysed and compared.

mod run;
mod words;

pub(crate) use run::{ValidateArgs, run};
