//! Legends: one line of keys above the panels, where they cover no data.

use super::letters::{fitted, text_width};
use super::style::{BLACK, Marker, SMALL, VECTOR, VECTOR_MARKER, VECTOR_NAME, lettering, marker};
use super::svg::{Anchor, Ink, Rect, Svg};

/// How a key looks.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Key<'a> {
    /// A data point: shape, colour, filled.
    Point(Marker, &'a str, bool),
    /// A line: colour and dash pattern.
    Line(&'a str, &'a str),
    /// A shaded band: colour and opacity.
    Band(&'a str, f64),
}

/// Space that a key and the gaps beside its text take, pt.
const BESIDE: f64 = 25.0;

/// Draws keys from left to right, the first one at `start` (its left end and text baseline). Where the texts are too
/// long for the page, the longest are cut off.
pub(crate) fn row(svg: &mut Svg, start: (f64, f64), keys: &[(Key, &str)]) {
    let (mut x, baseline) = start;
    let room = svg.width() - x - BESIDE * keys.len() as f64;
    let widths: Vec<f64> = keys.iter().map(|(_, t)| text_width(t, SMALL)).collect();
    let needed = |limit: f64| widths.iter().map(|w| w.min(limit)).sum::<f64>();
    let mut limit = widths.iter().copied().fold(0.0, f64::max);
    while needed(limit) > room && limit > 4.0 * SMALL {
        limit *= 0.9;
    }
    // Texts that have the width of the limit are whole.
    limit += 0.01;
    let middle = baseline - 0.36 * SMALL;
    for (key, text) in keys {
        let width = match *key {
            Key::Point(shape, colour, filled) => {
                marker(svg, (x + 3.0, middle), shape, colour, filled);
                6.0
            }
            Key::Line(colour, dash) => {
                let ink = Ink::line(colour, 1.0).dashed(dash);
                svg.line((x, middle), (x + 13.0, middle), &ink);
                13.0
            }
            Key::Band(colour, opacity) => {
                let patch = Rect::new(x, middle - 2.5, 11.0, 5.0);
                svg.rect(patch, &Ink::area(colour, opacity));
                11.0
            }
        };
        x += width + 2.5;
        let text = fitted(text, SMALL, limit);
        svg.text((x, baseline), &text, &lettering(SMALL, Anchor::Start));
        x += text_width(&text, SMALL) + 9.0;
    }
}

/// The keys of up and down scans.
pub(crate) fn directions() -> [(Key<'static>, &'static str); 2] {
    [
        (Key::Point(Marker::Circle, BLACK, true), "up"),
        (Key::Point(Marker::Circle, BLACK, false), "down"),
    ]
}

/// The keys of the three lattice vectors, and of the directions of scans.
pub(crate) fn vectors_and_directions(svg: &mut Svg, start: (f64, f64)) {
    row(
        svg,
        start,
        &vectors().chain(directions()).collect::<Vec<_>>(),
    );
}

/// The keys of the three lattice vectors.
pub(crate) fn vectors() -> impl Iterator<Item = (Key<'static>, &'static str)> {
    (0..3).map(|v| {
        let key = Key::Point(VECTOR_MARKER[v], VECTOR[v], true);
        (key, VECTOR_NAME[v])
    })
}
