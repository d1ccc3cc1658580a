//! A writer of SVG text: a handful of shapes, numbers short and always printed the same way.

use std::fmt::Write as _;

use super::letters::{FONT, text_width};

/// Height above and depth below the baseline that the font reserves, em.
const ASCENT: f64 = 0.93;
const DESCENT: f64 = 0.24;
/// Bold letters over plain ones.
const BOLD: f64 = 1.13;

/// A rectangle on the page, pt; `y` is its upper edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rect {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
}

impl Rect {
    pub(crate) fn new(x: f64, y: f64, width: f64, height: f64) -> Self {
        Self {
            x,
            y,
            width,
            height,
        }
    }

    pub(crate) fn right(&self) -> f64 {
        self.x + self.width
    }

    pub(crate) fn bottom(&self) -> f64 {
        self.y + self.height
    }
}

/// Where the anchor of a text lies along it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// How a text looks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lettering<'a> {
    pub(crate) size: f64,
    pub(crate) anchor: Anchor,
    pub(crate) bold: bool,
    pub(crate) fill: &'a str,
    /// Degrees, counter-clockwise as seen.
    pub(crate) turned: f64,
    /// Colour of an outline behind the letters, for text on an image.
    pub(crate) halo: Option<&'a str>,
}

/// Fill and stroke as SVG attributes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ink<'a> {
    pub(crate) fill: &'a str,
    pub(crate) fill_opacity: f64,
    pub(crate) stroke: &'a str,
    pub(crate) width: f64,
    /// Dash pattern, as in `3 2`; empty for a solid line.
    pub(crate) dash: &'a str,
}

impl<'a> Ink<'a> {
    /// A line without fill.
    pub(crate) fn line(stroke: &'a str, width: f64) -> Self {
        Self {
            fill: "none",
            fill_opacity: 1.0,
            stroke,
            width,
            dash: "",
        }
    }

    /// A filled area without outline.
    pub(crate) fn area(fill: &'a str, opacity: f64) -> Self {
        Self {
            fill,
            fill_opacity: opacity,
            stroke: "none",
            width: 0.0,
            dash: "",
        }
    }

    pub(crate) fn dashed(self, dash: &'a str) -> Self {
        Self { dash, ..self }
    }

    fn attributes(&self) -> String {
        let mut text = format!(" fill=\"{}\"", self.fill);
        if self.fill_opacity < 1.0 {
            let _ = write!(text, " fill-opacity=\"{}\"", number(self.fill_opacity));
        }
        if self.stroke != "none" {
            let _ = write!(
                text,
                " stroke=\"{}\" stroke-width=\"{}\"",
                self.stroke,
                number(self.width)
            );
        }
        if !self.dash.is_empty() {
            let _ = write!(text, " stroke-dasharray=\"{}\"", self.dash);
        }
        text
    }
}

/// An SVG document under construction. A shape at a place that is not finite is not drawn.
#[derive(Debug)]
pub(crate) struct Svg {
    /// Unique within a page that shows several figures; prefix of all ids.
    id: String,
    width: f64,
    height: f64,
    clips: usize,
    body: String,
    /// What texts need: left, top, right, bottom. The page grows to hold them.
    needed: [f64; 4],
}

impl Svg {
    /// An empty page of `width` × `height` pt.
    pub(crate) fn new(id: &str, width: f64, height: f64) -> Self {
        Self {
            id: id.to_owned(),
            width,
            height,
            clips: 0,
            body: String::new(),
            needed: [0.0, 0.0, width, height],
        }
    }

    /// Width of the page, pt.
    pub(crate) fn width(&self) -> f64 {
        self.width
    }

    /// Makes room for a text.
    fn hold(&mut self, (x, y): (f64, f64), text: &str, lettering: &Lettering) {
        let width = text_width(text, lettering.size) * if lettering.bold { BOLD } else { 1.0 };
        let start = match lettering.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -width / 2.0,
            Anchor::End => -width,
        };
        let (sin, cos) = (-lettering.turned).to_radians().sin_cos();
        for along in [start, start + width] {
            for across in [-ASCENT * lettering.size, DESCENT * lettering.size] {
                let (px, py) = (
                    x + cos * along - sin * across,
                    y + sin * along + cos * across,
                );
                let [left, top, right, bottom] = self.needed;
                self.needed = [left.min(px), top.min(py), right.max(px), bottom.max(py)];
            }
        }
    }

    pub(crate) fn line(&mut self, from: (f64, f64), to: (f64, f64), ink: &Ink) {
        self.polyline(&[from, to], ink);
    }

    /// An open line through those `points` that are finite.
    pub(crate) fn polyline(&mut self, points: &[(f64, f64)], ink: &Ink) {
        self.path(points, "", ink);
    }

    pub(crate) fn polygon(&mut self, points: &[(f64, f64)], ink: &Ink) {
        self.path(points, "Z", ink);
    }

    /// Many short lines as one shape.
    pub(crate) fn segments(&mut self, ends: &[[(f64, f64); 2]], ink: &Ink) {
        let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
        let mut data = String::new();
        for [a, b] in ends.iter().filter(|ends| ends.iter().all(finite)) {
            let [x, y] = [number(a.0), number(a.1)];
            let _ = write!(data, "M{x} {y}L{} {}", number(b.0), number(b.1));
        }
        if !data.is_empty() {
            let _ = writeln!(
                self.body,
                "<path d=\"{data}\" stroke-linecap=\"round\"{}/>",
                ink.attributes()
            );
        }
    }

    fn path(&mut self, points: &[(f64, f64)], end: &str, ink: &Ink) {
        let mut data = String::new();
        for &(x, y) in points
            .iter()
            .filter(|(x, y)| x.is_finite() && y.is_finite())
        {
            let command = if data.is_empty() { 'M' } else { 'L' };
            let _ = write!(data, "{command}{} {}", number(x), number(y));
        }
        let _ = writeln!(
            self.body,
            "<path d=\"{data}{end}\" stroke-linejoin=\"round\"{}/>",
            ink.attributes()
        );
    }

    pub(crate) fn rect(&mut self, rect: Rect, ink: &Ink) {
        if ![rect.x, rect.y, rect.width, rect.height]
            .iter()
            .all(|v| v.is_finite())
        {
            return;
        }
        let _ = writeln!(
            self.body,
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"{}/>",
            number(rect.x),
            number(rect.y),
            number(rect.width),
            number(rect.height),
            ink.attributes()
        );
    }

    pub(crate) fn circle(&mut self, centre: (f64, f64), radius: f64, ink: &Ink) {
        if centre.0.is_finite() && centre.1.is_finite() {
            let _ = writeln!(
                self.body,
                "<circle cx=\"{}\" cy=\"{}\" r=\"{}\"{}/>",
                number(centre.0),
                number(centre.1),
                number(radius),
                ink.attributes()
            );
        }
    }

    /// A line of text with its baseline at `at`.
    pub(crate) fn text(&mut self, at: (f64, f64), text: &str, lettering: &Lettering) {
        let anchor = match lettering.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        if !(at.0.is_finite() && at.1.is_finite()) {
            return;
        }
        self.hold(at, text, lettering);
        let (x, y) = (number(at.0), number(at.1));
        let weight = if lettering.bold {
            " font-weight=\"bold\""
        } else {
            ""
        };
        let turn = if lettering.turned == 0.0 {
            String::new()
        } else {
            format!(
                " transform=\"rotate({} {x} {y})\"",
                number(-lettering.turned)
            )
        };
        let halo = lettering.halo.map_or_else(String::new, |colour| {
            format!(
                " stroke=\"{colour}\" stroke-width=\"1.4\" stroke-linejoin=\"round\" paint-order=\"stroke\""
            )
        });
        let _ = writeln!(
            self.body,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" text-anchor=\"{anchor}\" fill=\"{}\"{weight}{halo}{turn}>{}</text>",
            number(lettering.size),
            lettering.fill,
            escape(text)
        );
    }

    /// A PNG, `matrix` (SVG order a b c d e f) mapping its pixels (x right, y down) to the page.
    ///
    /// `crisp` pixels keep their edges (counts in cells), others are interpolated (images).
    pub(crate) fn image(
        &mut self,
        png: &[u8],
        (columns, rows): (usize, usize),
        matrix: [f64; 6],
        crisp: bool,
    ) {
        let rendering = if crisp {
            " image-rendering=\"optimizeSpeed\" style=\"image-rendering:pixelated\""
        } else {
            ""
        };
        if !matrix.iter().all(|v| v.is_finite()) {
            return;
        }
        let matrix: Vec<String> = matrix.iter().map(|&v| precise(v)).collect();
        let _ = writeln!(
            self.body,
            "<image width=\"{columns}\" height=\"{rows}\" preserveAspectRatio=\"none\"{rendering} transform=\"matrix({})\" href=\"data:image/png;base64,{}\"/>",
            matrix.join(" "),
            super::base64::encode(png)
        );
    }

    /// Whatever `draw` draws, cut off at the edges of `window`.
    pub(crate) fn clipped(&mut self, window: Rect, draw: impl FnOnce(&mut Self)) {
        self.clips += 1;
        let id = format!("{}-clip{}", escape(&self.id), self.clips);
        let _ = writeln!(
            self.body,
            "<clipPath id=\"{id}\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath><g clip-path=\"url(#{id})\">",
            number(window.x),
            number(window.y),
            number(window.width),
            number(window.height)
        );
        draw(self);
        self.body.push_str("</g>\n");
    }

    /// The finished document; `title` is read out by screen readers. Its width is the one that was asked for: where
    /// a text would leave the page, all is drawn a little smaller.
    pub(crate) fn finish(self, title: &str) -> String {
        let millimetres = |points: f64| number(points * 25.4 / 72.0);
        // Half a point of paper beyond letters that reach the edge.
        let edge = |at: f64, page: f64, pad: f64| {
            if (at - page).abs() > 0.0 {
                at + pad
            } else {
                at
            }
        };
        let [left, top] = [self.needed[0], self.needed[1]].map(|at| edge(at, 0.0, -0.5));
        let right = edge(self.needed[2], self.width, 0.5);
        let bottom = edge(self.needed[3], self.height, 0.5);
        let (width, height) = (right - left, bottom - top);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}mm\" height=\"{}mm\" viewBox=\"{x} {y} {w} {h}\" font-family=\"{FONT}\" role=\"img\" aria-label=\"{title}\">\n<title>{title}</title>\n<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n{}</svg>\n",
            millimetres(self.width),
            millimetres(height * self.width / width),
            self.body,
            x = number(left),
            y = number(top),
            w = number(width),
            h = number(height),
            title = escape(title),
        )
    }
}

/// A coordinate with two decimals, which is 1/100 pt, and no trailing zeros.
pub(crate) fn number(value: f64) -> String {
    trimmed(format!("{value:.2}"))
}

/// A number that multiplies large ones.
fn precise(value: f64) -> String {
    trimmed(format!("{value:.6}"))
}

fn trimmed(text: String) -> String {
    if !text.contains('.') {
        return text;
    }
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0" } else { short }.to_owned()
}

/// `text` with the characters that XML reserves replaced; control characters become spaces.
pub(crate) fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => safe.push(' '),
            c => safe.push(c),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!(number(1.0), "1");
        assert_eq!(number(-0.001), "0");
        assert_eq!(number(100.0), "100");
        assert_eq!(number(2.346), "2.35");
    }

    #[test]
    fn hostile_text_stays_text() {
        let mut svg = Svg::new("f", 10.0, 10.0);
        let lettering = Lettering {
            size: 7.0,
            anchor: Anchor::Start,
            bold: false,
            fill: "#000",
            turned: 0.0,
            halo: None,
        };
        svg.text((0.0, 0.0), "</text><script>\u{0}&\"'", &lettering);
        let text = svg.finish("<title>");
        assert!(text.contains("&lt;/text&gt;&lt;script&gt; &amp;&quot;&#39;"));
        assert!(!text.contains("<script>"));
        assert!(resvg::usvg::roxmltree::Document::parse(&text).is_ok());
    }
}
