//! An image in little.

use moiregauge::frame::Image;

use crate::draw::colormap::ColorMap;
use crate::draw::raster::contrast;
use crate::error::ReportError;

/// The colour of missing pixels.
const MISSING: u8 = 255;
/// Share of the pixels that may be darker or brighter than the colours.
const BEYOND: f64 = 0.01;

/// An image as a small PNG, top line first: the pixels nearest to an even grid, at most `most`
/// along the longer side. Missing ones are white.
///
/// # Errors
/// None in practice: everything is written into memory.
pub fn thumbnail(image: &Image, most: usize, colours: ColorMap) -> Result<Vec<u8>, ReportError> {
    let longer = image.rows.max(image.columns).max(1);
    let side = |length: usize| (length * most.min(longer)).div_ceil(longer).max(1);
    let [columns, rows] = [side(image.columns), side(image.rows)];
    let range = contrast(image, BEYOND);
    let mut pixels = Vec::with_capacity(columns * rows);
    for row in (0..rows).rev() {
        let line = image.row((2 * row + 1) * image.rows / (2 * rows));
        for column in 0..columns {
            let value = line[(2 * column + 1) * image.columns / (2 * columns)];
            let share = (value - range.low) / (range.high - range.low);
            pixels.push(if share.is_finite() {
                (share.clamp(0.0, 1.0) * f64::from(MISSING - 1)).round() as u8
            } else {
                MISSING
            });
        }
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, columns as u32, rows as u32);
    encoder.set_color(png::ColorType::Indexed);
    let mut palette = colours.table();
    palette[usize::from(MISSING)] = [255; 3];
    encoder.set_palette(palette.concat());
    encoder.set_depth(png::BitDepth::Eight);
    let drawn = |e: png::EncodingError| ReportError::Png(e.to_string());
    let mut writer = encoder.write_header().map_err(drawn)?;
    writer.write_image_data(&pixels).map_err(drawn)?;
    writer.finish().map_err(drawn)?;
    Ok(bytes)
}
