//! What a validation found: a document, a table of all sets, a figure.

use std::fmt::Write as _;

use moiregauge::simulate::Simulation;
use moiregauge::spectrum::Method;
use moiregauge_report::pulls;
use serde::Serialize;

use super::compare::{Compared, Comparison, QUANTITIES};
use super::request::ValidateRequest;
use crate::sink::{Sink, SinkError};

/// Whatever a figure or a document cannot be made for.
type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// What is written.
pub const VALIDATION_FILES: [&str; 5] = [
    "validation.json",
    "sets.csv",
    "conditions.toml",
    "pulls.png",
    "pulls.svg",
];

/// The document `validation.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Validation {
    /// `moiregauge/validation/1`.
    pub schema: &'static str,
    /// Version of the library.
    pub version: &'static str,
    /// Seed of all noise.
    pub seed: u64,
    /// Estimator of the lattice vectors.
    pub method: Method,
    /// Sets that gave drift, twist and strain.
    pub sets: usize,
    /// Sets that did not.
    pub failed: usize,
    /// Drift, twist, strain.
    pub quantities: Vec<QuantityFound>,
    /// What true errors would give: the binomial scatter of the coverages, per cent.
    pub coverage_scatter_percent: [f64; 2],
    /// Instrument and sample.
    pub conditions: Simulation,
    /// Set by set.
    #[serde(skip)]
    pub compared: Vec<Comparison>,
}

/// One quantity over all sets, in its unit.
#[derive(Clone, Debug, Serialize)]
pub struct QuantityFound {
    /// Its name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Found minus true.
    pub mean_error: f64,
    /// Root mean square.
    pub rms_error: f64,
    /// Mean of the stated σ.
    pub mean_sigma: f64,
    /// Root mean square of the Cramér–Rao bounds for white pixel noise; null without any.
    pub cramer_rao: Option<f64>,
    /// `rms_error / cramer_rao`.
    pub error_over_bound: Option<f64>,
    /// Root mean square of errors over their stated σ.
    pub rms_pull: f64,
    /// Share of errors up to σ.
    pub within_1_sigma_percent: f64,
    /// Share of errors up to 2 σ.
    pub within_2_sigma_percent: f64,
}

impl Validation {
    pub(super) fn new(request: &ValidateRequest, failed: usize, compared: Vec<Comparison>) -> Self {
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
            seed: request.seed,
            method: request.method,
            sets: compared.len(),
            failed,
            quantities,
            coverage_scatter_percent: [0.683, 0.954].map(|p| 100.0 * (p * (1.0 - p) / n).sqrt()),
            conditions: request.conditions.clone(),
            compared,
        }
    }

    /// Writes all files.
    ///
    /// # Errors
    /// [`SinkError`].
    pub fn write(&self, sink: &dyn Sink) -> Result<(), SinkError> {
        for (name, bytes) in self
            .files()
            .map_err(|why| SinkError::made("validation", why))?
        {
            sink.write(&name, &bytes)?;
        }
        Ok(())
    }

    /// The files of a validation.
    fn files(&self) -> Result<Vec<(String, Vec<u8>)>, AnyError> {
        let of = |i: usize| {
            let pulls = self
                .compared
                .iter()
                .map(|c| c[i].error / c[i].sigma)
                .collect();
            (QUANTITIES[i].0, pulls)
        };
        let quantities: Vec<(&str, Vec<f64>)> = (0..QUANTITIES.len()).map(of).collect();
        let figure = pulls(&quantities)?;
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
        for (index, set) in self.compared.iter().enumerate() {
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

fn quantity(name: &'static str, unit: &'static str, all: &[Compared]) -> QuantityFound {
    let n = all.len() as f64;
    let mean = |f: &dyn Fn(Compared) -> f64| all.iter().map(|c| f(*c)).sum::<f64>() / n;
    let within = |k: f64| 100.0 * mean(&|c| f64::from(u8::from(c.error.abs() <= k * c.sigma)));
    let rms_error = mean(&|c| c.error * c.error).sqrt();
    let bound = Some(mean(&|c| c.bound * c.bound).sqrt()).filter(|b| b.is_finite());
    QuantityFound {
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
        let found = Validation::new(&ValidateRequest::default(), 3, compared);
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
        assert_eq!((found.sets, found.failed), (2, 3));
    }
}
