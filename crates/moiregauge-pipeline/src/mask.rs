//! Which pixels of the images to use: a picture or an array of the same size, drawn by hand or by another program.

use std::path::Path;

use moiregauge::settings::Mask;
use spmfile::ReadError;

use crate::content::Content;
use crate::known::Known;
use crate::opened::InputError;

/// Reads a mask from any file that holds an image (PNG, TIFF, .npy, …): pixels above zero are used, those that are zero (black),
/// below or missing are not. Rows are those of an image in the same format.
///
/// # Errors
/// It cannot be read, or holds no image.
pub fn read_mask(path: &Path) -> Result<Mask, InputError> {
    let content = Content::read(path)?;
    let known = Known::default();
    let (scan, _) = known.read(path, &content, &|_| true)?;
    let channel = scan.channels.first().ok_or(ReadError::Empty)?;
    let used: Vec<bool> = channel.values().iter().map(|v| *v > 0.0).collect();
    Ok(Mask::new(channel.columns, channel.rows, &used))
}
