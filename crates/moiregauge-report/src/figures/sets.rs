//! All sets side by side: drift, twist and the strain vector, each with its statistical uncertainty.

use moiregauge::campaign::{Analysis, SetAnalysis, SetMean};
use nalgebra::{Matrix2, Vector2};

use super::figure::Drawing;
use super::layout;
use crate::draw::axes::{Axes, Labels, Ticks, mean_band};
use crate::draw::legend::{self, Key};
use crate::draw::scale::Range;
use crate::draw::style::{GREY, HAIR, Marker, PAGE, SET, marker};
use crate::draw::svg::{Ink, Rect, Svg};
use crate::stats::ellipse;

const SIDE: f64 = 112.0;

pub(super) fn draw(analysis: &Analysis, id: &str) -> Result<Drawing, String> {
    let sets: Vec<(&SetAnalysis, &SetMean)> = analysis
        .sets
        .iter()
        .filter_map(|s| s.with_drift().map(|m| (s, m)))
        .collect();
    if sets.len() < 2 {
        return Err("fewer than two sets are corrected for drift".to_owned());
    }
    let top = layout::LEGEND + layout::ABOVE;
    let mut svg = Svg::new(id, PAGE, top + SIDE + layout::BELOW);
    let area = |i: usize| Rect::new(layout::LEFT + i as f64 * (PAGE / 3.0), top, SIDE, SIDE);

    let drifts: Vec<_> = sets
        .iter()
        .map(|(set, _)| {
            set.drift
                .as_ref()
                .map(|d| (d.velocity * 60.0, d.covariance * 3600.0))
        })
        .collect();
    let labels = Labels {
        letter: "a",
        title: "drift",
        x: "drift x (nm/min)",
        y: "drift y (nm/min)",
        ..Labels::default()
    };
    vectors(&mut svg, area(0), &drifts, &labels)?;

    twists(&mut svg, area(1), analysis, &sets)?;

    let strains: Vec<_> = sets
        .iter()
        .map(|(_, mean)| {
            let t = &mean.twist_strain;
            Some((t.strain_vector * 100.0, t.strain().covariance * 1e4))
        })
        .collect();
    let labels = Labels {
        letter: "c",
        title: "strain vector",
        x: "E₁ = ε cos 2φ (%)",
        y: "E₂ = ε sin 2φ (%)",
        ..Labels::default()
    };
    vectors(&mut svg, area(2), &strains, &labels)?;
    let names: Vec<(Key, String)> = sets
        .iter()
        .enumerate()
        .map(|(i, (set, _))| {
            (
                Key::Point(Marker::Circle, SET[i % SET.len()], true),
                layout::shortened(&set.name),
            )
        })
        .collect();
    let keys: Vec<_> = names
        .iter()
        .map(|(key, name)| (*key, name.as_str()))
        .collect();
    legend::row(&mut svg, (layout::LEFT, 11.0), &keys);
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Drift, twist and strain of all sets"),
        caption: "Every set that was corrected for drift: drift velocity (a) and strain vector in the laboratory (c) \
                  with their 1σ and 2σ ellipses, equal scales; twist with its σ (b). σ is the statistical part alone, \
                  because calibration and model change all sets of one scanner by the same amount. Band: all sets \
                  together. Dashed: zero. The drift may differ between sets, because it changes with time. Twist and \
                  strain belong to the sample and should agree.".to_owned(),
    })
}

/// Two-component quantities with 1σ and 2σ ellipses.
fn vectors(
    svg: &mut Svg,
    area: Rect,
    values: &[Option<(Vector2<f64>, Matrix2<f64>)>],
    labels: &Labels,
) -> Result<(), String> {
    let outlines: Vec<(f64, f64)> = values
        .iter()
        .flatten()
        .flat_map(|(v, c)| ellipse(*v, c, 2.0))
        .collect();
    let range = |component: fn(&(f64, f64)) -> f64| {
        Range::of(outlines.iter().map(component)).map(|r| r.padded(0.08, 1e-9))
    };
    let (x, y) = (range(|p| p.0), range(|p| p.1));
    let (x, y) = (
        x.ok_or("nothing to compare")?,
        y.ok_or("nothing to compare")?,
    );
    let axes = Axes::equal(area, x, y);
    svg.clipped(area, |svg| {
        let zero = Ink::line(GREY, HAIR).dashed("2 1.5");
        axes.level(svg, 0.0, &zero);
        let x = axes.x.at(0.0);
        svg.line((x, area.y), (x, area.bottom()), &zero);
        for (index, value) in values.iter().enumerate() {
            if let Some((centre, covariance)) = value {
                let colour = SET[index % SET.len()];
                for (n, opacity) in [(2.0, 0.10), (1.0, 0.22)] {
                    let ink = Ink {
                        fill: colour,
                        fill_opacity: opacity,
                        ..Ink::line(colour, HAIR)
                    };
                    svg.polygon(&axes.points(ellipse(*centre, covariance, n)), &ink);
                }
                marker(
                    svg,
                    axes.at(centre.x, centre.y),
                    Marker::Circle,
                    colour,
                    true,
                );
            }
        }
    });
    axes.draw(svg, labels);
    Ok(())
}

fn twists(
    svg: &mut Svg,
    area: Rect,
    analysis: &Analysis,
    sets: &[(&SetAnalysis, &SetMean)],
) -> Result<(), String> {
    let degrees = |t: &heterostrain::strain::TwistStrain| t.twist().scaled(1_f64.to_degrees());
    let values: Vec<_> = sets
        .iter()
        .map(|(_, mean)| degrees(&mean.twist_strain))
        .collect();
    let together = analysis.combined.as_ref().map(|c| degrees(&c.twist_strain));
    let all = layout::ends(values.iter().copied().chain(together));
    let range = Range::of(all)
        .ok_or("no twist is finite")?
        .padded(0.15, 1e-9);
    let axes = Axes::new(area, layout::counting(sets.len()), range);
    if let Some(together) = together {
        mean_band(svg, &axes, together.value, together.sigma, GREY);
    }
    for (index, value) in values.iter().enumerate() {
        let (x, colour) = (layout::ordinal(index), SET[index % SET.len()]);
        layout::point(svg, &axes, x, *value, (Marker::Circle, colour), true);
    }
    let labels = Labels {
        letter: "b",
        title: "twist",
        x: "set",
        y: "θ (°)",
        x_ticks: Ticks::Scans,
        ..Labels::default()
    };
    axes.draw(svg, &labels);
    Ok(())
}
