//! One scan: geometry, timing and lattice of each of its lines, trace and retrace.

use nalgebra::{Matrix2, Matrix4};
use spmfile::{Channel, FrameDirection, Scan};

use crate::calibration::Calibration;
use crate::caveat::Caveat;
use crate::caveat::files::FileDoubt;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::by_hand::measure_by_hand;
use crate::lattice::find::measure_own;
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::several::atoms::{self, Find};
use crate::lattice::several::together::measure_several;
use crate::lattice::start::Start;
use crate::numbers::interrupt;
use crate::numbers::words::line_name;
use crate::scan::channel::{channels, image_of};
use crate::scan::doubts::{about_coverage, about_fit, few_periods, lines_disagree, turned};
use crate::scan::fingerprint::Fingerprint;
use crate::scan::grains::{beside, grains};
use crate::scan::images::first_of_several;
use crate::scan::measured::{MeasureError, MeasuredLine, MeasuredScan};
use crate::scan::moires::in_order;
use crate::scan::overlap::Window;
use crate::scan::place::Place;
use crate::scan::positions::pitch_sigma;
use crate::scan::scanner::about_calibration;
use crate::scan::shared::correlation;
use crate::scan::told::{leave_out, meant};
use crate::settings::knobs::Settings;

/// Bytes of memory that the analysis of an image takes for each of its pixels at most: measured with 2048 × 2048
/// single-precision samples and eight pixels per period, where nothing can be binned.
pub const BYTES_PER_PIXEL: u64 = 105;

/// Measures one scan, restricted to the window if one is given.
///
/// # Errors
/// [`MeasureError`] says what the file lacks, or that its image shows no lattice. With both line
/// directions asked for, one of them is enough.
pub fn measure_scan(
    file: &str,
    scan: &Scan,
    settings: &Settings,
    window: Option<&Window>,
) -> Result<MeasuredScan, MeasureError> {
    Ok(measure_moires(file, scan, settings, window)?.swap_remove(0))
}

/// Measures a scan of a lattice whose cell is known: `cell` is its real-space pair, nm, at any orientation.
///
/// # Errors
/// As [`measure_scan`]; an image that shows another lattice shows none.
pub fn measure_known(
    file: &str,
    scan: &Scan,
    settings: &Settings,
    cell: &Matrix2<f64>,
) -> Result<MeasuredScan, MeasureError> {
    let find = |image: Image, geometry: &Geometry| {
        let start = Start::find_known(&image, geometry, settings.background, cell)?;
        Ok(vec![start.measure(settings.method)?])
    };
    Ok(measure_with(file, scan, settings, None, &find)?.swap_remove(0))
}

/// Measures every moiré of one scan, as many as `settings` say, the largest cell first; otherwise as
/// [`measure_scan`]. There is at least one.
///
/// # Errors
/// As [`measure_scan`]; also where there are fewer moirés, or two that cannot be told apart.
pub fn measure_moires(
    file: &str,
    scan: &Scan,
    settings: &Settings,
    window: Option<&Window>,
) -> Result<Vec<MeasuredScan>, MeasureError> {
    if let Some(problem) = settings.out_of_range() {
        return Err(problem.into());
    }
    let (background, method) = (settings.background, settings.method);
    let told = &settings.by_hand;
    let find = |image: Image, geometry: &Geometry| {
        let one = |image, geometry: &Geometry| {
            let found = if told.is_nothing() {
                measure_own(image, geometry, background, method)
            } else {
                measure_by_hand(&image, geometry, background, method, meant(told))
            };
            found.map(|lattice| vec![lattice])
        };
        let several = |image, geometry: &Geometry| {
            measure_several(&image, geometry, background, settings.moires)
        };
        let find: Find = match settings.moires {
            0 | 1 => &one,
            _ => &several,
        };
        let mut layers = settings.ruler_layers();
        layers.retain(|layer| atoms::may_show(geometry, layer));
        let scene = atoms::Scene {
            image: &image,
            geometry,
            background,
            find,
        };
        let both = scene.moires_with_atoms(&layers);
        both.map_or_else(|| find(image, geometry), Ok)
    };
    measure_with(file, scan, settings, window, &find)
}

fn measure_with(
    file: &str,
    scan: &Scan,
    settings: &Settings,
    window: Option<&Window>,
    find: Find,
) -> Result<Vec<MeasuredScan>, MeasureError> {
    if let Some(problem) = settings.scanner.as_ref().and_then(Calibration::problem) {
        return Err(MeasureError::Calibration(problem));
    }
    let channels = channels(scan, settings)?;
    let several = first_of_several(scan, &channels[0].name, settings);
    let mut caveats: Vec<Caveat> = several
        .into_iter()
        .map(|choice| Caveat::new(FileDoubt::SeveralImages(choice), file))
        .collect();
    let mut moires: Vec<Vec<MeasuredLine>> = Vec::new();
    let mut failures = Vec::new();
    let mut found = Vec::new();
    let measure = |channel: &Channel, find: Find| {
        interrupt::check();
        let mut caveats = Vec::new();
        let lines = measure_line(file, scan, channel, settings, window, find, &mut caveats);
        lines.map(|lines| (lines, caveats))
    };
    for channel in &channels {
        match measure(channel, find) {
            Ok(lines) => found.push((*channel, lines)),
            Err(error) => failures.push(error),
        }
    }
    for (_, (lines, told)) in found {
        caveats.extend(told);
        add_lines(&mut moires, lines);
    }
    if moires.is_empty() {
        return Err(failures.swap_remove(0));
    }
    caveats.extend(failures.iter().map(|error| left_out(error, file)));
    about_calibration(file, scan, moires.iter().flatten(), settings, &mut caveats);
    let channel = &channels[0].name;
    let of_moire = |lines| joined(file, scan, channel, lines, caveats.clone());
    Ok(moires.into_iter().map(of_moire).collect())
}

/// That one of several lines could not be measured.
fn left_out(error: &MeasureError, file: &str) -> Caveat {
    let reason = error.to_string();
    Caveat::new(FileDoubt::LineLeftOut { reason }, file)
}

/// One moiré of a scan, from the lines that show it, with the grains beside the largest.
fn joined(
    file: &str,
    scan: &Scan,
    channel: &str,
    lines: Vec<MeasuredLine>,
    mut caveats: Vec<Caveat>,
) -> MeasuredScan {
    let mut grains = grains(lines);
    for lines in &mut grains {
        share_noise(lines);
    }
    let lines = grains.remove(0);
    let excluded = lines_disagree(file, &lines, &mut caveats);
    let largest = MeasuredScan {
        file: file.to_owned(),
        acquired: scan.acquired,
        frame_direction: scan.frame_direction,
        line_rate_hz: scan.line_rate_hz,
        channel: channel.to_owned(),
        size_nm: scan.size_nm,
        set: None,
        digest: None,
        lines: lines.into(),
        excluded,
        repeats: None,
        caveats,
        grains: Vec::new(),
    };
    let others = grains.into_iter().map(|lines| beside(&largest, lines));
    MeasuredScan {
        grains: others.collect(),
        ..largest
    }
}

/// Adds the lines of one direction, each to its moiré.
fn add_lines(moires: &mut Vec<Vec<MeasuredLine>>, lines: Vec<MeasuredLine>) {
    if moires.is_empty() {
        moires.extend(lines.into_iter().map(|line| vec![line]));
        return;
    }
    let first: Vec<_> = moires
        .iter()
        .map(|lines| lines[0].in_sensor_coordinates())
        .collect();
    let lines = in_order(&first, lines, |l| Some(l.in_sensor_coordinates()));
    for (all, line) in moires.iter_mut().zip(lines) {
        all.push(line);
    }
}

/// Enlarges the errors of trace and retrace by what their noise has in common, so that they can be
/// taken as independent.
pub(crate) fn share_noise(lines: &mut [MeasuredLine]) {
    let [first, second] = lines else { return };
    let (Some(a), Some(b)) = (&first.lattice.fit, &second.lattice.fit) else {
        return;
    };
    let correlations = [correlation(a, b), correlation(b, a)];
    for (line, correlation) in [first, second].into_iter().zip(correlations) {
        let (mut weighted, mut weights) = (0.0, 0.0);
        let variances = line.lattice.phases.covariance.diagonal();
        for (variance, correlation) in variances.iter().zip(correlation) {
            weighted += correlation / variance;
            weights += variance.recip();
        }
        line.lattice.phases = line.lattice.phases.enlarged(correlation.map(|c| 1.0 + c));
        if weights > 0.0 {
            line.lattice.pixels.covariance *= 1.0 + weighted / weights;
        }
    }
}

fn measure_line(
    file: &str,
    scan: &Scan,
    channel: &Channel,
    settings: &Settings,
    window: Option<&Window>,
    find: Find,
    caveats: &mut Vec<Caveat>,
) -> Result<Vec<MeasuredLine>, MeasureError> {
    let mut place =
        Place::of(file, scan, channel, settings, caveats).ok_or(MeasureError::NoSize)?;
    let mut pitch = None;
    if place.sensors.is_none() {
        turned(file, scan.rotation_rad, caveats);
        pitch = pitch_sigma(scan, channel);
    }
    interrupt::check();
    let (speeds, speed_error) = place.speeds();
    let mut image = image_of(channel);
    let pixels = Fingerprint::of(&image);
    leave_out(&mut image, scan.size_nm, &settings.by_hand)?;
    interrupt::check();
    let mut lines_after = 0;
    if let Some(window) = window {
        (image, place, lines_after) = under(window, &image, place, scan.frame_direction)?;
    }
    let Place {
        line,
        nominal,
        geometry,
        timing,
        ..
    } = place;
    let mut lattices = find(image, &geometry).map_err(|error| MeasureError::Lattice {
        line: line_name(line),
        channel: channel.name.clone(),
        error,
    })?;
    let cell = |lattice: &MeasuredLattice| lattice.pixels.basis.determinant().abs();
    lattices.sort_by(|a, b| cell(b).total_cmp(&cell(a)));
    let displacement = geometry.displacement();
    let displacement = displacement.map(|off| off.drawn(geometry.size));
    let lines = lattices.into_iter().map(|lattice| {
        about_lattice(file, &lattice, &geometry, caveats);
        MeasuredLine {
            line,
            // What departs from it is in the lattice already.
            geometry: Geometry {
                departure: None,
                covariance: geometry.covariance + noise_of_departure(&geometry, &lattice),
                ..geometry.clone()
            },
            nominal: nominal.clone(),
            timing,
            frame_columns: channel.columns,
            lines_after,
            lattice,
            speeds,
            pitch_sigma: pitch,
            speed_error,
            displacement: displacement.clone().unwrap_or_default(),
            pixels: pixels.clone(),
        }
    });
    Ok(lines.collect())
}

/// What noise of the departure does to the steps: nothing over the whole frame, whose straight line it has no part in.
fn noise_of_departure(geometry: &Geometry, lattice: &MeasuredLattice) -> Matrix4<f64> {
    match (&geometry.departure, &lattice.patch) {
        (Some(departure), Some(patch)) => departure.noise_of_steps(&patch.places()),
        _ => Matrix4::zeros(),
    }
}

/// What lies under a window, and how many lines of the frame were recorded after it.
fn under(
    window: &Window,
    image: &Image,
    place: Place,
    direction: Option<FrameDirection>,
) -> Result<(Image, Place, usize), MeasureError> {
    let recorded = &place.recorded;
    let (first, size) = window.pixels(recorded).ok_or(MeasureError::NoOverlap)?;
    let lines_after = match direction {
        Some(FrameDirection::Down) => first[1],
        _ => image.rows - first[1] - size[1],
    };
    let (image, place) = (image.cropped(first, size), place.cropped(first, size));
    Ok((image, place, lines_after))
}

pub(crate) fn about_lattice(
    file: &str,
    lattice: &MeasuredLattice,
    geometry: &Geometry,
    caveats: &mut Vec<Caveat>,
) {
    few_periods(file, lattice, caveats);
    about_coverage(file, lattice, geometry, caveats);
    if let Some(fit) = &lattice.fit {
        about_fit(file, fit, caveats);
    }
}
