//! What a fit leaves of an image, and the mean cell of its lattice: to be looked at.

use nalgebra::{Matrix2, Vector2};
use spmfile::{LineDirection, Scan};

use crate::frame::departure::Departure;
use crate::frame::image::Image;
use crate::scan::channel::{channels, flat_image_of};
use crate::scan::measured::{MeasuredLine, MeasuredScan};
use crate::scan::place::Place;
use crate::settings::knobs::Settings;

/// Bins along each vector of the mean cell, at most.
const BINS: usize = 64;
/// Extent of the picture of the mean cell, lattice vectors.
const CELLS: f64 = 2.0;
/// Pixels along the side of that picture.
const SIDE: usize = 128;

/// An image beside the lattice that was measured in it.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Its unit.
    pub unit: String,
    /// The image less the waves of the fit, background removed; `None` where the method fits no waves.
    pub residual: Option<Image>,
    /// The mean over all cells of the lattice, repeated over two cells; NaN where no pixel fell.
    pub cell: Image,
    /// Pixels of the image along a pixel of `cell`.
    pub cell_step: f64,
    /// nm per pixel along the lines and across them, where a size is known.
    pub pixel_nm: Option<[f64; 2]>,
}

/// The image of a line of a scan beside what was measured in it; `None` where it was not measured, or is not there.
pub fn fitted(
    scan: &Scan,
    measured: &MeasuredScan,
    settings: &Settings,
    line: LineDirection,
) -> Option<Fitted> {
    let found = measured.lines.iter().find(|l| l.line == line)?;
    let channel = channels(scan, settings)
        .ok()?
        .into_iter()
        .find(|c| c.line_direction.unwrap_or(LineDirection::Trace) == line)?;
    let image = flat_image_of(channel, settings.background);
    let place = Place::of("", scan, channel, settings, &mut Vec::new());
    let displacement = place.and_then(|place| place.geometry.displacement());
    let (cell, cell_step) = mean_cell(&image, found, displacement.as_ref())?;
    let fit = found.lattice.fit.as_ref();
    Some(Fitted {
        unit: channel.plain_unit(),
        residual: fit.map(|fit| {
            let waves = fit.waves(&image, displacement.as_ref());
            let left = image.values.iter().zip(&waves).map(|(v, w)| v - w);
            Image::new(image.rows, image.columns, left.collect())
        }),
        cell,
        cell_step,
        pixel_nm: channel.pitch_nm(),
    })
}

/// The mean over the cells of the part that carries the lattice, as a picture in the axes of the image; and the pixels
/// along one of its pixels.
fn mean_cell(
    image: &Image,
    line: &MeasuredLine,
    displacement: Option<&Departure>,
) -> Option<(Image, f64)> {
    let basis = line.lattice.pixels.basis;
    let inverse = basis.try_inverse()?;
    let longest = basis.column(0).norm().max(basis.column(1).norm());
    let bins = (longest.round() as usize).clamp(2, BINS);
    let middle = Vector2::new(image.columns as f64, image.rows as f64) / 2.0;
    let bin = |at: Vector2<f64>| bin_of(&inverse, at - middle, bins);
    let patch = line.lattice.patch.as_ref();
    let patch = patch.filter(|p| p.is_of([image.columns, image.rows]));
    let (mut sums, mut counts) = (vec![0.0; bins * bins], vec![0_usize; bins * bins]);
    for (i, value) in image.values.iter().enumerate() {
        let at = [i % image.columns, i / image.columns];
        if value.is_finite() && patch.is_none_or(|patch| patch.holds(at)) {
            let at = Vector2::from(at.map(|n| n as f64));
            let bin = bin(at + displacement.map_or_else(Vector2::zeros, |u| u.at(at)));
            sums[bin] += value;
            counts[bin] += 1;
        }
    }
    let step = CELLS * longest / SIDE as f64;
    let values = (0..SIDE * SIDE).map(|i| {
        let [x, y] = [i % SIDE, i / SIDE].map(|n| (n as f64 - SIDE as f64 / 2.0) * step);
        let bin = bin(middle + Vector2::new(x, y));
        sums[bin] / counts[bin] as f64
    });
    Some((Image::new(SIDE, SIDE, values.collect()), step))
}

/// The bin of the cell into which a place falls.
fn bin_of(inverse: &Matrix2<f64>, at: Vector2<f64>, bins: usize) -> usize {
    let within = (inverse * at).map(|f| ((f - f.floor()) * bins as f64) as usize);
    within.y.min(bins - 1) * bins + within.x.min(bins - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::measure::measure_scan;
    use crate::simulate::{Simulation, Simulator};

    /// Without noise the fit leaves next to nothing, and the mean cell has the contrast of the image.
    #[test]
    fn fits_leave_little_and_cells_are_the_image() {
        left_over("clean");
    }

    /// The same of a scanner that its sensors say is bent.
    #[test]
    fn fits_leave_little_where_the_scanner_bends() {
        left_over("hysteresis+creep");
    }

    fn left_over(sample: &str) {
        let mut set = Simulation {
            features: crate::simulate::SampleFeature::parse(sample).unwrap(),
            ..Simulation::default()
        };
        set.raster.pixels = [128; 2];
        set.raster.scans = 1;
        set.noise.pixel_deg *= 0.01;
        let scan = Simulator::new(set).unwrap().frame(0);
        let settings = Settings::default();
        let measured = measure_scan("a", &scan, &settings, None).unwrap();
        let shown = fitted(&scan, &measured, &settings, LineDirection::Trace).unwrap();
        let spread = |image: &Image| {
            let finite = image.values.iter().filter(|v| v.is_finite());
            let (sum, square, n) =
                finite.fold((0.0, 0.0, 0.0), |(s, q, n), v| (s + v, q + v * v, n + 1.0));
            (square / n - (sum / n) * (sum / n)).sqrt()
        };
        let channel = channels(&scan, &settings).unwrap()[0];
        let image = flat_image_of(channel, settings.background);
        let residual = shown.residual.unwrap();
        assert!(spread(&residual) < 0.3 * spread(&image));
        let ratio = spread(&shown.cell) / spread(&image);
        assert!((0.8..1.1).contains(&ratio), "{ratio}");
        assert!(
            fitted(
                &scan,
                &measured,
                &Settings {
                    channel: Some("none".to_owned()),
                    ..settings
                },
                LineDirection::Trace
            )
            .is_none()
        );
    }
}
