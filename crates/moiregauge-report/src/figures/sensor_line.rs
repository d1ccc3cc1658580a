//! The position sensor of the fast axis along one line: reading, fit and residual.

use super::figure::Drawing;
use super::layout;
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels, Ticks, zero_line};
use crate::draw::legend::{self, Key};
use crate::draw::scale::Range;
use crate::draw::style::{BLUE, COLUMN, LINE, ORANGE};
use crate::draw::svg::{Ink, Rect, Svg};
use crate::stats::mean_and_deviation;

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let shown = subject.illustration()?;
    let line = &shown.sensor_line;
    let columns = Range::of(line.iter().map(|p| p[0]));
    let positions = Range::of(line.iter().flat_map(|p| [p[1], p[2]]));
    let (Some(columns), Some(positions)) = (columns, positions) else {
        return Err("there are no position sensors".to_owned());
    };
    // Picometres keep the numbers short.
    let residuals: Vec<f64> = line.iter().map(|p| (p[1] - p[2]) * 1000.0).collect();
    let spread = Range::of(residuals.iter().copied()).unwrap_or(Range::new(-1.0, 1.0));
    let x = columns.padded(0.02, 1.0);
    let width = COLUMN - layout::LEFT - 9.0;
    let upper = Rect::new(layout::LEFT, layout::LEGEND + layout::ABOVE, width, 108.0);
    let lower = Rect::new(
        layout::LEFT,
        upper.bottom() + layout::ABOVE + 3.0,
        width,
        62.0,
    );
    let mut svg = Svg::new(subject.id, COLUMN, lower.bottom() + layout::BELOW);

    let axes = Axes::new(upper, x, positions.padded(0.05, 1e-6));
    svg.polyline(
        &axes.points(line.iter().map(|p| (p[0], p[1]))),
        &Ink::line(BLUE, 1.6),
    );
    let fit = Ink::line(ORANGE, LINE).dashed("3 2");
    svg.polyline(&axes.points(line.iter().map(|p| (p[0], p[2]))), &fit);
    let labels = Labels {
        letter: "a",
        y: "position (nm)",
        x_ticks: Ticks::BareValues,
        ..Labels::default()
    };
    axes.draw(&mut svg, &labels);

    let axes = Axes::new(lower, x, spread.padded(0.08, 1e-3));
    zero_line(&mut svg, &axes);
    let residual = line.iter().zip(&residuals).map(|(p, &r)| (p[0], r));
    svg.polyline(&axes.points(residual), &Ink::line(BLUE, 0.6));
    let (_, deviation) = mean_and_deviation(&residuals);
    let title = format!("standard deviation {deviation:.0} pm");
    let labels = Labels {
        letter: "b",
        title: &title,
        x: "column (pixel)",
        y: "residual (pm)",
        ..Labels::default()
    };
    axes.draw(&mut svg, &labels);
    let keys = [
        (Key::Line(BLUE, ""), "sensor"),
        (Key::Line(ORANGE, "3 2"), "plane fit"),
    ];
    legend::row(&mut svg, (layout::LEFT, 11.0), &keys);
    Ok(Drawing {
        wide: false,
        svg: svg.finish("Position sensor along one line with fit and residual"),
        caption: format!(
            "Reading of the position sensor of the fast axis along the middle line of {} ({}), the plane fit of the whole frame along that line (a) and the difference of the two (b).",
            layout::short(&shown.file),
            layout::line_name(shown.line)
        ),
    })
}
