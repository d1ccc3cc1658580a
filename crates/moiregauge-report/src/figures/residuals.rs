//! Both position sensors over the whole frame: reading less the affine fit that places the pixels.

use moiregauge::frame::Image;
use nalgebra::Vector2;

use super::{Drawing, Subject, layout};
use crate::draw::axes::{Axes, Labels};
use crate::draw::scale::Range;
use crate::draw::style::PAGE;
use crate::draw::svg::{Rect, Svg};
use crate::draw::{colorbar, raster};
use crate::stats::mean_and_deviation;

const SIDE: f64 = 162.0;

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let shown = subject.set.illustration.as_ref();
    let shown = shown.ok_or("no scan of this set could be shown in detail")?;
    let residuals = shown.sensor_residuals.as_ref();
    let residuals = residuals.ok_or("there are no position sensors")?;
    // Picometres keep the numbers short.
    let picometres = residuals.each_ref().map(|image| {
        let values = image.values.iter().map(|v| 1000.0 * v).collect();
        Image::new(image.rows, image.columns, values)
    });
    let block = shown.residual_block as f64;
    let linear = shown.pixel_to_nm * block;
    let origin = shown.origin + shown.pixel_to_nm * Vector2::repeat((block - 1.0) / 2.0);
    let mut svg = Svg::new(subject.id, PAGE, 8.0 + layout::ABOVE + SIDE + layout::BELOW);
    let mut words = Vec::new();
    for (index, image) in picometres.iter().enumerate() {
        let (x, y) = extent(image, &linear, origin).ok_or("the frame of the scan is not finite")?;
        let left = layout::LEFT + index as f64 * PAGE / 2.0;
        let area = Rect::new(left, 8.0 + layout::ABOVE, SIDE, SIDE);
        let axes = Axes::equal(area, x, y);
        let shades = raster::Shades {
            map: subject.map,
            range: raster::contrast(image, 0.01),
            crisp: false,
        };
        svg.clipped(area, |svg| {
            raster::draw(svg, &axes, image, &linear, origin, &shades);
        });
        let finite: Vec<f64> = image
            .values
            .iter()
            .copied()
            .filter(|v| v.is_finite())
            .collect();
        let (_, deviation) = mean_and_deviation(&finite);
        let name = ["x", "y"][index];
        words.push(format!("{name} {deviation:.0} pm"));
        let title = format!("{name} sensor");
        let labels = Labels {
            letter: layout::LETTERS[index],
            title: &title,
            x: "x (nm)",
            y: "y (nm)",
            ..Labels::default()
        };
        axes.draw(&mut svg, &labels);
        let bar = Rect::new(area.right() + 5.0, area.y, 6.0, SIDE);
        colorbar::draw(
            &mut svg,
            bar,
            subject.map,
            shades.range,
            ("reading − fit", "pm"),
        );
    }
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Residual maps of both position sensors"),
        caption: format!(
            "Reading of the x sensor (a) and of the y sensor (b) less the affine fit that places the pixels, for {} ({}), means over blocks of {} × {} pixels; standard deviation {}. Structure that is the same in every scan (hysteresis of the scanner, columns where the tip turns round) is no noise. Colours from the 1 % to the 99 % quantile.",
            layout::short(&shown.file),
            layout::line_name(shown.line),
            shown.residual_block,
            shown.residual_block,
            words.join(", ")
        ),
    })
}

/// From where to where the pixels of an image reach along x and y.
pub(super) fn extent(
    image: &Image,
    linear: &nalgebra::Matrix2<f64>,
    origin: Vector2<f64>,
) -> Option<(Range, Range)> {
    let (right, top) = (image.columns as f64 - 0.5, image.rows as f64 - 0.5);
    let corners = [(-0.5, -0.5), (right, -0.5), (right, top), (-0.5, top)]
        .map(|(c, r)| origin + linear * Vector2::new(c, r));
    let range =
        |axis: usize| Range::of(corners.iter().map(|c| c[axis])).filter(|r| r.width() > 0.0);
    range(0).zip(range(1))
}
