//! Distributions of twist, strain, its axis and the orientation of the lattice over the Monte Carlo draws of every scan.

use std::f64::consts::FRAC_PI_3;

use heterostrain::Estimate;
use heterostrain::strain::StrainDraw;
use heterostrain::strain::TwistStrain;
use moiregauge::campaign::ScanAnalysis;

use super::figure::Drawing;
use super::layout;
use super::layout::{LETTERS, is_up, ordinal};
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels, Ticks};
use crate::draw::legend::{self, Key};
use crate::draw::scale::Range;
use crate::draw::style::{BLACK, BLUE, Marker, PAGE, marker};
use crate::draw::svg::{Ink, Rect, Svg};
use crate::stats::{Histogram, axis_near, central};

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let scans = &subject.set.scans;
    let drawn: Vec<(usize, &ScanAnalysis)> = scans
        .iter()
        .enumerate()
        .filter(|(_, s)| !s.draws.is_empty())
        .collect();
    if drawn.is_empty() {
        return Err("no Monte Carlo draws of twist and strain were made".to_owned());
    }
    let all = drawn
        .iter()
        .flat_map(|(_, s)| s.draws.iter().map(|d| d.strain_vector));
    let sum = all.fold(nalgebra::Vector2::zeros(), |sum, e| sum + e);
    let axis = sum.y.atan2(sum.x) / 2.0;

    let count = scans.len() as f64;
    let panel = (13.0 * count).clamp(60.0, 430.0);
    let top = layout::LEGEND + layout::ABOVE;
    let mut svg = Svg::new(subject.id, PAGE, top + panel + layout::BELOW);
    let width = (PAGE - 30.0 - 9.0) / 4.0;
    let angle = drawn
        .first()
        .and_then(|(_, s)| s.draws.first())
        .map_or(0.0, |d| d.lattice_angle);
    let near = [axis, angle];
    for quantity in 0..4 {
        let values: Vec<Vec<f64>> = drawn
            .iter()
            .map(|(_, s)| s.draws.iter().map(|d| of_draw(d, quantity, near)).collect())
            .collect();
        let range = central(&values.concat(), 0.998).ok_or("no draw is finite")?;
        let area = Rect::new(30.0 + quantity as f64 * width, top, width - 11.0, panel);
        let rows = Range::new(0.7, count + 1.1);
        let axes = Axes::new(area, range.padded(0.04, 1e-9), rows);
        ridges(&mut svg, &axes, &drawn, &values);
        for (index, scan) in &drawn {
            let result = scan.twist_strain.or(scan.twist_strain_sensor);
            if let Some(value) = result.and_then(|t| of_result(&t, quantity, near)) {
                axes.error_bar_x(&mut svg, value.value, ordinal(*index), value.sigma, BLACK);
                if axes.x.range.contains(value.value) {
                    let at = axes.at(value.value, ordinal(*index));
                    marker(&mut svg, at, Marker::Circle, BLACK, is_up(scan));
                }
            }
        }
        let labels = Labels {
            letter: LETTERS[quantity],
            x: [
                "twist θ (°)",
                "strain ε (%)",
                "strain axis φ, from x (°)",
                "lattice angle α (°)",
            ][quantity],
            y: if quantity == 0 { "scan" } else { "" },
            y_ticks: Ticks::scans(quantity == 0),
            ..Labels::default()
        };
        axes.draw(&mut svg, &labels);
    }
    let keys: Vec<_> = legend::directions()
        .into_iter()
        .chain([(Key::Band(BLUE, 0.35), "Monte Carlo draws")])
        .collect();
    legend::row(&mut svg, (30.0, 11.0), &keys);
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Distributions of twist, strain, axis and lattice angle per scan"),
        caption: "Monte Carlo distributions of twist, strain, its axis (modulo 180°) and the orientation α of layer 1 \
                  (modulo 60°) for every scan, the scans from bottom to top. Circles: the estimate with its analytic \
                  statistical σ. The strain of the draws is the length of the strain vector, which noise makes longer; \
                  in the circle this bias is removed. An axis without a circle is not significant (p ≥ 0.01).".to_owned(),
    })
}

/// `near`: the axis and the orientation about which their values are shown.
fn of_draw(draw: &StrainDraw, quantity: usize, [axis, angle]: [f64; 2]) -> f64 {
    let e = draw.strain_vector;
    match quantity {
        0 => draw.twist.to_degrees(),
        1 => e.norm() * 100.0,
        2 => axis_near(e.y.atan2(e.x) / 2.0, axis).to_degrees(),
        _ => angle_near(draw.lattice_angle, angle).to_degrees(),
    }
}

/// The orientation modulo 60° that is nearest to `near`, rad.
fn angle_near(angle: f64, near: f64) -> f64 {
    angle - FRAC_PI_3 * ((angle - near) / FRAC_PI_3).round()
}

fn of_result(result: &TwistStrain, quantity: usize, [axis, angle]: [f64; 2]) -> Option<Estimate> {
    let degree = 1_f64.to_degrees();
    match quantity {
        0 => Some(result.twist().scaled(degree)),
        1 => Some(result.heterostrain().scaled(100.0)),
        3 => {
            let found = result.lattice_angle();
            Some(Estimate::new(angle_near(found.value, angle), found.sigma).scaled(degree))
        }
        _ => result
            .axis_lab()
            .map(|a| Estimate::new(axis_near(a.value, axis), a.sigma).scaled(degree)),
    }
}

/// One histogram per scan, standing on the line of its scan, all to the same scale.
fn ridges(svg: &mut Svg, axes: &Axes, drawn: &[(usize, &ScanAnalysis)], values: &[Vec<f64>]) {
    let histograms: Vec<Histogram> = values
        .iter()
        .map(|v| Histogram::of(v, axes.x.range, 56))
        .collect();
    let highest = histograms
        .iter()
        .map(Histogram::highest)
        .fold(1.0, f64::max);
    svg.clipped(axes.area, |svg| {
        for ((index, scan), histogram) in drawn.iter().zip(&histograms).rev() {
            let base = ordinal(*index);
            let lifted = histogram
                .outline()
                .into_iter()
                .map(|(v, n)| (v, base + 0.92 * n / highest));
            let outline = axes.points(lifted);
            let opacity = if is_up(scan) { 0.4 } else { 0.18 };
            svg.polygon(&outline, &Ink::area(BLUE, opacity));
            svg.polyline(&outline, &Ink::line(BLUE, 0.5));
        }
    });
}
