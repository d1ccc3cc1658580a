//! Whether an image shows stripes: waves that stand out of the noise, and their overtones.
//!
//! In: the trace and the retrace of one frame, background gone. Out: patterns, each one wave vector, strongest first.
//!
//! A local maximum P of the periodogram is compared with the noise as it would be without it, three ways: in the bins
//! around it, at all wave vectors of its length (terrain is the same in all directions), and at all wave vectors with
//! its component along the lines (noise in time is a function of that alone). The least of the three counts. For a
//! mean known from n independent bins the chance of such a maximum among N is `N (1 + P/(n⟨P⟩))^{−n}`.
//! A wave along the slow axis does not count: it looks like offsets of lines. Waves of pick-up run the other way in
//! the retrace and are left out where there is one.

use std::f64::consts::{LN_2, TAU};

use nalgebra::Vector2;

use crate::frame::image::Image;
use crate::numbers::median::median;
use crate::spectrum::transform::Spectrum;
use crate::stripes::wave::ORDERS;

/// Fewer periods than this across the frame are terrain. Half and twice as much change no result of docs/constants.md.
const FEWEST: f64 = 3.0;
/// Cycles per pixel at the limit of sampling: 2.5 pixels per period, as for lattices.
const FASTEST: f64 = 0.4;
/// Waves with fewer cycles along the lines are offsets of lines, which the window spreads to one.
const ALONG: f64 = 1.25;
/// Local maxima that are looked at, highest first: many more than patterns have.
const MAXIMA: usize = 200;
/// A maximum has log₁₀ of its chance below this (one in thirty): weak overtones count, ...
const MEMBER: f64 = -1.5;
/// ... and a pattern has a sum of those below this: one in 10⁵ by chance.
const PATTERN: f64 = -5.0;
/// Bins nearer than this are the maximum itself: the main lobe of the window and half a bin.
const OWN: f64 = 2.5;
/// Bins around a maximum end here. Chosen by eye.
const AROUND: f64 = 8.0;
/// An overtone may be off by this many cycles: one bin, ...
const OFF: f64 = 1.0;
/// ... or by this share: stripes bend. Chosen by eye.
const OFF_SHARE: f64 = 0.12;
/// Largest difference of trace and retrace by drift and hysteresis, cycles per frame. Chosen by eye.
const APART: f64 = 1.5;
/// Two patterns whose wave vectors differ by less than this share are one that changes; 14° of direction.
pub(crate) const SAME: f64 = 0.25;
/// Patterns that are told apart: a herringbone has three directions.
const MOST: usize = 3;
/// Parts along each axis, one after the other: a pattern that changes across the frame is sharp in its parts.
const PARTS: [usize; 3] = [1, 2, 4];
/// Pixels are no more elongated than this: a guard against sizes that headers get wrong.
const THINNEST: f64 = 1e3;
/// Parts have this many pixels along each axis: a few periods of some pixels. On the scenes of docs/constants.md half and double change no result.
const SMALLEST: usize = 64;

/// A wave that stands out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pattern {
    /// Wave vector, rad per pixel.
    pub(crate) wave: Vector2<f64>,
    /// log₁₀ of the chance that noise makes it, all images of this size taken together.
    pub(crate) log_chance: f64,
    /// Power of its maxima.
    power: f64,
}

/// A local maximum: cycles per frame, power, log₁₀ of its chance.
#[derive(Clone, Copy, Debug)]
struct Maximum {
    cycles: Vector2<f64>,
    power: f64,
    log_chance: f64,
}

/// The patterns of images of one frame (trace, retrace), none where there is nothing but noise. `pitch`: nm per pixel.
pub(crate) fn find(images: &[&Image], pitch: [f64; 2]) -> Vec<Pattern> {
    let Some(first) = images.first() else {
        return Vec::new();
    };
    // Waves of one length then lie on an ellipse so thin that it holds no bins.
    let [narrow, wide] = [pitch[0].min(pitch[1]), pitch[0].max(pitch[1])];
    if !(wide <= THINNEST * narrow) {
        return Vec::new();
    }
    for parts in PARTS {
        let size = [first.columns / parts, first.rows / parts];
        if size[0].min(size[1]) < SMALLEST && parts > 1 {
            break;
        }
        let mut found: Vec<Pattern> = Vec::new();
        for part in 0..parts * parts {
            let corner = [(part % parts) * size[0], (part / parts) * size[1]];
            let cut: Vec<Image> = images.iter().map(|i| i.cropped(corner, size)).collect();
            let tried = ((parts * parts * PARTS.len()) as f64).log10();
            for pattern in patterns(&cut, pitch, tried) {
                let same = |p: &&mut Pattern| {
                    let near =
                        |w: Vector2<f64>| metric(w - p.wave, pitch) < SAME * metric(p.wave, pitch);
                    near(pattern.wave) || near(-pattern.wave)
                };
                match found.iter_mut().find(same) {
                    Some(known) => known.power += pattern.power,
                    None => found.push(pattern),
                }
            }
        }
        if !found.is_empty() {
            found.sort_by(|a, b| b.power.total_cmp(&a.power));
            found.truncate(MOST);
            return found;
        }
    }
    Vec::new()
}

fn metric(wave: Vector2<f64>, pitch: [f64; 2]) -> f64 {
    (wave.x / pitch[0]).hypot(wave.y / pitch[1])
}

/// The patterns of one part; `tried` is log₁₀ of the number of parts.
fn patterns(images: &[Image], pitch: [f64; 2], tried: f64) -> Vec<Pattern> {
    let [size, ..] = images else {
        return Vec::new();
    };
    let frame = Vector2::new(size.columns as f64, size.rows as f64);
    let mut maxima = common(images, pitch);
    let mut found: Vec<Pattern> = Vec::new();
    while found.len() < MOST {
        // Fundamentals that explain maxima: one of them, or the difference of two in line.
        let mut proposed: Vec<Vector2<f64>> = maxima.iter().map(|m| m.cycles).collect();
        for (i, a) in maxima.iter().enumerate() {
            for b in &maxima[..i] {
                let apart = a.cycles - b.cycles;
                let shorter = a.cycles.norm().min(b.cycles.norm());
                if apart.perp(&a.cycles).abs() < OFF * a.cycles.norm()
                    && apart.norm() > FEWEST
                    && apart.norm() < 0.8 * shorter
                {
                    proposed.push(apart * apart.dot(&a.cycles).signum());
                }
            }
        }
        let explained = |q: &Vector2<f64>| -> (f64, f64) {
            (1..=ORDERS)
                .filter_map(|n| {
                    let members = maxima.iter().filter(|m| belongs(m, q, n));
                    members.min_by(|a, b| a.log_chance.total_cmp(&b.log_chance))
                })
                .fold((0.0, 0.0), |(l, p), m| (l + m.log_chance, p + m.power))
        };
        // The same for less is more: a period twice as long explains no worse.
        let cost = |q: &Vector2<f64>| explained(q).0 - 0.01 * q.norm();
        let Some(best) = proposed
            .iter()
            .min_by(|a, b| cost(a).total_cmp(&cost(b)))
            .copied()
        else {
            break;
        };
        let (log_chance, power) = explained(&best);
        if log_chance + tried > PATTERN {
            break;
        }
        maxima.retain(|m| (1..=ORDERS).all(|n| !is_near(m, &best, n)));
        found.push(Pattern {
            wave: TAU * best.component_div(&frame),
            log_chance: log_chance + tried,
            power,
        });
    }
    found
}

/// Whether a maximum is the n-th harmonic of q.
fn belongs(m: &Maximum, q: &Vector2<f64>, n: i32) -> bool {
    let off = (m.cycles - q * f64::from(n)).norm();
    off < OFF.max(OFF_SHARE * f64::from(n) * q.norm())
}

/// Whether it is so near to it that it is a part of it.
fn is_near(m: &Maximum, q: &Vector2<f64>, n: i32) -> bool {
    let harmonic = q * f64::from(n);
    let off = (m.cycles - harmonic)
        .norm()
        .min((m.cycles + harmonic).norm());
    off < OWN.max(SAME * harmonic.norm())
}

/// The maxima that all images show.
fn common(images: &[Image], pitch: [f64; 2]) -> Vec<Maximum> {
    let mut all = images.iter().map(|image| maxima(image, pitch));
    let Some(mut kept) = all.next() else {
        return Vec::new();
    };
    for other in all {
        kept.retain_mut(|m| {
            let same = other
                .iter()
                .filter(|o| (o.cycles - m.cycles).norm() < APART);
            let Some(same) = same.min_by(|a, b| a.log_chance.total_cmp(&b.log_chance)) else {
                return false;
            };
            // Trace and retrace share noise: the worse one counts.
            m.log_chance = m.log_chance.max(same.log_chance);
            m.power = m.power.min(same.power);
            true
        });
    }
    kept
}

fn maxima(image: &Image, pitch: [f64; 2]) -> Vec<Maximum> {
    let spectrum = Spectrum::unpadded(image);
    let power = Power {
        spectrum: &spectrum,
        size: [image.columns as i64, image.rows as i64],
        per_cycle: [0, 1].map(|i| 1.0 / ([image.columns, image.rows][i] as f64 * pitch[i])),
    };
    let [columns, rows] = power.size;
    let limit = [0, 1].map(|i| (FASTEST * power.size[i] as f64) as i64);
    let trials = (2.0 * limit[0] as f64 * limit[1] as f64 / (1.5 * 1.5)).log10();
    let mut found = Vec::new();
    for x in (ALONG as i64 + 1)..=limit[0].min(columns / 2 - 1) {
        for y in -limit[1]..=limit[1].min(rows / 2 - 1) {
            let here = power.at(x, y);
            let neighbours = (-1..=1).flat_map(|i| (-1..=1).map(move |j| (i, j)));
            let highest = neighbours
                .filter(|d| *d != (0, 0))
                .all(|(i, j)| power.at(x + i, y + j) <= here);
            if here > 0.0 && highest && (x as f64).hypot(y as f64) > FEWEST - 0.5 {
                found.push((here, x, y));
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(MAXIMA);
    let assessed = found.into_iter().map(|(height, x, y)| Maximum {
        cycles: power.refined(x, y),
        power: height,
        log_chance: trials + power.log_chance(x, y),
    });
    assessed
        .filter(|m| m.log_chance < MEMBER && m.cycles.norm() > FEWEST && m.cycles.x > ALONG)
        .collect()
}

/// A periodogram of whole cycles per frame.
struct Power<'a> {
    spectrum: &'a Spectrum,
    size: [i64; 2],
    /// 1/nm for one cycle per frame.
    per_cycle: [f64; 2],
}

impl Power<'_> {
    /// Power at (x, y) cycles per frame.
    fn at(&self, x: i64, y: i64) -> f64 {
        let (x, y) = if x < 0 { (-x, -y) } else { (x, y) };
        self.spectrum
            .power(x as usize, y.rem_euclid(self.size[1]) as usize)
    }

    /// A maximum between bins: parabolas through the logarithms.
    fn refined(&self, x: i64, y: i64) -> Vector2<f64> {
        let log = |i: i64, j: i64| self.at(x + i, y + j).max(f64::MIN_POSITIVE).ln();
        let top = |low: f64, high: f64| {
            let bend = low + high - 2.0 * log(0, 0);
            if bend < 0.0 {
                (0.5 * (low - high) / bend).clamp(-0.5, 0.5)
            } else {
                0.0
            }
        };
        Vector2::new(
            x as f64 + top(log(-1, 0), log(1, 0)),
            y as f64 + top(log(0, -1), log(0, 1)),
        )
    }

    /// log₁₀ of the chance that one bin of noise is as high as this.
    fn log_chance(&self, x: i64, y: i64) -> f64 {
        let height = self.at(x, y);
        let [around, ring, column] = [self.around(x, y), self.ring(x, y), self.column(x, y)];
        let chance = |mut bins: Vec<f64>| {
            // The median of a quarter as many: neighbouring bins share the window, and medians are worth half a mean.
            let n = (bins.len() as f64 / 4.0).max(1.0);
            let mean = median(&mut bins) / LN_2;
            if mean > 0.0 {
                -n * (height / (n * mean)).ln_1p() / std::f64::consts::LN_10
            } else {
                0.0
            }
        };
        chance(around).max(chance(ring)).max(chance(column))
    }

    fn around(&self, x: i64, y: i64) -> Vec<f64> {
        let reach = AROUND as i64;
        let places = (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| (i, j)));
        places
            .filter(|(i, j)| (*i as f64).hypot(*j as f64) < AROUND)
            .map(|(i, j)| (x + i, y + j))
            .filter(|&at| self.is_inside(at) && is_far(at, (x, y)))
            .map(|(u, v)| self.at(u, v))
            .collect()
    }

    fn is_inside(&self, (x, y): (i64, i64)) -> bool {
        x.abs() < self.size[0] / 2 && y.abs() < self.size[1] / 2
    }

    /// Wave vectors of the same length.
    fn ring(&self, x: i64, y: i64) -> Vec<f64> {
        let [u, v] = self.per_cycle;
        let length = (x as f64 * u).hypot(y as f64 * v);
        let wide = 1.5 * u.max(v);
        let mut out = Vec::new();
        for i in 0..=((length + wide) / u) as i64 {
            let along = i as f64 * u;
            let [low, high] =
                [length - wide, length + wide].map(|l| (l * l - along * along).max(0.0).sqrt() / v);
            for j in low.ceil() as i64..=high as i64 {
                // A wave and its mirror image are one.
                let mirrored = (i != 0 && j != 0).then_some((i, -j));
                for at in [(i, j)].into_iter().chain(mirrored) {
                    if self.is_inside(at) && is_far(at, (x, y)) {
                        out.push(self.at(at.0, at.1));
                    }
                }
            }
        }
        out
    }

    /// Wave vectors with the same component along the lines.
    fn column(&self, x: i64, y: i64) -> Vec<f64> {
        let reach = (0.45 * self.size[1] as f64) as i64;
        let all = (-reach..=reach).map(|j| (x, j));
        all.filter(|&at| is_far(at, (x, y)))
            .map(|(u, v)| self.at(u, v))
            .collect()
    }
}

/// Whether a bin is neither near another one nor near its mirror image.
fn is_far((x, y): (i64, i64), (u, v): (i64, i64)) -> bool {
    let off = |s: i64| ((x - s * u) as f64).hypot((y - s * v) as f64);
    off(1) > OWN && off(-1) > OWN
}
