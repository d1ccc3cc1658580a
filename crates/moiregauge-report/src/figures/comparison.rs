//! Wavelengths by the estimator that was used against those by the other one.

use heterostrain::Estimate;
use moiregauge::spectrum::Method;
use spmfile::LineDirection;

use super::figure::Drawing;
use super::layout;
use super::layout::{counting, ends, is_up, ordinal, point};
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels, Ticks, zero_line};
use crate::draw::legend;
use crate::draw::scale::Range;
use crate::draw::style::{GREY, LINE, PAGE, VECTOR, VECTOR_MARKER};
use crate::draw::svg::{Ink, Svg};

const SIDE: f64 = 150.0;

/// One vector of one line of one scan by both estimators.
struct Pair {
    /// Number of the scan, a little further right for retrace.
    place: f64,
    vector: usize,
    up: bool,
    used: Estimate,
    other: Estimate,
}

/// The title, which has the estimators' names.
pub(super) fn title(method: Method) -> &'static str {
    match method {
        Method::Autocorrelation => "Autocorrelation against Fourier transform",
        Method::Fourier => "Fourier transform against autocorrelation",
        Method::Lattice => "Lattice fit against Fourier transform",
        Method::Paper => "Published autocorrelation against the other estimator",
    }
}

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let pairs = pairs(subject);
    if pairs.is_empty() {
        return Err("no second estimator was run".to_owned());
    }
    let (used, other) = match subject.analysis.settings.method {
        Method::Autocorrelation => ("autocorrelation", "Fourier transform"),
        Method::Fourier => ("Fourier transform", "autocorrelation"),
        Method::Lattice => ("lattice fit", "Fourier transform"),
        Method::Paper => ("published autocorrelation", "other estimator"),
    };
    let top = layout::LEGEND + layout::ABOVE;
    let mut svg = Svg::new(subject.id, PAGE, top + SIDE + layout::BELOW);
    let (square, beside) = layout::square_and_rest(top, SIDE);
    let all = pairs.iter().flat_map(|p| [p.used, p.other]);
    let range = Range::of(ends(all))
        .ok_or("no wavelength is finite")?
        .padded(0.05, 1e-6);
    let axes = Axes::new(square, range, range);
    let diagonal = axes.points([(range.low, range.low), (range.high, range.high)]);
    svg.polyline(&diagonal, &Ink::line(GREY, LINE));
    for pair in &pairs {
        let colour = VECTOR[pair.vector];
        axes.error_bar_x(
            &mut svg,
            pair.used.value,
            pair.other.value,
            pair.used.sigma,
            colour,
        );
        let look = (VECTOR_MARKER[pair.vector], colour);
        point(&mut svg, &axes, pair.used.value, pair.other, look, pair.up);
    }
    let (x, y) = (format!("λ by {used} (nm)"), format!("λ by {other} (nm)"));
    let labels = Labels {
        letter: "a",
        x: &x,
        y: &y,
        ..Labels::default()
    };
    axes.draw(&mut svg, &labels);

    // Both come from the same pixels: the larger σ is a fairer bar than the sum of squares.
    let difference = |p: &Pair| {
        let sigma = p.used.sigma.max(p.other.sigma) * 1000.0;
        Estimate::new((p.other.value - p.used.value) * 1000.0, sigma)
    };
    let range = Range::of(ends(pairs.iter().map(difference)).chain([0.0]));
    let range = range.ok_or("no wavelength is finite")?.padded(0.06, 1e-3);
    let axes = Axes::new(beside, counting(subject.set.scans.len()), range);
    zero_line(&mut svg, &axes);
    for pair in &pairs {
        let x = pair.place + (pair.vector as f64 - 1.0) * 0.24;
        let look = (VECTOR_MARKER[pair.vector], VECTOR[pair.vector]);
        point(&mut svg, &axes, x, difference(pair), look, pair.up);
    }
    let labels = Labels {
        letter: "b",
        x: "scan",
        y: "difference (pm)",
        x_ticks: Ticks::Scans,
        ..Labels::default()
    };
    axes.draw(&mut svg, &labels);
    legend::vectors_and_directions(&mut svg, (layout::LEFT, 11.0));
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Wavelengths by two estimators"),
        caption: format!(
            "Wavelengths by the {used}, which the results use, and by the {other}, in sensor coordinates, trace and retrace of every scan (a), and their difference, {other} minus {used} (b, retrace right of trace; error bar: the larger σ of the two, as both see the same pixels). Filled symbols: up scans; open: down scans."
        ),
    })
}

fn pairs(subject: &Subject) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (index, scan) in subject.set.scans.iter().enumerate() {
        for line in &scan.lines {
            let Some(other) = &line.comparison else {
                continue;
            };
            pairs.extend((0..3).map(|vector| Pair {
                place: ordinal(index)
                    + if line.line == LineDirection::Trace {
                        -0.05
                    } else {
                        0.05
                    },
                vector,
                up: is_up(scan),
                used: line.sensor.wavelength(vector),
                other: other.wavelength(vector),
            }));
        }
    }
    pairs
}
