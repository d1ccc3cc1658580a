//! Outliers clipped to the limit.

use crate::frame::image::Image;
use crate::numbers::median::median;

/// Values are cut off at this many standard deviations (by the median) from the median: three cosines, which reach
/// 2.5 of theirs, stay whole.
pub(crate) const CLIP: f64 = 3.0;

/// The image with outliers clipped to the limit.
pub(crate) fn cut_off(image: &Image) -> Image {
    let mut values = image.finite();
    let middle = median(&mut values);
    for value in &mut values {
        *value = (*value - middle).abs();
    }
    let reach = CLIP * 1.4826 * median(&mut values);
    let values = image
        .values
        .iter()
        .map(|v| v.clamp(middle - reach, middle + reach));
    Image::new(image.rows, image.columns, values.collect())
}
