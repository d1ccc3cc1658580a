//! Numbers and tables as the program writes them.

use heterostrain::{Estimate, TotalEstimate};
use moiregauge_report::{Results, with_statistical};
use pyo3::prelude::*;

use crate::errors::wrong;

/// `value ± σ`, or `value ± total (statistical ± σ)`, rounded to the uncertainty; NaN is what is not known.
#[pyfunction]
#[pyo3(signature = (value, sigma, total))]
pub(crate) fn plus_minus(value: f64, sigma: f64, total: Option<f64>) -> String {
    match total {
        None => moiregauge_report::plus_minus(Estimate::new(value, sigma)),
        Some(total) => {
            let found = TotalEstimate {
                value,
                statistical: sigma,
                total,
            };
            with_statistical(found, "")
        }
    }
}

/// The tables of the report of a results document: names and texts of `vectors.csv` and so on, and `columns.md`.
#[pyfunction]
pub(crate) fn tables(py: Python<'_>, document: &str) -> PyResult<Vec<(String, String)>> {
    py.detach(|| {
        let results: Results = serde_json::from_str(document).map_err(wrong)?;
        let text = |(name, bytes): (String, Vec<u8>)| {
            let text = String::from_utf8(bytes).map_err(wrong)?;
            Ok((name, text))
        };
        moiregauge_report::tables(&results)
            .into_iter()
            .map(text)
            .collect()
    })
}
