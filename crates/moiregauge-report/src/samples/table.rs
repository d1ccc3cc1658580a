//! The table of all samples, and that of what failed.

use super::row::{SampleRow, SampleStatus};
use crate::tables::{Column, csv_text, number};

/// The columns of `samples.csv`.
const COLUMNS: [Column<SampleRow>; 17] = [
    Column::new(
        "sample",
        "name of the sample: its folder, or the name in the table of samples",
        |r| r.sample.clone(),
    ),
    Column::new("moire", "number of the moiré, from 1", |r| {
        r.moire.to_string()
    }),
    Column::new(
        "status",
        "`ok`; `doubtful`: a serious caveat, no drift, or a file that could not be used; `failed`",
        |r| r.status.name().to_owned(),
    ),
    Column::new("scans", "scans that were used", |r| r.scans.to_string()),
    Column::new("twist_deg", "twist θ", |r| number(r.twist_deg)),
    Column::new("twist_sigma_deg", "its statistical σ", |r| {
        number(r.twist_sigma_deg)
    }),
    Column::new(
        "twist_sigma_total_deg",
        "its σ with everything, calibration and model included",
        |r| number(r.twist_sigma_total_deg),
    ),
    Column::new("heterostrain_percent", "ε, noise bias removed", |r| {
        number(r.heterostrain_percent)
    }),
    Column::new("heterostrain_sigma_percent", "its statistical σ", |r| {
        number(r.heterostrain_sigma_percent)
    }),
    Column::new(
        "heterostrain_sigma_total_percent",
        "its σ with everything",
        |r| number(r.heterostrain_sigma_total_percent),
    ),
    Column::new(
        "drift_x_nm_per_min",
        "drift of the first set to the right",
        |r| number(r.drift_x_nm_per_min),
    ),
    Column::new("drift_x_sigma_nm_per_min", "its σ", |r| {
        number(r.drift_x_sigma_nm_per_min)
    }),
    Column::new(
        "drift_y_nm_per_min",
        "drift of the first set upwards",
        |r| number(r.drift_y_nm_per_min),
    ),
    Column::new("drift_y_sigma_nm_per_min", "its σ", |r| {
        number(r.drift_y_sigma_nm_per_min)
    }),
    Column::new("caveats", "codes of the caveats, divided by blanks", |r| {
        r.caveats.join(" ")
    }),
    Column::new(
        "failed_files",
        "files that could not be used",
        |r| match r.status {
            SampleStatus::Failed => String::new(),
            _ => r.failed.len().to_string(),
        },
    ),
    Column::new(
        "error",
        "reason why there are no numbers, or why files could not be used",
        SampleRow::error,
    ),
];

/// `samples.csv`: one row for each moiré of each sample.
pub fn samples_csv(rows: &[SampleRow]) -> Vec<u8> {
    csv_text(&COLUMNS, rows).into_bytes()
}

/// `samples.parquet`: the same table.
///
/// # Errors
/// None in practice: everything is written into memory.
#[cfg(feature = "parquet")]
pub fn samples_parquet(rows: &[SampleRow]) -> Result<Vec<u8>, crate::error::ReportError> {
    crate::tables::parquet_of(&COLUMNS, rows)
}

/// One thing that failed.
struct Failed<'a> {
    sample: &'a str,
    file: &'a str,
    error: &'a str,
}

/// `failed.csv`: what failed and why, one row for each file or sample.
pub fn failed_csv(rows: &[SampleRow]) -> Vec<u8> {
    let columns: [Column<Failed<'_>>; 3] = [
        Column::new("sample", "name of the sample", |f| f.sample.to_owned()),
        Column::new(
            "file",
            "the file, or the sample where all of it failed",
            |f| f.file.to_owned(),
        ),
        Column::new("error", "why", |f| f.error.to_owned()),
    ];
    // The files of a sample are the same for all its moirés.
    let firsts = rows.iter().filter(|row| row.moire == 1);
    let all: Vec<Failed<'_>> = firsts
        .flat_map(|row| {
            row.failed.iter().map(|failed| Failed {
                sample: &row.sample,
                file: &failed.file,
                error: &failed.error,
            })
        })
        .collect();
    csv_text(&columns, &all).into_bytes()
}
