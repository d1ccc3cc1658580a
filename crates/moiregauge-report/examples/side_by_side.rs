//! Puts figures (SVG files of a report) side by side in one PNG of the given height: `OUT.png HEIGHT FIGURE.svg …`.

use std::fmt::Write as _;
use std::sync::Arc;

use resvg::tiny_skia::{Color, Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

/// Space between two figures, pixels.
const GAP: f64 = 12.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let out = arguments.next().ok_or("give the PNG to write")?;
    let height: f64 = arguments.next().ok_or("give its height")?.parse()?;
    let mut fonts = fontdb::Database::new();
    for font in [dejavu::sans::regular(), dejavu::sans::bold()] {
        fonts.load_font_source(fontdb::Source::Binary(Arc::new(font)));
    }
    fonts.set_sans_serif_family("DejaVu Sans");
    let options = Options {
        fontdb: Arc::new(fonts),
        ..Options::default()
    };
    let (mut body, mut left) = (String::new(), 0.0);
    for path in arguments {
        let svg = std::fs::read_to_string(&path)?;
        let size = Tree::from_str(&svg, &options)?.size();
        let width = height * f64::from(size.width()) / f64::from(size.height());
        // The figure's own size gives way to its place; its view box stays.
        let (_, rest) = svg.split_once("viewBox").ok_or("no view box")?;
        write!(
            body,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" x=\"{left}\" y=\"0\" width=\"{width}\" height=\"{height}\" viewBox{rest}"
        )?;
        left += width + GAP;
    }
    let width = left - GAP;
    let page = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\">{body}</svg>"
    );
    let tree = Tree::from_str(&page, &options)?;
    let mut picture =
        Pixmap::new(width.round() as u32, height.round() as u32).ok_or("nothing to draw")?;
    picture.fill(Color::WHITE);
    resvg::render(&tree, Transform::identity(), &mut picture.as_mut());
    std::fs::write(out, picture.encode_png()?)?;
    Ok(())
}
