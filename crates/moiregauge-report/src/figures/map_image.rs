//! The image that a map was made of.

use super::figure::Drawing;
use super::layout;
use super::picture::{IN_NM, Picture, column, extent};
use super::subject::MapSubject;
use crate::draw::axes::Axes;
use crate::draw::raster;
use crate::draw::style::COLUMN;
use crate::draw::svg::Svg;

pub(super) fn draw(subject: &MapSubject) -> Result<Drawing, String> {
    let picture = subject.details.picture.as_ref();
    let picture = picture.ok_or("the image was too large to be kept")?;
    let (image, linear, origin) = (&picture.image, &picture.pixel_to_nm, picture.origin);
    let (x, y) = extent(image, linear, origin).ok_or("the image covers no area")?;
    let area = column(x, y, 12.0, 50.0);
    let axes = Axes::equal(area, x, y);
    let mut svg = Svg::new(subject.id, COLUMN, area.bottom() + layout::BELOW);
    let shown = Picture {
        image,
        linear,
        origin,
        map: subject.colours,
        range: raster::contrast(image, 0.005),
    };
    shown.pixels(&mut svg, &axes, |_| {});
    let what = (picture.channel.as_str(), picture.unit.as_str());
    shown.frame(&mut svg, &axes, &IN_NM, what);
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
