//! The error of the twist against the error of the wavelength: θ = 2 arcsin(a/2λ) gives
//! |dθ| = θ |dλ|/λ at small angles.

use heterostrain::lattice::Lattice;
use heterostrain::strain::{TwistStrain, naive_twist};
use moiregauge::campaign::ScanAnalysis;

use super::figure::Drawing;
use super::layout;
use super::layout::{Grid, is_up};
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels, zero_line};
use crate::draw::legend::{self, Key};
use crate::draw::scale::Range;
use crate::draw::style::{
    BLACK, BLUE, GREY, LINE, Marker, ORANGE, PAGE, VECTOR, VECTOR_MARKER, marker,
};
use crate::draw::svg::{Ink, Svg};

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let set = subject.set;
    let mean = set.mean.as_ref().or(set.uncorrected.as_ref());
    let mean = mean.ok_or("this set has no common lattice")?;
    if set.scans.len() < 2 {
        return Err("a single scan shows no relation".to_owned());
    }
    let (wavelength, twist) = (
        mean_wavelength(&mean.lattice),
        mean.twist_strain.twist.to_degrees(),
    );
    let grid = Grid {
        width: PAGE,
        columns: 2,
        rows: 1,
        panel: 130.0,
    };
    let mut svg = Svg::new(subject.id, grid.width, grid.height());
    let slope = twist / wavelength;
    uncertainties(&mut svg, subject, &grid, slope)?;
    deviations(&mut svg, subject, &grid, (wavelength, twist))?;
    let keys: Vec<_> = legend::vectors()
        .chain([
            (Key::Point(Marker::Diamond, BLACK, true), "fit of all three"),
            (Key::Line(GREY, ""), "dθ = θ dλ/λ"),
            (
                Key::Point(Marker::Diamond, ORANGE, true),
                "before correction",
            ),
            (Key::Point(Marker::Diamond, BLUE, true), "after"),
        ])
        .collect();
    legend::row(&mut svg, (layout::LEFT, 11.0), &keys);
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Twist error against wavelength error"),
        caption: format!(
            "(a) σ of the twist against σ of the wavelength, scan by scan: from one wavelength alone (coloured), and from all three vectors together against the mean σ of the three (black). (b) Deviation of each scan's twist from the common one against the deviation of its mean wavelength, before and after the removal of drift. Line: dθ = θ dλ/λ (in b with its sign) for θ = {twist:.4}° and λ = {wavelength:.3} nm. Filled symbols: up scans; open: down scans."
        ),
    })
}

/// Mean length of the three vectors, nm.
fn mean_wavelength(lattice: &Lattice) -> f64 {
    (0..3).map(|v| lattice.wavelength(v).value).sum::<f64>() / 3.0
}

fn best(scan: &ScanAnalysis) -> (Lattice, Option<TwistStrain>) {
    match scan.drift_corrected {
        Some(lattice) => (lattice, scan.twist_strain),
        None => (scan.sensor, scan.twist_strain_sensor),
    }
}

/// One point: Δλ or its σ (nm), Δθ or its σ (°), its look.
type Point = (f64, f64, Marker, &'static str, bool);

fn uncertainties(svg: &mut Svg, subject: &Subject, grid: &Grid, slope: f64) -> Result<(), String> {
    let bilayer = subject.analysis.settings.bilayer();
    let mut points: Vec<Point> = Vec::new();
    for scan in &subject.set.scans {
        let (lattice, fit) = best(scan);
        let up = is_up(scan);
        for vector in 0..3 {
            let wavelength = lattice.wavelength(vector);
            let twist = naive_twist(wavelength, bilayer).sigma.to_degrees();
            points.push((
                wavelength.sigma,
                twist,
                VECTOR_MARKER[vector],
                VECTOR[vector],
                up,
            ));
        }
        if let Some(fit) = fit {
            let sigma = (0..3).map(|v| lattice.wavelength(v).sigma).sum::<f64>() / 3.0;
            points.push((
                sigma,
                fit.twist().sigma.to_degrees(),
                Marker::Diamond,
                BLACK,
                up,
            ));
        }
    }
    let range =
        |values: Vec<f64>| Range::of(values).map(|r| Range::new(0.0, (r.high * 1.25).max(1e-9)));
    let x = range(points.iter().map(|p| p.0).collect()).ok_or("no σ of a wavelength is finite")?;
    let y = range(points.iter().map(|p| p.1).collect()).ok_or("no σ of a twist is finite")?;
    let axes = Axes::new(grid.cell(0, 0), x, y);
    svg.clipped(axes.area, |svg| {
        let line = axes.points([(0.0, 0.0), (x.high, slope * x.high)]);
        svg.polyline(&line, &Ink::line(GREY, LINE));
    });
    scatter(svg, &axes, &points);
    let labels = Labels {
        letter: "a",
        x: "σ of the wavelength (nm)",
        y: "σ of the twist (°)",
        ..Labels::default()
    };
    axes.draw(svg, &labels);
    Ok(())
}

fn deviations(
    svg: &mut Svg,
    subject: &Subject,
    grid: &Grid,
    (wavelength, twist): (f64, f64),
) -> Result<(), String> {
    let mut points: Vec<Point> = Vec::new();
    for scan in &subject.set.scans {
        let results = [
            (Some(scan.sensor), scan.twist_strain_sensor, ORANGE),
            (scan.drift_corrected, scan.twist_strain, BLUE),
        ];
        for (lattice, fit, colour) in results {
            if let (Some(lattice), Some(fit)) = (lattice, fit) {
                let d_lambda = mean_wavelength(&lattice) - wavelength;
                let d_theta = fit.twist.to_degrees() - twist;
                points.push((d_lambda, d_theta, Marker::Diamond, colour, is_up(scan)));
            }
        }
    }
    let x = Range::of(points.iter().map(|p| p.0)).ok_or("no wavelength is finite")?;
    let y = Range::of(points.iter().map(|p| p.1)).ok_or("no twist is finite")?;
    let (x, y) = (x.padded(0.12, 1e-9), y.padded(0.12, 1e-9));
    let axes = Axes::new(grid.cell(1, 0), x, y);
    zero_line(svg, &axes);
    svg.clipped(axes.area, |svg| {
        let slope = -twist / wavelength;
        let line = axes.points([(x.low, slope * x.low), (x.high, slope * x.high)]);
        svg.polyline(&line, &Ink::line(GREY, LINE));
    });
    scatter(svg, &axes, &points);
    let labels = Labels {
        letter: "b",
        x: "Δλ (nm)",
        y: "Δθ (°)",
        ..Labels::default()
    };
    axes.draw(svg, &labels);
    Ok(())
}

fn scatter(svg: &mut Svg, axes: &Axes, points: &[Point]) {
    for &(x, y, shape, colour, up) in points {
        if x.is_finite() && y.is_finite() {
            marker(svg, axes.at(x, y), shape, colour, up);
        }
    }
}
