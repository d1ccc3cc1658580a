//! Measured scans → sets: same slow axis, line rate, size and channel, in order of time.

use std::cmp::Ordering;

use crate::caveat::Caveat;
use crate::caveat::kinds::each_kind_once;
use crate::frame::axis::Axis;
use crate::scan::measured::MeasuredScan;
use crate::settings::knobs::Grouping;

/// Line rates and sizes that differ by less than this share are the same: headers round them.
pub(crate) const SAME: f64 = 0.01;

/// The scans of one set, in order of time; at the end those that repeat others.
pub(crate) struct Group {
    pub(crate) name: String,
    pub(crate) slow_axis: Axis,
    pub(crate) line_rate_hz: f64,
    pub(crate) channel: String,
    pub(crate) scans: Vec<MeasuredScan>,
    /// How many times the cell of these scans is that of others beside them, or theirs of it, where one may be a harmonic shell of the other.
    pub(crate) other_shell: Option<i32>,
}

impl Group {
    /// What its scans doubt: those that are used together, each other one by itself.
    pub(crate) fn caveats(&self) -> Vec<Caveat> {
        let scans = self.scans.iter().filter(|scan| scan.repeats.is_none());
        let (used, others): (Vec<_>, Vec<_>) = scans.partition(|scan| scan.excluded.is_none());
        let mut told = each_kind_once(&self.name, used.into_iter().map(|scan| &scan.caveats));
        let alone = |scan: &MeasuredScan| each_kind_once(&scan.file, [&scan.caveats]);
        told.extend(others.into_iter().flat_map(alone));
        told
    }
}

/// Groups scans; the groups are in order of their first scans. Scans that repeat others go with them.
pub(crate) fn groups(mut scans: Vec<MeasuredScan>, grouping: Grouping) -> Vec<Group> {
    scans.sort_by(by_time);
    let (repeated, scans): (Vec<_>, Vec<_>) = scans.into_iter().partition(|s| s.repeats.is_some());
    let mut groups: Vec<Group> = Vec::new();
    for scan in scans {
        let Some(line) = scan.lines.first() else {
            continue;
        };
        let slow_axis = line.geometry.slow_axis();
        let rate = scan.line_rate_hz.unwrap_or(f64::NAN);
        let fits = |group: &Group| {
            let other = &group.scans[0];
            if scan.set.is_some() || other.set.is_some() {
                return scan.set == other.set;
            }
            let same_rate = rate == group.line_rate_hz
                || (rate - group.line_rate_hz).abs() < SAME * rate.abs()
                || (rate.is_nan() && group.line_rate_hz.is_nan());
            let same_size = match (scan.size_nm, other.size_nm) {
                (Some(a), Some(b)) => a.iter().zip(b).all(|(a, b)| (a - b).abs() < SAME * b),
                (a, b) => a == b,
            };
            // Unfinished frames have fewer lines and belong to the set all the same.
            let same_pixels = line.frame_columns == other.lines[0].frame_columns;
            slow_axis == group.slow_axis
                && same_rate
                && same_size
                && same_pixels
                && scan.channel == group.channel
                && match grouping {
                    Grouping::Auto => true,
                    Grouping::Folder => folder(&scan.file) == folder(&other.file),
                    Grouping::File => false,
                }
        };
        if let Some(group) = groups.iter_mut().find(|g| fits(g)) {
            group.scans.push(scan);
        } else {
            groups.push(Group {
                name: String::new(),
                slow_axis,
                line_rate_hz: rate,
                channel: scan.channel.clone(),
                scans: vec![scan],
                other_shell: None,
            });
        }
    }
    name(&mut groups);
    for scan in repeated {
        let with = |group: &&mut Group| {
            let mut files = group.scans.iter().map(|s| &s.file);
            files.any(|file| Some(file) == scan.repeats.as_ref())
        };
        if let Some(group) = groups.iter_mut().find(with) {
            group.scans.push(scan);
        }
    }
    groups
}

/// The folder part of a path, whatever its separators.
pub(crate) fn folder(file: &str) -> &str {
    file.rfind(['/', '\\']).map_or("", |i| &file[..i])
}

fn by_time(a: &MeasuredScan, b: &MeasuredScan) -> Ordering {
    // Headers hold whole seconds: files of the same second follow their names.
    let named = || natural_order(&a.file, &b.file);
    match (a.acquired, b.acquired) {
        (Some(ta), Some(tb)) => ta.cmp(&tb).then_with(named),
        (None, None) => named(),
        (a, b) => b.is_some().cmp(&a.is_some()),
    }
}

/// Compares names with their numbers as numbers: `scan.9` comes before `scan.10`.
pub fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a, b);
    loop {
        let number = |s: &str| s.bytes().take_while(u8::is_ascii_digit).count();
        let (na, nb) = (number(a), number(b));
        let order = if na > 0 && nb > 0 {
            let (ta, tb) = (
                a[..na].trim_start_matches('0'),
                b[..nb].trim_start_matches('0'),
            );
            let order = ta.len().cmp(&tb.len()).then_with(|| ta.cmp(tb));
            (a, b) = (&a[na..], &b[nb..]);
            order
        } else {
            let (mut ca, mut cb) = (a.chars(), b.chars());
            let (x, y) = (ca.next(), cb.next());
            if x.is_none() && y.is_none() {
                return Ordering::Equal;
            }
            (a, b) = (ca.as_str(), cb.as_str());
            x.cmp(&y)
        };
        if order != Ordering::Equal {
            return order;
        }
    }
}

/// Names sets by what tells them apart, for people.
fn name(groups: &mut [Group]) {
    let mut names: Vec<String> = Vec::new();
    for group in groups.iter() {
        let axis = match group.slow_axis {
            Axis::X => "x",
            Axis::Y => "y",
        };
        let mut name = format!("slow {axis}");
        if group.line_rate_hz.is_finite() {
            let rate = (group.line_rate_hz * 100.0).round() / 100.0;
            name = format!("{name}, {rate} Hz");
        }
        if groups.iter().any(|g| g.channel != group.channel) {
            name = format!("{name}, {}", group.channel);
        }
        if let Some(given) = group.scans.first().and_then(|s| s.set.clone()) {
            name = given;
        }
        let mut unique = name.clone();
        let mut count = 1;
        while names.contains(&unique) {
            count += 1;
            unique = format!("{name} ({count})");
        }
        names.push(unique);
    }
    for (group, name) in groups.iter_mut().zip(names) {
        group.name = name;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count_as_numbers() {
        let mut names = ["b.10", "b.9", "a.100", "b.010x", "b"];
        names.sort_by(|a, b| natural_order(a, b));
        assert_eq!(names, ["a.100", "b", "b.9", "b.10", "b.010x"]);
    }

    #[test]
    fn folders_of_either_separator() {
        assert_eq!(folder("C:\\data\\a\\scan.1"), "C:\\data\\a");
        assert_eq!(folder("data/a/scan.1"), "data/a");
        assert_eq!(folder("scan.1"), "");
    }
}
