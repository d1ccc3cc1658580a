//! Do the scans of a set show one lattice? Only those that do share a drift and a mean.
//!
//! Drift changes a reciprocal lattice along the time gradient alone, `K = G − u (D·G)`, and u is the slow axis but for
//! parts in a thousand: what a wave vector has along the fast axis is the same in all scans of a sample, up or down,
//! whatever the drift does. Two numbers of each scan are compared there; along the slow axis lattices may differ by what
//! a plausible drift makes of them. How the vectors are named does not matter.

use heterostrain::lattice::{Waves, same_handed};
use nalgebra::Vector2;

use crate::campaign::group::{Group, folder};
use crate::campaign::set::moire::moire;
use crate::campaign::shells::of_each_other;
use crate::caveat::Caveat;
use crate::caveat::sets::{DifferentSamples, SetDoubt};
use crate::scan::measured::MeasuredScan;
use crate::settings::knobs::Settings;

/// Lattices whose waves differ by more than this share along the fast axis are of different samples, or places:
/// scanners repeat themselves better. See docs/constants.md.
const APART: f64 = 0.01;
/// The same for methods that read peaks off pixels, which are off by a per cent, and for atoms at one place without position sensors: creep
/// and hysteresis make 1 to 2 % between frames up and down, or between trace and retrace.
const APART_ROUGHLY: f64 = 0.03;
/// Differences below this many σ are noise, however large: none of all pairs of scans exceeds it by chance.
const SIGMAS: f64 = 5.0;
/// Drift of the sample over the slow speed of the tip that has to be reckoned with. Half and twice as much change no
/// result of docs/constants.md.
const DRIFT: f64 = 0.25;

/// How one scan shows its lattice.
struct View {
    waves: Waves,
    /// Unit vector of the fast axis.
    fast: Vector2<f64>,
    /// Lines follow each other along this one; unknown directions make zero.
    slow: Vector2<f64>,
}

impl View {
    fn of(scan: &MeasuredScan) -> Option<Self> {
        let line = scan.lines.first()?;
        let steps = line.geometry.pixel_to_nm;
        let gradient = line.timing.and_then(|t| line.geometry.time_gradient(&t));
        Some(Self {
            waves: line.in_sensor_coordinates().waves()?,
            fast: steps.column(0).normalize(),
            slow: gradient.map_or_else(Vector2::zeros, |u| u.normalize()),
        })
    }

    /// By how much the waves of another scan differ along the fast axis, as a share of them, where that is more than
    /// noise and the names are those with which they differ least; 0 for the same lattice under another drift.
    fn apart(&self, other: &Self, limit: f64) -> f64 {
        let [a, b] = [0, 1].map(|i| self.waves.vector(i).norm());
        let size = f64::midpoint(a, b);
        let across = Vector2::new(-self.fast.y, self.fast.x);
        // Fast axes that differ see different parts of the drift.
        let turned = self.fast.perp(&other.fast).abs();
        let change = if self.slow.dot(&other.slow) > 0.0 {
            DRIFT
        } else {
            2.0 * DRIFT
        };
        let mut least = f64::INFINITY;
        for names in same_handed(1) {
            let named = other.waves.relabelled(&names);
            let miss = named.basis - self.waves.basis;
            let covariance = named.covariance + self.waves.covariance;
            let mut worst = 0.0_f64;
            for (i, wave) in miss.column_iter().enumerate() {
                let spread = covariance.fixed_view::<2, 2>(2 * i, 2 * i);
                let noise = (self.fast.transpose() * spread * self.fast)[0]
                    .max(0.0)
                    .sqrt();
                let room = (limit + turned * change) * size;
                let along = wave.dot(&self.fast).abs();
                if along > room.max(SIGMAS * noise) {
                    worst = worst.max(along / size);
                }
                if wave.dot(&across).abs() > change * size {
                    worst = f64::INFINITY;
                }
            }
            least = least.min(worst);
        }
        least
    }
}

/// Scans that show one lattice, by their numbers; each part in order. Those that are not used are in none.
struct Parts {
    parts: Vec<Vec<usize>>,
    /// The least difference between two parts, as a share.
    apart: f64,
}

/// Whether a difference of two scans is that of the scanner. No moiré of the layers is as short, so that they show atoms, whose length is known (that of a
/// moiré differs from place to place); headers say that they show one place (one folder, dates, frames that hold the middle of each other); no position
/// sensor says how the scanner moved.
fn are_atoms_of_one_place(a: &MeasuredScan, b: &MeasuredScan, settings: &Settings) -> bool {
    let told = |scan: &MeasuredScan| {
        let line = scan.lines.first()?;
        let frame = &line.geometry;
        let atoms = moire(&line.in_sensor_coordinates(), settings).is_none();
        let known = atoms && scan.acquired.is_some() && !frame.from_sensors;
        known.then(|| (frame.centre(), frame.extent()))
    };
    let (Some((one, extent)), Some((other, size))) = (told(a), told(b)) else {
        return false;
    };
    let holds = |size: [f64; 2]| (one - other).norm() < 0.5 * size[0].min(size[1]);
    folder(&a.file) == folder(&b.file) && holds(extent) && holds(size)
}

fn parts(scans: &[MeasuredScan], settings: &Settings) -> Parts {
    let views: Vec<(usize, View)> = scans
        .iter()
        .enumerate()
        .filter(|(_, scan)| scan.excluded.is_none())
        .filter_map(|(i, scan)| Some((i, View::of(scan)?)))
        .collect();
    let mut parts: Vec<Vec<usize>> = Vec::new();
    let file = |view: usize| scans[views[view].0].file.as_str();
    let apart = |a: usize, b: usize| {
        let ((i, one), (k, other)) = (&views[a], &views[b]);
        let roughly =
            !settings.method.is_joint() || are_atoms_of_one_place(&scans[*i], &scans[*k], settings);
        one.apart(other, if roughly { APART_ROUGHLY } else { APART })
    };
    for new in 0..views.len() {
        let like = |part: &Vec<usize>| {
            let mut known = part.iter();
            known.any(|&k| apart(k, new) == 0.0)
        };
        let mut joined = vec![new];
        let mut others = Vec::new();
        for part in parts {
            // Grains of one scan are never one lattice, however little is known of them.
            let beside = joined
                .iter()
                .any(|&a| part.iter().any(|&b| file(a) == file(b)));
            if like(&part) && !beside {
                joined.extend(part);
            } else {
                others.push(part);
            }
        }
        others.push(joined);
        parts = others;
    }
    let mut least = f64::INFINITY;
    for (i, first) in parts.iter().enumerate() {
        for second in &parts[i + 1..] {
            least = least.min(apart(first[0], second[0]));
        }
    }
    for part in &mut parts {
        for scan in part.iter_mut() {
            *scan = views[*scan].0;
        }
        part.sort_unstable();
    }
    parts.sort_unstable();
    Parts {
        parts,
        apart: least,
    }
}

/// Makes sets of their own of scans that show different lattices, and says so; of grains those that are not wanted go. Also
/// whether there are such.
pub(crate) fn separated(
    groups: Vec<Group>,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) -> (Vec<Group>, bool) {
    let mut all: Vec<Group> = Vec::new();
    let mut any = false;
    let wanted = |grain: usize| settings.grain.is_none_or(|wanted| wanted == grain);
    for group in groups {
        let Parts { parts, apart } = parts(&group.scans, settings);
        let grains = are_grains(&group, &parts);
        // Scans that show one lattice show one grain.
        if !grains && !wanted(1) {
            continue;
        }
        if parts.len() < 2 {
            all.push(group);
            continue;
        }
        let names = names(&group, &parts);
        let by_hand = group.scans.iter().any(|s| s.set.is_some());
        // Of grains the scans have said it themselves.
        if !grains {
            caveats.push(about(&group, &names, apart, by_hand));
        }
        if by_hand {
            all.push(group);
            continue;
        }
        any = true;
        let split = (1..).zip(split(group, &parts, names));
        all.extend(split.filter(|(i, _)| !grains || wanted(*i)).map(|(_, g)| g));
    }
    for i in 1..all.len() {
        let (before, rest) = all.split_at_mut(i);
        let mut count = 1;
        let name = rest[0].name.clone();
        while before.iter().any(|g| g.name == rest[0].name) {
            count += 1;
            rest[0].name = format!("{name} ({count})");
        }
    }
    (all, any)
}

fn about(group: &Group, names: &[String], apart: f64, by_hand: bool) -> Caveat {
    let samples = DifferentSamples {
        count: names.len(),
        names: names.join("; "),
        apart,
    };
    let doubt = if by_hand {
        SetDoubt::SamplesMixed(samples)
    } else {
        SetDoubt::SamplesSeparated(samples)
    };
    Caveat::new(doubt, &group.name)
}

/// Whether some scan is in several parts: they are grains that lie side by side.
fn are_grains(group: &Group, parts: &[Vec<usize>]) -> bool {
    let file = |i: &usize| group.scans[*i].file.as_str();
    let mut seen: Vec<&str> = parts.iter().flatten().map(file).collect();
    let all = seen.len();
    seen.sort_unstable();
    seen.dedup();
    seen.len() < all
}

/// What tells the parts apart, for people: their folders, the number of the grain, or the periods of their lattices.
fn names(group: &Group, parts: &[Vec<usize>]) -> Vec<String> {
    if are_grains(group, parts) {
        return (1..=parts.len()).map(|i| format!("grain {i}")).collect();
    }
    let folders: Vec<Vec<Vec<&str>>> = parts
        .iter()
        .map(|part| {
            let all = part.iter().map(|&i| folder(&group.scans[i].file));
            let mut all: Vec<Vec<&str>> = all.map(|f| f.split(['/', '\\']).collect()).collect();
            all.sort();
            all.dedup();
            all
        })
        .collect();
    let shared = |a: &Vec<Vec<&str>>, b: &Vec<Vec<&str>>| a.iter().any(|f| b.contains(f));
    let mut pairs = (0..parts.len()).flat_map(|i| (0..i).map(move |k| (i, k)));
    if pairs.any(|(i, k)| shared(&folders[i], &folders[k])) {
        let period = |part: &Vec<usize>| {
            let line = group.scans[part[0]].lines.first()?;
            let lattice = line.in_sensor_coordinates();
            let mean = (0..3).map(|i| lattice.wavelength(i).value).sum::<f64>() / 3.0;
            Some(format!("{mean:.2} nm"))
        };
        return parts
            .iter()
            .map(|p| period(p).unwrap_or_default())
            .collect();
    }
    let all: Vec<&Vec<&str>> = folders.iter().flatten().collect();
    let common =
        (0..).take_while(|&i| all.iter().all(|f| i < f.len() && f.get(i) == all[0].get(i)));
    let common = common.count();
    let rest = |f: &Vec<&str>| match f[common..].join("/") {
        rest if rest.is_empty() => f.last().copied().unwrap_or_default().to_owned(),
        rest => rest,
    };
    let name = |of: &Vec<Vec<&str>>| of.iter().map(rest).collect::<Vec<_>>().join(" + ");
    folders.iter().map(name).collect()
}

/// One group for each part; scans that are not used go with the one that they repeat, or with the first.
fn split(group: Group, parts: &[Vec<usize>], names: Vec<String>) -> Vec<Group> {
    let of = |i: usize| parts.iter().position(|part| part.contains(&i));
    let other_shell = other_shell(&group, parts);
    let files: Vec<String> = group.scans.iter().map(|s| s.file.clone()).collect();
    let places: Vec<usize> = (0..group.scans.len())
        .map(|i| {
            let repeated = group.scans[i].repeats.as_ref();
            let original = repeated.and_then(|of| files.iter().position(|f| f == of));
            of(i).or_else(|| of(original?)).unwrap_or(0)
        })
        .collect();
    let mut all: Vec<Group> = names
        .into_iter()
        .map(|name| Group {
            name: format!("{}, {name}", group.name),
            slow_axis: group.slow_axis,
            line_rate_hz: group.line_rate_hz,
            channel: group.channel.clone(),
            scans: Vec::new(),
            other_shell,
        })
        .collect();
    for (scan, place) in group.scans.into_iter().zip(places) {
        all[place].scans.push(scan);
    }
    all
}

/// How many times the cell of one part is that of another from the same folder: where noise hides the first waves in some frames, those show a
/// harmonic shell, and no other sample.
fn other_shell(group: &Group, parts: &[Vec<usize>]) -> Option<i32> {
    let scan = |part: &Vec<usize>| &group.scans[part[0]];
    let first = |part| scan(part).lines.first();
    let mut pairs = (0..parts.len()).flat_map(|i| (0..i).map(move |k| (&parts[i], &parts[k])));
    pairs.find_map(|(a, b)| {
        if folder(&scan(a).file) != folder(&scan(b).file) {
            return None;
        }
        of_each_other(first(a)?, first(b)?)
    })
}
