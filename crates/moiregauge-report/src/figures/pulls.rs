//! Pulls of a validation: errors in units of the stated σ, against the normal distribution.

use super::figure::Drawing;
use super::layout::{self, Grid, LETTERS};
use crate::draw::axes::{Axes, Labels, Ticks};
use crate::draw::legend::{self, Key};
use crate::draw::scale::Range;
use crate::draw::style::{BLACK, BLUE, LINE, PAGE};
use crate::draw::svg::{Ink, Svg};
use crate::stats::Histogram;

/// Beyond this no pull is shown one by one; the outermost bins hold what lies further out.
const REACH: f64 = 4.0;
/// A bin is half a σ wide where there are few sets, a quarter where there are many.
const FEW: usize = 400;

/// One panel for each quantity: its name and its pulls. At most six.
///
/// # Errors
/// Says what is missing.
pub fn pulls(quantities: &[(&str, Vec<f64>)]) -> Result<Drawing, String> {
    if quantities.is_empty() || quantities.len() > LETTERS.len() {
        return Err(format!(
            "{} quantities; 1 to 6 can be drawn",
            quantities.len()
        ));
    }
    let grid = Grid {
        width: PAGE,
        columns: 3,
        rows: quantities.len().div_ceil(3),
        panel: 105.0,
    };
    let mut svg = Svg::new("pulls", grid.width, grid.height());
    let x = Range::new(-REACH, REACH);
    let edge = REACH * (1.0 - 1e-9);
    let histograms: Vec<Histogram> = quantities
        .iter()
        .map(|(_, pulls)| {
            let held: Vec<f64> = pulls.iter().map(|p| p.clamp(-edge, edge)).collect();
            Histogram::of(&held, x, if pulls.len() < FEW { 16 } else { 32 })
        })
        .collect();
    let normal = |count: f64, step: f64| {
        (0..=160).map(move |i| {
            let z = REACH * (f64::from(i) / 80.0 - 1.0);
            let density = (-z * z / 2.0).exp() / std::f64::consts::TAU.sqrt();
            (z, density * count * step)
        })
    };
    for (i, ((name, pulls), histogram)) in quantities.iter().zip(&histograms).enumerate() {
        let count = pulls.len() as f64;
        let peak = count * histogram.step() / std::f64::consts::TAU.sqrt();
        let y = Range::new(0.0, 1.25 * histogram.highest().max(peak));
        let axes = Axes::new(grid.cell(i % 3, i / 3), x, y);
        svg.clipped(axes.area, |svg| {
            let outline = axes.points(histogram.outline());
            svg.polygon(&outline, &Ink::area(BLUE, 0.35));
            svg.polyline(&outline, &Ink::line(BLUE, 0.5));
            let curve = axes.points(normal(count, histogram.step()));
            svg.polyline(&curve, &Ink::line(BLACK, LINE));
        });
        let title = format!("{name}, rms {:.2}", rms(pulls));
        // The lowest panel of a column bears the numbers.
        let lowest = i + 3 >= quantities.len();
        axes.draw(
            &mut svg,
            &Labels {
                letter: LETTERS[i],
                title: &title,
                x: if lowest { "(found − true) / σ" } else { "" },
                y: if i % 3 == 0 { "sets" } else { "" },
                x_ticks: if lowest {
                    Ticks::Values
                } else {
                    Ticks::BareValues
                },
                ..Labels::default()
            },
        );
    }
    let keys = [
        (Key::Band(BLUE, 0.35), "simulated sets"),
        (Key::Line(BLACK, ""), "normal distribution of width 1"),
    ];
    legend::row(&mut svg, (layout::LEFT, 11.0), &keys);
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Pulls: errors in units of their stated standard deviations"),
        caption: "Errors of the simulated sets in units of the σ that each set states. If the stated σ are correct, \
                  the histogram follows the curve: 68.3 % within 1, 95.4 % within 2. The outermost bins also hold all \
                  values further out.".to_owned(),
    })
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}
