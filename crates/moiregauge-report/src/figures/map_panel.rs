//! The panel that all maps share: node values as an image in sample coordinates, scale bar, outlines of regions.

use moiregauge::image::Image;
use moiregauge::map::TwistStrainMap;
use nalgebra::Vector2;

use super::layout;
use super::map::MapSubject;
use crate::draw::axes::{Axes, Labels};
use crate::draw::scale::{Range, fixed, round_step};
use crate::draw::style::{BLACK, COLUMN, SMALL, TEXT, lettering};
use crate::draw::svg::{Anchor, Ink, Lettering, Rect, Svg};
use crate::draw::{colorbar, raster};

/// Space above the panel, pt.
const TOP: f64 = 12.0;
/// Space for the colour bar, pt.
const BAR: f64 = 50.0;

/// A page with one panel for a map.
pub(super) struct Panel {
    pub(super) svg: Svg,
    pub(super) axes: Axes,
}

impl Panel {
    /// An empty panel over the whole map, `above` more space on top of it (pt).
    pub(super) fn new(id: &str, map: &TwistStrainMap, above: f64) -> Result<Self, String> {
        let corners = map.grid.corners();
        let range = |axis: usize| {
            let range = Range::of(corners.iter().map(|c| c[axis]));
            range.filter(|r| r.width() > 0.0)
        };
        let (x, y) = range(0).zip(range(1)).ok_or("the map covers no area")?;
        let side = COLUMN - layout::LEFT - BAR;
        let height = (side * y.width() / x.width()).clamp(0.3 * side, 1.6 * side);
        let area = Rect::new(layout::LEFT, TOP + above, side, height);
        let axes = Axes::equal(area, x, y);
        Ok(Self {
            svg: Svg::new(id, COLUMN, area.bottom() + layout::BELOW),
            axes,
        })
    }

    /// The values of the nodes as an image with its colour bar; NaN stays blank. Returns the range of colours.
    pub(super) fn values(
        &mut self,
        subject: &MapSubject,
        label: (&str, &str),
        value: impl Fn(usize) -> f64,
    ) -> Result<Range, String> {
        let grid = &subject.map.grid;
        let values: Vec<f64> = (0..grid.len()).map(value).collect();
        if !values.iter().any(|v| v.is_finite()) {
            return Err("no node of the map is to be believed".to_owned());
        }
        let image = Image::new(grid.size[1], grid.size[0], values);
        let shades = raster::Shades {
            map: subject.colours,
            range: raster::contrast(&image, 0.002),
            crisp: true,
        };
        let axes = self.axes;
        self.svg.clipped(axes.area, |svg| {
            raster::draw(svg, &axes, &image, &grid.step, grid.origin, &shades);
        });
        let area = axes.area;
        let bar = Rect::new(area.right() + 6.0, area.y, 7.0, area.height);
        colorbar::draw(&mut self.svg, bar, subject.colours, shades.range, label);
        Ok(shades.range)
    }

    /// Outlines of what was asked, scale bar, axes; the finished document.
    pub(super) fn finish(mut self, subject: &MapSubject, title: &str) -> String {
        let axes = self.axes;
        self.svg.clipped(axes.area, |svg| {
            outlines(svg, &axes, subject);
            scale_bar(svg, &axes);
        });
        let labels = Labels {
            x: "x (nm)",
            y: "y (nm)",
            ..Labels::default()
        };
        axes.draw(&mut self.svg, &labels);
        self.svg.finish(title)
    }
}

/// A bar of a round length in the lower left corner.
fn scale_bar(svg: &mut Svg, axes: &Axes) {
    let (x, y) = (axes.x.range, axes.y.range);
    let length = round_step(0.3 * x.width());
    let (left, bottom) = (x.low + 0.05 * x.width(), y.low + 0.05 * x.width());
    let ends = (axes.at(left, bottom), axes.at(left + length, bottom));
    svg.line(ends.0, ends.1, &Ink::line("#ffffff", 3.6));
    svg.line(ends.0, ends.1, &Ink::line(BLACK, 2.0));
    let text = if length >= 1000.0 {
        format!("{} µm", fixed(length / 1000.0, 0))
    } else {
        let decimals = (-length.log10().floor()).max(0.0) as usize;
        format!("{} nm", fixed(length, decimals))
    };
    let middle = f64::midpoint(ends.0.0, ends.1.0);
    let style = Lettering {
        halo: Some("#ffffff"),
        ..lettering(TEXT, Anchor::Middle)
    };
    svg.text((middle, ends.0.1 - 4.0), &text, &style);
}

/// Regions (solid), areas for devices (dashed, with their rank), lines.
fn outlines(svg: &mut Svg, axes: &Axes, subject: &MapSubject) {
    let mut outline = |corners: &[Vector2<f64>], dash: &str, name: &str, closed: bool| {
        let points = axes.points(corners.iter().map(|c| (c.x, c.y)));
        for ink in [
            Ink::line("#ffffff", 1.9),
            Ink::line(BLACK, 0.9).dashed(dash),
        ] {
            if closed {
                svg.polygon(&points, &ink);
            } else {
                svg.polyline(&points, &ink);
            }
        }
        let count = points.len().max(1) as f64;
        let sum = points
            .iter()
            .fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
        let style = Lettering {
            halo: Some("#ffffff"),
            ..lettering(SMALL, Anchor::Middle)
        };
        let at = if closed {
            (sum.0 / count, sum.1 / count + 0.36 * SMALL)
        } else {
            points
                .first()
                .map_or((f64::NAN, f64::NAN), |p| (p.0, p.1 - 3.0))
        };
        svg.text(at, name, &style);
    };
    let details = subject.details;
    for found in &details.regions {
        outline(&found.region.corners, "", &found.region.name, true);
    }
    for device in &details.devices {
        let region = &device.found.region;
        outline(&region.corners, "2.5 1.5", &region.name, true);
    }
    for profile in &details.profiles {
        outline(&profile.ends, "", &profile.name, false);
    }
}

/// The words under every map.
pub(super) fn about(map: &TwistStrainMap) -> String {
    format!(
        "Gaussian window of {:.2} nm (standard deviation): a point becomes {:.2} nm wide (full width at half \
         maximum). Nodes that are not to be believed are blank. x to the right, y up.",
        map.window_nm,
        2.355 * map.window_nm
    )
}
