//! The twist that a wavelength would mean without strain, with the uncertainty of scanner and layers, and the measured
//! wavelengths on that curve.

use heterostrain::strain::naive_twist;
use heterostrain::{Estimate, TotalEstimate};
use moiregauge::campaign::SetMean;
use moiregauge::settings::Settings;

use super::figure::Drawing;
use super::layout;
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels};
use crate::draw::legend::{self, Key};
use crate::draw::scale::Range;
use crate::draw::style::{BLUE, COLUMN, LINE, Marker, ORANGE, VECTOR, VECTOR_MARKER, marker};
use crate::draw::svg::{Ink, Rect, Svg};
use crate::format::plus_minus;

/// Points of the curve.
const POINTS: usize = 200;
/// The curve reaches from the shortest wavelength over this factor to the longest times it.
const REACH: f64 = 1.6;

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let mean = subject.mean()?;
    let settings = &subject.analysis.settings;
    let lengths = [0, 1, 2].map(|i| mean.wavelength(i));
    let range = Range::of(lengths.iter().map(|l| l.value)).ok_or("no wavelength is finite")?;
    let middle = range.centre();
    let relative = relative_error(&lengths);
    let x = Range::new(range.low / REACH, range.high * REACH);
    let curve: Vec<(f64, Estimate)> = (0..=POINTS)
        .map(|k| x.low + x.width() * k as f64 / POINTS as f64)
        .map(|length| (length, naive(length, relative, settings)))
        .filter(|(_, twist)| twist.value.is_finite() && twist.sigma.is_finite())
        .collect();
    let y = Range::of(layout::ends(curve.iter().map(|(_, twist)| *twist)));
    let y = y
        .ok_or("no twist gives these wavelengths")?
        .padded(0.05, 1e-6);

    let area = Rect::new(
        layout::LEFT,
        layout::LEGEND + 8.0,
        COLUMN - layout::LEFT - 9.0,
        150.0,
    );
    let axes = Axes::new(area, x, y);
    let mut svg = Svg::new(subject.id, COLUMN, area.bottom() + layout::BELOW);
    svg.clipped(area, |svg| {
        let upper = curve.iter().map(|(l, t)| (*l, t.value + t.sigma));
        let lower = curve.iter().rev().map(|(l, t)| (*l, t.value - t.sigma));
        svg.polygon(&axes.points(upper.chain(lower)), &Ink::area(BLUE, 0.3));
        let line = curve.iter().map(|(l, t)| (*l, t.value));
        svg.polyline(&axes.points(line), &Ink::line(BLUE, LINE));
    });
    points(&mut svg, &axes, mean, relative, settings);
    let labels = Labels {
        x: "moiré wavelength λ (nm)",
        y: "twist θ (°)",
        ..Labels::default()
    };
    axes.draw(&mut svg, &labels);
    let keys: Vec<_> = legend::vectors()
        .chain([(
            Key::Point(Marker::Diamond, ORANGE, true),
            "twist of the set",
        )])
        .collect();
    legend::row(&mut svg, (layout::LEFT - 30.0, 11.0), &keys);
    let at_middle = naive(middle, relative, settings);
    Ok(Drawing {
        wide: false,
        svg: svg.finish("Twist against wavelength"),
        caption: format!(
            "Curve: twist of an unstrained moiré against its wavelength; for equal layers θ = 2 arcsin(a/2λ). Band: \
             one standard deviation from the lattice constants and from a wavelength known to {} %, the total \
             uncertainty in this set (at {} nm: {}°). Points: the three wavelengths of the set on the curve. Diamond: \
             its twist with strain taken into account, at the mean wavelength, with its total σ.",
            crate::format::two_digits(100.0 * relative),
            crate::draw::scale::fixed(middle, 2),
            plus_minus(at_middle)
        ),
    })
}

/// The relative total error of the wavelengths, their mean; statistical where the total is not known.
fn relative_error(lengths: &[TotalEstimate; 3]) -> f64 {
    let of = |l: &TotalEstimate| {
        let sigma = if l.total.is_finite() {
            l.total
        } else {
            l.statistical
        };
        sigma / l.value
    };
    lengths.iter().map(of).sum::<f64>() / 3.0
}

/// 2 arcsin(a/2λ), or what takes its place for layers of different size, degrees.
fn naive(length: f64, relative: f64, settings: &Settings) -> Estimate {
    let at = |settings: &Settings| {
        naive_twist(Estimate::new(length, relative * length), settings.bilayer())
    };
    let found = at(settings);
    let mut variance = found.sigma * found.sigma;
    let mut changed = settings.clone();
    changed.material.lattice_constant_nm += settings.material.lattice_constant_sigma_nm;
    variance += (at(&changed).value - found.value).powi(2);
    if let Some(substrate) = &settings.substrate {
        let mut changed = settings.clone();
        if let Some(layer) = &mut changed.substrate {
            layer.lattice_constant_nm += substrate.lattice_constant_sigma_nm;
        }
        variance += (at(&changed).value - found.value).powi(2);
    }
    Estimate::from_variance(found.value, variance).scaled(1_f64.to_degrees())
}

/// The three wavelengths on the curve, and the twist of the set at their mean.
fn points(svg: &mut Svg, axes: &Axes, mean: &SetMean, relative: f64, settings: &Settings) {
    let lengths = [0, 1, 2].map(|i| mean.wavelength(i));
    for (v, length) in lengths.iter().enumerate() {
        let twist = naive(length.value, relative, settings);
        axes.error_bar_x(svg, length.value, twist.value, length.total, VECTOR[v]);
        if axes.y.range.contains(twist.value) {
            let at = axes.at(length.value, twist.value);
            marker(svg, at, VECTOR_MARKER[v], VECTOR[v], true);
        }
    }
    let twist = mean.twist().scaled(1_f64.to_degrees());
    let middle = lengths.iter().map(|l| l.value).sum::<f64>() / 3.0;
    if axes.y.range.contains(twist.value) {
        axes.error_bar(svg, middle, twist.value, twist.total, ORANGE);
        marker(
            svg,
            axes.at(middle, twist.value),
            Marker::Diamond,
            ORANGE,
            true,
        );
    }
}
