//! The tables of an analysis as named files.

use super::budget::BudgetRow;
use super::columns::{Row, ScanRow, SetRow, VectorRow};
use super::csv;
use crate::results::Results;

/// All tables as named files.
pub fn tables(results: &Results) -> Vec<(String, Vec<u8>)> {
    let (vectors, scans, sets, budgets) = (
        VectorRow::rows(results),
        ScanRow::rows(results),
        SetRow::rows(results),
        BudgetRow::rows(results),
    );
    let mut about = format!("{ABOUT}{}\n", csv::APOSTROPHE);
    about.push_str(&csv::explanation(
        "vectors.csv",
        VectorRow::ABOUT,
        VectorRow::COLUMNS,
    ));
    about.push_str(&csv::explanation(
        "scans.csv",
        ScanRow::ABOUT,
        ScanRow::COLUMNS,
    ));
    about.push_str(&csv::explanation(
        "sets.csv",
        SetRow::ABOUT,
        SetRow::COLUMNS,
    ));
    about.push_str(&csv::explanation(
        "budget.csv",
        BudgetRow::ABOUT,
        BudgetRow::COLUMNS,
    ));
    vec![
        (
            "vectors.csv".to_owned(),
            csv::text(VectorRow::COLUMNS, &vectors).into_bytes(),
        ),
        (
            "scans.csv".to_owned(),
            csv::text(ScanRow::COLUMNS, &scans).into_bytes(),
        ),
        (
            "sets.csv".to_owned(),
            csv::text(SetRow::COLUMNS, &sets).into_bytes(),
        ),
        (
            "budget.csv".to_owned(),
            csv::text(BudgetRow::COLUMNS, &budgets).into_bytes(),
        ),
        ("columns.md".to_owned(), about.into_bytes()),
    ]
}

const ABOUT: &str = "# Columns of the tables

Comma-separated, UTF-8, RFC 4180; the unit is the end of the name (`_nm`, `_deg`, `_percent`,
`_nm_per_min`, `_hz`); `_sigma` is one standard deviation of the statistical error (noise and drift), `_total_sigma`
one with everything, calibration and model included (publish this one). An empty field means: not known.
x to the right, y up; angles counter-clockwise from x. `results.json` holds the same and more.
";
