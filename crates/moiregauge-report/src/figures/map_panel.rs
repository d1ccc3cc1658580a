//! The panel that all maps share: node values as an image in sample coordinates, scale bar, outlines of what was asked.

use moiregauge::frame::Image;
use moiregauge::map::TwistStrainMap;
use nalgebra::Vector2;

use super::layout;
use super::subject::MapSubject;
use crate::draw::axes::{Axes, Labels};
use crate::draw::letters::text_width;
use crate::draw::scale::{Range, fixed, round_step};
use crate::draw::style::{BLACK, COLUMN, SMALL, TEXT, lettering};
use crate::draw::svg::{Anchor, Ink, Lettering, Rect, Svg};
use crate::draw::{colorbar, raster};
use crate::map_details::MapDetails;

/// Space above the panel, pt.
const TOP: f64 = 12.0;
/// Space for the colour bar, pt.
const BAR: f64 = 50.0;
/// Colours span this many σ of a node at least: noise alone, ± 2 σ, takes a third of them.
const LEAST: f64 = 12.0;

/// What a map shows.
pub(super) struct Shown<'a> {
    pub(super) name: &'a str,
    pub(super) unit: &'a str,
    /// Noise of a node, in that unit; NaN where there is none to be told.
    pub(super) sigma: f64,
}

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
    ///
    /// The colours span at least twelve σ of a node, so that noise does not look like a landscape, and σ is marked in
    /// the colour bar.
    pub(super) fn values(
        &mut self,
        subject: &MapSubject,
        shown: &Shown,
        value: impl Fn(usize) -> f64,
    ) -> Result<Range, String> {
        let grid = &subject.map.grid;
        let values: Vec<f64> = (0..grid.len()).map(value).collect();
        if !values.iter().any(|v| v.is_finite()) {
            return Err("the map has no good node".to_owned());
        }
        let image = Image::new(grid.size[1], grid.size[0], values);
        let shades = raster::Shades {
            map: subject.colours,
            range: held(raster::contrast(&image, 0.002), shown.sigma),
            crisp: true,
        };
        let axes = self.axes;
        self.svg.clipped(axes.area, |svg| {
            raster::draw(svg, &axes, &image, &grid.step, grid.origin, &shades);
        });
        let area = axes.area;
        let bar = Rect::new(area.right() + 6.0, area.y, 7.0, area.height);
        let label = (shown.name, shown.unit);
        colorbar::draw(&mut self.svg, bar, subject.colours, shades.range, label);
        colorbar::noise(&mut self.svg, bar, shades.range, shown.sigma);
        Ok(shades.range)
    }

    /// Outlines and names of what was asked of the map.
    pub(super) fn overlays(&mut self, details: &MapDetails) {
        let axes = self.axes;
        let asked = asked(details);
        self.svg.clipped(axes.area, |svg| {
            for one in &asked {
                one.outline(svg, &axes);
            }
        });
        // Names last, so that no line strikes through them.
        for one in &asked {
            one.write(&mut self.svg, &axes);
        }
    }

    /// Scale bar, axes; the finished document.
    pub(super) fn finish(mut self, title: &str) -> String {
        let axes = self.axes;
        self.svg.clipped(axes.area, |svg| scale_bar(svg, &axes));
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
pub(super) fn scale_bar(svg: &mut Svg, axes: &Axes) {
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

/// A range of colours that noise of `sigma` does not fill.
fn held(range: Range, sigma: f64) -> Range {
    if sigma.is_finite() {
        range.padded(0.0, LEAST * sigma)
    } else {
        range
    }
}

/// A region (solid), an area for a device (dashed, with its rank) or a line, as it is drawn.
struct Asked<'a> {
    corners: &'a [Vector2<f64>],
    name: &'a str,
    dash: &'static str,
    closed: bool,
}

fn asked(details: &MapDetails) -> Vec<Asked<'_>> {
    let regions = details.regions.iter().map(|found| Asked {
        corners: &found.region.corners,
        name: &found.region.name,
        dash: "",
        closed: true,
    });
    let devices = details.devices.iter().map(|device| Asked {
        corners: &device.found.region.corners,
        name: &device.found.region.name,
        dash: "2.5 1.5",
        closed: true,
    });
    let profiles = details.profiles.iter().map(|profile| Asked {
        corners: &profile.ends,
        name: &profile.name,
        dash: "",
        closed: false,
    });
    regions.chain(devices).chain(profiles).collect()
}

impl Asked<'_> {
    fn points(&self, axes: &Axes) -> Vec<(f64, f64)> {
        axes.points(self.corners.iter().map(|c| (c.x, c.y)))
    }

    fn outline(&self, svg: &mut Svg, axes: &Axes) {
        let points = self.points(axes);
        for ink in [
            Ink::line("#ffffff", 1.9),
            Ink::line(BLACK, 0.9).dashed(self.dash),
        ] {
            if self.closed {
                svg.polygon(&points, &ink);
            } else {
                svg.polyline(&points, &ink);
            }
        }
    }

    /// The name at the corner that is highest on the page, a rank in the middle of its area; within the panel.
    fn write(&self, svg: &mut Svg, axes: &Axes) {
        let points = self.points(axes);
        let Some(&highest) = points.iter().min_by(|a, b| a.1.total_cmp(&b.1)) else {
            return;
        };
        let count = points.len() as f64;
        let middle = points
            .iter()
            .fold((0.0, 0.0), |s, p| (s.0 + p.0 / count, s.1 + p.1 / count));
        let (x, y) = if self.dash.is_empty() {
            (highest.0, highest.1 - 3.0)
        } else {
            (middle.0, middle.1 + 0.36 * SMALL)
        };
        let (area, half) = (axes.area, text_width(self.name, SMALL) / 2.0);
        let within = |v: f64, low: f64, high: f64| v.min(high).max(low);
        let at = (
            within(x, area.x + half + 1.0, area.right() - half - 1.0),
            within(y, area.y + SMALL + 1.0, area.bottom() - 2.0),
        );
        let style = Lettering {
            halo: Some("#ffffff"),
            ..lettering(SMALL, Anchor::Middle)
        };
        svg.text(at, self.name, &style);
    }
}

/// The words under every map.
pub(super) fn about(map: &TwistStrainMap) -> String {
    format!(
        "Gaussian window of {:.2} nm (standard deviation); resolution {:.2} nm (full width at half maximum). Bad nodes \
         are blank. x to the right, y up.",
        map.window_nm,
        2.355 * map.window_nm
    )
}
