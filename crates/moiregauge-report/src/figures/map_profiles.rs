//! Twist and strain along lines, with error bands.

use heterostrain::Estimate;
use moiregauge::region::{Profile, ProfileValues};

use super::figure::Drawing;
use super::layout::{self, Grid, shortened};
use super::subject::MapSubject;
use crate::draw::axes::{Axes, Labels, Ticks};
use crate::draw::legend::{self, Key};
use crate::draw::scale::Range;
use crate::draw::style::{COLUMN, LINE, SET};
use crate::draw::svg::{Ink, Svg};

type Value = fn(&ProfileValues) -> Estimate;

pub(super) fn draw(subject: &MapSubject) -> Result<Drawing, String> {
    let profiles = &subject.details.profiles;
    if profiles.is_empty() {
        return Err("no line was asked for".to_owned());
    }
    let grid = Grid {
        width: COLUMN,
        columns: 1,
        rows: 3,
        panel: 62.0,
    };
    let longest = profiles
        .iter()
        .filter_map(|p| p.points.last())
        .map(|p| p.distance);
    let x = Range::new(0.0, longest.fold(f64::MIN_POSITIVE, f64::max));
    let rows: [(&str, Value); 3] = [
        ("twist θ (°)", |v| v.twist.scaled(1f64.to_degrees())),
        ("strain |ε| (%)", |v| v.magnitude.scaled(100.0)),
        ("wavelength (nm)", |v| v.wavelength),
    ];
    let mut svg = Svg::new(subject.id, grid.width, grid.height());
    for (row, (label, value)) in rows.into_iter().enumerate() {
        let values = profiles
            .iter()
            .flat_map(|p| &p.points)
            .filter_map(|p| p.values);
        let range = Range::of(layout::ends(values.map(|v| value(&v))));
        let range = range
            .ok_or("no line crosses good nodes")?
            .padded(0.08, 1e-9);
        let axes = Axes::new(grid.cell(0, row), x, range);
        svg.clipped(axes.area, |svg| {
            for (profile, colour) in profiles.iter().zip(SET.iter().cycle()) {
                line(svg, &axes, profile, value, colour);
            }
        });
        let last = row == 2;
        let labels = Labels {
            letter: layout::LETTERS[row],
            x: if last { "distance (nm)" } else { "" },
            y: label,
            x_ticks: if last {
                Ticks::Values
            } else {
                Ticks::BareValues
            },
            ..Labels::default()
        };
        axes.draw(&mut svg, &labels);
    }
    let names: Vec<String> = profiles.iter().map(|p| shortened(&p.name)).collect();
    let keys: Vec<(Key, &str)> = names
        .iter()
        .zip(SET.iter().cycle())
        .map(|(name, colour)| (Key::Line(colour, ""), name.as_str()))
        .collect();
    legend::row(&mut svg, (layout::LEFT, 10.0), &keys);
    Ok(Drawing {
        wide: false,
        svg: svg.finish("Line profiles"),
        caption: format!(
            "The map along lines, with bands of ± σ. Points nearer than {:.1} nm share their noise. Gaps: the line \
             leaves the good nodes.",
            2.355 * subject.map.window_nm
        ),
    })
}

/// The unbroken parts of a profile, each with its band.
fn line(svg: &mut Svg, axes: &Axes, profile: &Profile, value: Value, colour: &str) {
    for part in profile.points.split(|p| p.values.is_none()) {
        let points: Vec<(f64, Estimate)> = part
            .iter()
            .filter_map(|p| p.values.map(|v| (p.distance, value(&v))))
            .collect();
        let upper = points.iter().map(|(d, e)| (*d, e.value + e.sigma));
        let lower = points.iter().rev().map(|(d, e)| (*d, e.value - e.sigma));
        let band = axes.points(upper.chain(lower));
        if points.len() > 1 {
            svg.polygon(&band, &Ink::area(colour, 0.22));
        }
        let middle = axes.points(points.iter().map(|(d, e)| (*d, e.value)));
        svg.polyline(&middle, &Ink::line(colour, LINE));
    }
}
