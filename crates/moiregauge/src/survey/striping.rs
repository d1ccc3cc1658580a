//! Scans without a lattice → maps of their stripes on the sample.

use spmfile::{LineDirection, Scan};

use crate::caveat::Caveat;
use crate::caveat::kinds::each_kind_once;
use crate::caveat::patterns::PatternDoubt;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::start::Start;
use crate::scan::channel::{channels, flat_image_of};
use crate::scan::place::Place;
use crate::settings::knobs::Settings;
use crate::stripes::maps::{find_stripes, stripe_maps};
use crate::stripes::sample::SampledStripes;
use crate::stripes::types::NoStripes;
use crate::survey::mapping::pitch;
use crate::window::types::{FULL_WIDTH, Resolution, ResolutionError};

/// The stripes of a scan.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ScanStripes {
    /// The channel that shows them.
    pub channel: String,
    /// The line directions that were averaged.
    pub lines: Vec<LineDirection>,
    /// Whether the drift that was given is taken off.
    pub drift_corrected: bool,
    /// Local stripes on the sample.
    pub stripes: SampledStripes,
    /// Doubts about positions and patterns.
    pub caveats: Vec<Caveat>,
}

/// Why a scan gives no map of stripes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StripeError {
    /// No image of this size has such a map.
    #[error(transparent)]
    Resolution(#[from] ResolutionError),
    /// The channel is not there, or the image has no size.
    #[error("no image with a size")]
    NoImage,
    /// Its images show none.
    #[error("{0}")]
    None(#[from] NoStripes),
}

/// One line direction.
struct Frame {
    line: LineDirection,
    flat: Image,
    geometry: Geometry,
    still: Option<Geometry>,
}

/// The images of a scan that are compared: those of one channel and of one size.
fn frames(
    file: &str,
    scan: &Scan,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) -> Result<(String, Vec<Frame>), StripeError> {
    let channels = channels(scan, settings).map_err(|_| StripeError::NoImage)?;
    let name = channels[0].name.clone();
    let mut frames: Vec<Frame> = Vec::new();
    for channel in channels {
        let place = Place::of(file, scan, channel, settings, caveats);
        let place = place.ok_or(StripeError::NoImage)?;
        let still = place.still(settings.drift.map(|d| d.velocity()));
        let flat = flat_image_of(channel, settings.background);
        let same = |f: &Frame| (f.flat.rows, f.flat.columns) == (flat.rows, flat.columns);
        if frames.first().is_none_or(same) {
            frames.push(Frame {
                line: place.line,
                flat,
                geometry: place.geometry,
                still,
            });
        }
    }
    *caveats = each_kind_once(file, [&*caveats]);
    Ok((name, frames))
}

/// Wavelength (nm), direction (rad, along the stripes) and log₁₀ of the chance that noise makes them, of the patterns
/// that a scan shows, strongest first; none where it shows nothing, or a lattice, each of whose waves would pass for
/// stripes.
pub fn stripes_in_short(scan: &Scan, settings: &Settings) -> Vec<[f64; 3]> {
    let Ok((_, frames)) = frames("", scan, settings, &mut Vec::new()) else {
        return Vec::new();
    };
    let images: Vec<&Image> = frames.iter().map(|f| &f.flat).collect();
    let geometry = &frames[0].geometry;
    if Start::find(&frames[0].flat, geometry, settings.background).is_ok() {
        return Vec::new();
    }
    let Some(dual) = geometry.pixel_to_nm.try_inverse().map(|j| j.transpose()) else {
        return Vec::new();
    };
    let found = find_stripes(&images, pitch(geometry)).into_iter();
    found
        .map(|(wave, log_chance)| {
            let wave = dual * wave;
            let along = wave.y.atan2(wave.x) + std::f64::consts::FRAC_PI_2;
            [
                std::f64::consts::TAU / wave.norm(),
                along.rem_euclid(std::f64::consts::PI),
                log_chance,
            ]
        })
        .collect()
}

/// Maps the stripes of a scan. Trace and retrace are mapped on the same nodes and averaged; a drift of `settings` is
/// taken off where the file tells its times.
///
/// # Errors
/// [`StripeError`]: there is no image, or nothing in it.
pub fn stripes_of_scan(
    file: &str,
    scan: &Scan,
    settings: &Settings,
    resolution: &Resolution,
) -> Result<ScanStripes, StripeError> {
    let mut caveats = Vec::new();
    let (channel, frames) = frames(file, scan, settings, &mut caveats)?;
    resolution.fits(frames[0].geometry.extent(), FULL_WIDTH)?;
    let images: Vec<&Image> = frames.iter().map(|f| &f.flat).collect();
    let maps = stripe_maps(&images, pitch(&frames[0].geometry), resolution)?;
    let placed: Vec<&Geometry> = frames
        .iter()
        .map(|f| f.still.as_ref().unwrap_or(&f.geometry))
        .collect();
    let both: Vec<_> = maps.iter().zip(placed).collect();
    let stripes = SampledStripes::new(&both).ok_or(StripeError::NoImage)?;
    if frames.len() == 1 {
        caveats.push(Caveat::new(PatternDoubt::StripesOfOneDirection, file));
    }
    Ok(ScanStripes {
        channel,
        lines: frames.iter().map(|f| f.line).collect(),
        drift_corrected: frames.iter().all(|f| f.still.is_some()),
        stripes,
        caveats,
    })
}
