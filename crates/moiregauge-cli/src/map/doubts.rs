//! What has to be said of maps beside their numbers.

use moiregauge::caveat::Caveat;
use moiregauge::map::{DriftChange, LatticeMap, register};
use moiregauge::series::LineMap;

use crate::say::line_name;

/// Shifts beyond this share of a period may belong to another one.
const FAR: f64 = 0.3;

/// Says that no twist and strain go with the map.
pub(super) fn no_twist_strain(why: &impl std::fmt::Display) -> Caveat {
    let words = format!("{why}: the map has wavelengths and directions only");
    Caveat::new("no-twist-strain", "map", words)
}

/// Says that the drift changes, where it does.
pub(super) fn about_change(drift_change: Option<DriftChange>, caveats: &mut Vec<Caveat>) {
    if let Some(found) = drift_change.filter(DriftChange::stands_out) {
        let [x, y] = found
            .acceleration
            .map(|a| moiregauge_report::plus_minus(a.scaled(3600.0)));
        caveats.push(Caveat::new(
            "drift-changes",
            "map",
            format!(
                "upward and downward frames differ along their slow axis as if the drift changed within a \
                 frame, by ({x}, {y}) nm/min² more upwards than downwards: that is no strain, and the average of \
                 both is free of it. A change of drift common to both directions looks like strain"
            ),
        ));
    }
}

/// Says that the margin is narrower than two windows where nobody asked for that.
pub(super) fn narrow_margin(margin: f64, file: &str) -> Option<Caveat> {
    let why = || {
        format!(
            "the frame is small for its window: the margin is {margin:.2} windows wide and not two. Windows there are \
             cut by the edge; what that does to their noise, and what leaks through them, is in their errors, but they \
             see less of the outer side (--margin 2 leaves such nodes out)"
        )
    };
    (margin > 0.0 && margin < 1.99).then(|| Caveat::new("map-narrow-margin", file, why()))
}

/// What is not as good as it could be.
pub(super) fn of_maps(maps: &[LineMap], caveats: &mut Vec<Caveat>) {
    if maps.iter().any(|m| !m.drift_corrected) {
        caveats.push(Caveat::new(
            "map-not-drift-corrected",
            "map",
            "the drift of some images is not known: it stretches and shears their maps, the same everywhere",
        ));
    }
    if let Some(guessed) = maps.iter().find(|m| !m.noise_measured) {
        caveats.push(Caveat::new(
            "map-noise-guessed",
            guessed.file.as_str(),
            "the frame holds too few periods to see noise between the harmonics: the errors of the map are those of \
             what the lattice leaves of the variance of the image, enlarged where the harmonics disagree by more",
        ));
    }
}

/// Puts the maps on each other by the phases of the pattern.
pub(super) fn registered(maps: &mut [LineMap], caveats: &mut Vec<Caveat>) {
    let mut all: Vec<&mut LatticeMap> = maps.iter_mut().map(|m| &mut m.map).collect();
    let found = register(&mut all);
    for (map, found) in maps.iter().zip(found) {
        if found.is_some_and(|f| f.reversed) {
            caveats.push(Caveat::new(
                "contrast-reversed",
                map.file.as_str(),
                format!(
                    "the contrast of the {} is the other way round than in the images before, as that of error signals \
                     is: half a period between them is taken for that and not for a shift",
                    line_name(map.line)
                ),
            ));
        }
        let Some(found) = found.filter(|f| f.of_period > FAR) else {
            continue;
        };
        let [x, y] = found.shift.map(moiregauge_report::plus_minus);
        caveats.push(Caveat::new(
            "map-registration",
            map.file.as_str(),
            format!(
                "by its phases the pattern stands ({x}, {y}) nm from where time and drift put it, {} of a period: it \
                 may have been put on the wrong period",
                moiregauge_report::two_digits(found.of_period)
            ),
        ));
    }
}
