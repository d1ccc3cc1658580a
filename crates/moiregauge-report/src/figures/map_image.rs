//! The image that a map was made of.

use super::map::MapSubject;
use super::residuals::extent;
use super::{Drawing, layout};
use crate::draw::axes::{Axes, Labels};
use crate::draw::style::COLUMN;
use crate::draw::svg::{Rect, Svg};
use crate::draw::{colorbar, raster};

pub(super) fn draw(subject: &MapSubject) -> Result<Drawing, String> {
    let picture = subject.details.picture.as_ref();
    let picture = picture.ok_or("the image was too large to be kept")?;
    let (image, linear, origin) = (&picture.image, &picture.pixel_to_nm, picture.origin);
    let (x, y) = extent(image, linear, origin).ok_or("the image covers no area")?;
    let side = COLUMN - layout::LEFT - 50.0;
    let height = (side * y.width() / x.width()).clamp(0.3 * side, 1.6 * side);
    let area = Rect::new(layout::LEFT, 12.0, side, height);
    let axes = Axes::equal(area, x, y);
    let mut svg = Svg::new(subject.id, COLUMN, area.bottom() + layout::BELOW);
    let shades = raster::Shades {
        map: subject.colours,
        range: raster::contrast(image, 0.005),
        crisp: false,
    };
    svg.clipped(area, |svg| {
        raster::draw(svg, &axes, image, linear, origin, &shades);
    });
    let labels = Labels {
        x: "x (nm)",
        y: "y (nm)",
        ..Labels::default()
    };
    axes.draw(&mut svg, &labels);
    let bar = Rect::new(area.right() + 6.0, area.y, 7.0, area.height);
    let what = (picture.channel.as_str(), picture.unit.as_str());
    colorbar::draw(&mut svg, bar, subject.colours, shades.range, what);
    let places = if picture.from_sensors {
        "the position sensors place it"
    } else {
        "the stated size and offset place it"
    };
    Ok(Drawing {
        wide: false,
        svg: svg.finish("Image behind the map"),
        caption: format!(
            "{} of {}, the first image behind the map, background removed, where {places}, not corrected for drift. x to the right, y up.",
            picture.channel,
            layout::short(&picture.file)
        ),
    })
}
