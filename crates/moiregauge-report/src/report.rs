//! Everything that a report consists of, as named files in memory.

use moiregauge::campaign::Analysis;
use moiregauge::numbers::interrupt;
use rayon::prelude::*;

use crate::choice::Choice;
use crate::draw::png;
use crate::error::ReportError;
use crate::figures::{Figure, figures};
use crate::html;
use crate::results::Provenance;
use crate::results::Results;
use crate::tables::tables;

/// The figures as files, in the order of the figures on any number of threads.
///
/// # Errors
/// [`ReportError::Png`] if a figure cannot be rendered.
pub fn figure_files(all: &[Figure], choice: Choice) -> Result<Vec<(String, Vec<u8>)>, ReportError> {
    let drawn: Vec<(&str, &str)> = all
        .iter()
        .filter_map(|f| {
            f.drawing
                .as_ref()
                .ok()
                .map(|d| (f.name.as_str(), d.svg.as_str()))
        })
        .collect();
    let pictures: Vec<Vec<(String, Vec<u8>)>> = drawn
        .par_iter()
        .map(|&(name, svg)| {
            interrupt::check();
            let mut files = Vec::new();
            if choice.figures {
                files.push((format!("figures/{name}.svg"), svg.as_bytes().to_vec()));
            }
            if choice.png {
                files.push((format!("figures/{name}.png"), png::render(svg)?));
            }
            Ok(files)
        })
        .collect::<Result<_, ReportError>>()?;
    Ok(pictures.into_iter().flatten().collect())
}

/// The tables as Parquet files, named like the CSV files of [`write_report`] and with their columns.
///
/// # Errors
/// [`ReportError`] if a table cannot be written.
#[cfg(feature = "parquet")]
pub fn parquet_tables(
    analysis: &Analysis,
    provenance: &Provenance,
) -> Result<Vec<(String, Vec<u8>)>, ReportError> {
    crate::tables::parquet_tables(&Results::new(analysis, provenance))
}

/// All files of a report: names relative to its folder, and their bytes.
///
/// Deterministic: the same analysis gives the same bytes on any number of threads.
///
/// # Errors
/// [`ReportError`] if a figure cannot be drawn or a document cannot be written; missing data are no error.
pub fn write_report(
    analysis: &Analysis,
    provenance: &Provenance,
    choice: &Choice,
) -> Result<Vec<(String, Vec<u8>)>, ReportError> {
    let results = Results::new(analysis, provenance);
    let mut files = vec![("results.json".to_owned(), results.to_json()?)];
    files.extend(tables(&results));
    if !(choice.figures || choice.png || choice.html) {
        return Ok(files);
    }
    let all = figures(analysis, choice.colormap);
    let page = if choice.html {
        Some(html::page((&results, analysis), &all, &files)?)
    } else {
        None
    };
    files.extend(figure_files(&all, *choice)?);
    files.extend(page.map(|page| ("report.html".to_owned(), page)));
    Ok(files)
}
