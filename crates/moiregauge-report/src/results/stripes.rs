//! Patterns of stripes in the document of a map.

use heterostrain::Estimate;
use moiregauge::map::Spread;
use moiregauge::region::{Trend, Trends};
use moiregauge::stripes::{SampledPattern, SampledStripes};
use moiregauge::window::Mask;
use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::convert::estimate;
use super::estimate::ResultEstimate;
use super::quantity::{QuantityResult, TrendResult};

/// A map of stripes: patterns with one wave vector each, which say nothing of twist and strain.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct StripesResult {
    /// The patterns, strongest first; `stripes` in the files has their numbers.
    pub patterns: Vec<StripePatternResult>,
}

/// A pattern of stripes.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct StripePatternResult {
    /// Its number, from 1.
    pub number: usize,
    /// Share of the nodes where it is the strongest, per cent.
    pub share_percent: f64,
    /// Good nodes.
    pub good_nodes: usize,
    /// Wavelength of one wave with overtones fitted to all its pixels, nm; its error is by what the fit leaves.
    pub wavelength_nm: Option<ResultEstimate>,
    /// Direction along its stripes by the same fit, degrees.
    pub direction_deg: Option<ResultEstimate>,
    /// Wavelength and direction of the map over its good nodes.
    pub map: Vec<QuantityResult>,
    /// Share of the local power of the pattern that the one wave has, per cent: 100 for straight stripes.
    pub coherence_percent: Option<f64>,
    /// log₁₀ of the chance that noise makes the pattern.
    pub log10_chance: f64,
    /// The harmonics of the fit.
    pub harmonics: Vec<StripeHarmonicResult>,
}

/// A harmonic of a pattern.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
pub struct StripeHarmonicResult {
    /// 1 for the wave itself, 2 for half its wavelength, ….
    pub order: i32,
    /// Amplitude in the fit to all pixels of the pattern, unit of the image.
    pub amplitude: f64,
    /// Amplitude under the window, root mean square where the pattern is.
    pub local_amplitude: f64,
}

impl From<&SampledStripes> for StripesResult {
    fn from(found: &SampledStripes) -> Self {
        let patterns = found.patterns.iter().enumerate();
        let all = patterns.map(|(i, p)| pattern(i + 1, p, trends(found, i + 1)));
        Self {
            patterns: all.collect(),
        }
    }
}

/// Planes through wavelength and direction over the good nodes of a pattern, about the middle of all its nodes. The
/// correlation of their noise is that of slopes in all directions.
fn trends(found: &SampledStripes, number: usize) -> [Option<Trend>; 2] {
    let own = |n: &usize| usize::from(found.pattern[*n]) == number;
    let mut map = found.map.clone();
    let (mut sum, mut count) = (Vector2::zeros(), 0.0);
    for n in 0..map.grid.len() {
        if own(&n) {
            sum += map.grid.place(n);
            count += 1.0;
        } else {
            map.mask[n] = Mask::Weak;
        }
    }
    let trends = Trends::about(&map, sum / count);
    let of = |plane| trends.as_ref().and_then(|t| t.of(plane));
    [of(&map.wavelengths[0]), of(&map.orientation)]
}

fn pattern(number: usize, p: &SampledPattern, trends: [Option<Trend>; 2]) -> StripePatternResult {
    let degree = 1f64.to_degrees();
    let [wavelength, direction] = match p.fit {
        Some([wavelength, direction]) => [
            Some(estimate(wavelength, 1.0)),
            Some(estimate(direction, degree)),
        ],
        None => [None, None],
    };
    let quantity = |name: &str, unit: &str, s: &Spread, trend: Option<Trend>, factor: f64| {
        let name = format!("{name} {number}");
        QuantityResult {
            trend: trend.map(|t| TrendResult::new(&t, factor)),
            ..QuantityResult::new(&name, unit, s, factor)
        }
    };
    StripePatternResult {
        number,
        share_percent: 100.0 * p.share,
        good_nodes: p.good,
        wavelength_nm: wavelength,
        direction_deg: direction,
        map: p.local.as_ref().map_or_else(Vec::new, |[w, d]| {
            vec![
                quantity("wavelength", "nm", w, trends[0], 1.0),
                quantity("direction", "°", d, trends[1], degree),
            ]
        }),
        coherence_percent: p.coherence.is_finite().then_some(100.0 * p.coherence),
        log10_chance: p.log_chance,
        harmonics: p
            .fitted
            .iter()
            .map(|&(order, amplitude)| StripeHarmonicResult {
                order,
                amplitude,
                local_amplitude: p
                    .harmonics
                    .iter()
                    .find(|h| h.index[0] == order)
                    .map_or(0.0, |h| h.amplitude),
            })
            .collect(),
    }
}

impl StripePatternResult {
    /// How far the map lies from the fit to all pixels where these have their middle: wavelength (nm) and direction
    /// (degrees), each with the error of both. Without a trend the means of the map.
    pub fn apart(&self) -> Option<[Estimate; 2]> {
        let [w, d] = [self.wavelength_nm?.plain(), self.direction_deg?.plain()];
        let [a, b] = self.map.as_slice() else {
            return None;
        };
        let off = |q: &QuantityResult, fit: Estimate| {
            let [value, sigma] = match q.trend {
                Some(t) => [t.middle, t.middle_sigma],
                None => [q.mean, q.mean_sigma],
            };
            Estimate::new(value - fit.value, sigma.hypot(fit.sigma))
        };
        Some([off(a, w), off(b, d)])
    }
}
