//! Maps as figures: one quantity each, in sample coordinates, nodes that are not to be believed left blank.

use moiregauge::image::Image;
use moiregauge::map::{Mask, Plane, TwistStrainMap};
use nalgebra::Vector2;

use super::{Drawing, Figure, layout};
use crate::draw::axes::{Axes, Labels};
use crate::draw::colormap::ColorMap;
use crate::draw::scale::Range;
use crate::draw::style::COLUMN;
use crate::draw::svg::{Rect, Svg};
use crate::draw::{colorbar, raster};

/// The figures of a map, drawn or with the reason why not.
pub fn map_figures(map: &TwistStrainMap, colours: ColorMap) -> Vec<Figure> {
    let degree = 1f64.to_degrees();
    let mean = mean_wavelength(map);
    let shown: [(&str, &'static str, &str, &Plane, f64); 4] = [
        ("map-twist", "Twist", "twist θ (°)", &map.twist, degree),
        (
            "map-strain",
            "Heterostrain",
            "strain |ε| (%)",
            &map.magnitude,
            100.0,
        ),
        (
            "map-wavelength",
            "Wavelength",
            "mean wavelength (nm)",
            &mean,
            1.0,
        ),
        (
            "map-twist-sigma",
            "Error of the twist",
            "σ of θ (°)",
            &sigma(&map.twist),
            degree,
        ),
    ];
    let mut all: Vec<Figure> = shown
        .into_iter()
        .map(|(name, title, label, plane, factor)| {
            let values = |n: usize| {
                if map.mask[n] == Mask::Good {
                    factor * f64::from(plane.value[n])
                } else {
                    f64::NAN
                }
            };
            Figure {
                name: name.to_owned(),
                set: None,
                title,
                drawing: draw(map, (name, title, label), values, colours),
            }
        })
        .collect();
    let mask = |n: usize| f64::from(map.mask[n] as u8);
    all.push(Figure {
        name: "map-mask".to_owned(),
        set: None,
        title: "Mask",
        drawing: draw(map, ("map-mask", "Mask", "mask (0: good)"), mask, colours),
    });
    all
}

fn sigma(plane: &Plane) -> Plane {
    Plane {
        value: plane.sigma.clone(),
        sigma: Vec::new(),
    }
}

fn mean_wavelength(map: &TwistStrainMap) -> Plane {
    let [a, b, c] = &map.wavelengths;
    let three = a.value.iter().zip(&b.value).zip(&c.value);
    Plane {
        value: three.map(|((a, b), c)| (a + b + c) / 3.0).collect(),
        sigma: Vec::new(),
    }
}

fn draw(
    map: &TwistStrainMap,
    (name, title, label): (&str, &str, &str),
    value: impl Fn(usize) -> f64,
    colours: ColorMap,
) -> Result<Drawing, String> {
    let [columns, rows] = map.grid.size;
    let image = Image::new(rows, columns, (0..map.grid.len()).map(value).collect());
    if !image.values.iter().any(|v| v.is_finite()) {
        return Err("no node of the map is to be believed".to_owned());
    }
    let (right, top) = (columns as f64 - 0.5, rows as f64 - 0.5);
    let corners = [(-0.5, -0.5), (right, -0.5), (right, top), (-0.5, top)]
        .map(|(c, r)| map.grid.origin + map.grid.step * Vector2::new(c, r));
    let range = |axis: usize| {
        Range::of(corners.iter().map(|c| c[axis])).ok_or("the map has no finite place")
    };
    let (x, y) = (range(0)?, range(1)?);
    let side = COLUMN - layout::LEFT - 50.0;
    let height = (side * y.width() / x.width()).clamp(0.3 * side, 1.6 * side);
    let area = Rect::new(layout::LEFT, 12.0, side, height);
    let axes = Axes::equal(area, x, y);
    let mut svg = Svg::new(name, COLUMN, area.bottom() + layout::BELOW);
    let contrast = raster::contrast(&image, 0.005);
    svg.clipped(area, |svg| {
        let shades = raster::Shades {
            map: colours,
            range: contrast,
            crisp: true,
        };
        raster::draw(svg, &axes, &image, &map.grid.step, map.grid.origin, &shades);
    });
    let labels = Labels {
        x: "x (nm)",
        y: "y (nm)",
        ..Labels::default()
    };
    axes.draw(&mut svg, &labels);
    let bar = Rect::new(area.right() + 6.0, area.y, 7.0, area.height);
    colorbar::draw(&mut svg, bar, colours, contrast, (label, ""));
    Ok(Drawing {
        wide: false,
        svg: svg.finish(title),
        caption: format!(
            "{title}. Gaussian window of {:.2} nm (standard deviation), {:.2} nm full width at half maximum; nodes \
             that are not to be believed are blank. x to the right, y up.",
            map.window_nm,
            2.355 * map.window_nm
        ),
    })
}
