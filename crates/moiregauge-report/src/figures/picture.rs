//! An image in its place: its pixels in colours, a frame with axes around it, a colour bar beside it.

use moiregauge::frame::Image;
use nalgebra::{Matrix2, Vector2};

use super::layout;
use crate::draw::axes::{Axes, Labels, Ticks};
use crate::draw::colormap::ColorMap;
use crate::draw::scale::Range;
use crate::draw::style::{COLUMN, PAGE};
use crate::draw::svg::{Rect, Svg};
use crate::draw::{colorbar, raster};

/// Side of one of two images beside each other, pt.
const SIDE: f64 = 162.0;
/// Space above them, pt.
const TOP: f64 = 8.0;

/// An image and where its pixels lie.
pub(super) struct Picture<'a> {
    pub(super) image: &'a Image,
    /// Pixels → data units.
    pub(super) linear: &'a Matrix2<f64>,
    /// Where pixel (0, 0) lies.
    pub(super) origin: Vector2<f64>,
    pub(super) map: ColorMap,
    /// The values that the colours reach over.
    pub(super) range: Range,
}

impl Picture<'_> {
    /// Draws the pixels within the frame, and on them what `over` draws.
    pub(super) fn pixels(&self, svg: &mut Svg, axes: &Axes, over: impl FnOnce(&mut Svg)) {
        let shades = raster::Shades {
            map: self.map,
            range: self.range,
            crisp: false,
        };
        svg.clipped(axes.area, |svg| {
            raster::draw(svg, axes, self.image, self.linear, self.origin, &shades);
            over(svg);
        });
    }

    /// Draws the frame, and the bar that tells `what` the colours are and their unit.
    pub(super) fn frame(&self, svg: &mut Svg, axes: &Axes, labels: &Labels, what: (&str, &str)) {
        axes.draw(svg, labels);
        let area = axes.area;
        // Of two images beside each other the bar is a little narrower.
        let (gap, width) = if svg.width() < PAGE {
            (6.0, 7.0)
        } else {
            (5.0, 6.0)
        };
        let bar = Rect::new(area.right() + gap, area.y, width, area.height);
        colorbar::draw(svg, bar, self.map, self.range, what);
    }
}

/// The axes of an image in nm.
pub(super) const IN_NM: Labels = Labels {
    letter: "",
    title: "",
    x: "x (nm)",
    y: "y (nm)",
    x_ticks: Ticks::Values,
    y_ticks: Ticks::Values,
};

/// The page of two images beside each other.
pub(super) fn page_of_two(id: &str) -> Svg {
    Svg::new(id, PAGE, TOP + layout::ABOVE + SIDE + layout::BELOW)
}

/// The frame of one of them, by its left edge.
pub(super) fn square(left: f64) -> Rect {
    Rect::new(left, TOP + layout::ABOVE, SIDE, SIDE)
}

/// The left edge of the first or the second.
pub(super) fn left_of(index: usize) -> f64 {
    layout::LEFT + index as f64 * PAGE / 2.0
}

/// The frame of an image of this extent, as wide as a column with `beside` pt to its right, from `top` down.
pub(super) fn column(x: Range, y: Range, top: f64, beside: f64) -> Rect {
    let side = COLUMN - layout::LEFT - beside;
    let height = (side * y.width() / x.width()).clamp(0.3 * side, 1.6 * side);
    Rect::new(layout::LEFT, top, side, height)
}

/// The outer corners of an image, counter-clockwise from pixel (0, 0).
pub(super) fn corners(
    image: &Image,
    linear: &Matrix2<f64>,
    origin: Vector2<f64>,
) -> [(f64, f64); 4] {
    let (right, top) = (image.columns as f64 - 0.5, image.rows as f64 - 0.5);
    [(-0.5, -0.5), (right, -0.5), (right, top), (-0.5, top)].map(|(column, row)| {
        let at = origin + linear * Vector2::new(column, row);
        (at.x, at.y)
    })
}

/// From where to where the pixels of an image reach along x and y.
pub(super) fn extent(
    image: &Image,
    linear: &Matrix2<f64>,
    origin: Vector2<f64>,
) -> Option<(Range, Range)> {
    let corners = corners(image, linear, origin);
    let wide = |range: Option<Range>| range.filter(|r| r.width() > 0.0);
    let x = wide(Range::of(corners.iter().map(|c| c.0)));
    let y = wide(Range::of(corners.iter().map(|c| c.1)));
    x.zip(y)
}
