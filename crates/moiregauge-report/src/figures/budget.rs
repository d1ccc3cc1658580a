//! The uncertainty budget: a bar for every source of error, on a logarithmic scale.

use heterostrain::Estimate;
use moiregauge::campaign::Analysis;
use moiregauge::meaning::{Budget, Contribution, Source};

use super::figure::Drawing;
use super::layout;
use crate::draw::legend::{self, Key};
use crate::draw::letters::text_width;
use crate::draw::scale::{Range, Scale, fixed};
use crate::draw::style::{
    BLACK, BLUE, GREY, HAIR, LETTER, ORANGE, PAGE, SMALL, TEXT, VECTOR, lettering,
};
use crate::draw::svg::{Anchor, Ink, Lettering, Rect, Svg};
use crate::format::two_digits;

/// Height of a row, pt.
const ROW: f64 = 12.5;
/// Space for the names of the rows, pt.
const NAMES: f64 = 112.0;
/// Space right of the bars for the last number, pt.
const RIGHT: f64 = 12.0;
/// Decades shown at most; a bar that is shorter keeps its number.
const DECADES: f64 = 5.0;

/// Rows from top to bottom: name, and the sources that it sums.
const ROWS: [(&str, Kind, &[Source]); 15] = [
    ("image noise", Kind::Statistical, &[Source::Image]),
    ("drift", Kind::Statistical, &[Source::Drift]),
    ("sensor noise", Kind::Statistical, &[Source::Sensor]),
    (
        "statistical σ: all three",
        Kind::Sum,
        &[Source::Image, Source::Drift, Source::Sensor],
    ),
    ("calibration: gain", Kind::Calibration, &[Source::Gain]),
    (
        "calibration: x against y",
        Kind::Calibration,
        &[Source::Mismatch],
    ),
    (
        "calibration: right angle",
        Kind::Calibration,
        &[Source::Orthogonality],
    ),
    (
        "pitch: N or N − 1 pixels",
        Kind::Calibration,
        &[Source::Pitch],
    ),
    ("shape of the grid", Kind::Calibration, &[Source::Shape]),
    ("lattice constant", Kind::Model, &[Source::LatticeConstant]),
    (
        "model: which layer is strained",
        Kind::Model,
        &[Source::StrainedLayer],
    ),
    (
        "model: isotropic strain",
        Kind::Model,
        &[Source::IsotropicStrain],
    ),
    ("model: Poisson ratio", Kind::Model, &[Source::PoissonRatio]),
    ("strain of the ruler", Kind::Model, &[Source::RulerStrain]),
    ("total", Kind::Sum, &Source::ALL),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Statistical,
    Calibration,
    Model,
    Sum,
}

impl Kind {
    fn colour(self) -> &'static str {
        match self {
            Self::Statistical => BLUE,
            Self::Calibration => ORANGE,
            Self::Model => VECTOR[2],
            Self::Sum => BLACK,
        }
    }
}

pub(super) fn draw(analysis: &Analysis, id: &str) -> Result<Drawing, String> {
    let (budget, of) = shown(analysis).ok_or("no set has a common lattice")?;
    let top = layout::LEGEND + layout::ABOVE;
    let rows = rows(budget);
    let height = rows.len() as f64 * ROW;
    let mut svg = Svg::new(id, PAGE, top + height + layout::BELOW);
    let width = (PAGE - NAMES - 3.0 * RIGHT) / 2.0;
    let panel = |i: f64| Rect::new(NAMES + i * (width + 2.0 * RIGHT), top, width, height);
    let sigma = |variance: f64| Estimate::from_variance(0.0, variance).sigma;
    let twist = |c: &Contribution| sigma(c.covariance[(0, 0)]).to_degrees();
    let strain = |c: &Contribution| 100.0 * sigma(c.magnitude);
    bars(
        &mut svg,
        panel(0.0),
        budget,
        ("a", "σ of the twist (°)"),
        twist,
    )?;
    bars(
        &mut svg,
        panel(1.0),
        budget,
        ("b", "σ of the heterostrain (%)"),
        strain,
    )?;
    for (row, (name, kind, sources)) in rows.iter().enumerate() {
        let name = match sources {
            [Source::Drift] if budget.drift_assumed => "drift (assumed)",
            _ => name,
        };
        let at = (NAMES - 5.0, middle(top, row) + 0.36 * SMALL);
        let text = Lettering {
            bold: *kind == Kind::Sum,
            ..lettering(SMALL, Anchor::End)
        };
        svg.text(at, name, &text);
    }
    let keys = [
        (Key::Band(BLUE, 1.0), "seen by the scans"),
        (Key::Band(ORANGE, 1.0), "calibration of the scanner"),
        (Key::Band(VECTOR[2], 1.0), "layers and model"),
        (Key::Band(BLACK, 1.0), "sums"),
    ];
    legend::row(&mut svg, (NAMES, 11.0), &keys);
    Ok(Drawing {
        wide: true,
        svg: svg.finish("Uncertainty budget"),
        caption: format!(
            "Contributions to the uncertainty of twist (a) and heterostrain (b) of {of}: one standard deviation each, \
             logarithmic scale. The squares of image noise, drift and sensor noise add up to the square of the \
             statistical σ; the squares of all contributions add up to that of the total, which every result quotes \
             first. More scans reduce the first three. The others are the same in every scan; only a better \
             calibration or better knowledge of the layers reduces them. The uncertainties of calibration, lattice \
             constant and model come from the settings."
        ),
    })
}

/// The budget of all sets together or, where there is none, of the first set that has one.
fn shown(analysis: &Analysis) -> Option<(&Budget, String)> {
    if let Some(combined) = analysis
        .combined
        .as_ref()
        .filter(|_| analysis.sets.len() > 1)
    {
        return Some((&combined.budget, "all sets together".to_owned()));
    }
    let of_mean = |corrected: bool| {
        analysis.sets.iter().find_map(|set| {
            let mean = if corrected {
                &set.mean
            } else {
                &set.uncorrected
            };
            let note = if corrected {
                ""
            } else {
                ", not corrected for drift"
            };
            Some((
                &mean.as_ref()?.budget,
                format!("the set {}{note}", set.name),
            ))
        })
    };
    of_mean(true).or_else(|| of_mean(false))
}

/// A row: its name, and the sources that it sums.
type Row = (&'static str, Kind, &'static [Source]);

/// All rows that say something.
fn rows(budget: &Budget) -> Vec<Row> {
    let shown = |sources: &[Source]| sources.iter().any(|source| budget.has(*source));
    ROWS.into_iter().filter(|row| shown(row.2)).collect()
}

fn middle(top: f64, row: usize) -> f64 {
    top + (row as f64 + 0.5) * ROW
}

fn bars(
    svg: &mut Svg,
    area: Rect,
    budget: &Budget,
    (letter, title): (&str, &str),
    sigma: impl Fn(&Contribution) -> f64,
) -> Result<(), String> {
    let rows = rows(budget);
    let found = rows.iter().map(|(_, _, sources)| {
        let missing = !budget.drift_known() && sources.contains(&Source::Drift);
        let known = budget.sum(|s| sources.contains(&s) && !(missing && s == Source::Drift));
        // A sum without its drift is drawn, with a mark; the drift itself is not.
        let nothing = missing && sources.len() == 1;
        (if nothing { f64::NAN } else { sigma(&known) }, missing)
    });
    let values: Vec<(f64, bool)> = found.collect();
    let largest = values.iter().map(|v| v.0).filter(|v| v.is_finite());
    let largest = largest.fold(0.0, f64::max);
    if largest <= 0.0 {
        return Err("no contribution is known".to_owned());
    }
    let smallest = values.iter().map(|v| v.0).filter(|v| *v > 0.0);
    let smallest = smallest.fold(largest, f64::min);
    let high = largest.log10().ceil();
    let low = (smallest.log10() - 0.2).floor().max(high - DECADES);
    let words: Vec<String> = values.iter().map(|v| number(v.0, v.1)).collect();
    // Every bar leaves space for the number at its end.
    let spans = values.iter().zip(&words).filter(|(v, _)| v.0 > 0.0);
    let reach = spans.map(|(v, text)| {
        let room = area.width - text_width(text, SMALL) * 1.15 - 4.0;
        low + (v.0.log10() - low).max(0.02) * area.width / room.max(0.2 * area.width)
    });
    let scale = Scale::new(
        Range::new(low, reach.fold(high, f64::max)),
        area.x,
        area.right(),
    );
    let mut decade = low;
    while decade <= scale.range.high {
        let x = scale.at(decade);
        svg.line((x, area.y), (x, area.bottom()), &Ink::line("#e3e6e9", HAIR));
        let at = (x, area.bottom() + 4.0 + SMALL);
        svg.text(at, &power(decade), &lettering(SMALL, Anchor::Middle));
        decade += 1.0;
    }
    for (row, ((_, kind, _), (value, _))) in rows.iter().zip(&values).enumerate() {
        let y = middle(area.y, row);
        let shown = if *value > 0.0 { value.log10() } else { low };
        let end = scale.at(shown.max(low + 0.02));
        let bar = Rect::new(area.x, y - 0.32 * ROW, end - area.x, 0.64 * ROW);
        svg.rect(bar, &Ink::area(kind.colour(), 1.0));
        let at = (end + 3.0, y + 0.36 * SMALL);
        let text = Lettering {
            bold: *kind == Kind::Sum,
            fill: if value.is_finite() { BLACK } else { GREY },
            ..lettering(SMALL, Anchor::Start)
        };
        svg.text(at, &words[row], &text);
    }
    svg.line(
        (area.x, area.y),
        (area.x, area.bottom()),
        &Ink::line(BLACK, HAIR),
    );
    let at = (
        area.x + area.width / 2.0,
        area.bottom() + 6.0 + SMALL + 2.0 + TEXT,
    );
    svg.text(at, title, &lettering(TEXT, Anchor::Middle));
    let bold = Lettering {
        bold: true,
        ..lettering(LETTER, Anchor::Start)
    };
    svg.text((area.x, area.y - 4.0), letter, &bold);
    Ok(())
}

/// What stands at the end of a bar.
fn number(value: f64, incomplete: bool) -> String {
    if !value.is_finite() {
        return "not known".to_owned();
    }
    let mark = if incomplete { " + drift" } else { "" };
    format!("{}{mark}", two_digits(value))
}

/// Ten to a whole power, written out unless it is long.
fn power(exponent: f64) -> String {
    if exponent > -5.0 {
        return fixed(10_f64.powf(exponent), (-exponent).max(0.0) as usize);
    }
    let digits = format!("{:.0}", -exponent);
    let raised = |c: char| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(c.to_digit(10)? as usize);
    format!(
        "10⁻{}",
        digits.chars().filter_map(raised).collect::<String>()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decades_are_written_out() {
        assert_eq!(power(-3.0), "0.001");
        assert_eq!(power(1.0), "10");
        assert_eq!(power(-12.0), "10⁻¹²");
    }

    /// Every source stands in one row of its own and in the total.
    #[test]
    fn rows_hold_every_source() {
        for source in Source::ALL {
            let rows = ROWS.iter().filter(|(_, kind, of)| {
                *kind != Kind::Sum && of.contains(&source) && of.len() == 1
            });
            assert_eq!(rows.count(), 1, "{source:?}");
            assert_eq!(source.is_statistical(), ROWS[3].2.contains(&source));
        }
    }
}
