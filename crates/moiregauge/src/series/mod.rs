//! The whole chain: scans → sets → drift → lattice → twist and strain.
//!
//! [`measure_scan`] does what needs the pixels, one scan at a time; [`analyse`] does the rest from
//! the few numbers that remain. [`illustrate`] goes back to the pixels of one scan for the figures.

mod atomic;
mod calibrate;
mod channel;
mod combine;
mod corrected;
mod domain_mapping;
mod doubts;
mod group;
mod illustrate;
mod mapping;
mod measure;
mod moires;
mod overlap;
mod positions;
mod scanner;
mod set;
mod shared;
mod sightings;
mod striping;
mod surveying;
mod tiling;

pub use atomic::{AtomicError, AtomicOrientation, atomic_orientation};
pub use calibrate::{CalibrateError, Calibrated, CalibratedSet, calibrate};
pub use channel::{channels_by_preference, choose_channel};
pub use corrected::{CorrectedImage, corrected_images, nominal_geometry, on_grid};
pub use domain_mapping::domains_of_scan;
pub use group::natural_order;
pub use illustrate::{amplitude_of, illustrate, picture};
pub use mapping::{LineMap, MapError, MapMethod, map_scan};
pub use measure::{
    MeasureError, MeasuredLine, MeasuredScan, measure_known, measure_moires, measure_scan,
};
pub use moires::sorted_moires;
pub use overlap::{Window, common_window};
pub use striping::{ScanStripes, StripeError, stripes_in_short, stripes_of_scan};
pub use surveying::{ReadBlock, SurveyError, SurveyPlan};

use nalgebra::Matrix2;

use crate::analysis::Analysis;
use crate::caveat::Caveat;
use crate::lattice::reciprocal::canonical;
use crate::settings::{Background, Method, Settings};

/// Groups measured scans into sets and finds their drift, lattice, twist and strain.
///
/// Sets and scans come out in order of time. Nothing here fails: what cannot be determined is left
/// out, and a caveat says why.
pub fn analyse(scans: Vec<MeasuredScan>, settings: &Settings) -> Analysis {
    let mut caveats = about_settings(settings);
    let mut scans = scans;
    exclude(&mut scans, settings, &mut caveats);
    let groups = group::groups(scans, settings.grouping);
    let mut reference: Option<Matrix2<f64>> = None;
    let mut sets = Vec::with_capacity(groups.len());
    let mut joint_scans = Vec::new();
    let mut index = 0;
    for mut group in groups {
        if let Some(line) = group.scans.first().and_then(|s| s.lines.first())
            && reference.is_none()
        {
            reference = Some(canonical(&line.in_sensor_coordinates()).basis);
        }
        for scan in &group.scans {
            caveats.extend(scan.caveats.iter().cloned());
        }
        let Some(reference) = reference else { continue };
        let count = group.scans.len() as u64;
        sets.push(set::analyse_set(
            &mut group,
            &reference,
            settings,
            index,
            &mut caveats,
        ));
        index += count;
        if settings.method.is_joint() && settings.drift.is_none() {
            joint_scans.extend(group.scans.into_iter().filter(|s| s.excluded.is_none()));
        }
    }
    let all: Vec<&MeasuredScan> = joint_scans.iter().collect();
    let joint = reference.map(|reference| (all.as_slice(), reference));
    let combined = combine::combine(&sets, joint, settings, &mut caveats);
    Analysis {
        settings: settings.clone(),
        sets,
        combined,
        atomic: None,
        survey: None,
        caveats,
    }
}

/// Marks the scans that the user does not want; a name that fits none of them deserves a word.
fn exclude(scans: &mut [MeasuredScan], settings: &Settings, caveats: &mut Vec<Caveat>) {
    for pattern in &settings.exclude {
        let mut found = false;
        for scan in scans.iter_mut().filter(|s| names(pattern, &s.file)) {
            scan.excluded = Some("the user excluded it".to_owned());
            found = true;
        }
        if !found {
            caveats.push(Caveat::new(
                "nothing-excluded",
                "analysis",
                format!("--exclude {pattern:?} fits none of the scans"),
            ));
        }
    }
}

/// Whether a pattern names a file: by its whole path or by its last part; `*` is any characters.
fn names(pattern: &str, file: &str) -> bool {
    let last = file.rfind(['/', '\\']).map_or(file, |i| &file[i + 1..]);
    matches(pattern, last) || matches(pattern, file)
}

fn matches(pattern: &str, text: &str) -> bool {
    let Some((start, rest)) = pattern.split_once('*') else {
        return pattern == text;
    };
    let Some(text) = text.strip_prefix(start) else {
        return false;
    };
    (0..=text.len())
        .filter(|&i| text.is_char_boundary(i))
        .any(|i| matches(rest, &text[i..]))
}

/// What the choice of settings does to the numbers.
fn about_settings(settings: &Settings) -> Vec<Caveat> {
    let mut caveats = Vec::new();
    let mut add = |code: &str, message: &str| caveats.push(Caveat::new(code, "analysis", message));
    if settings.method == Method::Paper {
        add(
            "method-paper-bias",
            "the published method sums the autocorrelation without dividing by the overlap: lattice \
             vectors come out too short by about a per cent at four to five periods (twist too large \
             by the same fraction) and whole-pixel peaks quantise them; it is meant for comparison",
        );
    }
    if settings.background == Background::LineMean {
        add(
            "line-levelling",
            "each line was levelled on its own: harmonics near the fast axis are damaged and lattice \
             vectors may be biased",
        );
    }
    caveats
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_name_files() {
        assert!(names("b.spm", "a/b.spm"));
        assert!(names("a/b.spm", "a/b.spm"));
        assert!(names("*.00?", "x.00?"));
        assert!(names("tbg*3.spm", "C:\\data\\tbg.0_00003.spm"));
        assert!(names("µ*", "µm scan"));
        assert!(!names("b", "a/b.spm"));
        assert!(!names("*.spm", "a/b.sxm"));
    }
}
