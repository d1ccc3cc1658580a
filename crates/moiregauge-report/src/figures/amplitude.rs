//! Phase and amplitude of one line of one scan side by side.

use moiregauge::frame::Image;

use super::figure::Drawing;
use super::layout;
use super::picture::{self, IN_NM, Picture, extent};
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels};
use crate::draw::raster;

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let shown = subject.illustration()?;
    let amplitude = shown.amplitude.as_ref();
    let amplitude = amplitude.ok_or("no amplitude was recorded beside the analysed channel")?;
    let (linear, origin) = (&shown.pixel_to_nm, shown.origin);
    let (x, y) =
        extent(&shown.image, linear, origin).ok_or("the frame of the scan is not finite")?;
    let mut svg = picture::page_of_two(subject.id);
    let both: [(&Image, &str, &str); 2] = [
        (&shown.image, &subject.set.channel, &shown.unit),
        (&amplitude.image, &amplitude.channel, &amplitude.unit),
    ];
    for (index, (image, channel, unit)) in both.into_iter().enumerate() {
        let axes = Axes::equal(picture::square(picture::left_of(index)), x, y);
        let picture = Picture {
            image,
            linear,
            origin,
            map: subject.map,
            range: raster::contrast(image, 0.005),
        };
        picture.pixels(&mut svg, &axes, |_| {});
        let labels = Labels {
            letter: layout::LETTERS[index],
            title: channel,
            ..IN_NM
        };
        picture.frame(&mut svg, &axes, &labels, (channel, unit));
    }
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Phase and amplitude"),
        caption: format!(
            "{} (a), which was analysed, and {} (b) of the same {} of {}, background removed, in sensor coordinates. Colours from the 0.5 % to the 99.5 % quantile.",
            subject.set.channel,
            amplitude.channel,
            layout::line_name(shown.line),
            layout::short(&shown.file)
        ),
    })
}
