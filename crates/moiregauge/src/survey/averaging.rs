//! Maps of the lines of several scans → one map of the sample, and what changed between upward and downward frames.

use spmfile::FrameDirection;

use crate::frame::axis::Axis;
use crate::map::combine::{Agreement, Shared, combine_frames, combine_with};
use crate::map::drift_change;
use crate::map::drift_change::DriftChange;
use crate::map::sample::LatticeMap;
use crate::survey::mapping::LineMap;

/// The average of all maps, trace and retrace of a frame together; `None` of none.
pub fn average_maps(maps: &[LineMap]) -> Option<(LatticeMap, Option<Agreement>)> {
    combine_frames(&by_frame(maps.iter()))
}

/// Compares upward with downward frames of one slow axis.
pub fn change_of_drift(maps: &[LineMap]) -> Option<DriftChange> {
    let axis = |m: &LineMap| {
        m.time_gradient.map(|u| {
            if u.x.abs() > u.y.abs() {
                Axis::X
            } else {
                Axis::Y
            }
        })
    };
    let of = |direction: FrameDirection, slow: Axis| -> Vec<&LineMap> {
        let wanted = |m: &&LineMap| m.frame_direction == Some(direction) && axis(m) == Some(slow);
        maps.iter().filter(wanted).collect()
    };
    [Axis::Y, Axis::X].into_iter().find_map(|slow| {
        let (up, down) = (of(FrameDirection::Up, slow), of(FrameDirection::Down, slow));
        let gradient = up.first()?.time_gradient?;
        // What the sample shows in all frames is in both averages.
        let average = |maps: Vec<&LineMap>| {
            combine_with(&by_frame(maps.into_iter()), Shared::Cancels).map(|(map, _)| map)
        };
        drift_change(&average(up)?, &average(down)?, gradient)
    })
}

/// The maps of each frame, in the order of the first of them.
fn by_frame<'a>(maps: impl Iterator<Item = &'a LineMap>) -> Vec<Vec<&'a LatticeMap>> {
    let mut frames: Vec<(&LineMap, Vec<&LatticeMap>)> = Vec::new();
    for map in maps {
        let same = |other: &LineMap| {
            other.file == map.file && other.frame_direction == map.frame_direction
        };
        match frames.iter_mut().find(|(first, _)| same(first)) {
            Some((_, lines)) => lines.push(&map.map),
            None => frames.push((map, vec![&map.map])),
        }
    }
    frames.into_iter().map(|(_, lines)| lines).collect()
}
