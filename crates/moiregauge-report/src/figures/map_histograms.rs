//! How twist and strain are distributed over the good nodes, and how much of that is noise.

use moiregauge::map::{Plane, Spread, TwistStrainMap};
use moiregauge::window::Mask;

use super::figure::Drawing;
use super::layout::{Grid, LETTERS};
use super::subject::MapSubject;
use crate::draw::axes::{Axes, Labels, Ticks};
use crate::draw::legend::{self, Key};
use crate::draw::scale::Range;
use crate::draw::style::{BLUE, GREY, LINE, ORANGE, PAGE, PALE};
use crate::draw::svg::{Ink, Svg};
use crate::format::two_digits;
use crate::stats::{Histogram, bins, central, gaussian};

pub(super) fn draw(subject: &MapSubject) -> Result<Drawing, String> {
    let map = subject.map;
    let degree = 1f64.to_degrees();
    let shown: [(&Plane, f64, &str, &str); 3] = [
        (&map.twist, degree, "twist θ (°)", "°"),
        (&map.strain[0], 100.0, "strain E₁ = ε cos 2φ (%)", " %"),
        (&map.strain[1], 100.0, "strain E₂ = ε sin 2φ (%)", " %"),
    ];
    let grid = Grid {
        width: PAGE,
        columns: 3,
        rows: 1,
        panel: 90.0,
    };
    let mut svg = Svg::new(subject.id, grid.width, grid.height());
    let mut words = Vec::new();
    for (i, (plane, factor, label, unit)) in shown.into_iter().enumerate() {
        let parts: Vec<(Spread, String)> = parts(map, plane, factor);
        if parts.is_empty() {
            return Err("the map has no good node".to_owned());
        }
        let values: Vec<f64> = (0..map.grid.len())
            .filter(|&n| map.mask[n] == Mask::Good)
            .map(|n| factor * f64::from(plane.value[n]))
            .filter(|v| v.is_finite())
            .collect();
        panel(&mut svg, (&grid, i), &values, &parts, label);
        let name = label.split(' ').take(2).collect::<Vec<_>>().join(" ");
        words.extend(parts.iter().map(|(spread, of)| {
            format!(
                "{name}{of}: spread {}{unit}, noise {}{unit}, without noise {}{unit}",
                two_digits(spread.spread),
                two_digits(spread.noise),
                two_digits(spread.corrected),
            )
        }));
    }
    let keys = [
        (Key::Band(PALE, 1.0), "good nodes"),
        (Key::Line(BLUE, ""), "noise alone"),
        (Key::Band(ORANGE, 0.25), "mean ± spread without noise"),
    ];
    legend::row(&mut svg, (super::layout::LEFT, 10.0), &keys);
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Distribution of twist and strain"),
        caption: format!(
            "Good nodes of the map. {}. Spreads are standard deviations; without noise: √(s² − ⟨σ²⟩).",
            words.join("; ")
        ),
    })
}

/// Mean and spread of all good nodes, or of those of each grain, with its name.
fn parts(map: &TwistStrainMap, plane: &Plane, factor: f64) -> Vec<(Spread, String)> {
    let most = map.grain.iter().copied().max();
    let Some(most) = most else {
        let all = map
            .spread(plane)
            .map(|s| (scaled(&s, factor), String::new()));
        return all.into_iter().collect();
    };
    let of_grain = |number: u8| {
        let spread = map.spread_where(plane, |node| map.grain[node] == number)?;
        Some((scaled(&spread, factor), format!(" of grain {number}")))
    };
    (1..=most).filter_map(of_grain).collect()
}

fn scaled(spread: &Spread, factor: f64) -> Spread {
    Spread {
        mean: factor * spread.mean,
        mean_sigma: factor * spread.mean_sigma,
        spread: factor * spread.spread,
        corrected: factor * spread.corrected,
        noise: factor * spread.noise,
    }
}

fn panel(
    svg: &mut Svg,
    (grid, i): (&Grid, usize),
    values: &[f64],
    parts: &[(Spread, String)],
    label: &str,
) {
    let area = grid.cell(i, 0);
    let range = central(values, 0.998).unwrap_or(Range::new(0.0, 1.0));
    let noise = parts.iter().map(|(spread, _)| spread.noise);
    let range = range.padded(0.08, 6.0 * noise.fold(1e-9, f64::max));
    let histogram = Histogram::of(values, range, bins(values.len()));
    let step = histogram.step();
    // Parts of about one size: a curve says where noise alone would be, and how wide.
    let density = values.len() as f64 * step / parts.len() as f64;
    // Noise may be far narrower than the distribution: its curve is cut off above.
    let top = 1.15 * histogram.highest();
    let axes = Axes::new(area, range, Range::new(0.0, top));
    svg.clipped(area, |svg| {
        let outline = axes.points(histogram.outline());
        svg.polygon(&outline, &Ink::area(PALE, 1.0));
        svg.polyline(&outline, &Ink::line(GREY, 0.5));
        for (spread, _) in parts {
            let [low, high] = [-1.0, 1.0].map(|s| axes.x.at(spread.mean + s * spread.corrected));
            let band = [
                (low, area.y),
                (high, area.y),
                (high, area.bottom()),
                (low, area.bottom()),
            ];
            svg.polygon(&band, &Ink::area(ORANGE, 0.25));
            let middle = axes.x.at(spread.mean);
            svg.line(
                (middle, area.y),
                (middle, area.bottom()),
                &Ink::line(ORANGE, LINE),
            );
            if spread.noise > 0.0 {
                let curve = (0..=300).map(|k| {
                    let x = range.low + range.width() * f64::from(k) / 300.0;
                    let noise = density * gaussian(x, spread.mean, spread.noise);
                    (x, noise.min(1.2 * top))
                });
                svg.polyline(&axes.points(curve), &Ink::line(BLUE, LINE));
            }
        }
    });
    let labels = Labels {
        letter: LETTERS[i],
        x: label,
        y: if i == 0 { "nodes" } else { "" },
        y_ticks: Ticks::None,
        ..Labels::default()
    };
    axes.draw(svg, &labels);
}
