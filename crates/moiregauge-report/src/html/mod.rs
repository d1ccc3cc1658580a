//! `report.html`: one page with everything in it, to be opened without a network and printed.
//!
//! In: the document, the figures and the tables. Out: the page. Every text from outside (file names,
//! channel names, error messages) is escaped by the template engine; only our own SVG is not.

mod meanings;
mod page;
mod words;

use minijinja::syntax::SyntaxConfig;
use minijinja::value::Serde;
use minijinja::{Environment, UndefinedBehavior};

use crate::error::ReportError;
use crate::figures::Figure;
use crate::results::Results;

const TEMPLATE: &str = include_str!("report.html");

/// The page. `downloads` are the files that it carries for saving.
pub(crate) fn page(
    results: &Results,
    figures: &[Figure],
    downloads: &[(String, Vec<u8>)],
) -> Result<Vec<u8>, ReportError> {
    let mut environment = Environment::new();
    // A misspelt name is an error, not an empty place in the page.
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    let syntax = SyntaxConfig::builder()
        .trim_blocks(true)
        .lstrip_blocks(true)
        .build()?;
    environment.set_syntax(syntax);
    // The name ends in .html, which switches escaping on.
    environment.add_template("report.html", TEMPLATE)?;
    let content = page::Page::new(results, figures, downloads)?;
    let text = environment
        .get_template("report.html")?
        .render(Serde(content))?;
    Ok(text.into_bytes())
}
