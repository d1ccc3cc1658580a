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

#[cfg(test)]
mod tests {
    use super::*;

    /// The first line of an array is the top one, as in images; masks begin at the bottom.
    #[test]
    fn masks_have_the_rows_of_their_images() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mask.txt");
        let top = "1 1 0\n";
        std::fs::write(&path, format!("{top}{}", "0 0 0\n".repeat(3))).unwrap();
        let mask = read_mask(&path).unwrap();
        assert_eq!((mask.columns, mask.rows), (3, 4));
        let mut expected = vec![false; 12];
        expected[9..11].fill(true);
        assert_eq!(mask.used(), expected);
    }
}
