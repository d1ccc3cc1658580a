//! A panel: a frame with ticks, titles and a letter, and the map from data to page.

use super::letters::text_width;
use super::scale::{Range, Scale, Tick, ticks, whole_ticks};
use super::style::{BLACK, GREY, HAIR, LETTER, LINE, SMALL, TEXT, lettering};
use super::svg::{Anchor, Ink, Lettering, Rect, Svg};

/// Data coordinates (x right, y up) of a rectangle on the page.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axes {
    pub(crate) area: Rect,
    pub(crate) x: Scale,
    pub(crate) y: Scale,
}

/// What is written around a panel. An empty title is left out.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Labels<'a> {
    pub(crate) letter: &'a str,
    pub(crate) title: &'a str,
    pub(crate) x: &'a str,
    pub(crate) y: &'a str,
    pub(crate) x_ticks: Ticks,
    pub(crate) y_ticks: Ticks,
}

/// The ticks of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Ticks {
    /// At round values, with numbers.
    #[default]
    Values,
    /// As `Values`, but a neighbouring panel has the numbers.
    BareValues,
    /// At whole numbers: the axis counts scans.
    Scans,
    /// As `Scans`, but a neighbouring panel has the numbers.
    BareScans,
    /// None: a density in arbitrary units.
    None,
}

impl Ticks {
    /// `Scans`, with or without numbers.
    pub(crate) fn scans(numbers: bool) -> Self {
        if numbers {
            Self::Scans
        } else {
            Self::BareScans
        }
    }

    fn whole(self) -> bool {
        matches!(self, Self::Scans | Self::BareScans)
    }

    fn numbers(self) -> bool {
        matches!(self, Self::Values | Self::Scans)
    }
}

const TICK: f64 = 2.4;

impl Axes {
    pub(crate) fn new(area: Rect, x: Range, y: Range) -> Self {
        Self {
            area,
            x: Scale::new(x, area.x, area.right()),
            y: Scale::new(y, area.bottom(), area.y),
        }
    }

    /// Axes of equal scale: the range that is too narrow for the area is widened about its centre.
    pub(crate) fn equal(area: Rect, x: Range, y: Range) -> Self {
        let unit = (x.width() / area.width).max(y.width() / area.height);
        let about = |r: Range, length: f64| {
            Range::new(
                r.centre() - unit * length / 2.0,
                r.centre() + unit * length / 2.0,
            )
        };
        Self::new(area, about(x, area.width), about(y, area.height))
    }

    pub(crate) fn at(&self, x: f64, y: f64) -> (f64, f64) {
        (self.x.at(x), self.y.at(y))
    }

    pub(crate) fn points(&self, data: impl IntoIterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
        data.into_iter().map(|(x, y)| self.at(x, y)).collect()
    }

    /// A horizontal line through the panel.
    pub(crate) fn level(&self, svg: &mut Svg, y: f64, ink: &Ink) {
        if self.y.range.contains(y) {
            let y = self.y.at(y);
            svg.line((self.area.x, y), (self.area.right(), y), ink);
        }
    }

    /// A horizontal band through the panel.
    pub(crate) fn band(&self, svg: &mut Svg, low: f64, high: f64, ink: &Ink) {
        let range = self.y.range;
        let (low, high) = (low.max(range.low), high.min(range.high));
        if low < high {
            let (top, bottom) = (self.y.at(high), self.y.at(low));
            svg.rect(
                Rect::new(self.area.x, top, self.area.width, bottom - top),
                ink,
            );
        }
    }

    /// A vertical error bar of ± `sigma`, cut off at the frame; nothing if `sigma` is not finite.
    pub(crate) fn error_bar(&self, svg: &mut Svg, x: f64, y: f64, sigma: f64, colour: &str) {
        let range = self.y.range;
        let (low, high) = ((y - sigma).max(range.low), (y + sigma).min(range.high));
        if low < high && self.x.range.contains(x) {
            svg.line(self.at(x, low), self.at(x, high), &Ink::line(colour, 0.8));
        }
    }

    /// A horizontal error bar.
    pub(crate) fn error_bar_x(&self, svg: &mut Svg, x: f64, y: f64, sigma: f64, colour: &str) {
        let range = self.x.range;
        let (low, high) = ((x - sigma).max(range.low), (x + sigma).min(range.high));
        if low < high && self.y.range.contains(y) {
            svg.line(self.at(low, y), self.at(high, y), &Ink::line(colour, 0.8));
        }
    }

    /// The frame, ticks and labels. Drawn last, so that data do not cover the frame.
    pub(crate) fn draw(&self, svg: &mut Svg, labels: &Labels) {
        let area = self.area;
        let frame = Ink::line(BLACK, HAIR);
        svg.rect(area, &frame);
        self.draw_x(svg, labels, &frame);
        let widest = if labels.y_ticks == Ticks::None {
            -6.0
        } else {
            self.draw_y(svg, labels, &frame)
        };
        if !labels.y.is_empty() {
            let upright = Lettering {
                turned: 90.0,
                ..lettering(TEXT, Anchor::Middle)
            };
            let x = area.x - TICK - 2.0 - widest - 5.0;
            svg.text((x, area.y + area.height / 2.0), labels.y, &upright);
        }
        let mut start = area.x;
        if !labels.letter.is_empty() {
            let bold = Lettering {
                bold: true,
                ..lettering(LETTER, Anchor::Start)
            };
            svg.text((start, area.y - 4.0), labels.letter, &bold);
            start += text_width(labels.letter, LETTER) + 6.0;
        }
        svg.text(
            (start, area.y - 4.0),
            labels.title,
            &lettering(TEXT, Anchor::Start),
        );
    }

    fn draw_x(&self, svg: &mut Svg, labels: &Labels, frame: &Ink) {
        let (area, range) = (self.area, self.x.range);
        let spacing = if labels.x_ticks.whole() { 17.0 } else { 34.0 };
        let wanted = ((area.width / spacing) as usize).clamp(3, 12);
        let marks = fitting(wanted, labels.x_ticks.whole(), range, |marks| {
            let needed: f64 = marks
                .iter()
                .map(|t| text_width(&t.label, SMALL) + 5.0)
                .sum();
            needed <= area.width + 10.0
        });
        for tick in marks {
            let x = self.x.at(tick.value);
            svg.line((x, area.bottom()), (x, area.bottom() + TICK), frame);
            if labels.x_ticks.numbers() {
                let at = (x, area.bottom() + TICK + 1.5 + SMALL);
                svg.text(at, &tick.label, &lettering(SMALL, Anchor::Middle));
            }
        }
        if !labels.x.is_empty() {
            let at = (
                area.x + area.width / 2.0,
                area.bottom() + TICK + SMALL + 4.0 + TEXT,
            );
            svg.text(at, labels.x, &lettering(TEXT, Anchor::Middle));
        }
    }

    /// Draws ticks and numbers of y and returns the width of the widest number, pt.
    fn draw_y(&self, svg: &mut Svg, labels: &Labels, frame: &Ink) -> f64 {
        let (area, range) = (self.area, self.y.range);
        let wanted = ((area.height / 22.0) as usize).clamp(3, 8);
        let mut widest: f64 = 0.0;
        for tick in fitting(wanted, labels.y_ticks.whole(), range, |_| true) {
            let y = self.y.at(tick.value);
            svg.line((area.x - TICK, y), (area.x, y), frame);
            if labels.y_ticks.numbers() {
                let at = (area.x - TICK - 2.0, y + 0.36 * SMALL);
                svg.text(at, &tick.label, &lettering(SMALL, Anchor::End));
                widest = widest.max(text_width(&tick.label, SMALL));
            }
        }
        widest
    }
}

/// As many ticks as wanted, or fewer until they fit.
fn fitting(wanted: usize, whole: bool, range: Range, fits: impl Fn(&[Tick]) -> bool) -> Vec<Tick> {
    let make = if whole { whole_ticks } else { ticks };
    (1..=wanted)
        .rev()
        .map(|n| make(range, n))
        .find(|marks| fits(marks))
        .unwrap_or_default()
}

/// Where the mean lies: a thin line, and a pale band of ± `sigma` under it.
pub(crate) fn mean_band(svg: &mut Svg, axes: &Axes, mean: f64, sigma: f64, colour: &str) {
    axes.band(svg, mean - sigma, mean + sigma, &Ink::area(colour, 0.18));
    axes.level(svg, mean, &Ink::line(colour, LINE));
}

/// A dashed line at zero, for differences.
pub(crate) fn zero_line(svg: &mut Svg, axes: &Axes) {
    axes.level(svg, 0.0, &Ink::line(GREY, HAIR).dashed("2 1.5"));
}
