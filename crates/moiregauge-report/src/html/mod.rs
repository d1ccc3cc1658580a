//! `report.html`: one page with everything in it, to be opened without a network and printed.
//!
//! In: the document, the figures and the tables. Out: the page. Every text from outside (file names,
//! channel names, error messages) is escaped by the template engine; only our own SVG is not.

mod map_page;
mod meanings;
mod page;
mod template;
mod words;

pub use map_page::map_page;
pub use page::layers;
pub(crate) use page::page;
pub(crate) use template::rendered;
