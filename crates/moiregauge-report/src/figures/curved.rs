//! Position sensors of a scanner that bends: readings less planes, less the curved grid, and that grid.

use moiregauge::scan::BentSensors;
use nalgebra::{Matrix2, Vector2};

use super::figure::Drawing;
use super::layout;
use super::picture::{IN_NM, Picture, extent};
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels, Ticks};
use crate::draw::raster;
use crate::draw::scale::Range;
use crate::draw::style::{BLUE, HAIR, PAGE, PALE};
use crate::draw::svg::{Ink, Rect, Svg};
use crate::format::two_digits;
use crate::stats::mean_and_deviation;

/// Side of a panel, pt.
const SIDE: f64 = 72.0;
/// Left edges of the panels, pt: before and after of x, before and after of y, the grid.
const EDGES: [f64; 5] = [34.0, 111.0, 232.0, 309.0, 430.0];
/// From row to row, pt.
const STEP: f64 = layout::ABOVE + SIDE + 6.0;
/// The largest departure is drawn as this share of the frame.
const SHOWN: f64 = 0.06;

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let shown = subject.illustration()?;
    if shown.bent.is_empty() {
        return Err("no position sensor departs from a plane".to_owned());
    }
    let block = shown.residual_block as f64;
    let linear = shown.pixel_to_nm * block;
    let origin = shown.origin + shown.pixel_to_nm * Vector2::repeat((block - 1.0) / 2.0);
    let rows = shown.bent.len();
    let mut svg = Svg::new(subject.id, PAGE, rows as f64 * STEP + layout::BELOW);
    let mut words = Vec::new();
    for (row, bent) in shown.bent.iter().enumerate() {
        let top = row as f64 * STEP + layout::ABOVE;
        let last = row + 1 == rows;
        for axis in 0..2 {
            words.push(sensor(
                &mut svg,
                bent,
                (axis, top, last),
                (&linear, origin),
                subject,
            )?);
        }
        grid(&mut svg, bent, Rect::new(EDGES[4], top, SIDE, SIDE), last)?;
    }
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Position sensors of a scanner that bends"),
        caption: format!(
            "Readings of the position sensors for {}, a row for each line direction: less the planes, then less the smooth departure that predicts \
             lines that were held out, and the grid with this departure enlarged so that it is seen (grey: straight). Standard deviations: {}. \
             The lattice is measured on the curved grid.",
            layout::short(&shown.file),
            words.join("; ")
        ),
    })
}

/// What a plane and the curved grid leave of a sensor, and how much that is in words.
fn sensor(
    svg: &mut Svg,
    bent: &BentSensors,
    (axis, top, last): (usize, f64, bool),
    (linear, origin): (&Matrix2<f64>, Vector2<f64>),
    subject: &Subject,
) -> Result<String, String> {
    let range = raster::contrast(&bent.before[axis], 0.01);
    let name = ["x", "y"][axis];
    let mut sizes = Vec::new();
    for (after, image) in [&bent.before[axis], &bent.after[axis]]
        .into_iter()
        .enumerate()
    {
        let (x, y) = extent(image, linear, origin).ok_or("the frame of the scan is not finite")?;
        let area = Rect::new(EDGES[2 * axis + after], top, SIDE, SIDE);
        let axes = Axes::equal(area, x, y);
        let picture = Picture {
            image,
            linear,
            origin,
            map: subject.map,
            range,
        };
        picture.pixels(svg, &axes, |_| {});
        let line = layout::line_name(bent.line);
        let title = [
            format!("{name}, {line}: less plane"),
            "less departure".to_owned(),
        ];
        let labels = Labels {
            title: &title[after],
            ..labels(axis + after == 0, last)
        };
        if after == 1 {
            picture.frame(svg, &axes, &labels, ("", "nm"));
        } else {
            axes.draw(svg, &labels);
        }
        let finite: Vec<f64> = image
            .values
            .iter()
            .copied()
            .filter(|v| v.is_finite())
            .collect();
        sizes.push(two_digits(mean_and_deviation(&finite).1));
    }
    Ok(format!(
        "{name}, {}: {} nm, then {} nm",
        layout::line_name(bent.line),
        sizes[0],
        sizes[1]
    ))
}

fn labels(first: bool, last: bool) -> Labels<'static> {
    Labels {
        x: if last { "x (nm)" } else { "" },
        y: if first { "y (nm)" } else { "" },
        x_ticks: if last {
            Ticks::Values
        } else {
            Ticks::BareValues
        },
        y_ticks: if first {
            Ticks::Values
        } else {
            Ticks::BareValues
        },
        ..IN_NM
    }
}

/// The grid of a line direction with its departure enlarged.
fn grid(svg: &mut Svg, bent: &BentSensors, area: Rect, last: bool) -> Result<(), String> {
    let all = || bent.grid.iter().flatten();
    let largest = all().map(|[_, off]| off.norm()).fold(0.0, f64::max);
    let over = |i: usize| Range::of(all().map(|[at, _]| at[i])).filter(|r| r.width() > 0.0);
    let (x, y) = over(0)
        .zip(over(1))
        .ok_or("the frame of the scan is not finite")?;
    let factor = SHOWN * x.width().max(y.width()) / largest.max(f64::MIN_POSITIVE);
    let wider = |r: Range| {
        Range::new(
            r.low - 2.0 * SHOWN * r.width(),
            r.high + 2.0 * SHOWN * r.width(),
        )
    };
    let axes = Axes::equal(area, wider(x), wider(y));
    svg.clipped(axes.area, |svg| {
        for (enlarged, colour) in [(0.0, PALE), (factor, BLUE)] {
            for line in &bent.grid {
                let places = line.iter().map(|[at, off]| at + off * enlarged);
                let points = axes.points(places.map(|at| (at.x, at.y)));
                svg.polyline(&points, &Ink::line(colour, HAIR));
            }
        }
    });
    let title = format!("departure × {}", two_digits(factor));
    axes.draw(
        svg,
        &Labels {
            title: &title,
            ..labels(false, last)
        },
    );
    Ok(())
}
