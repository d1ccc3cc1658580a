//! What several figures need: panels in a grid, scans as points, the sense of a scan.

use heterostrain::Estimate;
use moiregauge::campaign::{ScanAnalysis, SetAnalysis};
use moiregauge::scan::Illustration;
use nalgebra::Matrix2;
use spmfile::FrameDirection;

use crate::draw::axes::Axes;
use crate::draw::scale::Range;
use crate::draw::style::{Marker, PAGE, marker};
use crate::draw::svg::{Rect, Svg};

pub(super) use moiregauge::numbers::line_name;

/// Space above the panels for a legend, pt.
pub(super) const LEGEND: f64 = 16.0;
/// Space left of a panel for its numbers and title, pt.
pub(super) const LEFT: f64 = 42.0;
/// Space below a panel for its numbers and title, pt.
pub(super) const BELOW: f64 = 27.0;
/// Space above a panel for its letter, pt.
pub(super) const ABOVE: f64 = 16.0;
const RIGHT: f64 = 9.0;
/// Space between rows of panels, whose numbers of x only the lowest one shows, pt.
const GAP: f64 = 4.0;

/// Panels of equal size in rows and columns under a legend.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub(super) width: f64,
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Height of a panel's frame.
    pub(super) panel: f64,
}

impl Grid {
    pub(super) fn height(&self) -> f64 {
        LEGEND + self.rows as f64 * (ABOVE + self.panel + GAP) - GAP + BELOW
    }

    /// The frame of a panel; row 0 is the upper one.
    pub(super) fn cell(&self, column: usize, row: usize) -> Rect {
        let width = self.width / self.columns as f64;
        Rect::new(
            column as f64 * width + LEFT,
            LEGEND + row as f64 * (ABOVE + self.panel + GAP) + ABOVE,
            width - LEFT - RIGHT,
            self.panel,
        )
    }
}

/// A square panel at the left of a page, and one beside it that takes the rest.
pub(super) fn square_and_rest(top: f64, side: f64) -> (Rect, Rect) {
    let square = Rect::new(LEFT, top, side, side);
    let left = square.right() + RIGHT + LEFT;
    (square, Rect::new(left, top, PAGE - left - RIGHT, side))
}

/// Letters of the panels.
pub(super) const LETTERS: [&str; 6] = ["a", "b", "c", "d", "e", "f"];

/// The range of scan numbers from 1 to `count`.
pub(super) fn counting(count: usize) -> Range {
    Range::new(0.4, count as f64 + 0.6)
}

/// The number of the scan at `index`, as people count.
pub(super) fn ordinal(index: usize) -> f64 {
    index as f64 + 1.0
}

/// Whether the bottom line came first, or nobody knows; decides between filled and open symbols.
pub(super) fn is_up(scan: &ScanAnalysis) -> bool {
    scan.frame_direction != Some(FrameDirection::Down)
}

/// One value with its error bar at the place of its scan.
pub(super) fn point(
    svg: &mut Svg,
    axes: &Axes,
    x: f64,
    estimate: Estimate,
    (shape, colour): (Marker, &str),
    up: bool,
) {
    if axes.y.range.contains(estimate.value) && axes.x.range.contains(x) {
        axes.error_bar(svg, x, estimate.value, estimate.sigma, colour);
        marker(svg, axes.at(x, estimate.value), shape, colour, up);
    }
}

/// Both ends of the error bars of `estimates`; unknown errors count as zero.
pub(super) fn ends(estimates: impl IntoIterator<Item = Estimate>) -> impl Iterator<Item = f64> {
    estimates.into_iter().flat_map(|e| {
        let sigma = if e.sigma.is_finite() { e.sigma } else { 0.0 };
        [e.value - sigma, e.value + sigma]
    })
}

/// The last part of a path, for titles.
pub(super) fn short(file: &str) -> &str {
    file.rsplit(['/', '\\']).next().unwrap_or(file)
}

/// At most 24 characters of a name, for legends.
pub(super) fn shortened(name: &str) -> String {
    if name.chars().count() <= 24 {
        return name.to_owned();
    }
    name.chars().take(23).chain(['…']).collect()
}

/// The lattice of the illustrated line in sensor coordinates (columns, nm).
///
/// From the scan where it is found, as its vectors bear the names that the other figures use.
pub(super) fn shown_lattice(set: &SetAnalysis, shown: &Illustration) -> Matrix2<f64> {
    let scan = set.scans.iter().find(|scan| scan.file == shown.file);
    let line = scan.and_then(|scan| scan.lines.iter().find(|line| line.line == shown.line));
    line.map_or(shown.pixel_to_nm * shown.lattice.basis, |line| {
        line.sensor.basis
    })
}
