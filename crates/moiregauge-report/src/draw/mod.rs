//! The drawing layer: values in data units go in, SVG text and PNG bytes come out.
//!
//! Lengths on the page are in points (1/72 inch); the page's origin is the top left corner, as SVG
//! has it. [`axes::Axes`] turns data coordinates, y up, into page coordinates.

pub(crate) mod axes;
pub(crate) mod base64;
pub(crate) mod colorbar;
pub(crate) mod colormap;
pub(crate) mod contour;
pub(crate) mod legend;
pub(crate) mod letters;
pub(crate) mod png;
pub(crate) mod raster;
pub(crate) mod scale;
pub(crate) mod style;
pub(crate) mod svg;
