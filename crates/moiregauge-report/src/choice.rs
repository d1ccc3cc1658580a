//! What is wanted of a report.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::draw::colormap::ColorMap;

/// Which parts of a report are wanted. `results.json` and the tables always are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Choice {
    /// The figures as SVG files.
    pub figures: bool,
    /// The figures as PNG files, 300 dots per inch.
    pub png: bool,
    /// `report.html`, with the figures inside.
    pub html: bool,
    /// Colours of images.
    pub colormap: ColorMap,
}

impl Default for Choice {
    fn default() -> Self {
        Self {
            figures: true,
            png: true,
            html: true,
            colormap: ColorMap::default(),
        }
    }
}
