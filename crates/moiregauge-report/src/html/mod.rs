//! `report.html`: one page with everything in it, to be opened without a network and printed.
//!
//! In: the document, the figures and the tables. Out: the page. Every text from outside (file names,
//! channel names, error messages) is escaped by the template engine; only our own SVG is not.

mod map_page;
mod meanings;
mod page;
mod words;

use minijinja::syntax::SyntaxConfig;
use minijinja::value::Serde;
use minijinja::{Environment, UndefinedBehavior, Value};
use moiregauge::campaign::Analysis;
use serde::Serialize;

use crate::error::ReportError;
use crate::figures::Figure;
use crate::results::Results;

const TEMPLATE: &str = include_str!("report.html");

/// What pages share: their look, and their last sections.
const STYLE: &str = include_str!("style.html");
const END: &str = include_str!("end.html");

pub use map_page::map_page;
pub use page::layers;

/// The page. `downloads` are the files that it carries for saving.
pub(crate) fn page(
    of: (&Results, &Analysis),
    figures: &[Figure],
    downloads: &[(String, Vec<u8>)],
) -> Result<Vec<u8>, ReportError> {
    rendered(TEMPLATE, page::Page::new(of, figures, downloads)?)
}

/// The template filled in.
fn rendered(template: &'static str, content: impl Serialize) -> Result<Vec<u8>, ReportError> {
    let mut environment = Environment::new();
    // A misspelt name is an error, not an empty place in the page.
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    let syntax = SyntaxConfig::builder()
        .trim_blocks(true)
        .lstrip_blocks(true)
        .build()?;
    environment.set_syntax(syntax);
    // The name ends in .html, which switches escaping on.
    environment.add_global("style", Value::from_safe_string(STYLE.to_owned()));
    environment.add_template("end.html", END)?;
    environment.add_template("report.html", template)?;
    let text = environment
        .get_template("report.html")?
        .render(Serde(content))?;
    Ok(text.into_bytes())
}
