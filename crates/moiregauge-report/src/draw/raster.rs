//! Images inside figures: pixel values → a small palette PNG and its place on the page.
//!
//! The map pixel → nm is affine and stays so: the image is never resampled to a grid, the viewer
//! draws its pixels as the parallelograms they are.

use moiregauge::frame::Image;
use nalgebra::{Matrix2, Vector2};

use super::axes::Axes;
use super::colormap::ColorMap;
use super::png::palette_png;
use super::scale::Range;
use super::svg::Svg;

/// More pixels than this along a side are averaged away: a journal page shows no more.
const MOST: usize = 1024;

/// How values become colours.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shades {
    pub(crate) map: ColorMap,
    pub(crate) range: Range,
    /// Show every pixel as a block instead of interpolating.
    pub(crate) crisp: bool,
}

/// The range from the `share` quantile to the `1 − share` quantile of the finite values.
pub(crate) fn contrast(image: &Image, share: f64) -> Range {
    let mut values = image.finite();
    let mut at = |q: f64| {
        let place = (values.len().checked_sub(1)? as f64 * q).round() as usize;
        let (_, value, _) = values.select_nth_unstable_by(place, f64::total_cmp);
        Some(*value)
    };
    match (at(share), at(1.0 - share)) {
        (Some(low), Some(high)) if low < high => Range::new(low, high),
        (Some(low), _) => Range::new(low - 0.5, low + 0.5),
        _ => Range::new(0.0, 1.0),
    }
}

/// The block of `rows` × `columns` pixels from (`row`, `column`) on, cut off at the edges.
pub(crate) fn cropped(
    image: &Image,
    row: usize,
    column: usize,
    rows: usize,
    columns: usize,
) -> Image {
    let (row, column) = (row.min(image.rows), column.min(image.columns));
    let rows = rows.min(image.rows - row);
    let columns = columns.min(image.columns - column);
    let values = (row..row + rows)
        .flat_map(|r| image.row(r)[column..column + columns].iter().copied())
        .collect();
    Image::new(rows, columns, values)
}

/// Means over blocks of `factor` × `factor` pixels; an incomplete block at the end counts as well.
fn reduced(image: &Image, factor: usize) -> Image {
    let (rows, columns) = (image.rows.div_ceil(factor), image.columns.div_ceil(factor));
    // Sum and number of the values of each block.
    let mut blocks = vec![[0.0; 2]; rows * columns];
    for row in 0..image.rows {
        let line = blocks[row / factor * columns..].iter_mut();
        for ([sum, count], values) in line.zip(image.row(row).chunks(factor)) {
            for value in values.iter().filter(|v| v.is_finite()) {
                *sum += value;
                *count += 1.0;
            }
        }
    }
    let values = blocks.iter().map(|[sum, count]| sum / count).collect();
    Image::new(rows, columns, values)
}

/// Draws `image` with pixel (column, row) centred at `origin + linear · (column, row)` of `axes`.
pub(crate) fn draw(
    svg: &mut Svg,
    axes: &Axes,
    image: &Image,
    linear: &Matrix2<f64>,
    origin: Vector2<f64>,
    shades: &Shades,
) {
    if image.rows == 0 || image.columns == 0 {
        return;
    }
    let factor = image.rows.max(image.columns).div_ceil(MOST);
    let small = if factor > 1 {
        &reduced(image, factor)
    } else {
        image
    };
    let linear = linear * factor as f64;
    // The middle of the first block lies (factor − 1)/2 old pixels from pixel (0, 0).
    let shift = (factor as f64 - 1.0) / 2.0 / factor as f64;
    let origin = origin + linear * Vector2::new(shift, shift);

    let png = encode(small, shades);
    place(
        svg,
        axes,
        (&png, [small.columns, small.rows]),
        (&linear, origin),
        shades.crisp,
    );
}

/// Draws classes (numbers of `colours`) of nodes, row by row, placed like the pixels of [`draw`].
pub(crate) fn draw_classes(
    svg: &mut Svg,
    axes: &Axes,
    ([columns, rows], classes): ([usize; 2], &[u8]),
    (linear, origin): (&Matrix2<f64>, Vector2<f64>),
    colours: &[[u8; 3]],
) {
    // Classes have no mean: of many nodes one in the middle of a block is shown.
    let factor = rows.max(columns).div_ceil(MOST).max(1);
    let size = [columns.div_ceil(factor), rows.div_ceil(factor)];
    let pick = |i: usize, n: usize| (i * factor + factor / 2).min(n - 1);
    let mut indices = Vec::with_capacity(size[0] * size[1]);
    for row in (0..size[1]).rev() {
        for column in 0..size[0] {
            let class = classes[pick(row, rows) * columns + pick(column, columns)];
            indices.push(class.saturating_add(1));
        }
    }
    let mut table = [[255; 3]; 256];
    table.iter_mut().zip(colours).for_each(|(t, c)| *t = *c);
    let png = palette_png(size[0], size[1], &indices, &table);
    let shift = (factor as f64 - 1.0) / 2.0;
    let origin = origin + linear * Vector2::new(shift, shift);
    place(
        svg,
        axes,
        (&png, size),
        (&(linear * factor as f64), origin),
        true,
    );
}

/// Puts a PNG on the page, its pixel (column, row) centred at `origin + linear · (column, row)`.
fn place(
    svg: &mut Svg,
    axes: &Axes,
    (png, [columns, rows]): (&[u8], [usize; 2]),
    (linear, origin): (&Matrix2<f64>, Vector2<f64>),
    crisp: bool,
) {
    // PNG coordinates (u right, v down, edges at whole numbers): column = u − ½, row = rows − ½ − v.
    let corner = origin + linear * Vector2::new(-0.5, rows as f64 - 0.5);
    let (e, f) = axes.at(corner.x, corner.y);
    let (sx, sy) = (axes.x.per_unit(), axes.y.per_unit());
    let matrix = [
        linear[(0, 0)] * sx,
        linear[(1, 0)] * sy,
        -linear[(0, 1)] * sx,
        -linear[(1, 1)] * sy,
        e,
        f,
    ];
    svg.image(png, (columns, rows), matrix, crisp);
}

/// Pixels as a palette PNG, top line first; missing ones are transparent.
fn encode(image: &Image, shades: &Shades) -> Vec<u8> {
    let range = shades.range;
    let mut indices = Vec::with_capacity(image.values.len());
    for row in (0..image.rows).rev() {
        for &value in image.row(row) {
            // Index 0 is kept for missing pixels.
            let t = ((value - range.low) / range.width()).clamp(0.0, 1.0);
            indices.push(if value.is_nan() {
                0
            } else {
                1 + (t * 254.0).round() as u8
            });
        }
    }
    palette_png(image.columns, image.rows, &indices, &shades.map.table())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::svg::Rect;

    /// A 2 × 2 image whose pixels are told apart; the bottom left one must end up bottom left.
    #[test]
    fn y_points_up() -> Result<(), String> {
        let image = Image::new(2, 2, vec![0.0, 0.0, 0.0, 1.0]);
        let range = Range::new(-0.5, 1.5);
        let axes = Axes::new(Rect::new(0.0, 0.0, 40.0, 40.0), range, range);
        let mut svg = Svg::new("t", 40.0, 40.0);
        let shades = Shades {
            map: ColorMap::Grey,
            range: Range::new(0.0, 1.0),
            crisp: true,
        };
        draw(
            &mut svg,
            &axes,
            &image,
            &Matrix2::identity(),
            Vector2::zeros(),
            &shades,
        );
        let picture =
            crate::draw::png::pixmap(&svg.finish("t"), 72.0).map_err(|e| e.to_string())?;
        let red = |x, y| {
            picture
                .pixel(x, y)
                .map(resvg::tiny_skia::PremultipliedColorU8::red)
        };
        assert_eq!(red(35, 4), Some(255), "column 1, row 1 is top right");
        assert!(red(4, 35) < Some(10) && red(35, 35) < Some(10) && red(4, 4) < Some(10));
        Ok(())
    }

    #[test]
    fn averaging_keeps_the_mean_and_the_place() {
        let image = Image::new(3, 4, (0..12).map(f64::from).collect());
        let small = reduced(&image, 2);
        assert_eq!((small.rows, small.columns), (2, 2));
        assert_eq!(small.values, [2.5, 4.5, 8.5, 10.5]);
    }
}
