//! Scans that are analysed together: measured once each, analysed as often as one comes or goes.

mod atomic;
mod channel;
mod corrected;
mod error;
mod failure;
mod growing;
mod journal;
mod kept;
mod measure;
mod outcomes;
mod overlap;
mod scans;
mod shown;
mod survey;

pub use corrected::{Export, write_corrected};
pub use error::{AnalyseError, Place};
pub use failure::{Advice, in_words, no_advice};
pub use growing::{Campaign, Outcome};
pub use journal::{Journal, JournalError};
pub use kept::{Heard, Kept};
pub use measure::{given_again, measure_file};
pub use outcomes::outcomes;
pub use scans::Scans;
