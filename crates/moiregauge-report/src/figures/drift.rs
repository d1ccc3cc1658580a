//! The drift velocity over the Monte Carlo draws: density with the fitted Gaussian, both marginals
//! and the distribution of the residual.

use moiregauge::campaign::Drift;
use moiregauge::drift::DriftMonteCarlo;
use moiregauge::frame::Image;
use nalgebra::{Matrix2, Vector2};

use super::figure::Drawing;
use super::layout;
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels, Ticks};
use crate::draw::legend::{self, Key};
use crate::draw::raster;
use crate::draw::scale::Range;
use crate::draw::style::{BLACK, GREY, LINE, Marker, ORANGE, PAGE, PALE, outline};
use crate::draw::svg::{Ink, Rect, Svg};
use crate::stats::{Histogram, bins, central, ellipse, gaussian, mean_and_deviation};

const SIDE: f64 = 170.0;
const MARGINAL: f64 = 38.0;
const GAP: f64 = 6.0;
const PER_MINUTE: f64 = 60.0;

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let drift = subject
        .set
        .drift
        .as_ref()
        .ok_or("the scans of this set do not determine the drift")?;
    let draws = drift.monte_carlo.as_ref().ok_or(if drift.given {
        "the drift was given, not measured"
    } else {
        "no Monte Carlo draws of the drift were made"
    })?;
    let x: Vec<f64> = draws.draws.iter().map(|d| d.x * PER_MINUTE).collect();
    let y: Vec<f64> = draws.draws.iter().map(|d| d.y * PER_MINUTE).collect();
    let (Some(rx), Some(ry)) = (central(&x, 0.9995), central(&y, 0.9995)) else {
        return Err("no Monte Carlo draw of the drift is finite".to_owned());
    };
    let top = layout::LEGEND + layout::ABOVE;
    let area = Rect::new(layout::LEFT, top + MARGINAL + GAP, SIDE, SIDE);
    let axes = Axes::equal(area, rx.padded(0.06, 1e-9), ry.padded(0.06, 1e-9));
    let mut svg = Svg::new(subject.id, PAGE, area.bottom() + layout::BELOW);
    density(&mut svg, subject, &axes, (&x, &y));
    contours(&mut svg, &axes, drift, draws);
    let labels = Labels {
        x: "drift x (nm/min)",
        y: "drift y (nm/min)",
        ..Labels::default()
    };
    axes.draw(&mut svg, &labels);
    marginals(&mut svg, &axes, draws, (&x, &y));
    losses(&mut svg, draws, area);

    let mut keys = vec![
        (Key::Point(Marker::Circle, BLACK, true), "least squares"),
        (Key::Line(ORANGE, ""), "Gaussian fit, 1σ and 2σ"),
    ];
    if drift
        .fit
        .as_ref()
        .is_some_and(|fit| fit.paper_velocity.is_some())
    {
        keys.push((
            Key::Point(Marker::Diamond, BLACK, false),
            "published estimator",
        ));
    }
    legend::row(&mut svg, (layout::LEFT, 11.0), &keys);
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Distribution of the drift velocity and of the residual"),
        caption: format!(
            "(a) Drift velocity of the sample in the frame of the sensors over {} Monte Carlo draws of peak positions and tip velocities; brighter means more draws. Ellipses: the Gaussian with the mean and covariance of the draws. Above and at the right: the marginal distributions with the same Gaussian. Circle: the weighted least-squares estimate with its analytic σ. (b) Root-mean-square residual of each draw.",
            draws.draws.len()
        ),
    })
}

/// Cells along each side of the density.
fn cells(n: usize) -> usize {
    3 * bins(n) / 2
}

/// Counts of draws in square cells; empty cells stay white.
fn density(svg: &mut Svg, subject: &Subject, axes: &Axes, (x, y): (&[f64], &[f64])) {
    let cells = cells(x.len());
    let (rx, ry) = (axes.x.range, axes.y.range);
    let step = Vector2::new(rx.width(), ry.width()) / cells as f64;
    let mut counts = vec![0.0; cells * cells];
    for (&x, &y) in x.iter().zip(y) {
        if rx.contains(x) && ry.contains(y) {
            let column = (((x - rx.low) / step.x) as usize).min(cells - 1);
            let row = (((y - ry.low) / step.y) as usize).min(cells - 1);
            counts[row * cells + column] += 1.0;
        }
    }
    let most = counts.iter().copied().fold(1.0, f64::max);
    for count in counts.iter_mut().filter(|c| **c == 0.0) {
        *count = f64::NAN;
    }
    let image = Image::new(cells, cells, counts);
    let origin = Vector2::new(rx.low, ry.low) + step / 2.0;
    let shades = raster::Shades {
        map: subject.map,
        range: Range::new(0.0, most),
        crisp: true,
    };
    svg.clipped(axes.area, |svg| {
        raster::draw(
            svg,
            axes,
            &image,
            &Matrix2::from_diagonal(&step),
            origin,
            &shades,
        );
    });
}

fn contours(svg: &mut Svg, axes: &Axes, drift: &Drift, draws: &DriftMonteCarlo) {
    let (mean, covariance) = (
        draws.mean * PER_MINUTE,
        draws.covariance * PER_MINUTE * PER_MINUTE,
    );
    let estimate = drift.velocity * PER_MINUTE;
    let sigma = |i: usize| drift.covariance[(i, i)].max(0.0).sqrt() * PER_MINUTE;
    svg.clipped(axes.area, |svg| {
        for n in [1.0, 2.0] {
            let contour = axes.points(ellipse(mean, &covariance, n));
            svg.polygon(&contour, &Ink::line("#ffffff", LINE + 1.0));
            svg.polygon(&contour, &Ink::line(ORANGE, LINE));
        }
        if let Some(paper) = drift.fit.as_ref().and_then(|fit| fit.paper_velocity) {
            let paper = paper * PER_MINUTE;
            let ink = Ink {
                fill: "#ffffff",
                ..Ink::line(BLACK, 0.8)
            };
            outline(svg, axes.at(paper.x, paper.y), Marker::Diamond, 2.4, &ink);
        }
        axes.error_bar(svg, estimate.x, estimate.y, sigma(1), BLACK);
        axes.error_bar_x(svg, estimate.x, estimate.y, sigma(0), BLACK);
        let ink = Ink {
            fill: BLACK,
            ..Ink::line("#ffffff", 0.6)
        };
        outline(
            svg,
            axes.at(estimate.x, estimate.y),
            Marker::Circle,
            2.4,
            &ink,
        );
    });
}

fn marginals(svg: &mut Svg, axes: &Axes, draws: &DriftMonteCarlo, (x, y): (&[f64], &[f64])) {
    let area = axes.area;
    let fit = |i: usize| {
        let sigma = draws.covariance[(i, i)].max(0.0).sqrt() * PER_MINUTE;
        (draws.mean[i] * PER_MINUTE, sigma)
    };
    let counts = Histogram::of(x, axes.x.range, cells(x.len()));
    let full = Range::new(0.0, counts.highest() * 1.12);
    let above = Rect::new(area.x, area.y - GAP - MARGINAL, SIDE, MARGINAL);
    let top = Axes::new(above, axes.x.range, full);
    svg.polygon(&top.points(counts.outline()), &Ink::area(PALE, 1.0));
    svg.polyline(
        &top.points(bell(&counts, fit(0), x.len())),
        &Ink::line(ORANGE, LINE),
    );
    let bare = Labels {
        letter: "a",
        x_ticks: Ticks::BareValues,
        y_ticks: Ticks::None,
        ..Labels::default()
    };
    top.draw(svg, &bare);

    let counts = Histogram::of(y, axes.y.range, cells(y.len()));
    let full = Range::new(0.0, counts.highest() * 1.12);
    let beside = Rect::new(area.right() + GAP, area.y, MARGINAL, SIDE);
    let right = Axes::new(beside, full, axes.y.range);
    let turned = |points: Vec<(f64, f64)>| right.points(points.into_iter().map(|(v, n)| (n, v)));
    svg.polygon(&turned(counts.outline()), &Ink::area(PALE, 1.0));
    svg.polyline(
        &turned(bell(&counts, fit(1), y.len())),
        &Ink::line(ORANGE, LINE),
    );
    svg.rect(beside, &Ink::line(BLACK, 0.5));
}

/// The Gaussian in counts per bin.
fn bell(counts: &Histogram, (mean, sigma): (f64, f64), n: usize) -> Vec<(f64, f64)> {
    let range = counts.range;
    (0..=120)
        .map(|i| range.low + range.width() * f64::from(i) / 120.0)
        .map(|v| (v, gaussian(v, mean, sigma) * counts.step() * n as f64))
        .collect()
}

fn losses(svg: &mut Svg, draws: &DriftMonteCarlo, beside: Rect) {
    let left = beside.right() + GAP + MARGINAL + layout::LEFT + 6.0;
    let top = beside.y - GAP - MARGINAL;
    let area = Rect::new(left, top, PAGE - left - 9.0, beside.bottom() - top);
    // Picometres keep the numbers short.
    let values: Vec<f64> = draws.losses.iter().map(|loss| loss * 1000.0).collect();
    let Some(range) = central(&values, 0.999) else {
        return;
    };
    let counts = Histogram::of(&values, range.padded(0.05, 1e-9), bins(values.len()));
    let axes = Axes::new(area, counts.range, Range::new(0.0, counts.highest() * 1.08));
    svg.polygon(&axes.points(counts.outline()), &Ink::area(PALE, 1.0));
    svg.polyline(&axes.points(counts.outline()), &Ink::line(GREY, 0.6));
    let (mean, _) = mean_and_deviation(&values);
    let x = axes.x.at(mean);
    svg.line((x, area.y), (x, area.bottom()), &Ink::line(ORANGE, LINE));
    let title = format!("mean {mean:.1} pm");
    let labels = Labels {
        letter: "b",
        title: &title,
        x: "residual (pm)",
        y: "draws",
        ..Labels::default()
    };
    axes.draw(svg, &labels);
}
