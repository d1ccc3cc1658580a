//! The results as tables: `vectors.csv`, `scans.csv`, `sets.csv`, `budget.csv` and `columns.md`,
//! which explains them.
//!
//! In: the document. Out: RFC 4180 text in UTF-8, one header line, units in the column names, an
//! empty field where a number is not known. Nothing but data is in the files: comments break readers.

mod budget;
mod columns;
mod csv;
mod domains;
mod map;
#[cfg(feature = "parquet")]
mod parquet;
mod pattern;
mod region;
mod results;
mod stripes;

pub(crate) use csv::{Column, number, text as csv_text};
pub use map::{map_scan, map_scans};
#[cfg(feature = "parquet")]
pub(crate) use parquet::{parquet_of, parquet_tables};
pub use pattern::{cell_scan, undistorted_scan};
pub(crate) use region::COMMON;
pub use region::map_tables;
pub use results::tables;
pub use stripes::stripe_scan;
