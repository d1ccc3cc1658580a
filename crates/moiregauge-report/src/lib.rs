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
pub use draw::scale::fixed;
pub use error::ReportError;
pub use figures::{Drawing, Figure, cell_figure, figures, map_figures, pulls, stripe_figures};
pub use format::{plus_minus, two_digits, with_statistical};
pub use html::{layers, map_page};
pub use input::{FailedInput, InputFile};
pub use map_details::MapDetails;
pub use moire::{CellResult, MoireDocument};
#[cfg(feature = "parquet")]
pub use report::parquet_tables;
pub use report::{figure_files, write_report};
pub use results::{Provenance, Results, map_schema, schema};
#[cfg(feature = "parquet")]
pub use samples::samples_parquet;
pub use samples::{
    SampleRow, SampleStatus, SamplesPage, failed_csv, samples_csv, samples_page, thumbnail,
};
pub use tables::{
    cell_scan, map_scan, map_scans, map_tables, stripe_scan, tables, undistorted_scan,
};
