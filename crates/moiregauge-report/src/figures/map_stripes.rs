//! Stripes: wavelength with strokes along them, and how their direction differs from that of their pattern.

use moiregauge::stripes::SampledStripes;
use moiregauge::window::Mask;
use nalgebra::Vector2;

use super::figure::{Drawing, Figure};
use super::map_fields::{noise, shown, sparse};
use super::map_panel::{Panel, Shown, about};
use super::subject::MapSubject;
use super::{map_fields, map_mask};
use crate::draw::axes::Axes;
use crate::draw::colormap::ColorMap;
use crate::draw::style::BLACK;
use crate::draw::svg::{Ink, Svg};
use crate::format::two_digits;
use crate::map_details::MapDetails;

/// The figures of a map of stripes, drawn or with the reason why not.
pub fn stripe_figures(stripes: &SampledStripes, colours: ColorMap) -> Vec<Figure> {
    let details = MapDetails::default();
    let subject = |id| MapSubject {
        id,
        map: &stripes.map,
        details: &details,
        colours,
    };
    let figure = |name: &str, title, drawing| Figure {
        name: name.to_owned(),
        set: None,
        title,
        drawing,
    };
    vec![
        figure(
            "map-wavelength",
            "Wavelength of the stripes",
            wavelength(&subject("map-wavelength")),
        ),
        figure(
            "map-direction",
            "Direction of the stripes",
            direction(&subject("map-direction"), stripes),
        ),
        figure(
            "map-displacement",
            "Displacement",
            map_fields::displacement(&subject("map-displacement")),
        ),
        figure("map-mask", "Mask", map_mask::draw(&subject("map-mask"))),
    ]
}

/// Short strokes along the stripes at some good nodes.
fn strokes(svg: &mut Svg, axes: &Axes, subject: &MapSubject) {
    let map = subject.map;
    sparse(map, axes, |node, at, length| {
        let along = f64::from(map.orientation.value[node]);
        let half = Vector2::new(along.cos(), -along.sin()) * length * 0.36;
        let ends = (
            (at.0 - half.x, at.1 - half.y),
            (at.0 + half.x, at.1 + half.y),
        );
        svg.line(ends.0, ends.1, &Ink::line(BLACK, 1.5));
        svg.line(ends.0, ends.1, &Ink::line("#ffffff", 0.8));
    });
}

fn wavelength(subject: &MapSubject) -> Result<Drawing, String> {
    let map = subject.map;
    let plane = &map.wavelengths[0];
    let mut panel = Panel::new(subject.id, map, 0.0)?;
    let label = Shown {
        name: "wavelength λ",
        unit: "nm",
        sigma: noise(map, plane),
    };
    panel.values(subject, &label, shown(map, plane, 1.0))?;
    let axes = panel.axes;
    panel
        .svg
        .clipped(axes.area, |svg| strokes(svg, &axes, subject));
    Ok(Drawing {
        wide: false,
        svg: panel.finish("Wavelength of the stripes"),
        caption: format!(
            "Local wavelength of the stripes (noise of a node {} nm, σ, rms); strokes run along them. {}",
            two_digits(noise(map, plane)),
            about(map)
        ),
    })
}

fn direction(subject: &MapSubject, stripes: &SampledStripes) -> Result<Drawing, String> {
    let map = subject.map;
    let degree = 1f64.to_degrees();
    let means: Vec<f64> = stripes
        .patterns
        .iter()
        .map(|p| p.local.as_ref().map_or(f64::NAN, |l| l[1].mean))
        .collect();
    let off = |n: usize| match (map.mask[n], stripes.pattern[n]) {
        (Mask::Good, p @ 1..) => {
            degree * (f64::from(map.orientation.value[n]) - means[usize::from(p) - 1])
        }
        _ => f64::NAN,
    };
    let mut panel = Panel::new(subject.id, map, 0.0)?;
    let sigma = degree * noise(map, &map.orientation);
    let label = Shown {
        name: "direction − mean of its pattern",
        unit: "°",
        sigma,
    };
    panel.values(subject, &label, off)?;
    let axes = panel.axes;
    panel
        .svg
        .clipped(axes.area, |svg| strokes(svg, &axes, subject));
    let known: Vec<String> = means
        .iter()
        .zip(1..)
        .filter(|(mean, _)| mean.is_finite())
        .map(|(mean, number)| format!("pattern {number}: {:.1}°", degree * mean))
        .collect();
    Ok(Drawing {
        wide: false,
        svg: panel.finish("Direction of the stripes"),
        caption: format!(
            "Local direction of the stripes minus the mean of their pattern ({}; noise of a node {}°, σ, rms); strokes \
             run along them. {}",
            known.join(", "),
            two_digits(sigma),
            about(map)
        ),
    })
}
