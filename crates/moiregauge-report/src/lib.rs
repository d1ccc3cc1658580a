//! Numbers → pictures, tables and the report. No measuring.
//!
//! In: an [`Analysis`](moiregauge::campaign::Analysis) (nm, s, rad) and a [`Provenance`]. Out: files as bytes, in
//! the units of the surface (°, %, nm/min). Nothing is written to disk here.

mod choice;
mod draw;
mod error;
mod figures;
mod format;
mod html;
mod input;
mod map_details;
mod moire;
mod report;
pub mod results;
mod samples;
pub mod screen;
mod stats;
mod tables;

pub use choice::Choice;
pub use draw::colormap::ColorMap;
pub use error::ReportError;
pub use figures::{Drawing, Figure, figures, map_figures};
pub use html::map_page;
pub use report::write_report;
pub use results::{Provenance, Results, map_schema, schema};
pub use tables::{map_tables, tables};

/// What the front ends of this workspace use besides.
mod front {
    pub use crate::draw::scale::fixed;
    pub use crate::figures::{cell_figure, pulls, stripe_figures};
    pub use crate::format::{plus_minus, two_digits, with_statistical};
    pub use crate::html::layers;
    pub use crate::input::{FailedInput, InputFile};
    pub use crate::map_details::MapDetails;
    pub use crate::moire::{CellResult, MoireDocument};
    pub use crate::report::figure_files;
    #[cfg(feature = "parquet")]
    pub use crate::report::parquet_tables;
    #[cfg(feature = "parquet")]
    pub use crate::samples::samples_parquet;
    pub use crate::samples::{
        SampleRow, SampleStatus, SamplesPage, failed_csv, samples_csv, samples_page, thumbnail,
    };
    pub use crate::tables::{cell_scan, map_scan, map_scans, stripe_scan, undistorted_scan};
}
#[doc(hidden)]
pub use front::*;
