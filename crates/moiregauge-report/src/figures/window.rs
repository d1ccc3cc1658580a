//! Where the centre of the scanned window was, scan by scan.

use nalgebra::Vector2;

use super::figure::Drawing;
use super::layout;
use super::layout::{LEFT, counting, is_up, ordinal};
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels, Ticks, zero_line};
use crate::draw::legend::{self, Key};
use crate::draw::scale::{Range, fixed};
use crate::draw::style::{BLACK, BLUE, GREY, HAIR, Marker, ORANGE, PAGE, SMALL, lettering, marker};
use crate::draw::svg::{Anchor, Ink, Lettering, Svg};

const SIDE: f64 = 150.0;

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let scans = &subject.set.scans;
    let [first, _, ..] = scans.as_slice() else {
        return Err("a single scan has no motion".to_owned());
    };
    let moved: Vec<(Vector2<f64>, bool)> = scans
        .iter()
        .map(|s| (s.window_centre - first.window_centre, is_up(s)))
        .collect();
    let (Some(x), Some(y)) = (
        Range::of(moved.iter().map(|(m, _)| m.x)),
        Range::of(moved.iter().map(|(m, _)| m.y)),
    ) else {
        return Err("no window centre is finite".to_owned());
    };
    let top = layout::LEGEND + layout::ABOVE;
    let mut svg = Svg::new(subject.id, PAGE, top + SIDE + layout::BELOW);
    // One picometre: below it the sensors say nothing.
    let (x, y) = (x.padded(0.12, 1e-3), y.padded(0.12, 1e-3));
    let (square, area) = layout::square_and_rest(top, SIDE);
    let path = Axes::equal(square, x, y);
    path_panel(&mut svg, &path, &moved);

    let both = Range::new(x.low.min(y.low), x.high.max(y.high));
    let axes = Axes::new(area, counting(scans.len()), both);
    zero_line(&mut svg, &axes);
    for (component, shape, colour) in [(0, Marker::Circle, BLUE), (1, Marker::Square, ORANGE)] {
        let points = axes.points(
            moved
                .iter()
                .enumerate()
                .map(|(i, (m, _))| (ordinal(i), m[component])),
        );
        svg.polyline(&points, &Ink::line(colour, HAIR));
        for (at, (_, up)) in points.iter().zip(&moved) {
            marker(&mut svg, *at, shape, colour, *up);
        }
    }
    let labels = Labels {
        letter: "b",
        x: "scan",
        y: "shift of the centre (nm)",
        x_ticks: Ticks::Scans,
        ..Labels::default()
    };
    axes.draw(&mut svg, &labels);
    let keys: Vec<_> = legend::directions()
        .into_iter()
        .chain([
            (Key::Point(Marker::Circle, BLUE, true), "x"),
            (Key::Point(Marker::Square, ORANGE, true), "y"),
        ])
        .collect();
    legend::row(&mut svg, (LEFT, 11.0), &keys);
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Centre of the scanned window over the scans"),
        caption: format!(
            "Centre of the scanned window by the position sensors, relative to the first scan at ({}, {}) nm: path with scan numbers, x to the right, y up, equal scales (a); both components scan by scan (b). Filled symbols: up scans; open: down scans.",
            fixed(first.window_centre.x, 1),
            fixed(first.window_centre.y, 1)
        ),
    })
}

fn path_panel(svg: &mut Svg, axes: &Axes, moved: &[(Vector2<f64>, bool)]) {
    let points = axes.points(moved.iter().map(|(m, _)| (m.x, m.y)));
    svg.polyline(&points, &Ink::line(GREY, HAIR));
    for (&at, (_, up)) in points.iter().zip(moved) {
        marker(svg, at, Marker::Circle, BLACK, *up);
    }
    let mut taken = points.clone();
    let number = Lettering {
        halo: Some("#ffffff"),
        ..lettering(SMALL, Anchor::Middle)
    };
    for (index, at) in points.iter().enumerate() {
        let places = [(6.0, -4.5), (-6.0, -4.5), (6.0, 5.5), (-6.0, 5.5)];
        // Middle of the number; one on top of another can be read by nobody and is left out.
        let free = |place: &(f64, f64)| {
            taken
                .iter()
                .all(|t| (t.0 - place.0).abs() > 5.9 || (t.1 - place.1).abs() > 4.4)
        };
        let place = places
            .map(|(dx, dy)| (at.0 + dx, at.1 + dy))
            .into_iter()
            .find(free);
        if let Some(place) = place {
            let baseline = (place.0, place.1 + 0.36 * SMALL);
            svg.text(baseline, &(index + 1).to_string(), &number);
            taken.push(place);
        }
    }
    let labels = Labels {
        letter: "a",
        x: "shift x (nm)",
        y: "shift y (nm)",
        ..Labels::default()
    };
    axes.draw(svg, &labels);
}
