//! The look that all figures share: column widths, letters, lines, the marker of each vector.
//!
//! Colours: Okabe and Ito, <https://jfly.uni-koeln.de/color/>, told apart by all common forms of
//! colour blindness.

use super::svg::{Anchor, Ink, Lettering, Svg};

/// Width of one journal column, 88 mm, pt.
pub(crate) const COLUMN: f64 = 88.0 * 72.0 / 25.4;
/// Width of a journal page, 180 mm, pt.
pub(crate) const PAGE: f64 = 180.0 * 72.0 / 25.4;
/// Size of tick labels and notes, pt.
pub(crate) const SMALL: f64 = 6.5;
/// Size of axis titles and legends, pt.
pub(crate) const TEXT: f64 = 7.0;
/// Size of panel letters, pt.
pub(crate) const LETTER: f64 = 8.5;
/// Width of frames and ticks, pt.
pub(crate) const HAIR: f64 = 0.5;
/// Width of data lines, pt.
pub(crate) const LINE: f64 = 0.9;
/// Text and frames.
pub(crate) const BLACK: &str = "#222222";
/// Secondary lines.
pub(crate) const GREY: &str = "#8a8a8a";
/// Bands and histogram fills.
pub(crate) const PALE: &str = "#cfd6dc";
/// The first quantity where no lattice vector is meant.
pub(crate) const BLUE: &str = "#0072b2";
/// The second quantity.
pub(crate) const ORANGE: &str = "#d55e00";
/// Colours of the three lattice vectors.
pub(crate) const VECTOR: [&str; 3] = ["#0072b2", "#d55e00", "#009e73"];
/// Names of the three lattice vectors.
pub(crate) const VECTOR_NAME: [&str; 3] = ["L₁", "L₂", "L₃ = L₂ − L₁"];
/// Colours of the sets, where several share a figure.
pub(crate) const SET: [&str; 6] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9",
];

/// The shape of a data point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Marker {
    Circle,
    Square,
    Triangle,
    Diamond,
}

/// The marker of each lattice vector.
pub(crate) const VECTOR_MARKER: [Marker; 3] = [Marker::Circle, Marker::Square, Marker::Triangle];

/// Plain lettering of the given size.
pub(crate) fn lettering(size: f64, anchor: Anchor) -> Lettering<'static> {
    Lettering {
        size,
        anchor,
        bold: false,
        fill: BLACK,
        turned: 0.0,
        halo: None,
    }
}

/// A data point; `filled` for up scans, open for down scans.
pub(crate) fn marker(svg: &mut Svg, at: (f64, f64), marker: Marker, colour: &str, filled: bool) {
    let fill = if filled { colour } else { "#ffffff" };
    let ink = Ink {
        fill,
        ..Ink::line(colour, 0.8)
    };
    outline(svg, at, marker, 1.9, &ink);
}

/// A marker drawn with any ink; `radius` is that of the circle of about the same area.
pub(crate) fn outline(svg: &mut Svg, (x, y): (f64, f64), marker: Marker, radius: f64, ink: &Ink) {
    let r = radius;
    match marker {
        Marker::Circle => svg.circle((x, y), r, ink),
        Marker::Square => {
            let h = 0.89 * r;
            svg.polygon(
                &[
                    (x - h, y - h),
                    (x + h, y - h),
                    (x + h, y + h),
                    (x - h, y + h),
                ],
                ink,
            );
        }
        Marker::Triangle => {
            let h = 1.3 * r;
            svg.polygon(
                &[
                    (x, y - h),
                    (x + 0.9 * h, y + 0.6 * h),
                    (x - 0.9 * h, y + 0.6 * h),
                ],
                ink,
            );
        }
        Marker::Diamond => {
            let h = 1.25 * r;
            svg.polygon(&[(x, y - h), (x + h, y), (x, y + h), (x - h, y)], ink);
        }
    }
}
