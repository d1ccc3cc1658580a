//! The waves of all patterns → nodes: which pattern is the strongest, what is to be believed, phases.

use nalgebra::{Matrix2, Matrix4, Vector2};

use crate::frame::image::Image;
use crate::map::defects::{Setting, is_improbable};
use crate::map::displacement;
use crate::numbers::median::median;
use crate::stripes::fit;
use crate::stripes::types::{NoStripes, StripeMap, StripeNode, StripePattern};
use crate::stripes::wave::{Local, Wave};
use crate::window::blur::Blur;
use crate::window::mask::Mask;
use crate::window::setting::{LOST, NEAR, fours, winds};
use crate::window::smooth::{Envelope, Nodes, Smoothed};
use crate::window::types::{Reference, WaveMap, WaveNode};
use crate::window::widths::OF_DIFFERENCE;

/// Within a window of a boundary between patterns the second has this share of the power of the first or more: half of
/// the window less its error function there, `(Φ(−1)/Φ(1))²`.
const BETWEEN: f64 = 0.036;
/// A second pattern of such strength (power over that of the first) makes a lattice. On the scenes of docs/constants.md half and double change
/// results by at most 0.01 σ.
const CROSSED: f64 = 0.5;
/// In so much of the image it has to be there. On the scenes of docs/constants.md half and double change no result.
const CROSSING: f64 = 0.4;

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
        self.nodes.place(&self.waves[0].mixed.blocks, node)
    }

    /// The map; `found` has the chances of the patterns.
    pub(crate) fn map(&mut self, found: &[(Vector2<f64>, f64)]) -> Result<StripeMap, NoStripes> {
        let count = self.nodes.len();
        let smoothed: Vec<Smoothed> = self
            .waves
            .iter()
            .map(|w| w.mixed.cleaned(self.window, self.nodes))
            .collect();
        let mut locals = self.locals(&smoothed);
        let owner = owners(&locals, count);
        self.is_no_lattice(&locals, &owner)?;
        let mut patterns: Vec<StripePattern> = (0..self.waves.len())
            .map(|p| self.pattern(p, &locals[p], &owner, found[p].1))
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
        let masks = self.masks(&smoothed, &locals, &owner, &blurs);
        let mut nodes: Vec<StripeNode> = (0..count)
            .map(|n| {
                let local = owner[n].and_then(|p| Some((p, locals[p][n].as_ref()?)));
                node_of(local, masks[n], local.map(|(p, _)| blurs[p][n]))
            })
            .collect();
        for (p, smoothed) in smoothed.iter().enumerate() {
            self.follow(p, smoothed, &mut nodes);
        }
        Ok(StripeMap {
            size: self.nodes.size,
            first: self.place(0),
            step: self.nodes.step(&self.waves[0].mixed.blocks),
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
        locals: &[Option<Local>],
        owner: &[Option<usize>],
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
        let orders: Vec<i32> = wave.mixed.indices.iter().map(|i| i[0]).collect();
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
            harmonics: wave.mixed.used(&wave.levels),
            noise_measured: wave.noise_measured,
            fit,
        }
    }

    /// The pixels whose nearest node passes.
    fn pixels(&self, wanted: impl Fn(usize) -> bool) -> Vec<bool> {
        let first = self.place(0);
        let step = self.nodes.step(&self.waves[0].mixed.blocks);
        let nearest = |axis: usize, pixel: usize| {
            let node = ((pixel as f64 - first[axis]) / step[axis]).round().max(0.0);
            (node as usize).min(self.nodes.size[axis] - 1)
        };
        let columns: Vec<usize> = (0..self.image.columns).map(|c| nearest(0, c)).collect();
        let rows = (0..self.image.rows).map(|r| nearest(1, r) * self.nodes.size[0]);
        rows.flat_map(|row| columns.iter().map(move |c| row + c))
            .map(wanted)
            .collect()
    }

    /// What a window √2 wider changes at each node of each pattern.
    fn blurs(&self, locals: &[Vec<Option<Local>>]) -> Vec<Vec<Blur>> {
        let wider = self.window * std::f64::consts::SQRT_2;
        let smoothed: Vec<Smoothed> = self
            .waves
            .iter()
            .map(|w| w.mixed.cleaned(wider, self.nodes))
            .collect();
        let of_wave = |(narrow, wide): (&Vec<Option<Local>>, Vec<Option<Local>>)| {
            let pairs = narrow.iter().zip(&wide);
            pairs
                .map(|pair| match pair {
                    (Some(a), Some(b)) => blur(a, b),
                    _ => Blur::default(),
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
        smoothed: &[Smoothed],
        locals: &[Vec<Option<Local>>],
        owner: &[Option<usize>],
        blurs: &[Vec<Blur>],
    ) -> Vec<Mask> {
        let mixed = &self.waves[0].mixed;
        let (count, places) = (self.nodes.len(), mixed.places(self.nodes));
        let width = mixed.reference.in_pixels(self.window);
        let setting = Setting {
            smoothed: &smoothed[0],
            places: &places,
            width,
            margin: width.map(|w| w * self.margin),
            frame: mixed.frame,
        };
        let usual = usual(locals, owner);
        let strong = |n: usize| {
            let p = owner[n]?;
            let local = locals[p][n].as_ref()?;
            (local.power > LOST * usual[p]).then_some((p, local))
        };
        let clear =
            |n: usize| strong(n).filter(|_| !setting.is_outside(n) && !is_between(locals, n));
        let winding = windings(smoothed, self.nodes, owner, |n| clear(n).is_some());
        let spoilt = setting.near(NEAR, |n| {
            winding[n] || clear(n).is_some_and(|(_, l)| is_improbable(l.chi2, l.freedom))
        });
        // Neighbours of another pattern are another wave.
        let pair = |of: usize, n: usize| {
            let (p, local) = strong(n)?;
            (owner[of] == Some(p)).then(|| only(local.wave))
        };
        let bent = setting.bent(pair, |n| clear(n).map(|(p, _)| blurs[p][n]));
        let of_node = |n: usize| {
            if setting.is_outside(n) {
                Mask::Margin
            } else if setting.is_missing(n) {
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
        };
        (0..count).map(of_node).collect()
    }

    /// The phases of a pattern against its mean wave, followed through its good nodes.
    fn follow(&self, p: usize, smoothed: &Smoothed, nodes: &mut [StripeNode]) {
        let wave = &self.waves[p];
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
                phase_weights: [1.0 / variance, 1.0 / variance, 0.0],
                chi2: 0.0,
                freedom: 0,
                signal_to_noise: nodes[n].signal_to_noise,
                phases: [phase, 0.0, -phase],
            }
        };
        let map = WaveMap {
            size: self.nodes.size,
            first: self.place(0),
            step: self.nodes.step(&wave.mixed.blocks),
            window_nm: self.window,
            margin: self.margin,
            reference: Reference {
                pair: only(wave.first()),
                pitch: wave.mixed.reference.pitch,
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

/// A wave as the first of a pair whose second is not there.
fn only(wave: Vector2<f64>) -> Matrix2<f64> {
    Matrix2::from_columns(&[wave, Vector2::zeros()])
}

/// Median power of every pattern where it is the strongest.
fn usual(locals: &[Vec<Option<Local>>], owner: &[Option<usize>]) -> Vec<f64> {
    let of_pattern = |p: usize| {
        let own = (0..owner.len()).filter(|&n| owner[n] == Some(p));
        let powers = own.filter_map(|n| Some(locals[p][n].as_ref()?.power));
        median(&mut powers.collect::<Vec<f64>>())
    };
    (0..locals.len()).map(of_pattern).collect()
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
fn blur(narrow: &Local, wide: &Local) -> Blur {
    let change = wide.wave - narrow.wave;
    let inverse = narrow.slope.try_inverse().unwrap_or_default();
    Blur {
        chi2: change.dot(&(inverse * change)) / (narrow.variance * OF_DIFFERENCE),
        components: 2,
        share: change.norm() / narrow.wave.norm(),
        of_noise: OF_DIFFERENCE,
    }
}

/// A node; its error is enlarged by what the window blurs.
fn node_of(local: Option<(usize, &Local)>, mask: Mask, blur: Option<Blur>) -> StripeNode {
    let factor = blur.unwrap_or_default().factor();
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
    let mut cores = vec![false; nodes.len()];
    for (corner, around) in fours(nodes) {
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
        cores[corner] = winds(&strongest.amplitude, around);
    }
    cores
}
