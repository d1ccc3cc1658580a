//! The three wavelengths of every scan before and after drift correction, with the ±1 % band.

use heterostrain::Estimate;
use moiregauge::campaign::ScanAnalysis;

use super::figure::Drawing;
use super::layout;
use super::layout::{Grid, LETTERS, counting, ends, is_up, ordinal, point};
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels, Ticks};
use crate::draw::legend::{self, Key};
use crate::draw::scale::Range;
use crate::draw::style::{GREY, HAIR, PAGE, PALE, VECTOR, VECTOR_MARKER, VECTOR_NAME};
use crate::draw::svg::{Ink, Svg};

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let set = subject.set;
    let mean = subject.mean()?;
    let grid = Grid {
        width: PAGE,
        columns: 2,
        rows: 3,
        panel: 62.0,
    };
    let mut svg = Svg::new(subject.id, grid.width, grid.height());
    for vector in 0..3 {
        let common = mean.lattice.wavelength(vector).value;
        let before = |scan: &ScanAnalysis| Some(scan.sensor.wavelength(vector));
        let after = |scan: &ScanAnalysis| scan.drift_corrected.map(|l| l.wavelength(vector));
        let all: Vec<Estimate> = set
            .scans
            .iter()
            .flat_map(|s| before(s).into_iter().chain(after(s)))
            .collect();
        let band = [common * 0.99, common * 1.01];
        let range = Range::of(ends(all).chain(band)).ok_or("no wavelength is finite")?;
        for column in 0..2 {
            let x = counting(set.scans.len());
            let axes = Axes::new(grid.cell(column, vector), x, range.padded(0.06, 1e-6));
            axes.band(&mut svg, band[0], band[1], &Ink::area(PALE, 0.6));
            axes.level(&mut svg, common, &Ink::line(GREY, HAIR));
            for (index, scan) in set.scans.iter().enumerate() {
                let value = if column == 0 {
                    before(scan)
                } else {
                    after(scan)
                };
                if let Some(value) = value {
                    let look = (VECTOR_MARKER[vector], VECTOR[vector]);
                    point(&mut svg, &axes, ordinal(index), value, look, is_up(scan));
                }
            }
            let (name, column_title) = (VECTOR_NAME[vector], ["before", "after"][column]);
            let title = format!("{name}, {column_title} drift correction");
            let labels = Labels {
                letter: LETTERS[2 * vector + column],
                title: &title,
                x: if vector == 2 { "scan" } else { "" },
                x_ticks: Ticks::scans(vector == 2),
                y: "wavelength (nm)",
                ..Labels::default()
            };
            axes.draw(&mut svg, &labels);
        }
    }
    let keys: Vec<_> = legend::directions()
        .into_iter()
        .chain([
            (Key::Line(GREY, ""), "common lattice"),
            (Key::Band(PALE, 0.6), "±1 % of it"),
        ])
        .collect();
    legend::row(&mut svg, (layout::LEFT, 11.0), &keys);
    let verdict = if mean.within_one_percent {
        "All corrected wavelengths lie within the band."
    } else {
        "At least one corrected wavelength lies outside the band."
    };
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Wavelengths per scan before and after drift correction"),
        caption: format!(
            "Lengths of the three lattice vectors in sensor coordinates before (left) and after (right) the drift was removed. Line: the common, drift-corrected lattice of all scans; band: ±1 % of it. Filled symbols: up scans; open: down scans. Error bars: one σ. {verdict}"
        ),
    })
}
