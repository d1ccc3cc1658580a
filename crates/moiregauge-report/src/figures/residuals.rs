//! Both position sensors over the whole frame: reading less the affine fit that places the pixels.

use moiregauge::frame::Image;
use nalgebra::Vector2;

use super::figure::Drawing;
use super::layout;
use super::picture::{self, IN_NM, Picture, extent};
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels};
use crate::draw::raster;
use crate::stats::mean_and_deviation;

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let shown = subject.illustration()?;
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
    let mut svg = picture::page_of_two(subject.id);
    let mut words = Vec::new();
    for (index, image) in picometres.iter().enumerate() {
        let (x, y) = extent(image, &linear, origin).ok_or("the frame of the scan is not finite")?;
        let axes = Axes::equal(picture::square(picture::left_of(index)), x, y);
        let picture = Picture {
            image,
            linear: &linear,
            origin,
            map: subject.map,
            range: raster::contrast(image, 0.01),
        };
        picture.pixels(&mut svg, &axes, |_| {});
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
            ..IN_NM
        };
        picture.frame(&mut svg, &axes, &labels, ("reading − fit", "pm"));
    }
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Residual maps of both position sensors"),
        caption: format!(
            "Reading of the x sensor (a) and of the y sensor (b) less the affine fit that places the pixels, for {} \
             ({}), means over blocks of {} × {} pixels; standard deviation {}. Structure that is the same in every \
             scan (hysteresis of the scanner, columns where the tip turns round) is not noise. Colours from the 1 % to \
             the 99 % quantile.",
            layout::short(&shown.file),
            layout::line_name(shown.line),
            shown.residual_block,
            shown.residual_block,
            words.join(", ")
        ),
    })
}
