//! An image of a larger area with the frames of the scans marked in it.

use moiregauge::campaign::{Analysis, SetAnalysis};
use nalgebra::{Matrix2, Vector2};

use super::figure::Drawing;
use super::layout;
use super::picture::{IN_NM, Picture, column, extent};
use crate::draw::axes::Axes;
use crate::draw::colormap::ColorMap;
use crate::draw::legend::{self, Key};
use crate::draw::raster;
use crate::draw::scale::Range;
use crate::draw::style::{COLUMN, SET};
use crate::draw::svg::{Ink, Svg};

/// A frame that is drawn smaller than this (pt) gets a ring around it.
const SMALL_FRAME: f64 = 8.0;

pub(super) fn draw(analysis: &Analysis, id: &str, map: ColorMap) -> Result<Drawing, String> {
    let picture = analysis
        .survey
        .as_ref()
        .ok_or("no survey image was given")?;
    let (image, linear, origin) = (&picture.image, &picture.pixel_to_nm, picture.origin);
    let (x, y) = extent(image, linear, origin).ok_or("the survey image covers no area")?;
    let frames: Vec<[(f64, f64); 4]> = analysis.sets.iter().map(frame).collect();
    let outside = frames
        .iter()
        .filter(|f| !f.iter().any(|(cx, cy)| x.contains(*cx) && y.contains(*cy)))
        .count();
    // Frames beyond the image are shown as well, unless they are so far away that nothing would be seen.
    let near = |range: Range, axis: fn(&(f64, f64)) -> f64| {
        let ends = frames.iter().flatten().map(axis);
        let far = range.padded(1.0, 1e-6);
        let kept = ends
            .filter(|v| far.contains(*v))
            .chain([range.low, range.high]);
        Range::of(kept).unwrap_or(range).padded(0.01, 1e-6)
    };
    let (x, y) = (near(x, |p| p.0), near(y, |p| p.1));
    let area = column(x, y, layout::LEGEND + 8.0, 44.0);
    let axes = Axes::equal(area, x, y);
    let mut svg = Svg::new(id, COLUMN, area.bottom() + layout::BELOW);
    let shown = Picture {
        image,
        linear,
        origin,
        map,
        range: raster::contrast(image, 0.005),
    };
    shown.pixels(&mut svg, &axes, |svg| {
        for (frame, colour) in frames.iter().zip(SET.iter().cycle()) {
            mark(svg, &axes, frame, colour);
        }
    });
    let what = (picture.channel.as_str(), picture.unit.as_str());
    shown.frame(&mut svg, &axes, &IN_NM, what);
    let keys: Vec<(Key, &str)> = analysis
        .sets
        .iter()
        .zip(SET.iter().cycle())
        .map(|(set, colour)| (Key::Line(colour, ""), set.name.as_str()))
        .collect();
    legend::row(&mut svg, (layout::LEFT - 30.0, 11.0), &keys);
    let places = if picture.from_sensors {
        "its position sensors"
    } else {
        "the size and offset that the file states"
    };
    let missing = match outside {
        0 => String::new(),
        n => format!(" {n} of {} frames lie outside of it.", frames.len()),
    };
    Ok(Drawing {
        wide: false,
        svg: svg.finish("Survey image with the scanned frames"),
        caption: format!(
            "{} of {}, background removed, placed by {places}. Frames: the first scan of every set, at its own \
             positions. Offsets of the scanner and drift between the images can shift them.{missing}",
            picture.channel,
            layout::short(&picture.file)
        ),
    })
}

/// The corners of the first scan of a set, nm.
fn frame(set: &SetAnalysis) -> [(f64, f64); 4] {
    let around = |centre: Vector2<f64>, half: Matrix2<f64>| {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(a, b)| {
            let at = centre + half * Vector2::new(a, b);
            (at.x, at.y)
        })
    };
    if let Some(shown) = &set.illustration {
        let pixels = Vector2::new(
            shown.image.columns as f64 - 1.0,
            shown.image.rows as f64 - 1.0,
        );
        let half = shown.pixel_to_nm * Matrix2::from_diagonal(&pixels) / 2.0;
        return around(shown.origin + shown.pixel_to_nm * pixels / 2.0, half);
    }
    let first = set.scans.first();
    let centre = first.map_or(Vector2::repeat(f64::NAN), |s| s.window_centre);
    let half = first.map_or([f64::NAN; 2], |s| s.window_extent.map(|e| e / 2.0));
    around(centre, Matrix2::from_diagonal(&Vector2::from(half)))
}

/// A frame, with a ring around a small one.
fn mark(svg: &mut Svg, axes: &Axes, frame: &[(f64, f64); 4], colour: &str) {
    let corners = axes.points(frame.iter().copied());
    for ink in [Ink::line("#ffffff", 2.4), Ink::line(colour, 1.3)] {
        svg.polygon(&corners, &ink);
    }
    let middle = corners
        .iter()
        .fold((0.0, 0.0), |s, p| (s.0 + p.0 / 4.0, s.1 + p.1 / 4.0));
    let reach = corners
        .iter()
        .map(|p| (p.0 - middle.0).hypot(p.1 - middle.1))
        .fold(0.0, f64::max);
    if reach < SMALL_FRAME {
        for ink in [Ink::line("#ffffff", 2.4), Ink::line(colour, 1.3)] {
            svg.circle(middle, reach + 6.0, &ink);
        }
    }
}
