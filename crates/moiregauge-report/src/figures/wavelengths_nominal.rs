//! Wavelengths and naive twist angles by the nominal size of the scan and by the sensors.

use heterostrain::Estimate;
use heterostrain::lattice::Lattice;
use heterostrain::strain::naive_twist;

use super::figure::Drawing;
use super::layout;
use super::layout::{Grid, LETTERS, counting, ends, is_up, ordinal, point};
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels, Ticks};
use crate::draw::legend;
use crate::draw::scale::Range;
use crate::draw::style::{PAGE, VECTOR, VECTOR_MARKER};
use crate::draw::svg::Svg;

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let scans = &subject.set.scans;
    if scans.iter().all(|scan| scan.nominal.is_none()) {
        return Err("the files state no nominal size".to_owned());
    }
    let bilayer = subject.analysis.settings.bilayer();
    let twist = |wavelength: Estimate| {
        let angle = naive_twist(wavelength, bilayer);
        angle.scaled(1_f64.to_degrees())
    };
    let value = |lattice: &Lattice, vector: usize, row: usize| {
        let wavelength = lattice.wavelength(vector);
        if row == 0 {
            wavelength
        } else {
            twist(wavelength)
        }
    };
    let grid = Grid {
        width: PAGE,
        columns: 2,
        rows: 2,
        panel: 92.0,
    };
    let mut svg = Svg::new(subject.id, grid.width, grid.height());
    for row in 0..2 {
        let both = scans
            .iter()
            .flat_map(|s| s.nominal.iter().chain([&s.sensor]));
        let all = both.flat_map(|lattice| (0..3).map(move |v| value(lattice, v, row)));
        let range = Range::of(ends(all)).ok_or("no wavelength is finite")?;
        let range = range.padded(0.08, 1e-6);
        for column in 0..2 {
            let axes = Axes::new(grid.cell(column, row), counting(scans.len()), range);
            for (index, scan) in scans.iter().enumerate() {
                let lattice = if column == 0 {
                    scan.nominal.as_ref()
                } else {
                    Some(&scan.sensor)
                };
                for vector in 0..3 {
                    if let Some(lattice) = lattice {
                        // Side by side, or equal wavelengths hide each other.
                        let x = ordinal(index) + (vector as f64 - 1.0) * 0.16;
                        let look = (VECTOR_MARKER[vector], VECTOR[vector]);
                        point(
                            &mut svg,
                            &axes,
                            x,
                            value(lattice, vector, row),
                            look,
                            is_up(scan),
                        );
                    }
                }
            }
            let labels = Labels {
                letter: LETTERS[2 * row + column],
                title: ["nominal size", "position sensors"][column],
                x: if row == 1 { "scan" } else { "" },
                x_ticks: Ticks::scans(row == 1),
                y: ["wavelength (nm)", "naive twist (°)"][row],
                ..Labels::default()
            };
            axes.draw(&mut svg, &labels);
        }
    }
    legend::vectors_and_directions(&mut svg, (layout::LEFT, 11.0));
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Wavelengths and naive twist, nominal against sensor"),
        caption: "Lengths of the three lattice vectors (a, b) and the twist that follows from each of them by θ = 2 \
                  arcsin(a/2λ), which holds only for undistorted lattices (c, d). Left: pixels placed by the nominal \
                  size of the scan; right: by the position sensors. Nothing is corrected for drift. Filled symbols: up \
                  scans; open: down scans. Error bars: one σ.".to_owned(),
    })
}
