//! Which answer holds where the moiré relaxes: phases under a window, or nodes and triangles.

use heterostrain::strain::TwistStrain;

use crate::domains::cells::DomainMap;
use crate::map::quantities::TwistStrainMap;
use crate::numbers::median::median;
use crate::window::mask::Mask;

/// Below this twist the layers of most materials relax into domains, rad (0.5°): a round number in a gradual change.
const RELAXED: f64 = 0.5 / 57.295_779_513;
/// Share of the inner nodes of a map that the window blurs or whose harmonics contradict each other. On the scenes of docs/constants.md half and
/// double change results by at most 0.01 σ.
const BLURRED: f64 = 0.3;
/// Change of the cell's area over one window, as a share of itself: a tenth of the twist. Half and twice as much change
/// no result of docs/constants.md.
const VARIED: f64 = 0.2;
/// Error of the twist of a triangle as a share of it, beyond which triangles tell nothing: as large as the change
/// that calls for them.
const NOISY: f64 = 0.2;

/// What is to be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegimeChoice {
    /// The maps of phases under a window.
    Phases,
    /// The triangles between nodes.
    Domains,
}

/// Which regime applies, and what says so.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Regime {
    /// What is to be used.
    pub choice: RegimeChoice,
    /// Whether the maps of phases are in doubt.
    pub in_doubt: bool,
    /// Share of inner nodes that are bent or defects, 0 to 1; NaN without inner nodes.
    pub blurred: f64,
    /// Typical change of the area of a cell over the full width of a window, as a share of itself; NaN without cells.
    pub variation: f64,
    /// In words: what speaks against the maps of phases, and against the triangles.
    pub reasons: Vec<String>,
}

/// Decides from a map, and from the cells if there are any.
///
/// Domains are for a relaxed lattice (small twist) and for one that changes faster than the window resolves, provided
/// that their triangles tell something; phases for all others.
pub fn regime(map: &TwistStrainMap, domains: Option<&DomainMap>) -> Regime {
    let inner = map.grid.len() - map.count(Mask::Margin) - map.count(Mask::Missing);
    let bad = map.count(Mask::Bent) + map.count(Mask::Defect) + map.count(Mask::NoSolution);
    let blurred = bad as f64 / inner as f64;
    let found: Vec<TwistStrain> = domains.map_or_else(Vec::new, |d| {
        d.cells.iter().filter_map(|c| c.twist_strain).collect()
    });
    let of_cells = median_of(found.iter().map(|t| t.twist).collect());
    let twist = of_cells.or_else(|| map.spread(&map.twist).map(|s| s.mean));
    let variation = domains.map_or(f64::NAN, |d| variation(d, 2.355 * map.window_nm));
    let mut reasons = doubts(map, twist, blurred, variation);
    let in_doubt = !reasons.is_empty();
    let shares = found.iter().map(|t| t.twist().sigma / t.twist.abs());
    let noise = median_of(shares.filter(|s| s.is_finite()).collect());
    let told = match noise {
        None if in_doubt => Some("no triangles were found or looked for".to_owned()),
        Some(noise) if noise > NOISY => Some(format!(
            "the twists of the triangles are uncertain by {:.0} %",
            100.0 * noise
        )),
        _ => None,
    };
    let choice = if in_doubt && told.is_none() {
        RegimeChoice::Domains
    } else {
        RegimeChoice::Phases
    };
    reasons.extend(told);
    if !in_doubt {
        reasons.push("the lattice changes slowly within the window".to_owned());
    }
    Regime {
        choice,
        in_doubt,
        blurred,
        variation,
        reasons,
    }
}

/// What speaks against phases. `twist` in rad, `blurred` and `variation` as in [`Regime`].
fn doubts(map: &TwistStrainMap, twist: Option<f64>, blurred: f64, variation: f64) -> Vec<String> {
    let mut reasons = Vec::new();
    let window = 4.0 * std::f64::consts::PI * map.window_nm * map.window_nm;
    if map.good() as f64 * map.node_area() < window {
        reasons.push(format!(
            "{} of {} nodes of the map of phases are good, less than the area of one window: too few periods lie \
             within the margins, or the lattice changes too fast",
            map.good(),
            map.grid.len()
        ));
    }
    if let Some(twist) = twist.filter(|t| t.abs() < RELAXED) {
        reasons.push(format!(
            "the twist of {:.2}° is below 0.5°, where lattices relax into domains",
            twist.to_degrees()
        ));
    }
    if blurred > BLURRED {
        reasons.push(format!(
            "{:.0} % of the inner nodes of the map change too fast for its window or contradict themselves",
            100.0 * blurred
        ));
    }
    if variation > VARIED {
        reasons.push(format!(
            "cells change by {:.0} % of their area over the width of the window",
            100.0 * variation
        ));
    }
    reasons
}

/// Median over pairs of neighbouring cells of |ln(area ratio)|, scaled from their distance to `width`, its noise
/// taken off.
fn variation(domains: &DomainMap, width: f64) -> f64 {
    let mut by_edge = std::collections::BTreeMap::<[usize; 2], Vec<usize>>::new();
    for (n, cell) in domains.cells.iter().enumerate() {
        for i in 0..3 {
            let mut edge = [cell.nodes[i], cell.nodes[(i + 1) % 3]];
            edge.sort_unstable();
            by_edge.entry(edge).or_default().push(n);
        }
    }
    let area = |n: usize| domains.cells[n].lattice.basis.determinant().abs();
    // Variance of ln|det B| by the errors of a cell: bᵀ C b with b the entries of B⁻ᵀ.
    let noise = |n: usize| {
        let lattice = &domains.cells[n].lattice;
        lattice.basis.try_inverse().map_or(f64::NAN, |inverse| {
            let slope = nalgebra::Vector4::from_column_slice(inverse.transpose().as_slice());
            (slope.transpose() * lattice.covariance * slope)[0]
        })
    };
    let changes = by_edge.values().filter_map(|two| {
        let &[a, b] = two.as_slice() else { return None };
        let apart = (domains.cells[a].centre - domains.cells[b].centre).norm();
        let change = (area(a) / area(b)).ln().powi(2) - noise(a) - noise(b);
        (apart > 0.0).then(|| change.max(0.0).sqrt() * width / apart)
    });
    median_of(changes.filter(|c| c.is_finite()).collect()).unwrap_or(f64::NAN)
}

fn median_of(mut values: Vec<f64>) -> Option<f64> {
    (!values.is_empty()).then(|| median(&mut values))
}
