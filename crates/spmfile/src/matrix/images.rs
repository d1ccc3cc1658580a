//! Data and the state of the log → the scan.

use std::collections::BTreeSet;

use super::data::Data;
use super::format::{FORMAT, damaged};
use super::frame::{Shape, Understood};
use super::log::{self, State};
use super::names::{Name, parse};
use crate::clock;
use crate::header::{ChannelHeader, Scaling};
use crate::outline::Outline;
use crate::scan::{ChannelInfo, DateTime, FrameDirection, LineDirection, Scan};
use crate::stored::{Failure, Stored, Unpacked};

/// Units, as far as they were met in descriptions.
const METRE: [(&str, f64); 2] = [("Meter", 1e9), ("m", 1e9)];
const SECOND: [(&str, f64); 2] = [("Second", 1.0), ("s", 1.0)];
const DEGREE: [(&str, f64); 2] = [("Degree", 1.0), ("°", 1.0)];
/// Parameters of which a scan depends.
const RASTER_TIME: [&str; 2] = ["Raster_Time", "Raster_Period_Time"];
const GEOMETRY: [&str; 5] = ["Width", "Height", "Zoom", "Points", "Lines"];
const PLACE: [&str; 3] = ["Angle", "X_Offset", "Y_Offset"];

/// A frame, its geometry and its channels; `None` if nothing of it was recorded.
pub(super) fn outline<'a>(
    state: &State,
    data: &Data<'a>,
    name: &str,
    understood: &Understood<'_>,
    frame: FrameDirection,
) -> Option<Outline<'a>> {
    let shape = understood.shape;
    let all = data.counts.len() / 4;
    if shape.recorded(frame, all) == 0 {
        return None;
    }
    let mut scan = Scan {
        format: format!("{FORMAT} {}", state.program).trim().to_owned(),
        frame_direction: Some(frame),
        notes: vec![
            "the reader of Omicron Matrix files was written from public descriptions and is untested on real \
             files: check size, direction and scale against the instrument's own program"
                .to_owned(),
        ],
        ..Scan::default()
    };
    let raster = state.quantity(&RASTER_TIME, &SECOND).filter(|t| *t > 0.0);
    // Since the first sample of the file; a parameter that changed meanwhile may hold or not.
    let start = raster.map_or(0, |t| {
        state.stored.saturating_sub((t * all as f64).ceil() as u64)
    });
    let changed = |names: &[&str]| -> Vec<String> {
        let names = names.iter().filter(|name| state.changed(name, start));
        names.map(|&name| name.to_owned()).collect()
    };
    let (geometry, times) = (changed(&GEOMETRY), changed(&RASTER_TIME));
    let meanwhile = [&geometry[..], &times, &changed(&PLACE)].concat();
    if !meanwhile.is_empty() {
        scan.notes.push(format!(
            "changed while the file was recorded, so parts of it may have another position: {}",
            meanwhile.join(", ")
        ));
    }
    let steady = raster.filter(|_| times.is_empty());
    tell_times(&mut scan, data, shape, frame, steady);
    place(&mut scan, state, geometry.is_empty());
    let mut outline = Outline::of(scan);
    channels(&mut outline, data, name, understood, frame);
    Some(outline)
}

/// Times of the lines and of the end of the frame; `raster` is the time of a point that did not change.
fn tell_times(
    scan: &mut Scan,
    data: &Data<'_>,
    shape: Shape,
    frame: FrameDirection,
    raster: Option<f64>,
) {
    let all = data.counts.len() / 4;
    if let Some(raster) = raster {
        if shape.retrace {
            let line = raster * shape.points as f64;
            scan.line_times_s = Some([line; 2]);
            scan.line_rate_hz = Some(0.5 / line);
        }
        // The frame upwards ended before that downwards.
        let later = all - shape.recorded(FrameDirection::Up, all);
        let later = if frame == FrameDirection::Up {
            later
        } else {
            0
        };
        if later == 0 || shape.retrace {
            scan.acquired = date(data.time, raster * later as f64);
        }
    } else if frame == FrameDirection::Down || shape.recorded(FrameDirection::Down, all) == 0 {
        scan.acquired = date(data.time, 0.0);
    }
}

/// Size, rotation and centre.
fn place(scan: &mut Scan, state: &State, steady: bool) {
    let length = |name| state.quantity(&[name], &METRE);
    scan.size_nm = length("Width").zip(length("Height")).map(<[f64; 2]>::from);
    if !steady {
        scan.size_nm = None;
    }
    let zoom = state.any(&["Zoom"]);
    if let Some(zoom) = zoom.filter(|zoom| zoom.number() != Some(1.0)) {
        scan.size_nm = None;
        scan.notes.push(format!(
            "the size is left out, because descriptions differ on how a zoom of {zoom} changes it"
        ));
    }
    let angle = state.quantity(&["Angle"], &DEGREE);
    scan.rotation_rad = angle.unwrap_or(0.0).to_radians();
    let centre = length("X_Offset").zip(length("Y_Offset"));
    scan.offset_nm = centre.map(<[f64; 2]>::from).unwrap_or_default();
    for (name, understood) in [("Angle", angle.is_some()), ("X_Offset", centre.is_some())] {
        if let Some(value) = state.any(&[name]).filter(|_| !understood) {
            scan.notes.push(format!(
                "{name} {value} has an unknown unit and is taken as 0"
            ));
        }
    }
}

/// The images of the frame.
fn channels<'a>(
    outline: &mut Outline<'a>,
    data: &Data<'a>,
    name: &str,
    understood: &Understood<'_>,
    frame: FrameDirection,
) {
    let shape = understood.shape;
    let (unit, scaling) = scaling(name, understood, &mut outline.scan.notes);
    let directions = [LineDirection::Trace, LineDirection::Retrace];
    for direction in &directions[..=usize::from(shape.retrace)] {
        let info = ChannelInfo {
            name: name.to_owned(),
            internal_name: String::new(),
            line_direction: Some(*direction),
            scan_line: None,
        };
        let header = ChannelHeader {
            scaling: Some(scaling.clone()),
            ..ChannelHeader::new(info, shape.lines, shape.points)
                .in_unit(&unit)
                .of_size(outline.scan.size_nm)
        };
        let (counts, line, name) = (data.counts, *direction, name.to_owned());
        let samples = move || match shape.image(counts, frame, line) {
            Ok(Some(samples)) => Ok(Unpacked::measured(samples)),
            Ok(None) => Err(Failure::Channel {
                name: Some(format!("{name} (retrace)")),
                error: "the scan was stopped before its first sample".to_owned(),
            }),
            Err(reason) => Err(Failure::File(damaged(reason))),
        };
        outline.add(header, Stored::Packed(Box::new(samples)));
    }
    tell_frames(&mut outline.scan, shape, data.counts.len() / 4);
}

/// Unit and scaling of a channel; counts, with a note, where it is not known.
fn scaling(name: &str, understood: &Understood<'_>, notes: &mut Vec<String>) -> (String, Scaling) {
    let line = understood.transfer.and_then(|t| Some((t, t.line()?)));
    let Some((transfer, (scale, offset))) = line else {
        notes.push(format!(
            "channel {name} is in counts: {}",
            match understood.transfer {
                Some(transfer) => format!("its function {} is not known", transfer.kind),
                None => "no function in the log certainly belongs to it".to_owned(),
            }
        ));
        let counts = Scaling {
            scale: 1.0,
            offset: 0.0,
            words: "counts".to_owned(),
        };
        return (String::new(), counts);
    };
    let listed = understood.quantity.map_or("", |q| plain_unit(&q.unit));
    let unit = match (plain_unit(&transfer.unit), listed) {
        (unit, "") | ("", unit) => unit,
        (a, b) if a == b => a,
        (a, b) => {
            notes.push(format!(
                "channel {name} has no unit: its function says {a}, its name {b}"
            ));
            ""
        }
    };
    let scaling = Scaling {
        scale,
        offset,
        words: format!("{}: counts × {scale} + {offset}", transfer.kind),
    };
    (unit.to_owned(), scaling)
}

/// Units in signs.
fn plain_unit(unit: &str) -> &str {
    match unit.trim() {
        "Meter" => "m",
        "Ampere" => "A",
        "Volt" => "V",
        "Hertz" => "Hz",
        "Degree" => "°",
        "--" | "---" => "",
        other => other,
    }
}

/// Which frames the file holds.
fn tell_frames(scan: &mut Scan, shape: Shape, recorded: usize) {
    let down = shape.recorded(FrameDirection::Down, recorded) > 0;
    let frames = if down { "up, down" } else { "up" };
    scan.metadata
        .push(("Frames in the file".to_owned(), frames.to_owned()));
}

/// What else the log says.
pub(super) fn tell(
    scan: &mut Scan,
    state: &State,
    log: &[&[u8]],
    name: &Name<'_>,
    file_name: &str,
) {
    let of_frame: BTreeSet<String> = log::files(log)
        .into_iter()
        .filter(|other| {
            let parsed = parse(other);
            parsed.is_some_and(|o| o.session == name.session && o.frame == name.frame)
                && !other.eq_ignore_ascii_case(file_name)
        })
        .collect();
    let others: Vec<String> = of_frame.into_iter().collect();
    if !others.is_empty() {
        scan.metadata
            .push(("Other files of the frame".to_owned(), others.join(", ")));
    }
    for (key, words) in &state.marks {
        scan.metadata.push((key.clone(), words.clone()));
    }
    for key in &state.names {
        if let Some(property) = state.properties.get(key) {
            let words = format!("{} {}", property.value, plain_unit(&property.unit));
            scan.metadata.push((key.clone(), words.trim().to_owned()));
        }
    }
}

/// A time in UTC, some seconds earlier.
fn date(since_1970: u64, earlier: f64) -> Option<DateTime> {
    let start = DateTime {
        year: 1970,
        month: 1,
        day: 1,
        hour: 0,
        minute: 0,
        second: 0,
    };
    // Files are younger than 2000.
    let seconds = since_1970 as f64 - earlier;
    (9.4e8..4e9)
        .contains(&seconds)
        .then(|| clock::later(start, seconds))
}
