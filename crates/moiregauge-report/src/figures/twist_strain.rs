//! Twist, strain and strain axis of every scan before and after drift correction, with the means.

use heterostrain::Estimate;
use heterostrain::strain::TwistStrain;
use moiregauge::campaign::ScanAnalysis;

use super::figure::Drawing;
use super::layout;
use super::layout::{Grid, LETTERS, counting, ends, is_up, ordinal, point};
use super::subject::Subject;
use crate::draw::axes::{Axes, Labels, Ticks, mean_band};
use crate::draw::legend::{self, Key};
use crate::draw::scale::Range;
use crate::draw::style::{BLUE, GREY, Marker, ORANGE, PAGE, SMALL, lettering};
use crate::draw::svg::{Anchor, Lettering, Svg};
use crate::stats::axis_near;

/// Twist (°), strain (%) or axis (°, near `axis`); `None` for an axis that means nothing.
fn quantity(result: &TwistStrain, row: usize, axis: f64) -> Option<Estimate> {
    let degree = 1_f64.to_degrees();
    match row {
        0 => Some(result.twist().scaled(degree)),
        1 => Some(result.heterostrain().scaled(100.0)),
        _ => result
            .axis_lab()
            .map(|a| Estimate::new(axis_near(a.value, axis), a.sigma).scaled(degree)),
    }
}

pub(super) fn draw(subject: &Subject) -> Result<Drawing, String> {
    let set = subject.set;
    let (Some(after), Some(before)) = (set.with_drift(), &set.uncorrected) else {
        return Err("the drift of this set is not known".to_owned());
    };
    let means = [&before.twist_strain, &after.twist_strain];
    let vector = after.twist_strain.strain_vector;
    let axis = vector.y.atan2(vector.x) / 2.0;
    let of = |scan: &ScanAnalysis, column: usize| {
        if column == 0 {
            scan.twist_strain_sensor
        } else {
            scan.twist_strain
        }
    };
    let grid = Grid {
        width: PAGE,
        columns: 2,
        rows: 3,
        panel: 70.0,
    };
    let mut svg = Svg::new(subject.id, grid.width, grid.height());
    for row in 0..3 {
        let scans = set
            .scans
            .iter()
            .flat_map(|s| [of(s, 0), of(s, 1)])
            .flatten();
        let all: Vec<Estimate> = scans
            .chain(means.into_iter().copied())
            .filter_map(|t| quantity(&t, row, axis))
            .collect();
        let range = Range::of(ends(all)).map_or(Range::new(0.0, 180.0), |r| r.padded(0.08, 1e-6));
        for column in 0..2 {
            let axes = Axes::new(grid.cell(column, row), counting(set.scans.len()), range);
            let mean = quantity(means[column], row, axis);
            if let Some(mean) = mean {
                mean_band(&mut svg, &axes, mean.value, mean.sigma, ORANGE);
            }
            let values: Vec<_> = set
                .scans
                .iter()
                .map(|scan| {
                    (
                        of(scan, column).and_then(|t| quantity(&t, row, axis)),
                        is_up(scan),
                    )
                })
                .collect();
            for (index, (value, up)) in values.iter().enumerate() {
                if let Some(value) = value {
                    point(
                        &mut svg,
                        &axes,
                        ordinal(index),
                        *value,
                        (Marker::Circle, BLUE),
                        *up,
                    );
                }
            }
            if row == 2 && values.iter().all(|(value, _)| value.is_none()) {
                let area = axes.area;
                let at = (area.x + area.width / 2.0, area.y + area.height / 2.0);
                let grey = Lettering {
                    fill: GREY,
                    ..lettering(SMALL, Anchor::Middle)
                };
                svg.text(at, "no scan has a significant strain", &grey);
            }
            let name = ["twist θ", "strain ε", "strain axis φ"][row];
            let title = format!("{name}, {} drift correction", ["before", "after"][column]);
            let labels = Labels {
                letter: LETTERS[2 * row + column],
                title: &title,
                x: if row == 2 { "scan" } else { "" },
                x_ticks: Ticks::scans(row == 2),
                y: ["θ (°)", "ε (%)", "φ, from x (°)"][row],
                ..Labels::default()
            };
            axes.draw(&mut svg, &labels);
        }
    }
    let keys: Vec<_> = legend::directions()
        .into_iter()
        .chain([
            (Key::Line(ORANGE, ""), "all scans together"),
            (Key::Band(ORANGE, 0.18), "±1σ"),
        ])
        .collect();
    legend::row(&mut svg, (layout::LEFT, 11.0), &keys);
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Twist and strain per scan before and after drift correction"),
        caption: "Twist angle, heterostrain and axis of the strain in the laboratory (counter-clockwise from x, modulo \
                  180°) of every scan before (left) and after (right) the drift was removed. Line and band: the result \
                  from all scans together and its statistical σ (calibration and model change all scans by the same \
                  amount). The strain is the length of the strain vector with the noise bias removed: it is zero where \
                  noise alone explains it. Axes are shown only where the strain is significant (p < 0.01). Filled \
                  symbols: up scans; open: down scans.".to_owned(),
    })
}
