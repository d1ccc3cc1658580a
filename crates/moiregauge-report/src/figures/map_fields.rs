//! Twist with contour lines, strain with its axes, wavelength, displacement with arrows.

use moiregauge::map::{Plane, TwistStrainMap};
use moiregauge::window::Mask;
use nalgebra::Vector2;

use super::figure::Drawing;
use super::map_panel::{Panel, Shown, about};
use super::subject::MapSubject;
use crate::draw::axes::Axes;
use crate::draw::contour::contours;
use crate::draw::scale::{Range, ticks};
use crate::draw::style::BLACK;
use crate::draw::svg::{Ink, Svg};
use crate::format::two_digits;

/// Strokes and arrows along the shorter side of a map.
const STROKES: f64 = 16.0;

/// A plane at the good nodes in another unit, NaN elsewhere.
pub(super) fn shown(map: &TwistStrainMap, plane: &Plane, factor: f64) -> impl Fn(usize) -> f64 {
    move |n| {
        if map.mask[n] == Mask::Good {
            factor * f64::from(plane.value[n])
        } else {
            f64::NAN
        }
    }
}

/// Root mean square of the errors of a plane at the good nodes.
pub(super) fn noise(map: &TwistStrainMap, plane: &Plane) -> f64 {
    map.spread(plane).map_or(f64::NAN, |s| s.noise)
}

fn twist_with(sigma: f64) -> Shown<'static> {
    Shown {
        name: "twist θ",
        unit: "°",
        sigma,
    }
}

pub(super) fn twist(subject: &MapSubject) -> Result<Drawing, String> {
    let map = subject.map;
    let degree = 1f64.to_degrees();
    let value = shown(map, &map.twist, degree);
    let sigma = degree * noise(map, &map.twist);
    let mut panel = Panel::new(subject.id, map, 0.0)?;
    let range = panel.values(subject, &twist_with(sigma), &value)?;
    let lines = lines(&mut panel, map, range, sigma, &value);
    Ok(Drawing {
        wide: false,
        svg: panel.finish("Twist"),
        caption: format!(
            "Twist θ. {lines} Noise of a node {}° (σ, rms; bracket in the colour bar: ± σ). {}",
            two_digits(sigma),
            about(map)
        ),
    })
}

/// Contour lines at the ticks of the colour bar, if noise does not draw them; says what was done.
fn lines(
    panel: &mut Panel,
    map: &TwistStrainMap,
    range: Range,
    sigma: f64,
    value: &dyn Fn(usize) -> f64,
) -> &'static str {
    let levels = ticks(range, 4);
    let apart = levels.windows(2).map(|w| w[1].value - w[0].value);
    if apart.fold(f64::INFINITY, f64::min) < 3.0 * sigma {
        return "No contour lines, because their distance would be less than 3 σ of the noise.";
    }
    let values: Vec<f64> = (0..map.grid.len()).map(value).collect();
    let axes = panel.axes;
    panel.svg.clipped(axes.area, |svg| {
        for level in levels {
            let segments = contours(&values, map.grid.size, level.value);
            let page = segments.into_iter().map(|ends| {
                ends.map(|[c, r]| {
                    let place = map.grid.origin + map.grid.step * Vector2::new(c, r);
                    axes.at(place.x, place.y)
                })
            });
            let page: Vec<_> = page.collect();
            svg.segments(&page, &Ink::line("#ffffff", 1.1));
            svg.segments(&page, &Ink::line(BLACK, 0.45));
        }
    });
    "Contour lines at the ticks of the colour bar."
}

/// The twist with everything that was asked of the map drawn on it.
pub(super) fn overlays(subject: &MapSubject) -> Result<Drawing, String> {
    let (map, details) = (subject.map, subject.details);
    if details.regions.is_empty() && details.devices.is_empty() && details.profiles.is_empty() {
        return Err("no region, device or line was asked for".to_owned());
    }
    let degree = 1f64.to_degrees();
    let sigma = degree * noise(map, &map.twist);
    let mut panel = Panel::new(subject.id, map, 0.0)?;
    let value = shown(map, &map.twist, degree);
    panel.values(subject, &twist_with(sigma), value)?;
    panel.overlays(details);
    let mut words = Vec::new();
    if !details.regions.is_empty() {
        words.push("Solid outlines: the regions.");
    }
    if !details.devices.is_empty() {
        words.push("Dashed boxes: the most uniform areas for the device, numbered by rank.");
    }
    if !details.profiles.is_empty() {
        words.push("Lines: those of the figure Line profiles.");
    }
    Ok(Drawing {
        wide: false,
        svg: panel.finish("Twist with regions, areas for devices and lines"),
        caption: format!("Twist θ. {} {}", words.join(" "), about(map)),
    })
}

pub(super) fn strain(subject: &MapSubject) -> Result<Drawing, String> {
    let map = subject.map;
    let mut panel = Panel::new(subject.id, map, 0.0)?;
    panel.values(
        subject,
        &Shown {
            name: "strain |ε|",
            unit: "%",
            sigma: 100.0 * noise(map, &map.strain[0]),
        },
        shown(map, &map.magnitude, 100.0),
    )?;
    let axes = panel.axes;
    let sigma = 100.0 * noise(map, &map.strain[0]);
    panel.svg.clipped(axes.area, |svg| {
        sparse(map, &axes, |node, at, length| {
            let axis = f64::from(map.axis.value[node]);
            if axis.is_finite() {
                let half = Vector2::new(axis.cos(), -axis.sin()) * length * 0.36;
                let ends = (
                    (at.0 - half.x, at.1 - half.y),
                    (at.0 + half.x, at.1 + half.y),
                );
                svg.line(ends.0, ends.1, &Ink::line(BLACK, 1.5));
                svg.line(ends.0, ends.1, &Ink::line("#ffffff", 0.8));
            }
        });
    });
    Ok(Drawing {
        wide: false,
        svg: panel.finish("Heterostrain"),
        caption: format!(
            "Magnitude of the heterostrain with the noise bias removed (σ of a component {} %, rms). Strokes: its axis \
             in the laboratory where it is significant (p < 0.01). {}",
            two_digits(sigma),
            about(map)
        ),
    })
}

/// Calls `draw` with good nodes on a coarse grid, their place on the page and the distance of neighbours there.
pub(super) fn sparse(
    map: &TwistStrainMap,
    axes: &Axes,
    mut draw: impl FnMut(usize, (f64, f64), f64),
) {
    let [columns, rows] = map.grid.size;
    let side = columns.min(rows) as f64;
    let every = (side / STROKES).ceil().max(1.0) as usize;
    let pitch = map
        .grid
        .step
        .column(0)
        .norm()
        .min(map.grid.step.column(1).norm());
    let length = (every as f64 * pitch * axes.x.per_unit()).abs();
    for row in (every / 2..rows).step_by(every) {
        for column in (every / 2..columns).step_by(every) {
            let node = row * columns + column;
            if map.mask[node] == Mask::Good {
                let place = map.grid.place(node);
                draw(node, axes.at(place.x, place.y), length);
            }
        }
    }
}

pub(super) fn wavelength(subject: &MapSubject) -> Result<Drawing, String> {
    let map = subject.map;
    let [a, b, c] = map.wavelengths.each_ref().map(|w| shown(map, w, 1.0));
    let mut panel = Panel::new(subject.id, map, 0.0)?;
    // As if the three were independent, which errs by little.
    let square = map.wavelengths.each_ref().map(|w| noise(map, w).powi(2));
    let sigma = square.iter().sum::<f64>().sqrt() / 3.0;
    let label = Shown {
        name: "mean wavelength",
        unit: "nm",
        sigma,
    };
    panel.values(subject, &label, |n| (a(n) + b(n) + c(n)) / 3.0)?;
    Ok(Drawing {
        wide: false,
        svg: panel.finish("Wavelength"),
        caption: format!(
            "Mean of the three moiré wavelengths. Noise of a node {} nm (σ, rms; bracket in the colour bar: ± σ). {}",
            two_digits(sigma),
            about(map)
        ),
    })
}

pub(super) fn twist_sigma(subject: &MapSubject) -> Result<Drawing, String> {
    let map = subject.map;
    let sigma = Plane {
        value: map.twist.sigma.clone(),
        sigma: Vec::new(),
    };
    let mut panel = Panel::new(subject.id, map, 0.0)?;
    panel.values(
        subject,
        &Shown {
            name: "σ of θ",
            unit: "°",
            sigma: f64::NAN,
        },
        shown(map, &sigma, 1f64.to_degrees()),
    )?;
    Ok(Drawing {
        wide: false,
        svg: panel.finish("Error of the twist"),
        caption: format!(
            "Standard error of the twist of each node, from the noise of the image. {}",
            about(map)
        ),
    })
}

pub(super) fn displacement(subject: &MapSubject) -> Result<Drawing, String> {
    let map = subject.map;
    let [x, y] = map.displacement.each_ref().map(|d| shown(map, d, 1.0));
    let mut panel = Panel::new(subject.id, map, 0.0)?;
    let sigma = map.displacement.each_ref().map(|d| noise(map, d).powi(2));
    let sigma = (sigma.iter().sum::<f64>() / 2.0).sqrt();
    let label = Shown {
        name: "displacement |u|",
        unit: "nm",
        sigma,
    };
    let range = panel.values(subject, &label, |n| x(n).hypot(y(n)))?;
    let axes = panel.axes;
    panel.svg.clipped(axes.area, |svg| {
        sparse(map, &axes, |node, at, length| {
            let u = Vector2::new(x(node), -y(node)) * (0.95 * length / range.high);
            if u.norm() > 0.12 * length {
                arrow(svg, at, u);
            }
        });
    });
    Ok(Drawing {
        wide: false,
        svg: panel.finish("Displacement"),
        caption: format!(
            "Displacement of the pattern from the mean lattice of the good nodes, where its phase could be followed. \
             Arrows show the direction and are enlarged; colours show the length. {}",
            about(map)
        ),
    })
}

/// An arrow about a place on the page.
fn arrow(svg: &mut Svg, (x, y): (f64, f64), way: Vector2<f64>) {
    let (tail, tip) = (
        Vector2::new(x, y) - way / 2.0,
        Vector2::new(x, y) + way / 2.0,
    );
    let head = way.normalize() * (0.45 * way.norm()).min(2.6);
    let side = Vector2::new(-head.y, head.x) * 0.5;
    let [a, b] = [tip - head + side, tip - head - side];
    let page = |v: Vector2<f64>| (v.x, v.y);
    for ink in [Ink::line("#ffffff", 1.5), Ink::line(BLACK, 0.7)] {
        svg.line(page(tail), page(tip), &ink);
        svg.polyline(&[page(a), page(tip), page(b)], &ink);
    }
}
