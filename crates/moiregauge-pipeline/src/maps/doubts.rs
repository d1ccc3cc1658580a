//! Caveats of maps.

use moiregauge::caveat::{Caveat, Doubt, DriftDoubt, MapDoubt, Mapped};
use moiregauge::map::register;
use moiregauge::map::{DriftChange, LatticeMap, TwistStrainMap};
use moiregauge::survey::LineMap;

/// Shifts beyond this share of a period may belong to another one.
const FAR: f64 = 0.3;

/// Says that no twist and strain go with the map.
pub(super) fn no_twist_strain(reason: String) -> Caveat {
    Caveat::new(MapDoubt::NoTwistStrain { reason }, "map")
}

/// Whether it says that no twist and strain go with the map.
pub(super) fn is_no_twist_strain(caveat: &Caveat) -> bool {
    matches!(caveat.doubt, Doubt::Maps(MapDoubt::NoTwistStrain { .. }))
}

/// Says that several grains are mapped.
pub(super) fn of_grains(grains: usize) -> Caveat {
    Caveat::new(MapDoubt::OfGrains { grains }, "map")
}

/// Says that the drift changes, where it does.
pub(super) fn about_change(drift_change: Option<DriftChange>, caveats: &mut Vec<Caveat>) {
    if let Some(found) = drift_change.filter(DriftChange::is_significant) {
        let acceleration = found.acceleration;
        caveats.push(Caveat::new(DriftDoubt::Changes { acceleration }, "map"));
    }
}

/// Says that the margin is narrower than two windows where nobody asked for that.
pub(super) fn narrow_margin(margin: f64, file: &str) -> Option<Caveat> {
    let doubt = MapDoubt::NarrowMargin { margin };
    (margin > 0.0 && margin < 1.99).then(|| Caveat::new(doubt, file))
}

/// Says that the spread of the twist may be that of a bent grid.
pub(super) fn of_bends(map: &TwistStrainMap, from_sensors: bool) -> Option<Caveat> {
    let (found, bends) = (map.spread(&map.twist)?, map.rms_of_bends(0)?);
    let spread = found.corrected;
    let doubt = MapDoubt::SpreadOfGrid {
        spread,
        bends,
        from_sensors,
    };
    let seen = spread > found.mean_sigma && spread < 2.0 * bends;
    seen.then(|| Caveat::new(doubt, "map"))
}

/// What is not as good as it could be.
pub(super) fn of_maps(maps: &[LineMap], caveats: &mut Vec<Caveat>) {
    if maps.iter().any(|m| !m.drift_corrected) {
        let doubt = MapDoubt::NotDriftCorrected {
            of: Mapped::Lattice,
        };
        caveats.push(Caveat::new(doubt, "map"));
    }
    if let Some(guessed) = maps.iter().find(|m| !m.noise_measured) {
        let doubt = MapDoubt::NoiseGuessed {
            of: Mapped::Lattice,
        };
        caveats.push(Caveat::new(doubt, guessed.file.as_str()));
    }
}

/// Puts the maps on each other by the phases of the pattern.
pub(super) fn registered(maps: &mut [LineMap], caveats: &mut Vec<Caveat>) {
    let mut all: Vec<&mut LatticeMap> = maps.iter_mut().map(|m| &mut m.map).collect();
    let found = register(&mut all);
    for (map, found) in maps.iter().zip(found) {
        if found.is_some_and(|f| f.reversed) {
            let doubt = MapDoubt::ContrastReversed { line: map.line };
            caveats.push(Caveat::new(doubt, map.file.as_str()));
        }
        let Some(found) = found.filter(|f| f.of_period > FAR) else {
            continue;
        };
        let doubt = MapDoubt::Registration {
            shift: found.shift,
            of_period: found.of_period,
        };
        caveats.push(Caveat::new(doubt, map.file.as_str()));
    }
}
