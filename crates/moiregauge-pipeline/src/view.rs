//! What files hold, to be looked at: channels in little, blocks of their pixels, their spectrum.

use std::path::Path;

use heterostrain::lattice::reciprocal;
use moiregauge::campaign::Analysis;
use moiregauge::frame::{Background, Image, remove_background};
use moiregauge::scan::{fitted, measure_moires};
use moiregauge::settings::Settings;
use moiregauge::spectrum::log_power;
use moiregauge_report::{ColorMap, ReportError, thumbnail};
use serde::Serialize;
use spmfile::{Channel, LineDirection, ReadError, Scan};

use crate::known::{Known, KnownError};
use crate::opened::{InputError, read_scan};

/// Pixels along the longer side of an image that is transformed.
const MOST: usize = 1024;

/// Values of an image as they are shown, in single precision.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Number of columns.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
    /// Row by row from the bottom; NaN where nothing was recorded.
    pub values: Vec<f32>,
    /// Unit of the values.
    pub unit: String,
    /// From one value to the next along a row and along a column, nm; none without a size.
    pub pixel_nm: Option<[f64; 2]>,
}

/// A part of an image, pixels from the lower left corner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Part {
    /// First column.
    pub column: usize,
    /// First row, from the bottom.
    pub row: usize,
    /// Number of columns; none: to the right edge.
    pub columns: Option<usize>,
    /// Number of rows; none: to the top.
    pub rows: Option<usize>,
    /// Pixels along the side of the blocks that are averaged; 0 is 1.
    pub step: usize,
}

/// What is drawn on an image: the lattice that was measured in it, and where.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Overlay {
    /// `trace` or `retrace`.
    pub line: &'static str,
    /// Two vectors of the lattice, columns and rows.
    pub lattice_px: [[f64; 2]; 2],
    /// The same, nm, in the axes of the results, before drift is taken out: what can be told by hand.
    pub lattice_nm: [[f64; 2]; 2],
    /// Wave vectors, periods per pixel.
    pub spots_per_px: [[f64; 2]; 2],
    /// Wave vectors, periods per nm.
    pub spots_per_nm: [[f64; 2]; 2],
    /// The sides of the part that carries the lattice, from point to point (column, row), pixels at whole numbers; none
    /// where it is the whole image.
    pub outline_px: Vec<[[f64; 2]; 2]>,
    /// How far from its own place a pixel is on a straight grid, columns and rows: at 9 × 9 places of the frame from edge to edge, row by row;
    /// none of a straight grid.
    pub displacement_px: Vec<[f64; 2]>,
    /// nm for a column and for a row.
    pub pixel_to_nm: [[f64; 2]; 2],
    /// The place of the first pixel, nm.
    pub origin_nm: [f64; 2],
    /// Why the scan is shown and not used.
    pub excluded: Option<String>,
}

/// What was measured in a file, by its words: one for each line direction.
pub fn overlays(analysis: &Analysis, file: &str) -> Vec<Overlay> {
    let scans = analysis.sets.iter().flat_map(|set| &set.scans);
    let scans = scans.filter(|scan| scan.file == file);
    let pairs = |m: &nalgebra::Matrix2<f64>| [0, 1].map(|i| [m[(0, i)], m[(1, i)]]);
    let periods = |m: &nalgebra::Matrix2<f64>| {
        let waves = reciprocal(m).unwrap_or_default();
        pairs(&(waves / std::f64::consts::TAU))
    };
    let of = |(scan, line): (
        &moiregauge::ScanAnalysis,
        &moiregauge::campaign::LineAnalysis,
    )| {
        let outline = line
            .patch
            .as_ref()
            .map(moiregauge::coverage::LatticeRegion::outline);
        let outline = outline.unwrap_or_default().into_iter();
        Overlay {
            line: moiregauge::numbers::line_name(line.line),
            lattice_px: pairs(&line.pixels.basis),
            lattice_nm: pairs(&line.sensor.basis),
            spots_per_px: periods(&line.pixels.basis),
            spots_per_nm: periods(&line.sensor.basis),
            outline_px: outline.map(|side| side.map(Into::into)).collect(),
            displacement_px: line.displacement.clone(),
            pixel_to_nm: pairs(&line.pixel_to_nm),
            origin_nm: line.origin.into(),
            excluded: scan.excluded.clone(),
        }
    };
    let lines = scans.flat_map(|scan| scan.lines.iter().map(move |line| (scan, line)));
    lines.map(of).collect()
}

/// The logarithm (base 10) of the power of a channel, a plane taken off, periods per pixel zero in the middle; and the
/// step of its columns and rows, periods per pixel. Large images are averaged over blocks first.
pub fn spectrum(channel: &Channel) -> (View, [f64; 2]) {
    let longer = channel.rows.max(channel.columns);
    let step = longer.div_ceil(MOST).max(1);
    let view = blocks(
        channel,
        &Part {
            step,
            ..Part::default()
        },
    );
    let values = view.values.iter().map(|v| f64::from(*v)).collect();
    let image = Image::new(view.rows, view.columns, values);
    let (power, cycles) = log_power(&remove_background(&image, Background::Plane));
    let view = of_image(&power, "", view.pixel_nm);
    (view, cycles.map(|c| c / step as f64))
}

/// What is left of the image of a file when the fit is taken off, and the mean cell of its lattice: measured again with
/// these settings.
///
/// # Errors
/// It cannot be read or measured, or has no such line.
pub fn fit_of(
    path: &Path,
    settings: &Settings,
    known: &Known,
    line: LineDirection,
) -> Result<Option<FitView>, InputError> {
    let reading = read_scan(path, settings, known)?;
    let scan = &reading.scan;
    let moires = measure_moires(&reading.input.file, scan, settings, None)?;
    let shown = moires.first().and_then(|m| fitted(scan, m, settings, line));
    Ok(shown.map(|shown| FitView {
        residual: shown
            .residual
            .map(|image| of_image(&image, &shown.unit, shown.pixel_nm)),
        cell: of_image(
            &shown.cell,
            &shown.unit,
            shown.pixel_nm.map(|p| p.map(|nm| nm * shown.cell_step)),
        ),
    }))
}

/// What a fit leaves, and what it found.
#[derive(Clone, Debug)]
pub struct FitView {
    /// The image less the fit; none where the method fits no waves.
    pub residual: Option<View>,
    /// The mean cell, repeated over two cells.
    pub cell: View,
}

fn of_image(image: &Image, unit: &str, pixel_nm: Option<[f64; 2]>) -> View {
    View {
        columns: image.columns,
        rows: image.rows,
        values: image.values.iter().map(|v| *v as f32).collect(),
        unit: unit.to_owned(),
        pixel_nm,
    }
}

/// Everything that a file holds, as [`crate::inspect()`] lists it: of a damaged file what can be read.
///
/// # Errors
/// It cannot be read, or is no scan.
pub fn whole(path: &Path, known: &Known) -> Result<Scan, InputError> {
    if let Some(held) = known.in_memory(path) {
        return Ok((*held.scan()).clone());
    }
    let content = known.source(path).content()?;
    let mut scan = match known.decode(path, &content, &|_| true) {
        Err(ReadError::Incomplete { readable, .. }) => *readable,
        other => other?,
    };
    // What is wrong with that is told beside the channels.
    let _: Result<_, KnownError> = known.complete(path, &mut scan);
    Ok(scan)
}

/// Means over blocks of a part of a channel. Blocks at the right and upper edge may hold less; one of which less than
/// half is there is missing.
pub fn blocks(channel: &Channel, part: &Part) -> View {
    let step = part.step.max(1);
    let end = |first: usize, wanted: Option<usize>, all: usize| {
        wanted.map_or(all, |n| first.saturating_add(n)).min(all)
    };
    let [left, bottom] = [part.column.min(channel.columns), part.row.min(channel.rows)];
    let right = end(left, part.columns, channel.columns);
    let top = end(bottom, part.rows, channel.rows);
    let columns = (right - left).div_ceil(step);
    let rows = (top - bottom).div_ceil(step);
    let mut values = Vec::with_capacity(columns * rows);
    for first in (bottom..top).step_by(step) {
        let lines = first..(first + step).min(top);
        let all = channel.lines(lines);
        let lines: Vec<&[f64]> = all
            .chunks(channel.columns)
            .map(|l| &l[left..right])
            .collect();
        values.extend((0..columns).map(|block| mean(&lines, block * step, step)));
    }
    View {
        columns,
        rows,
        values,
        unit: channel.plain_unit(),
        pixel_nm: channel.pitch_nm().map(|p| p.map(|nm| nm * step as f64)),
    }
}

fn mean(lines: &[&[f64]], from: usize, step: usize) -> f32 {
    let (mut sum, mut count, mut all) = (0.0, 0_usize, 0_usize);
    for line in lines {
        let block = &line[from..(from + step).min(line.len())];
        all += block.len();
        for value in block.iter().filter(|v| v.is_finite()) {
            sum += value;
            count += 1;
        }
    }
    if 2 * count >= all && count > 0 {
        (sum / count as f64) as f32
    } else {
        f32::NAN
    }
}

/// A channel in little, a plane taken off, as PNG; `side` is the number of pixels along the longer side.
///
/// # Errors
/// None in practice: everything is written into memory.
pub fn little(channel: &Channel, side: usize, colours: ColorMap) -> Result<Vec<u8>, ReportError> {
    let longer = channel.rows.max(channel.columns);
    let view = blocks(
        channel,
        &Part {
            step: longer.div_ceil(side.max(1)),
            ..Part::default()
        },
    );
    let values = view.values.iter().map(|v| f64::from(*v)).collect();
    let image = Image::new(view.rows, view.columns, values);
    let level = remove_background(&image, Background::Plane);
    thumbnail(&level, side, colours)
}

#[cfg(test)]
mod tests {
    use super::*;
    use spmfile::Samples;

    fn channel(columns: usize, rows: usize) -> Channel {
        let text = ["0 0"; 2].join("\n");
        let options = spmfile::arrays::ArrayOptions::default();
        let read = spmfile::arrays::read(text.as_bytes(), &options, &|_| true);
        let mut channel = read.unwrap().channels.remove(0);
        (channel.columns, channel.rows) = (columns, rows);
        channel.width_nm = Some(columns as f64);
        channel.height_nm = Some(rows as f64);
        let values = (0..columns * rows).map(|n| n as f64).collect();
        channel.samples = Samples::F64(values);
        channel
    }

    #[test]
    fn blocks_are_means_and_parts_are_parts() {
        let mut channel = channel(5, 3);
        let view = blocks(&channel, &Part::default());
        assert_eq!(
            (view.columns, view.rows, view.pixel_nm),
            (5, 3, Some([1.0; 2]))
        );
        assert_eq!(view.values[7], 7.0);
        let two = Part {
            step: 2,
            ..Part::default()
        };
        let view = blocks(&channel, &two);
        assert_eq!(
            (view.columns, view.rows, view.pixel_nm),
            (3, 2, Some([2.0; 2]))
        );
        assert_eq!(view.values, [3.0, 5.0, 6.5, 10.5, 12.5, 14.0]);
        let part = Part {
            column: 3,
            row: 1,
            columns: Some(9),
            rows: Some(1),
            step: 0,
        };
        assert_eq!(blocks(&channel, &part).values, [8.0, 9.0]);
        let beyond = Part { column: 99, ..part };
        assert!(blocks(&channel, &beyond).values.is_empty());
        let Samples::F64(values) = &mut channel.samples else {
            panic!("doubles");
        };
        values[0] = f64::NAN;
        (values[3], values[8]) = (f64::NAN, f64::NAN);
        values[2] = f64::NAN;
        let view = blocks(&channel, &two);
        assert_eq!(view.values[0], 4.0);
        assert!(view.values[1].is_nan());
    }

    /// A wave of 4 periods along x and 3 along y in 64 pixels.
    #[test]
    fn spectra_show_waves_where_they_are() {
        let side = 64;
        let mut channel = channel(side, side);
        let wave = |n: usize| {
            let (x, y) = ((n % side) as f64, (n / side) as f64);
            (std::f64::consts::TAU * (4.0 * x + 3.0 * y) / side as f64).cos()
        };
        channel.samples = Samples::F64((0..side * side).map(wave).collect());
        let (view, step) = spectrum(&channel);
        let (mx, my) = (view.columns / 2, view.rows / 2);
        let power = |x: f64, y: f64| {
            let at = |middle: usize, f: f64, step: f64| {
                (middle as f64 + f / 64.0 / step).round() as usize
            };
            view.values[at(my, y, step[1]) * view.columns + at(mx, x, step[0])]
        };
        for (x, y) in [(4.0, 3.0), (-4.0, -3.0)] {
            assert!(power(x, y) > power(x, -y) + 3.0, "{x} {y}");
        }
    }

    #[test]
    fn channels_in_little_are_pictures() {
        let png = little(&channel(50, 20), 16, ColorMap::default()).unwrap();
        assert_eq!(png[1..4], *b"PNG");
        // Width and height.
        assert_eq!((png[19], png[23]), (13, 5));
    }
}
