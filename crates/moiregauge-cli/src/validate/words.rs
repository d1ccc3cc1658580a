//! What a validation says on the screen.

use std::fmt::Write as _;

use moiregauge_pipeline::validate::{Tally, Validation};

/// The table, one line for each quantity.
pub(super) fn table(found: &Validation) -> String {
    let mut text = format!(
        "{} sets\n{:18} {:>11} {:>11} {:>11} {:>11} {:>9} {:>9} {:>9} {:>9}\n",
        found.sets,
        "",
        "mean error",
        "rms error",
        "mean σ",
        "bound",
        "rms/bound",
        "rms pull",
        "in 1 σ %",
        "in 2 σ %"
    );
    for q in &found.quantities {
        let name = format!("{} ({})", q.name, q.unit);
        let _ = writeln!(
            text,
            "{name:18} {:11.6} {:11.6} {:11.6} {:>11} {:>9} {:9.2} {:9.1} {:9.1}",
            q.mean_error,
            q.rms_error,
            q.mean_sigma,
            q.cramer_rao.map_or("–".to_owned(), |b| format!("{b:.6}")),
            q.error_over_bound
                .map_or("–".to_owned(), |r| format!("{r:.2}")),
            q.rms_pull,
            q.within_1_sigma_percent,
            q.within_2_sigma_percent
        );
    }
    let [one, two] = found.coverage_scatter_percent;
    let _ = writeln!(
        text,
        "correct errors would give 68.3 ± {one:.1} % and 95.4 ± {two:.1} %"
    );
    if found.failed > 0 {
        let _ = writeln!(
            text,
            "{} of {} sets gave no drift or no lattice",
            found.failed,
            found.failed + found.sets
        );
    }
    text
}

/// One line for each sample.
pub(super) fn samples(tallies: &[Tally]) -> String {
    let mut text = format!(
        "{:18} {:>6} {:>9} {:>8} {:>12} {:>9} {:>15} {:>12}\n",
        "sample",
        "sets",
        "answered",
        "refused",
        "beyond 5 σ",
        "rms pull",
        "median error °",
        "caveats %"
    );
    for tally in tallies {
        text += &line(tally);
    }
    text += "beyond 5 σ: more than five total σ of the twist from the truth; without a moiré, every answer.\n\
             Pulls use the statistical σ. With several grains, the one nearest to the answer counts as the truth.\n";
    text
}

fn line(tally: &Tally) -> String {
    let share = match tally.answered {
        0 => "–".to_owned(),
        n => format!("{:.0}", 100.0 * tally.doubted as f64 / n as f64),
    };
    let number = |value: Option<f64>, digits: usize| {
        value.map_or("–".to_owned(), |v| format!("{v:.digits$}"))
    };
    format!(
        "{:18} {:>6} {:>9} {:>8} {:>12} {:>9} {:>15} {:>12}\n",
        tally.sample,
        tally.outcomes.len(),
        tally.answered,
        tally.outcomes.len() - tally.answered,
        tally.wrong,
        number(tally.rms_pull, 2),
        number(tally.median_error_deg, 5),
        share,
    )
}
