//! Many samples: each analysed by itself, all in one table.
//!
//! A folder of results holds, beside the tables, `parts/`:
//! - `KEY.jsonl`: one sample, written under another name and renamed when it is whole. The key is a hash of all that
//!   the part depends on: version of the program, settings, name of the sample, names and hashes of its files. Who
//!   finds the part of a key has nothing left to do, and two processes that make the same part write the same bytes.
//! - `list-I-of-N.json`: the samples of one shard and their keys, written when all of its parts are there.
//!
//! Nothing else is remembered: a run that is killed is gone on with by running it again, on any machine. Tables and
//! page are made from the parts alone, so that they have the same bytes however often a run was interrupted and
//! however it was divided. [`merge`] joins the parts of several folders.

mod done;
mod error;
mod find;
mod list;
mod merge;
mod one;
mod part;
mod run;
mod shown;
mod tables;

pub use done::SamplesDone;
pub use error::SamplesError;
pub use find::{Sample, samples_in, samples_of_table};
pub use list::Shard;
pub use merge::{Merge, merge};
pub use run::{Samples, analyse_samples, analyse_some, give_up};
pub use shown::{SamplesShown, samples_shown};
