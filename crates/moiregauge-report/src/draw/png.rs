//! SVG → PNG with the bundled font, and palette PNG for images inside a figure.

use std::sync::{Arc, OnceLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{self, fontdb};

use crate::error::ReportError;

/// Resolution of the PNG figures, dots per inch.
pub(crate) const DPI: f64 = 300.0;

/// The figure `svg` as a PNG of [`DPI`] dots per inch, which the file states.
pub(crate) fn render(svg: &str) -> Result<Vec<u8>, ReportError> {
    let picture = pixmap(svg, DPI)?;
    // The page is painted white, so that there is no transparency left to keep.
    let pixels = picture.data().chunks_exact(4);
    let mut opaque = vec![0; 3 * pixels.len()];
    for (opaque, pixel) in opaque.chunks_exact_mut(3).zip(pixels) {
        opaque.copy_from_slice(&pixel[..3]);
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.width(), picture.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    // A third of the time of the best compression, and files a little larger.
    encoder.set_compression(png::Compression::Fast);
    let per_metre = (DPI / 0.0254).round() as u32;
    encoder.set_pixel_dims(Some(png::PixelDimensions {
        xppu: per_metre,
        yppu: per_metre,
        unit: png::Unit::Meter,
    }));
    let drawn = |e: png::EncodingError| ReportError::Png(e.to_string());
    let mut writer = encoder.write_header().map_err(drawn)?;
    writer.write_image_data(&opaque).map_err(drawn)?;
    writer.finish().map_err(drawn)?;
    Ok(bytes)
}

/// The figure `svg` as pixels.
pub(crate) fn pixmap(svg: &str, dpi: f64) -> Result<Pixmap, ReportError> {
    let options = usvg::Options {
        fontdb: fonts(),
        ..usvg::Options::default()
    };
    let drawn = |what: String| ReportError::Png(what);
    let tree = usvg::Tree::from_str(svg, &options).map_err(|e| drawn(e.to_string()))?;
    // usvg measures the page in CSS pixels, 96 per inch.
    let zoom = (dpi / 96.0) as f32;
    let size = tree.size();
    let (width, height) = (
        (size.width() * zoom).round() as u32,
        (size.height() * zoom).round() as u32,
    );
    let mut pixmap = Pixmap::new(width, height)
        .ok_or_else(|| drawn(format!("{width} × {height} pixels are out of range")))?;
    // Before anything is drawn, or the last, half covered line would stay half transparent.
    pixmap.fill(resvg::tiny_skia::Color::WHITE);
    resvg::render(
        &tree,
        Transform::from_scale(zoom, zoom),
        &mut pixmap.as_mut(),
    );
    Ok(pixmap)
}

/// The bundled fonts; those of the machine are never asked, so figures look the same everywhere.
fn fonts() -> Arc<fontdb::Database> {
    static FONTS: OnceLock<Arc<fontdb::Database>> = OnceLock::new();
    let fonts = FONTS.get_or_init(|| {
        let mut database = fontdb::Database::new();
        for font in [dejavu::sans::regular(), dejavu::sans::bold()] {
            database.load_font_source(fontdb::Source::Binary(Arc::new(font)));
        }
        database.set_sans_serif_family("DejaVu Sans");
        Arc::new(database)
    });
    Arc::clone(fonts)
}

/// A palette PNG: `indices` row by row from the top, 0 transparent, `1 + i·254/255` the colour `i`.
pub(crate) fn palette_png(
    columns: usize,
    rows: usize,
    indices: &[u8],
    colours: &[[u8; 3]; 256],
) -> Vec<u8> {
    let mut palette = vec![255_u8; 3];
    // 255 entries are left; the one that is dropped lies in the middle of the map, unseen.
    palette.extend((0..255).flat_map(|i| colours[(f64::from(i) * 255.0 / 254.0).round() as usize]));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, columns as u32, rows as u32);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette);
    encoder.set_trns(vec![0_u8]);
    encoder.set_compression(png::Compression::High);
    // Differences of palette indices mean nothing: a filter only spoils the compression.
    encoder.set_filter(png::Filter::NoFilter);
    let written = encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(indices));
    // Writing to memory fails only if the shape and the data disagree.
    debug_assert!(written.is_ok(), "{columns} × {rows} for {}", indices.len());
    bytes
}
