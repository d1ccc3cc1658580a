//! The letters of all figures: their font, and how wide a text is in it.

/// Font families in order of preference. The first one is bundled for PNG.
pub(crate) const FONT: &str = "DejaVu Sans, Arial, sans-serif";

/// Advances of the characters from space to `~` in the bundled font, 1/2048 em.
const ADVANCES: [u16; 95] = [
    651, 821, 942, 1716, 1303, 1946, 1597, 563, 799, 799, 1024, 1716, 651, 739, 651, 690, 1303,
    1303, 1303, 1303, 1303, 1303, 1303, 1303, 1303, 1303, 690, 690, 1716, 1716, 1716, 1087, 2048,
    1401, 1405, 1430, 1577, 1294, 1178, 1587, 1540, 604, 604, 1343, 1141, 1767, 1532, 1612, 1235,
    1612, 1423, 1300, 1251, 1499, 1401, 2025, 1403, 1251, 1403, 799, 690, 799, 1716, 1024, 1024,
    1255, 1300, 1126, 1300, 1260, 721, 1300, 1298, 569, 569, 1186, 569, 1995, 1298, 1253, 1300,
    1300, 842, 1067, 803, 1298, 1212, 1675, 1212, 1212, 1075, 1303, 690, 1303, 1716,
];

/// How wide `text` is in the bundled font, pt; characters that figures seldom show are taken to be wide ones.
pub(crate) fn text_width(text: &str, size: f64) -> f64 {
    let advance = |c: char| match c {
        ' '..='~' => ADVANCES[c as usize - ' ' as usize],
        '°' | '–' => 1024,
        '·' => 651,
        '²' | '³' | '⁰'..='⁹' | '₀'..='₉' => 821,
        '⁻' => 1081,
        'α'..='χ' | 'à'..='ÿ' | 'µ' => 1351,
        '…' | '—' => 2048,
        _ => 1716,
    };
    text.chars().map(|c| f64::from(advance(c))).sum::<f64>() / 2048.0 * size
}

/// The longest beginning of `text` that is no wider than `limit` (pt), with an ellipsis where something is missing.
pub(crate) fn fitted(text: &str, size: f64, limit: f64) -> String {
    if text_width(text, size) <= limit {
        return text.to_owned();
    }
    let mut kept: String = text.to_owned();
    while !kept.is_empty() && text_width(&kept, size) + size > limit {
        kept.pop();
    }
    format!("{}…", kept.trim_end())
}
