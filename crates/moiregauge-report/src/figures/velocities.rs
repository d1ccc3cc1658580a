//! Distributions of the fast and the slow tip velocity, as fitted line by line.

use super::figure::Drawing;
use super::layout;
use super::layout::Grid;
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels};
use crate::draw::legend::{self, Key};
use crate::draw::scale::Range;
use crate::draw::style::{GREY, LINE, ORANGE, PAGE, PALE};
use crate::draw::svg::{Ink, Svg};
use crate::format::plus_minus;
use crate::stats::{Histogram, bins, central, gaussian, mean_and_deviation};
use heterostrain::Estimate;

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let shown = subject.illustration()?;
    if shown.fast_velocities.len() < 2 || shown.slow_velocities.len() < 2 {
        return Err("there are no position sensors to fit velocities to".to_owned());
    }
    let grid = Grid {
        width: PAGE,
        columns: 2,
        rows: 1,
        panel: 104.0,
    };
    let mut svg = Svg::new(subject.id, grid.width, grid.height());
    let panels = [&shown.fast_velocities, &shown.slow_velocities];
    for (column, values) in panels.into_iter().enumerate() {
        let range = central(values, 1.0)
            .ok_or("no tip velocity is finite")?
            .padded(0.06, 1e-9);
        let counts = Histogram::of(values, range, bins(values.len()));
        let (mean, sigma) = mean_and_deviation(values);
        let curve = (0..=120)
            .map(|i| range.low + range.width() * f64::from(i) / 120.0)
            .map(|v| {
                let n = values.len() as f64;
                (v, gaussian(v, mean, sigma) * counts.step() * n)
            });
        let curve: Vec<(f64, f64)> = curve.collect();
        let top = curve.iter().map(|p| p.1).fold(counts.highest(), f64::max);
        let axes = Axes::new(grid.cell(column, 0), range, Range::new(0.0, top * 1.08));
        svg.polygon(&axes.points(counts.outline()), &Ink::area(PALE, 1.0));
        svg.polyline(&axes.points(counts.outline()), &Ink::line(GREY, 0.6));
        svg.polyline(&axes.points(curve), &Ink::line(ORANGE, LINE));
        let title = format!("{} nm/s", plus_minus(Estimate::new(mean, sigma)));
        let labels = Labels {
            letter: ["a", "b"][column],
            title: &title,
            x: ["fast tip velocity (nm/s)", "slow tip velocity (nm/s)"][column],
            y: ["lines", "columns"][column],
            ..Labels::default()
        };
        axes.draw(&mut svg, &labels);
    }
    let keys = [
        (Key::Band(PALE, 1.0), "line-by-line fits"),
        (
            Key::Line(ORANGE, ""),
            "Gaussian of the same mean and spread",
        ),
    ];
    legend::row(&mut svg, (layout::LEFT, 11.0), &keys);
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Distributions of the fast and slow tip velocity"),
        caption: format!(
            "Tip velocities of {} from straight-line fits to the position sensors: along each line for the fast axis (a), along each column for the slow axis (b). Above: mean ± standard deviation over the lines (the error of the mean is smaller).",
            layout::short(&shown.file)
        ),
    })
}
