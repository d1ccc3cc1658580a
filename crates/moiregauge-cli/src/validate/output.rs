//! What a validation found: a table, a document, a figure.

use std::fmt::Write as _;

use moiregauge::simulate::Simulation;
use moiregauge::spectrum::Method;
use moiregauge_report::pulls;
use serde::Serialize;

use super::compare::{Compared, Comparison, QUANTITIES};

/// What is written.
pub(super) const NAMES: [&str; 5] = [
    "validation.json",
    "sets.csv",
    "conditions.toml",
    "pulls.png",
    "pulls.svg",
];

/// The document `validation.json`.
#[derive(Serialize)]
pub(super) struct Validation {
    schema: &'static str,
    version: &'static str,
    seed: u64,
    method: Method,
    /// Sets that gave drift, twist and strain.
    sets: usize,
    /// Sets that did not.
    failed: usize,
    quantities: Vec<Quantity>,
    /// What true errors would give: the binomial scatter of the coverages, per cent.
    coverage_scatter_percent: [f64; 2],
    conditions: Simulation,
}

/// One quantity over all sets, in its unit.
#[derive(Serialize)]
struct Quantity {
    name: &'static str,
    unit: &'static str,
    mean_error: f64,
    rms_error: f64,
    mean_sigma: f64,
    /// Root mean square of the Cramér–Rao bounds for white pixel noise; null without any.
    cramer_rao: Option<f64>,
    /// `rms_error / cramer_rao`.
    error_over_bound: Option<f64>,
    rms_pull: f64,
    within_1_sigma_percent: f64,
    within_2_sigma_percent: f64,
}

impl Validation {
    pub(super) fn new(
        method: Method,
        seed: u64,
        failed: usize,
        compared: &[Comparison],
        conditions: Simulation,
    ) -> Self {
        let n = compared.len() as f64;
        let quantities = QUANTITIES
            .iter()
            .enumerate()
            .map(|(i, &(name, unit))| {
                let all: Vec<Compared> = compared.iter().map(|c| c[i]).collect();
                quantity(name, unit, &all)
            })
            .collect();
        Self {
            schema: "moiregauge/validation/1",
            version: env!("CARGO_PKG_VERSION"),
            seed,
            method,
            sets: compared.len(),
            failed,
            quantities,
            coverage_scatter_percent: [0.683, 0.954].map(|p| 100.0 * (p * (1.0 - p) / n).sqrt()),
            conditions,
        }
    }

    /// The table, one line for each quantity.
    pub(super) fn table(&self) -> String {
        let mut text = format!(
            "{} sets\n{:18} {:>11} {:>11} {:>11} {:>11} {:>9} {:>9} {:>9} {:>9}\n",
            self.sets,
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
        for q in &self.quantities {
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
        let [one, two] = self.coverage_scatter_percent;
        let _ = writeln!(
            text,
            "true errors would give 68.3 ± {one:.1} % and 95.4 ± {two:.1} %"
        );
        if self.failed > 0 {
            let _ = writeln!(
                text,
                "{} of {} sets gave no drift or no lattice",
                self.failed,
                self.failed + self.sets
            );
        }
        text
    }

    /// The files of a validation.
    pub(super) fn files(&self, compared: &[Comparison]) -> anyhow::Result<Vec<(String, Vec<u8>)>> {
        let of = |i: usize| {
            let pulls = compared.iter().map(|c| c[i].error / c[i].sigma).collect();
            (QUANTITIES[i].0, pulls)
        };
        let quantities: Vec<(&str, Vec<f64>)> = (0..QUANTITIES.len()).map(of).collect();
        let figure = pulls(&quantities).map_err(anyhow::Error::msg)?;
        let mut table = String::from("set");
        for (name, unit) in QUANTITIES {
            let plain = name.replace(' ', "_").replace('₁', "1").replace('₂', "2");
            let _ = write!(
                table,
                ",{plain}_error_{0},{plain}_sigma_{0}",
                plain_unit(unit)
            );
        }
        table.push('\n');
        for (index, set) in compared.iter().enumerate() {
            let _ = write!(table, "{}", index + 1);
            for Compared { error, sigma, .. } in set {
                let _ = write!(table, ",{error},{sigma}");
            }
            table.push('\n');
        }
        let mut document = serde_json::to_string_pretty(self)?;
        document.push('\n');
        Ok(vec![
            ("validation.json".to_owned(), document.into_bytes()),
            ("sets.csv".to_owned(), table.into_bytes()),
            (
                "conditions.toml".to_owned(),
                toml::to_string_pretty(&self.conditions)?.into_bytes(),
            ),
            ("pulls.png".to_owned(), figure.png()?),
            ("pulls.svg".to_owned(), figure.svg.into_bytes()),
        ])
    }
}

fn plain_unit(unit: &str) -> &'static str {
    match unit {
        "°" => "deg",
        "%" => "percent",
        _ => "nm_per_min",
    }
}

fn quantity(name: &'static str, unit: &'static str, all: &[Compared]) -> Quantity {
    let n = all.len() as f64;
    let mean = |f: &dyn Fn(Compared) -> f64| all.iter().map(|c| f(*c)).sum::<f64>() / n;
    let within = |k: f64| 100.0 * mean(&|c| f64::from(u8::from(c.error.abs() <= k * c.sigma)));
    let rms_error = mean(&|c| c.error * c.error).sqrt();
    let bound = Some(mean(&|c| c.bound * c.bound).sqrt()).filter(|b| b.is_finite());
    Quantity {
        name,
        unit,
        mean_error: mean(&|c| c.error),
        rms_error,
        mean_sigma: mean(&|c| c.sigma),
        cramer_rao: bound,
        error_over_bound: bound.map(|b| rms_error / b),
        rms_pull: mean(&|c| (c.error / c.sigma).powi(2)).sqrt(),
        within_1_sigma_percent: within(1.0),
        within_2_sigma_percent: within(2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of exactly ±σ lie within 1 σ, those of 1.5 σ do not; the mean and rms are those of
    /// the numbers put in.
    #[test]
    fn the_table_counts_coverage() {
        let of = |error, sigma| {
            [Compared {
                error,
                sigma,
                bound: 0.5,
            }; 5]
        };
        let compared = vec![of(0.5, 0.5), of(-1.5, 1.0)];
        let conditions = Simulation::default();
        let found = Validation::new(Method::Lattice, 1, 3, &compared, conditions);
        let twist = &found.quantities[2];
        assert_eq!(
            (twist.name, twist.mean_error, twist.mean_sigma),
            ("twist", -0.5, 0.75)
        );
        assert!((twist.rms_error - 1.25f64.sqrt()).abs() < 1e-12);
        assert_eq!(twist.error_over_bound, Some(twist.rms_error / 0.5));
        assert_eq!(
            (twist.within_1_sigma_percent, twist.within_2_sigma_percent),
            (50.0, 100.0)
        );
        assert!(found.table().contains("3 of 5 sets gave no drift"));
    }
}
