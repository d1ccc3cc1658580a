//! Is it one scan or are they two? The same data under other names, in other formats or units count once.
//!
//! A scan is known by the bytes of its file, where whoever read it tells their hash, and by its pixels: two images
//! of equal shape whose values, freed of plane and scale, agree far better than the noise of two scans allows.
//! Where there is no noise to tell by (simulations), frames of another direction, time or size are other frames.

use crate::campaign::group::SAME;
use crate::campaign::shells::counts;
use crate::caveat::Caveat;
use crate::caveat::files::FileDoubt;
use crate::scan::measured::{MeasuredLine, MeasuredScan};

/// Rounding of formats with single precision or 16 bits, in standard deviations of the image.
const ROUNDING: f64 = 1e-3;
/// Copies of few bits round to some share of the noise; two scans differ by 1.4 times the noise.
const OF_NOISE: f64 = 0.2;
/// Where headers say that it is another frame, copies have to agree to this share of the noise, …
const CERTAIN: f64 = 0.05;
/// … and the noise has to be this share of the image: it is no rounding then and no misfit of the lattice.
const NOISY: f64 = 0.02;

/// Noise of a pixel in standard deviations of the image: the lesser of what its neighbours and the first harmonics of
/// the fit see. What the sample shows beside the lattice is in the latter.
fn noise(line: &MeasuredLine) -> f64 {
    let beside = line.pixels.noise();
    if line.lattice.fit.is_none() {
        return beside;
    }
    let [columns, rows] = line.geometry.size;
    // Three harmonics of amplitude A make a variance of 3A²/2, and σ = A √(N/2)/(√2 · snr).
    let pixels = (columns * rows) as f64;
    let fitted = pixels.sqrt() / (2.0 * line.lattice.signal_to_noise) * (2.0_f64 / 3.0).sqrt();
    fitted.min(beside)
}

/// Whether two scans hold the same data.
pub(crate) fn same(a: &MeasuredScan, b: &MeasuredScan) -> bool {
    let both = |a: &MeasuredLine, b: &MeasuredLine| {
        if a.line != b.line {
            return None;
        }
        let noise = noise(a).min(noise(b));
        let limit = ROUNDING.max(OF_NOISE * noise);
        Some((a.pixels.difference(&b.pixels, limit)?, noise))
    };
    let pairs = a
        .lines
        .iter()
        .flat_map(|x| b.lines.iter().map(move |y| (x, y)));
    let found: Vec<(f64, f64)> = pairs.filter_map(|(x, y)| both(x, y)).collect();
    if found.is_empty() {
        return false;
    }
    let same_bytes = a.digest.is_some() && a.digest == b.digest;
    let certain =
        |(difference, noise): &(f64, f64)| *noise > NOISY && *difference < CERTAIN * noise;
    same_bytes || !said_to_differ(a, b) || found.iter().any(certain)
}

/// Whether their headers say that they are different frames.
fn said_to_differ(a: &MeasuredScan, b: &MeasuredScan) -> bool {
    fn other<T: PartialEq>(a: Option<T>, b: Option<T>) -> bool {
        matches!((a, b), (Some(a), Some(b)) if a != b)
    }
    let sizes = a.size_nm.zip(b.size_nm);
    let other_size = |(a, b): ([f64; 2], [f64; 2])| {
        let mut sides = a.iter().zip(b);
        sides.any(|(a, b)| (a - b).abs() > SAME * b)
    };
    other(a.frame_direction, b.frame_direction)
        || other(a.acquired, b.acquired)
        || sizes.is_some_and(other_size)
}

/// How much a scan tells beside its pixels: of equal ones the first of those that tell most is used.
fn knowledge(scan: &MeasuredScan) -> [usize; 4] {
    let of_lines =
        |known: fn(&MeasuredLine) -> bool| scan.lines.iter().filter(|l| known(l)).count();
    [
        of_lines(|l| l.geometry.from_sensors),
        of_lines(|l| l.timing.is_some()),
        usize::from(scan.acquired.is_some()),
        scan.lines.len(),
    ]
}

/// Marks the scans that repeat another one, which is used: each frame counts once.
pub(crate) fn mark_repeats(scans: &mut [MeasuredScan], caveats: &mut Vec<Caveat>) {
    let mut order: Vec<usize> = (0..scans.len()).filter(|&i| counts(&scans[i])).collect();
    order.sort_by_key(|&i| std::cmp::Reverse(knowledge(&scans[i])));
    let mut kept: Vec<usize> = Vec::new();
    for i in order {
        let original = kept.iter().find(|&&k| same(&scans[k], &scans[i]));
        let Some(&original) = original else {
            kept.push(i);
            continue;
        };
        let of = scans[original].file.clone();
        scans[i].excluded = Some(format!("it repeats {of}"));
        scans[i].repeats = Some(of);
    }
    for scan in scans.iter() {
        if let Some(of) = &scan.repeats {
            caveats.push(about_repeat(&scan.file, of));
        }
    }
}

/// The scans without those that repeat another one, and the words about these.
pub(crate) fn once(mut scans: Vec<MeasuredScan>) -> (Vec<MeasuredScan>, Vec<Caveat>) {
    let mut caveats = Vec::new();
    mark_repeats(&mut scans, &mut caveats);
    scans.retain(|scan| scan.repeats.is_none());
    (scans, caveats)
}

/// The caveat about a file that holds the data of another one, `of`, or is that file.
pub fn about_repeat(file: &str, of: &str) -> Caveat {
    let of = (file != of).then(|| of.to_owned());
    Caveat::new(FileDoubt::SameScanTwice { of }, file)
}
