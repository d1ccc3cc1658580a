//! Autocorrelation and power spectrum side by side in true coordinates, the lattice marked.

use moiregauge::frame::Image;
use moiregauge::scan::Illustration;
use nalgebra::{Matrix2, Vector2};

use super::figure::Drawing;
use super::layout;
use super::picture::{self, Picture};
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels};
use crate::draw::raster;
use crate::draw::scale::Range;
use crate::draw::style::{Marker, PAGE, VECTOR, VECTOR_MARKER, outline};
use crate::draw::svg::{Ink, Svg};

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let shown = subject.illustration()?;
    let basis = layout::shown_lattice(subject.set, shown);
    let dual = basis.try_inverse().map(|inverse| inverse.transpose());
    let to_frequency = shown
        .pixel_to_nm
        .try_inverse()
        .map(|inverse| inverse.transpose());
    let (Some(dual), Some(to_frequency)) = (dual, to_frequency) else {
        return Err("the lattice of the scan has no area".to_owned());
    };
    if ![longest(&basis), longest(&dual)]
        .iter()
        .all(|l| l.is_normal())
    {
        return Err("the lattice of the scan is not finite".to_owned());
    }
    let mut svg = picture::page_of_two(subject.id);
    autocorrelation(&mut svg, subject, shown, &basis);
    spectrum(&mut svg, subject, shown, &dual, &to_frequency);
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Autocorrelation and spectrum with the lattice marked"),
        caption: format!(
            "Of {}, {}: (a) autocorrelation, relative to that at no shift, against the shift in nm, (b) decimal logarithm of the power spectrum, relative to its highest peak, against spatial frequency (cycles per nm), both in sensor coordinates, x to the right, y up, not corrected for drift. Coloured symbols: the three lattice vectors; circles: further points of the fitted lattice (a) and the first two shells of its reciprocal lattice (b).",
            layout::short(&shown.file),
            layout::line_name(shown.line)
        ),
    })
}

fn panel(left: f64, half: f64) -> Axes {
    let range = Range::new(-half, half);
    Axes::new(picture::square(left), range, range)
}

fn autocorrelation(svg: &mut Svg, subject: &Subject, shown: &Illustration, basis: &Matrix2<f64>) {
    let reach = reach(&shown.autocorrelation, &shown.pixel_to_nm, longest(basis));
    let axes = panel(layout::LEFT, reach);
    let (mut image, origin) = visible(&shown.autocorrelation, &shown.pixel_to_nm, &axes);
    // Relative to no shift, where the image agrees with itself and noise with noise.
    let whole = &shown.autocorrelation;
    let unshifted = whole
        .values
        .get(whole.rows / 2 * whole.columns + whole.columns / 2);
    if let Some(unshifted) = unshifted.filter(|v| **v > 0.0) {
        image.values.iter_mut().for_each(|v| *v /= unshifted);
    }
    let picture = Picture {
        image: &image,
        linear: &shown.pixel_to_nm,
        origin,
        map: subject.map,
        range: raster::contrast(&image, 0.005),
    };
    picture.pixels(svg, &axes, |svg| {
        for (i, j, at) in lattice_points(basis, &axes) {
            let ends = [(1, 0), (0, 1), (-1, 1)];
            match ends.iter().position(|&end| end == (i, j)) {
                Some(index) => {
                    let ink = Ink {
                        fill: VECTOR[index],
                        ..Ink::line("#ffffff", 0.8)
                    };
                    outline(svg, at, VECTOR_MARKER[index], 3.0, &ink);
                }
                None => ring(svg, at, 2.6),
            }
        }
    });
    let labels = Labels {
        letter: "a",
        title: "autocorrelation",
        x: "shift x (nm)",
        y: "shift y (nm)",
        ..Labels::default()
    };
    let what = ("autocorrelation over that at no shift", "");
    picture.frame(svg, &axes, &labels, what);
}

fn spectrum(
    svg: &mut Svg,
    subject: &Subject,
    shown: &Illustration,
    dual: &Matrix2<f64>,
    to_frequency: &Matrix2<f64>,
) {
    let [across, up] = shown.spectrum_step;
    let map = to_frequency * Matrix2::new(across, 0.0, 0.0, up);
    let reach = reach(&shown.spectrum, &map, longest(dual));
    let axes = panel(PAGE / 2.0 + layout::LEFT + 2.0, reach);
    let (mut image, origin) = visible(&shown.spectrum, &map, &axes);
    // In decades below the highest peak.
    let highest = Range::of(image.values.iter().copied()).map_or(0.0, |r| r.high);
    let decades = |v: &mut f64| *v = (*v - highest) / std::f64::consts::LN_10;
    image.values.iter_mut().for_each(decades);
    // The peaks are a handful of pixels: only the floor may be cut off.
    let floor = raster::contrast(&image, 0.3).low;
    let top: f64 = 0.0;
    let picture = Picture {
        image: &image,
        linear: &map,
        origin,
        map: subject.map,
        range: Range::new(floor, top.max(floor + 1e-12)),
    };
    picture.pixels(svg, &axes, |svg| {
        // 1.8: the first two shells; rings further out would mark noise.
        let near = |i: i32, j: i32| {
            (dual * Vector2::new(f64::from(i), f64::from(j))).norm() < 1.8 * longest(dual)
        };
        for (_, _, at) in lattice_points(dual, &axes)
            .into_iter()
            .filter(|&(i, j, _)| near(i, j))
        {
            ring(svg, at, 5.0);
        }
    });
    let labels = Labels {
        letter: "b",
        title: "power spectrum",
        x: "frequency x (1/nm)",
        y: "frequency y (1/nm)",
        ..Labels::default()
    };
    let what = ("log₁₀ of power over the highest", "");
    picture.frame(svg, &axes, &labels, what);
}

/// Half the width of a panel: a few vectors, but not more than the picture holds.
fn reach(image: &Image, map: &Matrix2<f64>, longest: f64) -> f64 {
    let pixels = Vector2::new(image.columns as f64, image.rows as f64) / 2.0;
    let held = (map[(0, 0)].abs() * pixels.x).min(map[(1, 1)].abs() * pixels.y);
    held.clamp(1.2 * longest, 2.4 * longest)
}

fn longest(basis: &Matrix2<f64>) -> f64 {
    let third = basis.column(1) - basis.column(0);
    basis
        .column(0)
        .norm()
        .max(basis.column(1).norm())
        .max(third.norm())
}

/// A circle that is seen on light and on dark ground.
fn ring(svg: &mut Svg, at: (f64, f64), radius: f64) {
    outline(svg, at, Marker::Circle, radius, &Ink::line("#222222", 1.5));
    outline(svg, at, Marker::Circle, radius, &Ink::line("#ffffff", 0.8));
}

/// Lattice points other than zero inside the panel, with their indices.
fn lattice_points(basis: &Matrix2<f64>, axes: &Axes) -> Vec<(i32, i32, (f64, f64))> {
    let inside = |at: &Vector2<f64>| axes.x.range.contains(at.x) && axes.y.range.contains(at.y);
    let indices = (-4..=4).flat_map(|i| (-4..=4).map(move |j| (i, j)));
    indices
        .filter(|&indices| indices != (0, 0))
        .map(|(i, j)| (i, j, basis * Vector2::new(f64::from(i), f64::from(j))))
        .filter(|(_, _, at)| inside(at))
        .map(|(i, j, at)| (i, j, axes.at(at.x, at.y)))
        .collect()
}

/// The part of a centred image that the panel shows, and the place of its first pixel.
fn visible(image: &Image, map: &Matrix2<f64>, axes: &Axes) -> (Image, Vector2<f64>) {
    let centre = Vector2::new((image.columns / 2) as f64, (image.rows / 2) as f64);
    let half = axes.x.range.high;
    // A singular map was refused before; the whole image is a safe answer.
    let inverse = map.try_inverse().unwrap_or_else(Matrix2::zeros);
    let reach = inverse.abs() * Vector2::new(half, half);
    let cut = |middle: f64, reach: f64, size: usize| {
        if reach == 0.0 {
            return (0, size);
        }
        let first = (middle - reach - 1.0).floor().max(0.0) as usize;
        let last = (middle + reach + 2.0).ceil().clamp(0.0, size as f64) as usize;
        (first, last.saturating_sub(first))
    };
    let (column, columns) = cut(centre.x, reach.x, image.columns);
    let (row, rows) = cut(centre.y, reach.y, image.rows);
    let first = Vector2::new(column as f64, row as f64);
    (
        raster::cropped(image, row, column, rows, columns),
        map * (first - centre),
    )
}
