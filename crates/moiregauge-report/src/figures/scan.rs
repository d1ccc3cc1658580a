//! The scan in true coordinates: every pixel where the sensors say it was, the frame that was
//! asked for and the one that was scanned, a scale bar and the lattice vectors.

use moiregauge::coverage::LatticeRegion;
use moiregauge::scan::Illustration;
use nalgebra::{Matrix2, Vector2};

use super::figure::Drawing;
use super::layout;
use super::picture::{IN_NM, Picture, column, corners};
use super::subject::Subject;
use crate::draw::axes::Axes;
use crate::draw::letters::text_width;
use crate::draw::scale::{Range, fixed, round_step};
use crate::draw::style::{COLUMN, LINE, SMALL, TEXT, VECTOR, VECTOR_MARKER, lettering, outline};
use crate::draw::svg::{Anchor, Ink, Lettering, Rect, Svg};
use crate::draw::{legend, raster};

/// The outline of the part of the frame that carries the lattice.
const COVERED: &str = "#009e73";

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let shown = subject.illustration()?;
    let actual = corners(&shown.image, &shown.pixel_to_nm, shown.origin);
    // Without sensors the frame is the intended one.
    let from_sensors = !shown.sensor_line.is_empty();
    let nominal = shown
        .nominal_pixel_to_nm
        .filter(|_| from_sensors)
        .map(|map| {
            let middle = middle_pixel(shown);
            corners(
                &shown.image,
                &map,
                shown.origin + (shown.pixel_to_nm - map) * middle,
            )
        });
    let points: Vec<(f64, f64)> = actual
        .iter()
        .chain(nominal.iter().flatten())
        .copied()
        .collect();
    let range = |values: Vec<f64>| {
        let range = Range::of(values).ok_or("the frame of the scan is not finite");
        range.map(|r| r.padded(0.02, 1e-6))
    };
    let x = range(points.iter().map(|p| p.0).collect())?;
    let y = range(points.iter().map(|p| p.1).collect())?;

    let area = column(x, y, layout::LEGEND + 8.0, 44.0);
    let axes = Axes::equal(area, x, y);
    let mut svg = Svg::new(subject.id, COLUMN, area.bottom() + layout::BELOW);
    let picture = Picture {
        image: &shown.image,
        linear: &shown.pixel_to_nm,
        origin: shown.origin,
        map: subject.map,
        range: raster::contrast(&shown.image, 0.005),
    };
    picture.pixels(&mut svg, &axes, |svg| {
        svg.polygon(&axes.points(actual), &Ink::line("#222222", LINE));
        if let Some(nominal) = nominal {
            svg.polygon(
                &axes.points(nominal),
                &Ink::line("#d55e00", LINE).dashed("4 2.5"),
            );
        }
        for [from, to] in shown.patch.iter().flat_map(LatticeRegion::outline) {
            let at = |pixel: Vector2<f64>| {
                let place = shown.origin + shown.pixel_to_nm * pixel;
                axes.at(place.x, place.y)
            };
            svg.line(at(from), at(to), &Ink::line("#ffffff", 2.2));
            svg.line(at(from), at(to), &Ink::line(COVERED, 1.1));
        }
    });
    let basis = layout::shown_lattice(subject.set, shown);
    vectors(&mut svg, &axes, shown, &basis);
    scale_bar(&mut svg, &axes, &actual);
    let channel = &subject.set.channel;
    let what = (channel.as_str(), shown.unit.as_str());
    picture.frame(&mut svg, &axes, &IN_NM, what);
    let (scanned, places) = if from_sensors {
        ("scanned (sensors)", "the position sensors place it")
    } else {
        ("frame (nominal)", "nominal size and rotation place it")
    };
    let mut keys = vec![(legend::Key::Line("#222222", ""), scanned)];
    if nominal.is_some() {
        keys.push((legend::Key::Line("#d55e00", "4 2.5"), "intended (nominal)"));
    }
    if shown.patch.is_some() {
        keys.push((legend::Key::Line(COVERED, ""), "measured"));
        // Three keys leave room for a word each.
        for key in &mut keys {
            key.1 = key.1.split(' ').next().unwrap_or(key.1);
        }
    }
    legend::row(&mut svg, (layout::LEFT, 11.0), &keys);

    let nominal_note = match (from_sensors, nominal.is_some()) {
        (false, _) => " There are no position sensors that could be used.",
        (true, true) => {
            " The intended frame is drawn about the same centre, at the size and rotation that the file states."
        }
        (true, false) => " The file states no intended frame.",
    };
    Ok(Drawing {
        wide: false,
        svg: svg.finish("Scan with intended and actual frame"),
        caption: format!(
            "{}, {} of {}, background removed. Every pixel is drawn where {places}, without resampling; x to the \
             right, y up. Arrows: the measured lattice vectors L₁, L₂ and L₃ = L₂ − L₁, not corrected for \
             drift.{nominal_note} Colours from the 0.5 % to the 99.5 % quantile.",
            channel,
            layout::line_name(shown.line),
            layout::short(&shown.file),
        ),
    })
}

/// Pixel coordinates of the middle of the image.
fn middle_pixel(shown: &Illustration) -> Vector2<f64> {
    let image = &shown.image;
    Vector2::new(image.columns as f64 - 1.0, image.rows as f64 - 1.0) / 2.0
}

/// The three lattice vectors as arrows from the middle of the image.
fn vectors(svg: &mut Svg, axes: &Axes, shown: &Illustration, basis: &Matrix2<f64>) {
    let middle = shown.origin + shown.pixel_to_nm * middle_pixel(shown);
    let (first, second) = (basis.column(0).into_owned(), basis.column(1).into_owned());
    for (index, vector) in [first, second, second - first].into_iter().enumerate() {
        let tip = middle + vector;
        let (from, to) = (axes.at(middle.x, middle.y), axes.at(tip.x, tip.y));
        let colour = VECTOR[index];
        svg.line(from, to, &Ink::line("#ffffff", 2.6));
        svg.line(from, to, &Ink::line(colour, 1.3));
        let ink = Ink {
            fill: colour,
            ..Ink::line("#ffffff", 0.7)
        };
        outline(svg, to, VECTOR_MARKER[index], 3.0, &ink);
        let away = Vector2::new(to.0 - from.0, to.1 - from.1).normalize() * 9.0;
        let label = Lettering {
            bold: true,
            fill: colour,
            halo: Some("#ffffff"),
            ..lettering(TEXT, Anchor::Middle)
        };
        let at = (to.0 + away.x, to.1 + away.y + 0.36 * TEXT);
        svg.text(at, ["L₁", "L₂", "L₃"][index], &label);
    }
}

/// A bar of round length in the lower right corner of the scanned frame.
fn scale_bar(svg: &mut Svg, axes: &Axes, frame: &[(f64, f64); 4]) {
    let length = round_step(axes.x.range.width() / 4.0);
    let text = format!("{} nm", fixed(length, usize::from(length < 1.0)));
    let points = length * axes.x.per_unit();
    let wide = points.max(text_width(&text, SMALL)) + 8.0;
    let corners = frame.map(|(x, y)| axes.at(x, y));
    let lowest = |a: &(f64, f64), b: &(f64, f64)| (a.0 + a.1).total_cmp(&(b.0 + b.1));
    let (right, bottom) = corners
        .into_iter()
        .max_by(lowest)
        .unwrap_or((axes.area.right(), axes.area.bottom()));
    let plate = Rect::new(right - wide - 6.0, bottom - 21.0, wide, 15.0);
    svg.rect(plate, &Ink::area("#ffffff", 0.8));
    let middle = plate.x + wide / 2.0;
    let bar = Rect::new(middle - points / 2.0, plate.bottom() - 4.5, points, 2.0);
    svg.rect(bar, &Ink::area("#222222", 1.0));
    svg.text(
        (middle, plate.y + 7.5),
        &text,
        &lettering(SMALL, Anchor::Middle),
    );
}
