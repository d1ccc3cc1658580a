//! Images as they would have been recorded with true positions on a sample at rest.

use nalgebra::Vector2;
use spmfile::{Channel, LineDirection, Samples, Scan, Span};

use crate::campaign::analysis::ScanAnalysis;
use crate::frame::geometry::Geometry;
use crate::frame::resample::on_curved_grid;
use crate::scan::channel::{channels, image_of};
use crate::scan::positions::nominal;
use crate::settings::knobs::Settings;
use crate::survey::mapping::{place_of, still};

/// One corrected image as a scan of its own, and what was done with it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct CorrectedImage {
    /// Trace or retrace.
    pub line: LineDirection,
    /// A scan of one channel on a square grid along the laboratory axes. It has no rotation and no
    /// times: neither means anything for it any more.
    pub scan: Scan,
    /// What was done, in words.
    pub log: Vec<String>,
}

/// The images behind `analysed`, corrected by the position sensors and, where it is known, for the
/// drift at the time of the scan; whole frames, values as recorded.
///
/// Lines without a geometry are left out.
pub fn corrected_images(
    scan: &Scan,
    analysed: &ScanAnalysis,
    settings: &Settings,
) -> Vec<CorrectedImage> {
    let Ok(channels) = channels(scan, settings) else {
        return Vec::new();
    };
    channels
        .into_iter()
        .filter_map(|channel| corrected(scan, channel, analysed, settings))
        .collect()
}

fn corrected(
    scan: &Scan,
    channel: &Channel,
    analysed: &ScanAnalysis,
    settings: &Settings,
) -> Option<CorrectedImage> {
    let (place, found) = place_of(scan, channel, analysed, settings)?;
    let still = still(&place, found, analysed);
    let (file, drift) = (
        &analysed.file,
        analysed.drift.filter(|_| found.ruler.is_none()),
    );
    let geometry = place.geometry;
    let mut log = vec![format!("from {file}")];
    log.push(if geometry.from_sensors {
        "positions: planes fitted to the X and Y sensors".to_owned()
    } else {
        "positions: nominal size and rotation, no position sensors".to_owned()
    });
    if settings.scanner.is_some() {
        log.push("corrected by the calibration of the scanner".to_owned());
    }
    log.push(match (drift, &still) {
        (None, Some(_)) => {
            let layer = found.ruler.map_or(2, |atoms| atoms.layer);
            format!("drift, gains and skew taken off by the atoms of layer {layer}")
        }
        (Some(drift), Some(_)) => {
            let [x, y] = [drift.x * 60.0, drift.y * 60.0];
            format!(
                "corrected for the drift at its time, {x} nm/min along x and {y} nm/min along y"
            )
        }
        (None, None) => "not corrected for drift: it is not known".to_owned(),
        (Some(_), None) => {
            "not corrected for drift: the times of the lines are not known".to_owned()
        }
    });
    let corrected = drift.filter(|_| still.is_some());
    let at_rest = still.unwrap_or(geometry);
    let mut out = on_grid(scan, channel, &at_rest)?;
    out.metadata = about(&at_rest, corrected);
    let pitch = out.channels[0].pitch_nm()?[0];
    log.push(format!(
        "resampled by cubic convolution on a square grid along the laboratory axes, {pitch} nm"
    ));
    Some(CorrectedImage {
        line: place.line,
        scan: out,
        log,
    })
}

/// A channel on a square grid along the laboratory axes, as a scan without rotation and times.
///
/// `None` where the geometry is singular.
pub fn on_grid(scan: &Scan, channel: &Channel, geometry: &Geometry) -> Option<Scan> {
    let found = on_curved_grid(&image_of(channel), geometry)?;
    let centre = found.centre();
    let (rows, columns) = (found.image.rows, found.image.columns);
    let size = [columns, rows].map(|count| count as f64 * found.pitch);
    let channel = Channel {
        rows,
        columns,
        width_nm: Some(size[0]),
        height_nm: Some(size[1]),
        span: Span::PixelEdges,
        scale: 1.0,
        offset: 0.0,
        scaling: "resampled".to_owned(),
        samples: Samples::F64(found.image.values),
        ..channel.clone()
    };
    Some(Scan {
        format: scan.format.clone(),
        instrument: scan.instrument.clone(),
        acquired: scan.acquired,
        offset_nm: [centre.x, centre.y],
        size_nm: Some(size),
        closed_loop: scan.closed_loop,
        channels: vec![channel],
        ..Scan::default()
    })
}

/// The nominal geometry of a channel: pitch and rotation as the file states them.
pub fn nominal_geometry(scan: &Scan, channel: &Channel) -> Option<Geometry> {
    nominal(scan, channel)
}

/// The numbers of the correction.
fn about(geometry: &Geometry, drift: Option<Vector2<f64>>) -> Vec<(String, String)> {
    let m = geometry.pixel_to_nm;
    let (r, from) = (geometry.origin, geometry.from_sensors);
    let mut lines = vec![
        (
            "moiregauge positions".to_owned(),
            if from { "sensors" } else { "nominal" }.to_owned(),
        ),
        (
            "moiregauge step per column (nm)".to_owned(),
            format!("{} {}", m.m11, m.m21),
        ),
        (
            "moiregauge step per row (nm)".to_owned(),
            format!("{} {}", m.m12, m.m22),
        ),
        (
            "moiregauge first pixel (nm)".to_owned(),
            format!("{} {}", r.x, r.y),
        ),
    ];
    lines.extend(drift.map(|d| {
        (
            "moiregauge drift (nm/min)".to_owned(),
            format!("{} {}", d.x * 60.0, d.y * 60.0),
        )
    }));
    lines
}
