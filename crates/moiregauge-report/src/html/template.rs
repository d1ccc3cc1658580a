//! A template and its content → a page.

use minijinja::syntax::SyntaxConfig;
use minijinja::value::Serde;
use minijinja::{Environment, UndefinedBehavior, Value};
use serde::Serialize;

use crate::error::ReportError;

/// What pages share: their look, and their last sections.
const STYLE: &str = include_str!("style.html");
const END: &str = include_str!("end.html");

/// The template filled in.
pub(crate) fn rendered(
    template: &'static str,
    content: impl Serialize,
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
    environment.add_global("style", Value::from_safe_string(STYLE.to_owned()));
    environment.add_template("end.html", END)?;
    environment.add_template("report.html", template)?;
    let text = environment
        .get_template("report.html")?
        .render(Serde(content))?;
    Ok(text.into_bytes())
}
