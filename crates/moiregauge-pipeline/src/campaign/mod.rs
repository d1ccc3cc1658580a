//! Scans that are analysed together: measured once each, analysed as often as one comes or goes.

mod atomic;
mod channel;
mod corrected;
mod error;
mod growing;
mod kept;
mod measure;
mod outcomes;
mod overlap;
mod shown;
mod survey;

pub use corrected::{Export, write_corrected};
pub use error::{AnalyseError, Place};
pub use growing::{Campaign, Outcome};
pub use kept::Kept;
pub use measure::{Advice, given_again, in_words, measure_file, no_advice};
pub use outcomes::outcomes;
