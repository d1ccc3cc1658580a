//! What can go wrong in writing a report.

/// A report that could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A figure could not be turned into a PNG.
    #[error("a figure could not be drawn as PNG: {0}")]
    Png(String),
    /// The results could not be written as JSON.
    #[error("the results could not be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// The page could not be filled in.
    #[error("report.html could not be filled in: {0}")]
    Html(#[from] minijinja::Error),
    /// A table could not be written as Parquet.
    #[error("a table could not be written as Parquet: {0}")]
    Parquet(String),
}
