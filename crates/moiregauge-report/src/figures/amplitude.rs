//! Phase and amplitude of one line of one scan side by side.

use moiregauge::frame::Image;

use super::residuals::extent;
use super::{Drawing, Subject, layout};
use crate::draw::axes::{Axes, Labels};
use crate::draw::style::PAGE;
use crate::draw::svg::{Rect, Svg};
use crate::draw::{colorbar, raster};

const SIDE: f64 = 162.0;

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let shown = subject.set.illustration.as_ref();
    let shown = shown.ok_or("no scan of this set could be shown in detail")?;
    let amplitude = shown.amplitude.as_ref();
    let amplitude = amplitude.ok_or("no amplitude was recorded beside the analysed channel")?;
    let (linear, origin) = (&shown.pixel_to_nm, shown.origin);
    let (x, y) =
        extent(&shown.image, linear, origin).ok_or("the frame of the scan is not finite")?;
    let mut svg = Svg::new(subject.id, PAGE, 8.0 + layout::ABOVE + SIDE + layout::BELOW);
    let both: [(&Image, &str, &str); 2] = [
        (&shown.image, &subject.set.channel, &shown.unit),
        (&amplitude.image, &amplitude.channel, &amplitude.unit),
    ];
    for (index, (image, channel, unit)) in both.into_iter().enumerate() {
        let left = layout::LEFT + index as f64 * PAGE / 2.0;
        let area = Rect::new(left, 8.0 + layout::ABOVE, SIDE, SIDE);
        let axes = Axes::equal(area, x, y);
        let shades = raster::Shades {
            map: subject.map,
            range: raster::contrast(image, 0.005),
            crisp: false,
        };
        svg.clipped(area, |svg| {
            raster::draw(svg, &axes, image, linear, origin, &shades);
        });
        let labels = Labels {
            letter: layout::LETTERS[index],
            title: channel,
            x: "x (nm)",
            y: "y (nm)",
            ..Labels::default()
        };
        axes.draw(&mut svg, &labels);
        let bar = Rect::new(area.right() + 5.0, area.y, 6.0, SIDE);
        colorbar::draw(&mut svg, bar, subject.map, shades.range, (channel, unit));
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
