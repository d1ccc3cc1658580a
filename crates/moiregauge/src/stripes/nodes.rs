//! The waves of all patterns → nodes: which pattern is the strongest, what is to be believed, phases.

use nalgebra::{Matrix2, Matrix4, Vector2};

use crate::frame::image::Image;
use crate::map::defects::{Setting, bend, is_improbable, near};
use crate::map::displacement;
use crate::numbers::median::median;
use crate::stripes::fit;
use crate::stripes::types::{NoStripes, StripeMap, StripeNode, StripePattern};
use crate::stripes::wave::{Local, Wave};
use crate::window::mask::Mask;
use crate::window::smooth::{Envelope, Nodes, Smoothed};
use crate::window::types::{Reference, UsedHarmonic, WaveMap, WaveNode};
use crate::window::widths::OF_DIFFERENCE;

/// Less of a window than this is too little: as for lattices.
const SHARE: f64 = 0.6;
/// Signal is lost where its power is below this share of what is usual for the pattern: half of the amplitude, as for
/// lattices.
const LOST: f64 = 0.25;
/// Within a window of a boundary between patterns the second has this share of the power of the first or more: half of
/// the window less its error function there, `(Φ(−1)/Φ(1))²`.
const BETWEEN: f64 = 0.036;
/// A second pattern of such strength (power over that of the first) makes a lattice. Chosen by eye; see
/// docs/constants.md.
const CROSSED: f64 = 0.5;
/// In so much of the image it has to be there. Chosen by eye.
const CROSSING: f64 = 0.4;
/// Nodes this near to a contradiction and to a winding point (window widths) see them: as for lattices, ...
const NEAR: f64 = 2.0;
/// ... and this near to a bent one.
const BESIDE: f64 = 1.0;
/// Phase (rad) by which a wave may bend over one window width: as for lattices.
const STRAIGHT: f64 = 0.35;
/// Blur that matters, as a share of the wave vector: as for lattices.
const BLURRED: f64 = 0.004;
/// χ² of two numbers that is more than chance (p < 0.01).
const MORE_THAN_CHANCE: f64 = 9.21;

/// A map under way.
pub(crate) struct Work<'a> {
    pub(crate) image: &'a Image,
    pub(crate) waves: Vec<Wave>,
    /// nm.
    pub(crate) window: f64,
    pub(crate) nodes: Nodes,
    /// Windows.
    pub(crate) margin: f64,
}

impl Work<'_> {
    fn place(&self, node: usize) -> Vector2<f64> {
        self.nodes.place(&self.waves[0].blocks, node)
    }

    /// The map; `found` has the chances of the patterns.
    pub(crate) fn map(&mut self, found: &[(Vector2<f64>, f64)]) -> Result<StripeMap, NoStripes> {
        let count = self.nodes.len();
        let smoothed: Vec<Smoothed> = self
            .waves
            .iter()
            .map(|w| w.smoothed(self.window, self.nodes))
            .collect();
        let mut locals = self.locals(&smoothed);
        let owner = owners(&locals, count);
        self.is_no_lattice(&locals, &owner)?;
        let mut patterns: Vec<StripePattern> = (0..self.waves.len())
            .map(|p| self.pattern(p, (&locals[p], &owner), found[p].1))
            .collect();
        // Noise that could not be seen is what the fits leave.
        for (wave, pattern) in self.waves.iter_mut().zip(&patterns) {
            if let (false, Some(fit)) = (wave.noise_measured, &pattern.fit) {
                wave.levels.clone_from(&fit.noise);
            }
        }
        locals = self.locals(&smoothed);
        let owner = owners(&locals, count);
        for (p, pattern) in patterns.iter_mut().enumerate() {
            for (harmonic, level) in pattern.harmonics.iter_mut().zip(&self.waves[p].levels) {
                harmonic.noise = *level;
            }
        }
        let blurs = self.blurs(&locals);
        let masks = self.masks((&smoothed, &locals), &owner, &blurs);
        let mut nodes: Vec<StripeNode> = (0..count)
            .map(|n| {
                let local = owner[n].and_then(|p| Some((p, locals[p][n].as_ref()?)));
                node_of(local, masks[n], local.map(|(p, _)| blurs[p][n]))
            })
            .collect();
        for (p, smoothed) in smoothed.iter().enumerate() {
            self.follow(p, smoothed, &mut nodes);
        }
        let blocks = &self.waves[0].blocks;
        Ok(StripeMap {
            size: self.nodes.size,
            first: self.place(0),
            step: [0, 1].map(|i| (self.nodes.stride[i] * blocks.block[i]) as f64),
            window_nm: self.window,
            margin: self.margin,
            patterns,
            nodes,
        })
    }

    fn locals(&self, smoothed: &[Smoothed]) -> Vec<Vec<Option<Local>>> {
        self.under(smoothed, self.window)
    }

    fn under(&self, smoothed: &[Smoothed], window: f64) -> Vec<Vec<Option<Local>>> {
        let of_wave = |p: usize| {
            let others = (0..self.waves.len()).filter(|other| *other != p);
            let others: Vec<_> = others.map(|i| (&self.waves[i], &smoothed[i])).collect();
            self.waves[p].locals(&smoothed[p], window, &others)
        };
        (0..self.waves.len()).map(of_wave).collect()
    }

    /// Patterns that lie on each other are a lattice.
    fn is_no_lattice(
        &self,
        locals: &[Vec<Option<Local>>],
        owner: &[Option<usize>],
    ) -> Result<(), NoStripes> {
        let owned: Vec<usize> = (0..owner.len()).filter(|&n| owner[n].is_some()).collect();
        let crossed = owned.iter().filter(|&&n| second(locals, n) > CROSSED);
        if crossed.count() as f64 > CROSSING * owned.len() as f64 {
            return Err(NoStripes::Crossing(self.waves.len()));
        }
        Ok(())
    }

    /// A pattern, one wave fitted to the pixels of its nodes.
    fn pattern(
        &self,
        p: usize,
        (locals, owner): (&[Option<Local>], &[Option<usize>]),
        log_chance: f64,
    ) -> StripePattern {
        let wave = &self.waves[p];
        let own: Vec<usize> = (0..owner.len())
            .filter(|&n| owner[n] == Some(p) && locals[n].is_some())
            .collect();
        let (mut mean, mut power, mut powers) = (Vector2::zeros(), 0.0, Vec::new());
        for local in own.iter().filter_map(|&n| locals[n].as_ref()) {
            mean += local.wave * local.power;
            power += local.power;
            powers.push(local.power);
        }
        // Windows beside boundaries have less: the usual one counts.
        let usual = median(&mut powers);
        let shows = self.pixels(|n| owner[n] == Some(p));
        let orders: Vec<i32> = wave.indices.iter().map(|i| i[0]).collect();
        let fit = (power > 0.0)
            .then(|| fit::fit(self.image, mean / power, &orders, &shows))
            .flatten();
        let fitted: f64 = fit
            .iter()
            .flat_map(|f| &f.amplitudes)
            .map(|a| a.1 * a.1 / 4.0)
            .sum();
        StripePattern {
            share: own.len() as f64 / owner.len().max(1) as f64,
            log_chance,
            coherence: (fitted / usual).min(1.0),
            harmonics: wave
                .indices
                .iter()
                .zip(&wave.powers)
                .zip(&wave.levels)
                .map(|((&index, power), &noise)| UsedHarmonic {
                    index,
                    amplitude: 2.0 * power.sqrt(),
                    noise,
                })
                .collect(),
            noise_measured: wave.noise_measured,
            fit,
        }
    }

    /// The pixels whose nearest node passes.
    fn pixels(&self, wanted: impl Fn(usize) -> bool) -> Vec<bool> {
        let first = self.place(0);
        let blocks = &self.waves[0].blocks;
        let nearest = |axis: usize, pixel: usize| {
            let step = (self.nodes.stride[axis] * blocks.block[axis]) as f64;
            let node = ((pixel as f64 - first[axis]) / step).round().max(0.0);
            (node as usize).min(self.nodes.size[axis] - 1)
        };
        let columns: Vec<usize> = (0..self.image.columns).map(|c| nearest(0, c)).collect();
        let rows = (0..self.image.rows).map(|r| nearest(1, r) * self.nodes.size[0]);
        rows.flat_map(|row| columns.iter().map(move |c| row + c))
            .map(wanted)
            .collect()
    }

    /// What a window √2 wider changes at each node of each pattern.
    fn blurs(&self, locals: &[Vec<Option<Local>>]) -> Vec<Vec<Change>> {
        let wider = self.window * std::f64::consts::SQRT_2;
        let smoothed: Vec<Smoothed> = self
            .waves
            .iter()
            .map(|w| w.smoothed(wider, self.nodes))
            .collect();
        let of_wave = |(narrow, wide): (&Vec<Option<Local>>, Vec<Option<Local>>)| {
            let pairs = narrow.iter().zip(&wide);
            pairs
                .map(|pair| match pair {
                    (Some(a), Some(b)) => blur(a, b),
                    _ => Change::default(),
                })
                .collect()
        };
        locals
            .iter()
            .zip(self.under(&smoothed, wider))
            .map(of_wave)
            .collect()
    }

    fn masks(
        &self,
        (smoothed, locals): (&[Smoothed], &[Vec<Option<Local>>]),
        owner: &[Option<usize>],
        blurs: &[Vec<Change>],
    ) -> Vec<Mask> {
        let count = self.nodes.len();
        let places: Vec<Vector2<f64>> = (0..count).map(|n| self.place(n)).collect();
        let width = self.waves[0].reference.in_pixels(self.window);
        let last = Vector2::new(self.image.columns as f64, self.image.rows as f64);
        let frame = [Vector2::zeros(), last - Vector2::repeat(1.0)];
        let setting = Setting {
            smoothed: &smoothed[0],
            places: &places,
            width,
            margin: width.map(|w| w * self.margin),
            frame,
            noise_share: &[],
            blurs: &[],
        };
        let outside = |n: usize| {
            (0..2).any(|i| {
                (places[n] - frame[0])[i].min((frame[1] - places[n])[i]) < setting.margin[i]
            })
        };
        let usual: Vec<f64> = (0..locals.len())
            .map(|p| {
                let own = (0..count).filter(|&n| owner[n] == Some(p));
                let powers = own.filter_map(|n| Some(locals[p][n].as_ref()?.power));
                median(&mut powers.collect::<Vec<f64>>())
            })
            .collect();
        let strong = |n: usize| {
            let p = owner[n]?;
            let local = locals[p][n].as_ref()?;
            (local.power > LOST * usual[p]).then_some((p, local))
        };
        let clear = |n: usize| strong(n).is_some() && !outside(n) && !is_between(locals, n);
        let winding = windings(smoothed, self.nodes, owner, clear);
        let spoilt = near(&setting, NEAR, |n| {
            let contradicts = strong(n).is_some_and(|(_, l)| is_improbable(l.chi2, l.freedom));
            winding[n] || clear(n) && contradicts
        });
        let pairs: Vec<Option<Matrix2<f64>>> = (0..count)
            .map(|n| {
                Some(Matrix2::from_columns(&[
                    strong(n)?.1.wave,
                    Vector2::zeros(),
                ]))
            })
            .collect();
        let bent = near(&setting, BESIDE, |n| {
            let Some((p, _)) = strong(n).filter(|_| clear(n)) else {
                return false;
            };
            let blurred = is_improbable(blurs[p][n].chi2, 2) && blurs[p][n].share > BLURRED;
            // Neighbours of another pattern are another wave.
            let same = |m: usize| pairs[m].filter(|_| owner[m] == Some(p));
            blurred || bend(&setting, same, n) > STRAIGHT
        });
        (0..count)
            .map(|n| {
                if outside(n) {
                    Mask::Margin
                } else if smoothed[0].support[n].is_none_or(|s| s.share < SHARE) {
                    Mask::Missing
                } else if strong(n).is_none() {
                    Mask::Weak
                } else if spoilt[n] {
                    Mask::Defect
                } else if bent[n] || is_between(locals, n) {
                    Mask::Bent
                } else {
                    Mask::Good
                }
            })
            .collect()
    }

    /// The phases of a pattern against its mean wave, followed through its good nodes.
    fn follow(&self, p: usize, smoothed: &Smoothed, nodes: &mut [StripeNode]) {
        let wave = &self.waves[p];
        let only = |v: Vector2<f64>| Matrix2::from_columns(&[v, Vector2::zeros()]);
        let of_node = |n: usize| {
            let own = nodes[n].pattern == Some(p) && nodes[n].mask == Mask::Good;
            let phase = wave.phase(smoothed, n);
            // Of the first harmonic alone, whose phase this is.
            let power = f64::from(smoothed.envelopes[0].amplitude[n].norm_sqr());
            let unit = smoothed.support[n].map_or(f64::NAN, |s| s.amplitude_noise);
            let variance = wave.levels[0] * unit / (2.0 * power);
            WaveNode {
                mask: if own { Mask::Good } else { Mask::Weak },
                pair: only(nodes[n].wave),
                covariance: Matrix4::zeros(),
                phase_covariance: Matrix2::identity() * variance,
                chi2: 0.0,
                freedom: 0,
                signal_to_noise: nodes[n].signal_to_noise,
                phases: [phase, 0.0, -phase],
            }
        };
        let map = WaveMap {
            size: self.nodes.size,
            first: self.place(0),
            step: [0, 1].map(|i| (self.nodes.stride[i] * wave.blocks.block[i]) as f64),
            window_nm: self.window,
            margin: self.margin,
            reference: Reference {
                pair: only(wave.reference.wave([1, 0])),
                pitch: wave.reference.pitch,
            },
            centre: Vector2::zeros(),
            nodes: (0..nodes.len()).map(of_node).collect(),
            harmonics: Vec::new(),
            noise_measured: true,
        };
        for (node, found) in nodes.iter_mut().zip(displacement::phases(&map)) {
            if let Some((phases, covariance)) = found {
                node.phase = phases.x;
                node.phase_sigma = covariance[(0, 0)].sqrt();
            }
        }
    }
}

/// What a window √2 wider changes at a node.
#[derive(Clone, Copy, Debug, Default)]
struct Change {
    /// χ² of its two numbers.
    chi2: f64,
    /// As a share of the wave vector.
    share: f64,
}

/// The strongest pattern at every node.
fn owners(locals: &[Vec<Option<Local>>], count: usize) -> Vec<Option<usize>> {
    let of_node = |n: usize| {
        let there = (0..locals.len()).filter_map(|p| Some((p, locals[p][n].as_ref()?.power)));
        there.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(p, _)| p)
    };
    (0..count).map(of_node).collect()
}

/// Power of the second pattern at a node, as a share of that of the strongest.
fn second(locals: &[Vec<Option<Local>>], node: usize) -> f64 {
    let power = |all: &Vec<Option<Local>>| all[node].as_ref().map_or(0.0, |l| l.power);
    let mut powers: Vec<f64> = locals.iter().map(power).collect();
    powers.sort_by(|a, b| b.total_cmp(a));
    match powers[..] {
        [first, second, ..] if first > 0.0 => second / first,
        _ => 0.0,
    }
}

/// Whether a boundary between patterns is near.
fn is_between(locals: &[Vec<Option<Local>>], node: usize) -> bool {
    second(locals, node) > BETWEEN
}

/// The change from one wave to that under a wider window; χ² of two numbers.
fn blur(narrow: &Local, wide: &Local) -> Change {
    let change = wide.wave - narrow.wave;
    let inverse = narrow.slope.try_inverse().unwrap_or_default();
    let chi2 = change.dot(&(inverse * change)) / (narrow.variance * OF_DIFFERENCE);
    Change {
        chi2,
        share: change.norm() / narrow.wave.norm(),
    }
}

/// A node; its error is enlarged by what the window blurs where that is more than chance.
fn node_of(local: Option<(usize, &Local)>, mask: Mask, blur: Option<Change>) -> StripeNode {
    let factor = match blur {
        Some(blur) if blur.chi2 > MORE_THAN_CHANCE => 1.0 + (blur.chi2 / 2.0 - 1.0) * OF_DIFFERENCE,
        _ => 1.0,
    };
    let known = local.map(|l| l.1);
    let unknown = f64::NAN;
    StripeNode {
        mask,
        pattern: local.map(|l| l.0),
        wave: known.map_or(Vector2::repeat(unknown), |l| l.wave),
        covariance: known.map_or(Matrix2::repeat(unknown), |l| {
            l.slope * (l.variance * factor)
        }),
        chi2: known.map_or(unknown, |l| l.chi2),
        freedom: known.map_or(0, |l| l.freedom),
        signal_to_noise: known.map_or(0.0, |l| l.signal_to_noise),
        phase: unknown,
        phase_sigma: unknown,
    }
}

/// Points around which the phase of a pattern winds, all four nodes around being `clear` and of that pattern.
fn windings(
    smoothed: &[Smoothed],
    nodes: Nodes,
    owner: &[Option<usize>],
    clear: impl Fn(usize) -> bool,
) -> Vec<bool> {
    let [columns, rows] = nodes.size;
    let mut cores = vec![false; nodes.len()];
    for (row, column) in (1..rows).flat_map(|r| (1..columns).map(move |c| (r, c))) {
        let corner = row * columns + column;
        let around = [corner, corner - 1, corner - 1 - columns, corner - columns];
        let Some(p) = owner[corner] else { continue };
        if !around.iter().all(|&n| owner[n] == Some(p)) || !around.iter().any(|&n| clear(n)) {
            continue;
        }
        // The strongest harmonic has the clearest phase.
        let envelopes = &smoothed[p].envelopes;
        let Some(strongest) = envelopes.iter().max_by(|a, b| {
            let power =
                |e: &Envelope| -> f32 { around.iter().map(|&n| e.amplitude[n].norm_sqr()).sum() };
            power(a).total_cmp(&power(b))
        }) else {
            continue;
        };
        let turn = |a: usize, b: usize| {
            f64::from((strongest.amplitude[b] * strongest.amplitude[a].conj()).arg())
        };
        let turns: f64 = (0..4).map(|k| turn(around[k], around[(k + 1) % 4])).sum();
        cores[corner] = turns.abs() > std::f64::consts::PI;
    }
    cores
}
