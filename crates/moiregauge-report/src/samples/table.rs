//! The table of all samples, and that of what failed.

use super::row::{SampleRow, SampleStatus};
use crate::tables::{Column, csv_text, number};

/// The columns of `samples.csv`.
const COLUMNS: [Column<SampleRow>; 17] = [
    Column {
        name: "sample",
        about: "name of the sample: its folder, or as the table of samples says",
        value: |r| r.sample.clone(),
    },
    Column {
        name: "moire",
        about: "number of the moiré, from 1",
        value: |r| r.moire.to_string(),
    },
    Column {
        name: "status",
        about: "`ok`; `doubtful`: a serious caveat, no drift, or a file that could not be used; `failed`",
        value: |r| r.status.name().to_owned(),
    },
    Column {
        name: "scans",
        about: "scans that were used",
        value: |r| r.scans.to_string(),
    },
    Column {
        name: "twist_deg",
        about: "twist θ",
        value: |r| number(r.twist_deg),
    },
    Column {
        name: "twist_sigma_deg",
        about: "its statistical σ",
        value: |r| number(r.twist_sigma_deg),
    },
    Column {
        name: "twist_sigma_total_deg",
        about: "its σ with everything, calibration and model included",
        value: |r| number(r.twist_sigma_total_deg),
    },
    Column {
        name: "heterostrain_percent",
        about: "ε, noise bias removed",
        value: |r| number(r.heterostrain_percent),
    },
    Column {
        name: "heterostrain_sigma_percent",
        about: "its statistical σ",
        value: |r| number(r.heterostrain_sigma_percent),
    },
    Column {
        name: "heterostrain_sigma_total_percent",
        about: "its σ with everything",
        value: |r| number(r.heterostrain_sigma_total_percent),
    },
    Column {
        name: "drift_x_nm_per_min",
        about: "drift of the first set to the right",
        value: |r| number(r.drift_x_nm_per_min),
    },
    Column {
        name: "drift_x_sigma_nm_per_min",
        about: "its σ",
        value: |r| number(r.drift_x_sigma_nm_per_min),
    },
    Column {
        name: "drift_y_nm_per_min",
        about: "drift of the first set upwards",
        value: |r| number(r.drift_y_nm_per_min),
    },
    Column {
        name: "drift_y_sigma_nm_per_min",
        about: "its σ",
        value: |r| number(r.drift_y_sigma_nm_per_min),
    },
    Column {
        name: "caveats",
        about: "codes of the caveats, divided by blanks",
        value: |r| r.caveats.join(" "),
    },
    Column {
        name: "failed_files",
        about: "files that could not be used",
        value: |r| match r.status {
            SampleStatus::Failed => String::new(),
            _ => r.failed.len().to_string(),
        },
    },
    Column {
        name: "error",
        about: "why there are no numbers, or why files could not be used",
        value: SampleRow::error,
    },
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
pub fn samples_parquet(rows: &[SampleRow]) -> Result<Vec<u8>, crate::ReportError> {
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
        Column {
            name: "sample",
            about: "name of the sample",
            value: |f| f.sample.to_owned(),
        },
        Column {
            name: "file",
            about: "the file, or the sample where all of it failed",
            value: |f| f.file.to_owned(),
        },
        Column {
            name: "error",
            about: "why",
            value: |f| f.error.to_owned(),
        },
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
