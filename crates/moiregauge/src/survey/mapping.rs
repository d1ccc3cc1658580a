//! Scans that were analysed → maps of their local lattice on the sample.
//!
//! Places are those on the sample at the time of the first scan: what it drifts until a later scan is taken off.

use heterostrain::lattice::reciprocal;
use nalgebra::{Matrix2, Vector2};
use spmfile::{Channel, FrameDirection, LineDirection, Scan};

use crate::campaign::analysis::{LineAnalysis, LineRuler, ScanAnalysis};
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::ground::even_image;
use crate::map::local::local_lattices;
use crate::map::sample::LatticeMap;
use crate::scan::channel::{channels, flat_image_of, image_of};
use crate::scan::place::Place;
use crate::settings::knobs::Settings;
use crate::survey::tiling::tile_map;
use crate::window::types::{
    FULL_WIDTH, Reference, Resolution, ResolutionError, UsedHarmonic, WaveMap,
};

/// The map of one line direction of a scan.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LineMap {
    /// The file as the user named it.
    pub file: String,
    /// Trace or retrace.
    pub line: LineDirection,
    /// Sense of the slow motion.
    pub frame_direction: Option<FrameDirection>,
    /// Whether the drift is taken off.
    pub drift_corrected: bool,
    /// Time gradient of the frame, s/nm; `None` without timing.
    pub time_gradient: Option<Vector2<f64>>,
    /// The harmonics that were used; none by tiles.
    pub harmonics: Vec<UsedHarmonic>,
    /// Margin at the edges, in windows; 0 by tiles.
    pub margin: f64,
    /// Whether the noise was seen between the harmonics and not guessed.
    pub noise_measured: bool,
    /// The lattice of the whole image under the same corrections, wave vectors as columns, rad/nm.
    pub whole: Matrix2<f64>,
    /// The atoms of a layer that places and lattices are measured by, and whether node by node; `None` by the scanner.
    pub ruler: Option<(LineRuler, bool)>,
    /// Local lattices on the sample.
    pub map: LatticeMap,
}

/// How local lattices are measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MapMethod {
    /// Phases under a Gaussian window.
    #[default]
    Demodulation,
    /// The fit of whole images on overlapping tiles.
    Tiles,
}

/// Why an image gives no map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MapError {
    /// No image of this size has such a map.
    #[error(transparent)]
    Resolution(#[from] ResolutionError),
    /// Neither trace nor retrace of the scan was analysed, or it has no size.
    #[error("no analysed image with a size")]
    NoImage,
    /// The windows do not fit into the frame.
    #[error(
        "the frame is too small for a map (windows of 0.6 periods with margins of two windows must fit), or it shows a \
         lattice nowhere"
    )]
    TooSmall,
}

/// Maps the images behind `analysed`, drift and sensors taken into account as there.
///
/// `origin` is the time at which places on the sample are meant, that of the middle of the first frame
/// ([`crate::campaign::motion::Motion`]). By tiles, the window of `resolution` is the side of a tile.
///
/// # Errors
/// [`MapError`], where none of its images gives a map.
pub fn map_scan(
    scan: &Scan,
    analysed: &ScanAnalysis,
    origin: Option<f64>,
    settings: &Settings,
    method: MapMethod,
    resolution: &Resolution,
) -> Result<Vec<LineMap>, MapError> {
    let wanted = (method, resolution, Part::Frame);
    map_lines(scan, analysed, origin, settings, wanted)
}

/// The same of one grain of several: what lies beside its patch is left out.
///
/// # Errors
/// [`MapError`], where none of its images gives a map.
pub fn map_grain(
    scan: &Scan,
    analysed: &ScanAnalysis,
    origin: Option<f64>,
    settings: &Settings,
    method: MapMethod,
    resolution: &Resolution,
) -> Result<Vec<LineMap>, MapError> {
    let wanted = (method, resolution, Part::LatticeRegion);
    map_lines(scan, analysed, origin, settings, wanted)
}

/// What of a frame is mapped.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    /// All of it: nodes say themselves whether they are of the lattice.
    Frame,
    /// The patch that the lattice was measured on: beside it is another.
    LatticeRegion,
}

fn map_lines(
    scan: &Scan,
    analysed: &ScanAnalysis,
    origin: Option<f64>,
    settings: &Settings,
    wanted: (MapMethod, &Resolution, Part),
) -> Result<Vec<LineMap>, MapError> {
    let channels = channels(scan, settings).map_err(|_| MapError::NoImage)?;
    let (mut maps, mut error) = (Vec::new(), MapError::NoImage);
    for channel in channels {
        match map_line(scan, channel, analysed, settings, wanted) {
            Ok(mut map) => {
                map.map.move_by(-drifted(analysed, origin));
                maps.push(map);
            }
            Err(why) => error = why,
        }
    }
    if maps.is_empty() {
        Err(error)
    } else {
        Ok(maps)
    }
}

/// How far the sample drifted from `origin` until the middle of the scan.
pub(crate) fn drifted(analysed: &ScanAnalysis, origin: Option<f64>) -> Vector2<f64> {
    match (analysed.motion, origin) {
        (Some(motion), Some(then)) => motion.path.between(then, motion.middle),
        _ => Vector2::zeros(),
    }
}

fn map_line(
    scan: &Scan,
    channel: &Channel,
    analysed: &ScanAnalysis,
    settings: &Settings,
    (method, resolution, part): (MapMethod, &Resolution, Part),
) -> Result<LineMap, MapError> {
    let (place, found) = place_of(scan, channel, analysed, settings).ok_or(MapError::NoImage)?;
    let still = still(&place, found, analysed);
    let geometry = place.geometry;
    let reference = Reference {
        pair: reciprocal(&found.pixels.basis).ok_or(MapError::NoImage)?,
        pitch: pitch(&geometry),
    };
    let placed = still.as_ref().unwrap_or(&geometry);
    let widths = match method {
        MapMethod::Demodulation => FULL_WIDTH,
        // The window is the side of a tile.
        MapMethod::Tiles => 1.0,
    };
    resolution.fits(geometry.extent(), widths)?;
    let patch = found.patch.as_ref().filter(|_| part == Part::LatticeRegion);
    let mut by_nodes = false;
    let (map, harmonics, noise_measured, margin) = match method {
        MapMethod::Demodulation => {
            let mut image = flat_image_of(channel, settings.background);
            if found.on_ground {
                let (pair, background) = (&reference.pair, settings.background);
                let even = even_image(&image, pair, &geometry, background);
                image = even.unwrap_or(image);
            }
            if let Some(patch) = patch {
                image = patch.of(&image);
            }
            let waves = local_lattices(&image, &reference, resolution).ok_or(MapError::TooSmall)?;
            let mut map = LatticeMap::new(&waves, placed).ok_or(MapError::NoImage)?;
            if let Some(atoms) = &found.ruler
                && let Some(local) = local_atoms(&image, atoms, &reference, &waves)
            {
                let layers = settings.bilayer();
                let material = match atoms.layer {
                    1 => layers.reference,
                    _ => layers.stretched,
                };
                by_nodes = map.rule_nodes(&local, placed, material, atoms.ruler.angle);
            }
            (map, waves.harmonics, waves.noise_measured, waves.margin)
        }
        MapMethod::Tiles => {
            let mut image = image_of(channel);
            if let Some(patch) = patch {
                image = patch.of(&image);
            }
            let map = tile_map(&image, &geometry, placed, &reference, resolution, settings);
            (map.ok_or(MapError::TooSmall)?, Vec::new(), true, 0.0)
        }
    };
    let dual = placed.pixel_to_nm.try_inverse().ok_or(MapError::NoImage)?;
    Ok(LineMap {
        file: analysed.file.clone(),
        line: place.line,
        frame_direction: analysed.frame_direction,
        drift_corrected: still.is_some(),
        time_gradient: place
            .timing
            .and_then(|timing| geometry.time_gradient(&timing)),
        harmonics,
        margin,
        noise_measured,
        whole: dual.transpose() * reference.pair,
        ruler: found.ruler.map(|atoms| (atoms, by_nodes)),
        map,
    })
}

/// The atoms under the windows of a moiré.
fn local_atoms(
    image: &Image,
    atoms: &LineRuler,
    reference: &Reference,
    waves: &WaveMap,
) -> Option<WaveMap> {
    let of_atoms = Reference {
        pair: reciprocal(&atoms.atoms.basis)?,
        ..*reference
    };
    let same = Resolution {
        window_nm: Some(waves.window_nm),
        step_nm: Some(waves.step[0] * reference.pitch[0]),
        margin: Some(waves.margin),
    };
    local_lattices(image, &of_atoms, &same)
}

/// The pixels on the sample: by the atoms where they are the ruler, about the middle of the frame, or at rest; `None` where its drift is
/// not known.
pub(crate) fn still(
    place: &Place,
    found: &LineAnalysis,
    analysed: &ScanAnalysis,
) -> Option<Geometry> {
    let Some(atoms) = &found.ruler else {
        return place.still(analysed.drift);
    };
    let (map, centre) = (atoms.ruler.map, place.geometry.centre());
    let mut placed = place.geometry.mapped(&map);
    placed.origin += centre - map * centre;
    Some(placed)
}

/// The place of a channel and what was found in its whole image; `None` for one that was not analysed or has no size.
pub(crate) fn place_of<'a>(
    scan: &Scan,
    channel: &Channel,
    analysed: &'a ScanAnalysis,
    settings: &Settings,
) -> Option<(Place, &'a LineAnalysis)> {
    // Doubts about the sensors are in the analysis already.
    let place = Place::of(&analysed.file, scan, channel, settings, &mut Vec::new())?;
    let found = analysed.lines.iter().find(|l| l.line == place.line)?;
    Some((place, found))
}

pub(crate) fn pitch(geometry: &Geometry) -> [f64; 2] {
    [geometry.fast_step().norm(), geometry.slow_step().norm()]
}
