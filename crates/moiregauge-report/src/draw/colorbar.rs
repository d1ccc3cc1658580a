//! A colour bar beside an image.

use super::colormap::ColorMap;
use super::png::palette_png;
use super::scale::{Range, Scale, ticks};
use super::style::{BLACK, HAIR, SMALL, TEXT, lettering, text_width};
use super::svg::{Anchor, Ink, Lettering, Rect, Svg};

/// Draws the colours of `range` in `bar`, with numbers and a title at its right.
pub(crate) fn draw(svg: &mut Svg, bar: Rect, map: ColorMap, range: Range, title: &str) {
    let steps = 128_u8;
    let indices: Vec<u8> = (0..steps).rev().map(|i| 1 + i * 2).collect();
    let png = palette_png(1, indices.len(), &indices, &map.table());
    let matrix = [
        bar.width,
        0.0,
        0.0,
        bar.height / f64::from(steps),
        bar.x,
        bar.y,
    ];
    svg.image(&png, (1, indices.len()), matrix, true);
    let frame = Ink::line(BLACK, HAIR);
    svg.rect(bar, &frame);
    let scale = Scale::new(range, bar.bottom(), bar.y);
    let mut widest: f64 = 0.0;
    for tick in ticks(range, 4) {
        let y = scale.at(tick.value);
        svg.line((bar.right(), y), (bar.right() + 2.0, y), &frame);
        let at = (bar.right() + 3.5, y + 0.36 * SMALL);
        svg.text(at, &tick.label, &lettering(SMALL, Anchor::Start));
        widest = widest.max(text_width(&tick.label, SMALL));
    }
    let upright = Lettering {
        turned: 90.0,
        ..lettering(TEXT, Anchor::Middle)
    };
    let x = bar.right() + 3.5 + widest + 3.0 + TEXT;
    svg.text((x, bar.y + bar.height / 2.0), title, &upright);
}
