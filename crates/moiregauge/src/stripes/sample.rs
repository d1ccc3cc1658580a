//! Local stripes in pixels → on the sample, trace and retrace averaged, and in a few numbers for each pattern.
//!
//! Wave vectors go through the inverse transpose of the map of pixels, as those of lattices do. Wavelength `2π/|q|`,
//! direction of the stripes at right angles to q, displacement `−φ/|q|` along q.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use heterostrain::Estimate;
use nalgebra::{Matrix2, Vector2};

use crate::frame::geometry::Geometry;
use crate::map::combine::Agreement;
use crate::map::nodes::Grid;
use crate::map::quantities::{Plane, TwistStrainMap};
use crate::map::summary::Spread;
use crate::numbers::chi2::enlargement;
use crate::stripes::types::{StripeMap, StripeNode};
use crate::window::blur::is_improbable;
use crate::window::mask::Mask;
use crate::window::types::UsedHarmonic;

/// χ² of two numbers that is no chance (p < 0.001).
const NO_CHANCE: f64 = 13.8;

/// Stripes on the sample.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SampledStripes {
    /// The map: `wavelengths[0]`, `orientation` (along the stripes, in [0, 180°) for the mean of each pattern),
    /// `displacement`, `closure`, `signal_to_noise` and the mask. Twist, strain and the other wavelengths are NaN.
    pub map: TwistStrainMap,
    /// The pattern of every node, counted from 1; 0 where there is none.
    pub pattern: Vec<u8>,
    /// The patterns, strongest first.
    pub patterns: Vec<SampledPattern>,
    /// How trace and retrace agree.
    pub agreement: Option<Agreement>,
    /// Whether the noise was seen beside the harmonics everywhere.
    pub noise_measured: bool,
    /// Margin at the edges, in windows.
    pub margin: f64,
}

/// A pattern on the sample.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SampledPattern {
    /// Wavelength of the one wave fitted to its pixels, nm, and direction of its stripes, rad.
    pub fit: Option<[Estimate; 2]>,
    /// Amplitudes of its harmonics in the fit, as (n, amplitude).
    pub fitted: Vec<(i32, f64)>,
    /// The same of the local stripes over its good nodes.
    pub local: Option<[Spread; 2]>,
    /// Number of good nodes.
    pub good: usize,
    /// Share of the nodes that belong to it, 0 to 1.
    pub share: f64,
    /// log₁₀ of the chance that noise makes it.
    pub log_chance: f64,
    /// Share of its local power that the one wave has.
    pub coherence: f64,
    /// Its harmonics under the window.
    pub harmonics: Vec<UsedHarmonic>,
}

/// Wavelength and direction of stripes with the wave vector q (rad/nm), the direction within 90° of `near`.
fn shown(q: Vector2<f64>, covariance: &Matrix2<f64>, near: f64) -> [Estimate; 2] {
    let length = q.norm();
    let [along, across] = [q / length, Vector2::new(-q.y, q.x) / length];
    let variance = |way: Vector2<f64>| way.dot(&(covariance * way));
    let direction = q.y.atan2(q.x) + FRAC_PI_2;
    let direction = near + (direction - near + FRAC_PI_2).rem_euclid(PI) - FRAC_PI_2;
    [
        Estimate::from_variance(
            TAU / length,
            variance(along) * (TAU / length.powi(2)).powi(2),
        ),
        Estimate::from_variance(direction, variance(across) / length.powi(2)),
    ]
}

impl SampledStripes {
    /// Takes maps of the line directions of one frame, on the same nodes, to the sample; each with its geometry.
    ///
    /// `None` where there is none, or a geometry is singular.
    pub fn new(maps: &[(&StripeMap, &Geometry)]) -> Option<Self> {
        let (first, geometry) = *maps.first()?;
        let duals: Vec<Matrix2<f64>> = maps
            .iter()
            .map(|(_, g)| Some(g.pixel_to_nm.try_inverse()?.transpose()))
            .collect::<Option<_>>()?;
        let mut nodes: Vec<Averaged> = (0..first.nodes.len())
            .map(|n| {
                let seen = maps.iter().zip(&duals);
                average(
                    &seen
                        .map(|((m, _), d)| m.nodes[n].mapped(d))
                        .collect::<Vec<_>>(),
                )
            })
            .collect();
        let agreement = agree(&mut nodes);
        let directions: Vec<f64> = (0..first.patterns.len())
            .map(|p| mean_direction(&nodes, p))
            .collect();
        let j = geometry.pixel_to_nm;
        let grid = Grid {
            size: first.size,
            origin: geometry.origin + j * first.first,
            step: j * Matrix2::new(first.step[0], 0.0, 0.0, first.step[1]),
        };
        let mut map = TwistStrainMap::empty(grid, first.window_nm);
        map.grid = grid;
        for Averaged { node, .. } in &nodes {
            push(&mut map, node, &directions);
        }
        let whole: Vec<SampledPattern> = (0..first.patterns.len())
            .map(|p| pattern(p, maps, &duals, &map, &nodes, directions[p]))
            .collect();
        Some(Self {
            pattern: nodes
                .iter()
                .map(|n| n.node.pattern.map_or(0, |p| p as u8 + 1))
                .collect(),
            noise_measured: maps
                .iter()
                .all(|(m, _)| m.patterns.iter().all(|p| p.noise_measured)),
            margin: first.margin,
            map,
            patterns: whole,
            agreement,
        })
    }
}

/// A node, χ² of the line directions about it and its degrees of freedom.
struct Averaged {
    node: StripeNode,
    chi2: f64,
    freedom: usize,
}

impl StripeNode {
    /// The same on the sample; wave vectors point to the right (upwards where they are upright).
    fn mapped(&self, dual: &Matrix2<f64>) -> Self {
        let wave = dual * self.wave;
        let sign = if wave.x < 0.0 || (wave.x == 0.0 && wave.y < 0.0) {
            -1.0
        } else {
            1.0
        };
        Self {
            wave: wave * sign,
            covariance: dual * self.covariance * dual.transpose(),
            phase: self.phase * sign,
            ..*self
        }
    }
}

/// The average of the good ones of one pattern, weighted by their errors; else the least bad.
fn average(seen: &[StripeNode]) -> Averaged {
    let alone = |node: StripeNode| Averaged {
        node,
        chi2: 0.0,
        freedom: 0,
    };
    let best = seen.iter().min_by_key(|n| n.mask).copied();
    let best = best.expect("a line direction");
    let good: Vec<&StripeNode> = seen
        .iter()
        .filter(|n| n.mask == Mask::Good && n.pattern == best.pattern)
        .collect();
    let weights: Option<Vec<Matrix2<f64>>> =
        good.iter().map(|n| n.covariance.try_inverse()).collect();
    let (Some(weights), true) = (weights, good.len() > 1) else {
        return alone(best);
    };
    // Of two waves at right angles to the lines the sign may differ.
    let waves: Vec<Vector2<f64>> = good
        .iter()
        .map(|n| n.wave * n.wave.dot(&best.wave).signum())
        .collect();
    let Some(covariance) = weights.iter().sum::<Matrix2<f64>>().try_inverse() else {
        return alone(best);
    };
    let sum: Vector2<f64> = weights.iter().zip(&waves).map(|(w, q)| w * q).sum();
    let wave = covariance * sum;
    let chi2 = weights
        .iter()
        .zip(&waves)
        .map(|(w, q)| (q - wave).dot(&(w * (q - wave))));
    Averaged {
        chi2: chi2.sum(),
        freedom: 2 * (good.len() - 1),
        node: StripeNode {
            wave,
            covariance,
            chi2: good.iter().map(|n| n.chi2).sum(),
            freedom: good.iter().map(|n| n.freedom).sum(),
            signal_to_noise: good.iter().map(|n| n.signal_to_noise).sum(),
            ..best
        },
    }
}

/// What all nodes together say of the errors: scatter beyond them enlarges them, and so does what is missing of it, which
/// is noise that trace and retrace share (`χ²/dof = 1 − ρ`, `σ² → σ²(1 + ρ)`).
fn agree(nodes: &mut [Averaged]) -> Option<Agreement> {
    let good = |n: &&Averaged| n.node.mask == Mask::Good && n.freedom > 0;
    let all = nodes.iter().filter(good);
    let (chi2, freedom, count) = all.fold((0.0, 0, 0), |(c, f, n), node| {
        (c + node.chi2, f + node.freedom, n + 1)
    });
    if freedom == 0 {
        return None;
    }
    let reduced = chi2 / freedom as f64;
    let factor = if reduced >= 1.0 {
        enlargement(chi2, freedom)
    } else {
        2.0 - reduced
    };
    for averaged in nodes.iter_mut().filter(|n| n.freedom > 0) {
        averaged.node.covariance *= factor;
        let scaled = averaged.chi2 / reduced.max(1.0);
        if averaged.node.mask == Mask::Good && is_improbable(scaled, averaged.freedom) {
            averaged.node.mask = Mask::Contradiction;
        }
    }
    Some(Agreement {
        chi2_per_dof: reduced,
        factor,
        nodes: count,
    })
}

/// Mean direction of the stripes of a pattern, in [0, π): doubled angles have no ends.
fn mean_direction(nodes: &[Averaged], pattern: usize) -> f64 {
    let own = nodes.iter().map(|n| &n.node);
    let own = own.filter(|n| n.mask == Mask::Good && n.pattern == Some(pattern));
    let sum = own.fold(Vector2::zeros(), |sum: Vector2<f64>, n| {
        let twice = 2.0 * (n.wave.y.atan2(n.wave.x) + FRAC_PI_2);
        sum + Vector2::new(twice.cos(), twice.sin())
    });
    (0.5 * sum.y.atan2(sum.x)).rem_euclid(PI)
}

/// Adds a node to the planes that stripes have; the others hold nothing. `directions`: those of the patterns.
fn push(map: &mut TwistStrainMap, node: &StripeNode, directions: &[f64]) {
    let nothing = Estimate::new(f64::NAN, f64::NAN);
    let known = node.pattern.filter(|_| node.wave.x.is_finite());
    let [wavelength, direction] = known.map_or([nothing; 2], |p| {
        shown(node.wave, &node.covariance, directions[p])
    });
    let length = node.wave.norm();
    let across = node.wave / length;
    let moved = |axis: usize| {
        let share = across[axis] / length;
        Estimate::new(-node.phase * share, node.phase_sigma * share.abs())
    };
    let closure = node.chi2 / node.freedom as f64;
    for plane in map.planes_mut() {
        plane.push(f32::NAN);
    }
    let set = |plane: &mut Plane, e: Estimate| {
        if let (Some(value), Some(sigma)) = (plane.value.last_mut(), plane.sigma.last_mut()) {
            (*value, *sigma) = (e.value as f32, e.sigma as f32);
        }
    };
    set(&mut map.wavelengths[0], wavelength);
    set(&mut map.orientation, direction);
    set(&mut map.displacement[0], moved(0));
    set(&mut map.displacement[1], moved(1));
    if let Some(last) = map.closure.last_mut().filter(|_| node.freedom > 0) {
        *last = closure as f32;
    }
    if let Some(last) = map.signal_to_noise.last_mut() {
        *last = node.signal_to_noise.sqrt() as f32;
    }
    map.mask.push(node.mask);
}

fn pattern(
    p: usize,
    maps: &[(&StripeMap, &Geometry)],
    duals: &[Matrix2<f64>],
    map: &TwistStrainMap,
    nodes: &[Averaged],
    direction: f64,
) -> SampledPattern {
    let found = &maps[0].0.patterns[p];
    let fits: Vec<(Vector2<f64>, Matrix2<f64>)> = maps
        .iter()
        .zip(duals)
        .filter_map(|((m, _), dual)| {
            let fit = m.patterns[p].fit.as_ref()?;
            Some((dual * fit.wave, dual * fit.covariance * dual.transpose()))
        })
        .collect();
    let own = |n: usize| nodes[n].node.pattern == Some(p);
    let local = map
        .spread_where(&map.wavelengths[0], own)
        .zip(map.spread_where(&map.orientation, own));
    SampledPattern {
        fit: both(&fits).map(|(wave, covariance)| shown(wave, &covariance, direction)),
        fitted: found
            .fit
            .as_ref()
            .map_or_else(Vec::new, |f| f.amplitudes.clone()),
        local: local.map(|(a, b)| [a, b]),
        good: (0..nodes.len())
            .filter(|&n| own(n) && nodes[n].node.mask == Mask::Good)
            .count(),
        share: found.share,
        log_chance: found.log_chance,
        coherence: found.coherence,
        harmonics: found.harmonics.clone(),
    }
}

/// The mean of the fits to trace and retrace. Their noise may be the same: errors are not divided, and half of a
/// difference that is no chance is added.
fn both(fits: &[(Vector2<f64>, Matrix2<f64>)]) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let (first, rest) = fits.split_first()?;
    let Some(second) = rest.first() else {
        return Some(*first);
    };
    let difference = second.0 * second.0.dot(&first.0).signum() - first.0;
    let mut covariance = 0.5 * (first.1 + second.1);
    let chi2 = difference.dot(&((first.1 + second.1).try_inverse()? * difference));
    if chi2 > NO_CHANCE {
        covariance += 0.25 * difference * difference.transpose();
    }
    Some((first.0 + 0.5 * difference, covariance))
}
