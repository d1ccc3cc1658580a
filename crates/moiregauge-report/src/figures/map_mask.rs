//! Which nodes are to be believed, and why others are not.

use moiregauge::window::Mask;

use super::figure::Drawing;
use super::map_panel::{Panel, about};
use super::subject::MapSubject;
use crate::draw::legend::{self, Key};
use crate::draw::raster;
use crate::draw::scale::fixed;

/// A colour for every mask, in the order of [`Mask::ALL`].
const COLOURS: [[u8; 3]; 8] = [
    [0xe9, 0xee, 0xf1],
    [0x9a, 0xa4, 0xad],
    [0x33, 0x33, 0x33],
    [0x56, 0xb4, 0xe9],
    [0xd5, 0x5e, 0x00],
    [0xe6, 0x9f, 0x00],
    [0xcc, 0x79, 0xa7],
    [0x00, 0x9e, 0x73],
];
/// Keys in a row of the legend.
const IN_A_ROW: usize = 3;

pub(super) fn draw(subject: &MapSubject) -> Result<Drawing, String> {
    let map = subject.map;
    let present: Vec<Mask> = Mask::ALL
        .into_iter()
        .filter(|m| map.count(*m) > 0)
        .collect();
    let above = 9.0 * present.len().div_ceil(IN_A_ROW) as f64 - 4.0;
    let mut panel = Panel::new(subject.id, map, above)?;
    let classes: Vec<u8> = map.mask.iter().map(|m| *m as u8).collect();
    let axes = panel.axes;
    panel.svg.clipped(axes.area, |svg| {
        raster::draw_classes(
            svg,
            &axes,
            (map.grid.size, &classes),
            (&map.grid.step, map.grid.origin),
            &COLOURS,
        );
    });
    let all = map.grid.len() as f64;
    for (row, masks) in present.chunks(IN_A_ROW).enumerate() {
        let keys: Vec<(String, String)> = masks
            .iter()
            .map(|m| {
                let [r, g, b] = COLOURS[*m as usize];
                let share = 100.0 * map.count(*m) as f64 / all;
                let text = format!("{} {} %", m.name(), fixed(share, 1));
                (format!("#{r:02x}{g:02x}{b:02x}"), text)
            })
            .collect();
        let keys: Vec<(Key, &str)> = keys
            .iter()
            .map(|(colour, text)| (Key::Band(colour, 1.0), text.as_str()))
            .collect();
        legend::row(
            &mut panel.svg,
            (axes.area.x - 30.0, 9.0 + 9.0 * row as f64),
            &keys,
        );
    }
    Ok(Drawing {
        wide: false,
        svg: panel.finish("Mask"),
        caption: format!(
            "Good nodes, and the reasons why others are bad (share of all nodes). Margin: the window reaches beyond \
             the frame. Weak signal: the lattice is not above the noise. Defect: harmonics contradict each other, or a \
             phase winds around a point. Bent: the lattice changes faster than the window resolves. Contradiction: \
             scans differ. {}",
            about(map)
        ),
    })
}
