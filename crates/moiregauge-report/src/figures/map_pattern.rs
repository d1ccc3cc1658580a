//! The pattern of a map: the undistorted image, and the averaged cell over two by two cells.

use moiregauge::frame::Image;
use moiregauge::map::MeanCell;
use moiregauge::survey::MappedPattern;
use nalgebra::{Matrix2, Vector2};

use super::figure::Drawing;
use super::layout;
use super::map_panel::scale_bar;
use super::picture::{IN_NM, Picture, column, extent};
use super::subject::MapSubject;
use crate::draw::axes::Axes;
use crate::draw::scale::Range;
use crate::draw::style::{BLACK, COLUMN, HAIR, SMALL, lettering};
use crate::draw::svg::{Anchor, Ink, Lettering, Rect, Svg};
use crate::draw::{colorbar, raster};
use crate::format::two_digits;

/// Cells that are drawn along each vector.
const CELLS: usize = 2;
/// Room around the cells as a share of their extent.
const MARGIN: f64 = 0.08;
/// How far beside a vector its name stands, in lengths of the other one.
const BESIDE: f64 = 0.13;
/// Space above a panel and beside it for the colour bar, pt.
const TOP: f64 = 12.0;
const BAR: f64 = 50.0;

fn pattern<'a>(subject: &MapSubject<'a>) -> Result<&'a MappedPattern, String> {
    let found = subject.details.pattern.as_ref();
    found.ok_or_else(|| {
        "the displacement of the pattern is not known: maps in bands and by tiles do not follow its phases".to_owned()
    })
}

fn vectors(vectors: &Matrix2<f64>) -> String {
    let [a, b] = [0, 1].map(|i| vectors.column(i).into_owned());
    format!(
        "L₁ = ({:.3}, {:.3}) nm, L₂ = ({:.3}, {:.3}) nm",
        a.x, a.y, b.x, b.y
    )
}

/// The undistorted image in the frame of the image itself, so that both can be laid on each other.
pub(super) fn undistorted(subject: &MapSubject) -> Result<Drawing, String> {
    let found = pattern(subject)?;
    let shown = &found.undistorted;
    let linear = Matrix2::identity() * shown.pitch;
    let (mut x, mut y) =
        extent(&shown.image, &linear, shown.origin).ok_or("the image covers no area")?;
    if let Some(picture) = &subject.details.picture {
        let whole = extent(&picture.image, &picture.pixel_to_nm, picture.origin);
        (x, y) = whole.unwrap_or((x, y));
    }
    let area = column(x, y, TOP, BAR);
    let axes = Axes::equal(area, x, y);
    let mut svg = Svg::new(subject.id, COLUMN, area.bottom() + layout::BELOW);
    let drawn = Picture {
        image: &shown.image,
        linear: &linear,
        origin: shown.origin,
        map: subject.colours,
        range: raster::contrast(&shown.image, 0.005),
    };
    drawn.pixels(&mut svg, &axes, |svg| scale_bar(svg, &axes));
    let what = (found.channel.as_str(), found.unit.as_str());
    drawn.frame(&mut svg, &axes, &IN_NM, what);
    let drift = if found.drift_corrected {
        "Positions and drift are corrected."
    } else {
        "Positions are corrected, the drift is not known."
    };
    Ok(Drawing {
        wide: false,
        svg: svg.finish("Undistorted image"),
        caption: format!(
            "{} of {} with the displacement of its pattern (figure Displacement) taken off: the lattice is the mean lattice \
             everywhere, {}. Blank where the displacement is not known. Resampled to be shown; nothing is measured from it. \
             {drift} x to the right, y up.",
            found.channel,
            layout::short(&found.file),
            vectors(&found.gauge.vectors)
        ),
    })
}

/// The averaged cell in its true shape.
pub(super) fn cell(subject: &MapSubject) -> Result<Drawing, String> {
    let found = pattern(subject)?;
    let cell = found.cell.as_ref();
    let cell = cell.ok_or("the displacement is known on fewer than two cells of the pattern")?;
    let image = repeated(cell);
    let linear = cell.vectors / cell.bins as f64;
    let origin = linear * Vector2::repeat(0.5);
    let (x, y) = extent(&image, &linear, origin).ok_or("the cell has no area")?;
    // Room for names around the cells, and for the scale bar below them.
    let margin = MARGIN * x.width().max(y.width());
    let x = Range::new(x.low - margin, x.high + margin);
    let y = Range::new(y.low - 2.0 * margin, y.high + margin);
    let area = column(x, y, TOP, BAR);
    let axes = Axes::equal(area, x, y);
    let mut svg = Svg::new(subject.id, COLUMN, area.bottom() + layout::BELOW);
    let drawn = Picture {
        image: &image,
        linear: &linear,
        origin,
        map: subject.colours,
        range: raster::contrast(&image, 0.0),
    };
    drawn.pixels(&mut svg, &axes, |svg| {
        outlines(svg, &axes, &cell.vectors);
        scale_bar(svg, &axes);
    });
    let what = (found.channel.as_str(), found.unit.as_str());
    drawn.frame(&mut svg, &axes, &IN_NM, what);
    let sigma = typical(cell);
    let bar = Rect::new(area.right() + 6.0, area.y, 7.0, area.height);
    colorbar::noise(&mut svg, bar, drawn.range, sigma);
    let node = if found.gauge.bright { "bright" } else { "dark" };
    Ok(Drawing {
        wide: false,
        svg: svg.finish("Averaged moiré cell"),
        caption: format!(
            "Mean of {} cells of {} of {}, drawn over {CELLS} × {CELLS} cells: each pixel is put into the cell by the local \
             phases of the pattern, so that a lattice that bends is not smeared. {} × {} bins, {}; corners are nodes of the pattern \
             ({node}). Standard error of a bin {} {} (rms, from how the cells scatter; bracket in the colour bar: ± σ). x to the \
             right, y up.",
            cell.all_cells,
            found.channel,
            layout::short(&found.file),
            cell.bins,
            cell.bins,
            vectors(&cell.vectors),
            two_digits(sigma),
            found.unit,
        ),
    })
}

/// Root mean square of the errors of the bins.
fn typical(cell: &MeanCell) -> f64 {
    let known = cell.sigma.iter().filter(|s| s.is_finite());
    let (sum, count) = known.fold((0.0, 0.0f64), |(s, n), v| (s + v * v, n + 1.0));
    (sum / count).sqrt()
}

/// The bins of several cells beside each other.
fn repeated(cell: &MeanCell) -> Image {
    let side = CELLS * cell.bins;
    let bin = |n: usize| (n / side % cell.bins) * cell.bins + n % side % cell.bins;
    let values = (0..side * side).map(|n| cell.mean[bin(n)]);
    Image::new(side, side, values.collect())
}

/// The cells, and the names of the vectors of one of them.
fn outlines(svg: &mut Svg, axes: &Axes, vectors: &Matrix2<f64>) {
    let at = |i: f64, j: f64| {
        let place = vectors * Vector2::new(i, j);
        axes.at(place.x, place.y)
    };
    let most = CELLS as f64;
    for n in 0..=CELLS {
        let n = n as f64;
        for ink in [Ink::line("#ffffff", 1.2), Ink::line(BLACK, HAIR)] {
            svg.line(at(n, 0.0), at(n, most), &ink);
            svg.line(at(0.0, n), at(most, n), &ink);
        }
    }
    let style = Lettering {
        halo: Some("#ffffff"),
        ..lettering(SMALL + 1.0, Anchor::Middle)
    };
    for (name, (i, j)) in [("L₁", (1.5, -BESIDE)), ("L₂", (-BESIDE, 1.5))] {
        let (x, y) = at(i, j);
        svg.text((x, y + 2.5), name, &style);
    }
}
