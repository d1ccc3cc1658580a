//! Triangles between nodes, coloured by their twist; missing nodes and dislocations marked.

use super::figure::Drawing;
use super::map_panel::Panel;
use super::subject::MapSubject;
use crate::draw::colorbar;
use crate::draw::legend::{self, Key};
use crate::draw::scale::Range;
use crate::draw::style::{BLACK, Marker, SMALL, lettering, outline};
use crate::draw::svg::{Anchor, Ink, Lettering, Rect};
use crate::format::two_digits;
use crate::stats::central;

const MISSING: &str = "#d55e00";

pub(super) fn draw(subject: &MapSubject) -> Result<Drawing, String> {
    let domains = subject.details.domains.as_ref();
    let domains = domains.ok_or("no domains were looked for or found")?;
    let degree = 1f64.to_degrees();
    let twists: Vec<f64> = domains
        .cells
        .iter()
        .map(|c| c.twist_strain.map_or(f64::NAN, |t| degree * t.twist))
        .collect();
    let range = central(&twists, 0.98)
        .ok_or("no triangle has a twist")?
        .padded(0.0, 1e-6);
    let range = Range::new(range.low, range.high);
    let table = subject.colours.table();
    let mut panel = Panel::new(subject.id, subject.map, 6.0)?;
    let axes = panel.axes;
    panel.svg.clipped(axes.area, |svg| {
        for (cell, twist) in domains.cells.iter().zip(&twists) {
            let corners = cell.nodes.map(|n| (domains.nodes[n].x, domains.nodes[n].y));
            let share = ((twist - range.low) / range.width()).clamp(0.0, 1.0);
            let [r, g, b] = table[(255.0 * share) as usize];
            let colour = format!("#{r:02x}{g:02x}{b:02x}");
            let ink = Ink {
                fill: if twist.is_finite() { &colour } else { "none" },
                ..Ink::line("#ffffff", 0.3)
            };
            svg.polygon(&axes.points(corners), &ink);
        }
        let dot = Ink {
            fill: BLACK,
            ..Ink::line("#ffffff", 0.4)
        };
        for (n, node) in domains.nodes.iter().enumerate() {
            let at = axes.at(node.x, node.y);
            if domains.extra.contains(&n) {
                outline(svg, at, Marker::Square, 2.2, &Ink::line(MISSING, 0.9));
            } else {
                svg.circle(at, 0.9, &dot);
            }
        }
        for place in &domains.missing {
            svg.circle(axes.at(place.x, place.y), 2.6, &Ink::line(MISSING, 1.1));
        }
        let bold = Lettering {
            bold: true,
            fill: MISSING,
            halo: Some("#ffffff"),
            ..lettering(SMALL + 4.0, Anchor::Middle)
        };
        for dislocation in &domains.dislocations {
            let (x, y) = axes.at(dislocation.place.x, dislocation.place.y);
            svg.text((x, y + 3.5), "⊥", &bold);
        }
    });
    let area = axes.area;
    let bar = Rect::new(area.right() + 6.0, area.y, 7.0, area.height);
    colorbar::draw(
        &mut panel.svg,
        bar,
        subject.colours,
        range,
        ("twist θ", "°"),
    );
    let keys = [
        (Key::Point(Marker::Circle, BLACK, true), "node"),
        (Key::Point(Marker::Circle, MISSING, false), "missing"),
        (Key::Point(Marker::Square, MISSING, false), "extra"),
    ];
    legend::row(&mut panel.svg, (area.x, 10.0), &keys);
    let mut sigmas: Vec<f64> = domains
        .cells
        .iter()
        .filter_map(|c| c.twist_strain.map(|t| degree * t.twist().sigma))
        .collect();
    sigmas.sort_by(f64::total_cmp);
    let sigma = sigmas.get(sigmas.len() / 2).copied().unwrap_or(f64::NAN);
    Ok(Drawing {
        wide: false,
        svg: panel.finish("Domains"),
        caption: format!(
            "Twist of every triangle of neighbouring nodes, from its three edges (median σ {}°). {} nodes, {} missing, \
             {} that fit into no triangle, {} dislocations (⊥). x to the right, y up.",
            two_digits(sigma),
            domains.nodes.len(),
            domains.missing.len(),
            domains.extra.len(),
            domains.dislocations.len()
        ),
    })
}
