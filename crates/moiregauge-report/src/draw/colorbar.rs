//! A colour bar beside an image.

use super::colormap::ColorMap;
use super::letters::{fitted, text_width};
use super::png::palette_png;
use super::scale::{Range, Scale, ticks};
use super::style::{BLACK, HAIR, SMALL, TEXT, lettering};
use super::svg::{Anchor, Ink, Lettering, Rect, Svg};

/// Draws the colours of `range` in `bar`, with numbers and a title at its right: what it is and its unit,
/// with a power of ten where the numbers are small or large.
pub(crate) fn draw(
    svg: &mut Svg,
    bar: Rect,
    map: ColorMap,
    range: Range,
    (quantity, unit): (&str, &str),
) {
    let (power, range) = by_thousands(range);
    let unit = [power, unit.to_owned()].join(" ");
    let unit = match unit.trim() {
        "" => String::new(),
        unit => format!(" ({})", fitted(unit, TEXT, bar.height / 2.0)),
    };
    // A long name of a channel is cut off, its unit is not; the caption has all of it.
    let space = bar.height + 2.0 * TEXT - text_width(&unit, TEXT);
    let title = fitted(quantity, TEXT, space) + &unit;
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
    svg.text((x, bar.y + bar.height / 2.0), &title, &upright);
}

/// Marks ± `sigma` in a colour bar, about the middle of its range: differences of such colours are noise.
pub(crate) fn noise(svg: &mut Svg, bar: Rect, range: Range, sigma: f64) {
    let half = sigma * bar.height / range.width();
    if !(half.is_finite() && half > 0.0) {
        return;
    }
    let half = half.min(bar.height / 2.0);
    let (x, y) = (bar.x + bar.width / 2.0, bar.y + bar.height / 2.0);
    let caps = [y - half, y + half].map(|y| [(x - 2.0, y), (x + 2.0, y)]);
    let bracket = [[(x, y - half), (x, y + half)], caps[0], caps[1]];
    svg.segments(&bracket, &Ink::line("#ffffff", 2.0));
    svg.segments(&bracket, &Ink::line(BLACK, 0.8));
}

/// The power of a thousand that makes the numbers of a range handy, in words, and the range in it. Files in SI
/// units hold heights of 10⁻¹⁰ m.
fn by_thousands(range: Range) -> (String, Range) {
    let largest = range.low.abs().max(range.high.abs());
    if !largest.is_normal() || (0.01..1e5).contains(&largest) {
        return (String::new(), range);
    }
    let exponent = 3 * (largest.log10() / 3.0).floor() as i32;
    let digits = exponent.to_string();
    let raised = digits.chars().map(|c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32(0x2070 + u32::from(digit) - u32::from('0')).unwrap_or(digit),
    });
    let unit = 10_f64.powi(exponent);
    (
        format!("10{}", raised.collect::<String>()),
        Range::new(range.low / unit, range.high / unit),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_in_metres_get_a_power_of_ten() {
        let (power, range) = by_thousands(Range::new(-1e-10, 3.5e-10));
        assert_eq!(power, "10⁻¹²");
        assert!((range.low + 100.0).abs() < 1e-9 && (range.high - 350.0).abs() < 1e-9);
        assert_eq!(by_thousands(Range::new(0.0, 4e6)).0, "10⁶");
        for handy in [
            Range::new(-0.3, 0.2),
            Range::new(0.0, 9e4),
            Range::new(0.0, 0.0),
        ] {
            assert_eq!(by_thousands(handy), (String::new(), handy));
        }
    }
}
