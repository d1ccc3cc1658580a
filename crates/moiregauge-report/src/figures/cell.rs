//! The moiré cell: real-space vectors and cell, wave vectors and Brillouin zone.

use heterostrain::lattice::MoireCell;
use nalgebra::{Matrix2, Vector2};

use super::figure::Drawing;
use super::layout::{ABOVE, BELOW, LEFT, LEGEND};
use crate::draw::axes::{Axes, Labels};
use crate::draw::legend::{self, Key};
use crate::draw::scale::{Range, fixed};
use crate::draw::style::{
    BLACK, GREY, HAIR, LINE, PAGE, PALE, SMALL, VECTOR, VECTOR_MARKER, lettering, outline,
};
use crate::draw::svg::{Anchor, Ink, Lettering, Rect, Svg};

const SIDE: f64 = 180.0;
/// Half the width of a panel over the longest vector.
const REACH: f64 = 1.75;

/// The figure; `name` is unique within a page.
pub fn cell(cell: &MoireCell, name: &str, layers: &str) -> Drawing {
    let mut svg = Svg::new(name, PAGE, LEGEND + ABOVE + SIDE + BELOW);
    let real = Labels {
        letter: "a",
        x: "x (nm)",
        y: "y (nm)",
        ..Labels::default()
    };
    panel(&mut svg, LEFT, &cell.vectors, &real, ["L₁", "L₂", "L₃"]);
    let waves = Labels {
        letter: "b",
        x: "kx (rad/nm)",
        y: "ky (rad/nm)",
        ..Labels::default()
    };
    let right = PAGE - SIDE - 9.0;
    panel(&mut svg, right, &cell.waves, &waves, ["K₁", "K₂", "K₃"]);
    let lengths = cell.wavelengths().map(|l| format!("{} nm", fixed(l, 3)));
    let keys: Vec<(Key, &str)> = lengths
        .iter()
        .enumerate()
        .map(|(i, text)| (Key::Point(VECTOR_MARKER[i], VECTOR[i], true), text.as_str()))
        .collect();
    legend::row(&mut svg, (LEFT, 11.0), &keys);
    Drawing {
        wide: true,
        svg: svg.finish("Moiré cell and wave vectors"),
        caption: format!(
            "Moiré of {layers}: lattice points, vectors L₁, L₂ and L₃ = L₂ − L₁, the primitive cell (outline) and the Wigner–Seitz cell (grey), area {} nm² (a); the wave vectors K₁, K₂ and K₃ = K₂ − K₁ with the first Brillouin zone (b). Legend: lengths of L₁, L₂ and L₃.",
            fixed(cell.area, 3)
        ),
    }
}

fn panel(svg: &mut Svg, left: f64, vectors: &[Vector2<f64>; 3], labels: &Labels, names: [&str; 3]) {
    let longest = vectors.iter().map(Vector2::norm).fold(0.0, f64::max);
    let reach = Range::new(-REACH * longest, REACH * longest);
    let area = Rect::new(left, LEGEND + ABOVE, SIDE, SIDE);
    let axes = Axes::equal(area, reach, reach);
    let at = |v: &Vector2<f64>| axes.at(v.x, v.y);
    let basis = Matrix2::from_columns(&vectors[..2]);
    svg.clipped(area, |svg| {
        let corners: Vec<(f64, f64)> = wigner_seitz(vectors).iter().map(at).collect();
        svg.polygon(&corners, &Ink::area(PALE, 0.7));
        let [a, b, _] = vectors;
        let outline_of_cell = [Vector2::zeros(), *a, a + b, *b].map(|v| at(&v));
        svg.polygon(&outline_of_cell, &Ink::line(GREY, HAIR).dashed("3 2"));
        for (h, k) in (-6..=6).flat_map(|h| (-6..=6).map(move |k| (h, k))) {
            let point = basis * Vector2::new(f64::from(h), f64::from(k));
            let inside = [point.x, point.y].iter().all(|x| reach.contains(*x));
            if inside {
                svg.circle(at(&point), 1.4, &Ink::area(BLACK, 1.0));
            }
        }
        for ((vector, colour), name) in vectors.iter().zip(VECTOR).zip(names) {
            arrow(svg, at(&Vector2::zeros()), at(vector), colour);
            let label = Lettering {
                fill: colour,
                bold: true,
                halo: Some("#ffffff"),
                ..lettering(SMALL + 1.0, Anchor::Middle)
            };
            let (x, y) = at(&(vector * (1.0 + 0.2 * longest / vector.norm())));
            svg.text((x, y + 2.5), name, &label);
        }
        for (vector, index) in vectors.iter().zip(0..) {
            let ink = Ink::area(VECTOR[index], 1.0);
            outline(svg, at(vector), VECTOR_MARKER[index], 2.2, &ink);
        }
    });
    axes.draw(svg, labels);
}

fn arrow(svg: &mut Svg, from: (f64, f64), to: (f64, f64), colour: &str) {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let length = dx.hypot(dy);
    let (ux, uy) = (dx / length, dy / length);
    let base = (to.0 - 7.0 * ux, to.1 - 7.0 * uy);
    svg.line(from, base, &Ink::line(colour, 1.4 * LINE));
    let side = |s: f64| (base.0 - s * 2.2 * uy, base.1 + s * 2.2 * ux);
    svg.polygon(&[to, side(1.0), side(-1.0)], &Ink::area(colour, 1.0));
}

/// The corners of the region nearer to the origin than to any other lattice point: the centres of the circles
/// through the origin and two neighbours, for a pair of vectors at 60° to 90°.
fn wigner_seitz(vectors: &[Vector2<f64>; 3]) -> [Vector2<f64>; 6] {
    let [a, b, c] = *vectors;
    let around = [a, b, c, -a, -b, -c];
    [0, 1, 2, 3, 4, 5].map(|i| {
        let (u, v) = (around[i], around[(i + 1) % 6]);
        // x·u = u²/2 and x·v = v²/2.
        let rows = Matrix2::from_rows(&[u.transpose(), v.transpose()]);
        let right = Vector2::new(u.norm_squared(), v.norm_squared()) / 2.0;
        rows.try_inverse().map_or(Vector2::zeros(), |m| m * right)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The region has the area of the primitive cell, and its corners are as far from the neighbours as
    /// from the origin.
    #[test]
    fn the_region_has_the_area_of_the_cell() {
        let (a, b) = (Vector2::new(13.0, 1.0), Vector2::new(5.5, 10.8));
        let vectors = [a, b, b - a];
        let corners = wigner_seitz(&vectors);
        let area: f64 = (0..6)
            .map(|i| corners[i].perp(&corners[(i + 1) % 6]) / 2.0)
            .sum();
        assert!((area - a.perp(&b)).abs() < 1e-9);
        let near = (corners[0] - a).norm() - corners[0].norm();
        assert!(near.abs() < 1e-9);
    }
}
