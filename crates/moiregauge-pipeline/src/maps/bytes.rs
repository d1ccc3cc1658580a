//! Bands of a survey as they are kept: their names and their bytes.

use moiregauge::map::{Grid, TwistStrainMap};
use moiregauge::settings::Settings;
use moiregauge::survey::SurveyPlan;
use moiregauge::window::{Mask, Resolution};
use nalgebra::{Matrix2, Vector2};
use sha2::{Digest as _, Sha256};

use super::error::NoBands;
use crate::hash::hexadecimal;
use crate::sink::{SinkError, build};

/// What a band depends on: the image, settings, resolution, the first image of the survey (window and labelling), and
/// the program to its last bit.
pub(super) fn key(
    image: &str,
    settings: &Settings,
    resolution: &Resolution,
    plan: &SurveyPlan,
) -> Result<String, NoBands> {
    let mut hash = Sha256::new();
    hash.update(image);
    hash.update(format!("{} {}", plan.window_nm, plan.whole));
    let settings = serde_json::to_vec(settings);
    hash.update(settings.map_err(|why| SinkError::made("bands", why))?);
    let unknown = NoBands::Nothing("the program cannot read itself: bands cannot be kept");
    let build = build().ok_or(unknown)?;
    hash.update(format!("{resolution:?} {build}"));
    Ok(hexadecimal(&hash.finalize())[..16].to_owned())
}

/// Numbers of a band's head: columns, rows, origin, steps.
const HEAD: usize = 8;

/// A band as bytes: head in double precision, masks, then all planes in single precision, little endian.
pub(super) fn encoded(map: &mut TwistStrainMap) -> Vec<u8> {
    let grid = map.grid;
    let head: [f64; HEAD] = [
        grid.size[0] as f64,
        grid.size[1] as f64,
        grid.origin.x,
        grid.origin.y,
        grid.step.m11,
        grid.step.m21,
        grid.step.m12,
        grid.step.m22,
    ];
    let mut bytes: Vec<u8> = head.iter().flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend(map.mask.iter().map(|m| *m as u8));
    for plane in map.planes_mut() {
        bytes.extend(plane.iter().flat_map(|v| v.to_le_bytes()));
    }
    bytes
}

/// The band; `None` if the bytes are not a band.
pub(super) fn decoded(bytes: &[u8], plan: &SurveyPlan) -> Option<TwistStrainMap> {
    let (head, rest) = bytes.split_at_checked(8 * HEAD)?;
    let head: Vec<f64> = head
        .as_chunks::<8>()
        .0
        .iter()
        .map(|b| f64::from_le_bytes(*b))
        .collect();
    let size = [head[0] as usize, head[1] as usize];
    let nodes = size[0].checked_mul(size[1])?;
    let grid = Grid {
        size,
        origin: Vector2::new(head[2], head[3]),
        step: Matrix2::new(head[4], head[6], head[5], head[7]),
    };
    let mut map = plan.start(&grid);
    map.grid = grid;
    let (masks, mut rest) = rest.split_at_checked(nodes)?;
    map.mask = masks
        .iter()
        .map(|m| Mask::ALL.get(usize::from(*m)).copied())
        .collect::<Option<_>>()?;
    for plane in map.planes_mut() {
        let (values, after) = rest.split_at_checked(4 * nodes)?;
        *plane = values
            .as_chunks::<4>()
            .0
            .iter()
            .map(|b| f32::from_le_bytes(*b))
            .collect();
        rest = after;
    }
    rest.is_empty().then_some(map)
}
