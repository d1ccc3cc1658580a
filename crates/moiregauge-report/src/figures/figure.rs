//! What comes out: a drawing with its caption, or the reason why there is none.

use crate::draw::png;
use crate::error::ReportError;

/// A figure, or the reason why there is none.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name for files, unique within a report, as in `set1-drift`.
    pub name: String,
    /// The set it belongs to, counted from 0; `None` for one of all sets together.
    pub set: Option<usize>,
    /// Title for people.
    pub title: &'static str,
    /// The drawing, or why it was left out.
    pub drawing: Result<Drawing, String>,
}

/// A drawn figure.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// The figure as an SVG document.
    pub svg: String,
    /// What it shows, with its conventions.
    pub caption: String,
    /// Whether it is as wide as a journal page (180 mm) and not as a column (88 mm).
    pub wide: bool,
}

impl Drawing {
    /// The figure as a PNG of 300 dots per inch.
    ///
    /// # Errors
    /// [`ReportError::Png`] if it cannot be rendered.
    pub fn png(&self) -> Result<Vec<u8>, ReportError> {
        png::render(&self.svg)
    }
}
