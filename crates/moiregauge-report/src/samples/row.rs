//! What is told of one sample.

use std::collections::BTreeSet;

use moiregauge::campaign::{Analysis, refusal};
use moiregauge::caveat::Severity;
use serde::{Deserialize, Serialize};

use crate::input::FailedInput;
use crate::results::Provenance;
use crate::results::{DriftResult, Results, TwistStrainResult};

/// Whether the numbers of a sample can be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SampleStatus {
    /// Twist and strain, corrected for drift, from all files, without a serious caveat.
    Ok,
    /// Twist and strain, but a caveat is serious, the drift is not known, or a file could not be used.
    Doubtful,
    /// No twist and strain.
    Failed,
}

impl SampleStatus {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Doubtful => "doubtful",
            Self::Failed => "failed",
        }
    }
}

/// One moiré of one sample. Numbers in degrees, per cent and nm/min; `None` where they are not known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SampleRow {
    /// Name of the sample.
    pub sample: String,
    /// Number of the moiré in the sample, from 1, the largest cell first.
    pub moire: usize,
    /// Whether the numbers can be used.
    pub status: SampleStatus,
    /// Scans that were used.
    pub scans: usize,
    /// Twist.
    pub twist_deg: Option<f64>,
    /// Its statistical σ.
    pub twist_sigma_deg: Option<f64>,
    /// Its σ with everything, calibration and model included.
    pub twist_sigma_total_deg: Option<f64>,
    /// Magnitude of the heterostrain, noise bias removed.
    pub heterostrain_percent: Option<f64>,
    /// Its statistical σ.
    pub heterostrain_sigma_percent: Option<f64>,
    /// Its σ with everything.
    pub heterostrain_sigma_total_percent: Option<f64>,
    /// Drift of the first set to the right.
    pub drift_x_nm_per_min: Option<f64>,
    /// Its σ.
    pub drift_x_sigma_nm_per_min: Option<f64>,
    /// Drift of the first set upwards.
    pub drift_y_nm_per_min: Option<f64>,
    /// Its σ.
    pub drift_y_sigma_nm_per_min: Option<f64>,
    /// Codes of the caveats, each once, in the order in which they came up.
    pub caveats: Vec<String>,
    /// Why there are no numbers, or which files could not be used.
    pub failed: Vec<FailedInput>,
}

impl SampleRow {
    /// A sample without numbers.
    pub fn without_numbers(sample: &str, failed: Vec<FailedInput>) -> Self {
        Self {
            sample: sample.to_owned(),
            moire: 1,
            status: SampleStatus::Failed,
            scans: 0,
            twist_deg: None,
            twist_sigma_deg: None,
            twist_sigma_total_deg: None,
            heterostrain_percent: None,
            heterostrain_sigma_percent: None,
            heterostrain_sigma_total_percent: None,
            drift_x_nm_per_min: None,
            drift_x_sigma_nm_per_min: None,
            drift_y_nm_per_min: None,
            drift_y_sigma_nm_per_min: None,
            caveats: Vec::new(),
            failed,
        }
    }

    /// The moiré of this number in a sample: all sets together where they have a common result, otherwise the first
    /// set that has one, corrected for drift where that is known.
    pub fn of(sample: &str, moire: usize, analysis: &Analysis, provenance: &Provenance) -> Self {
        let results = Results::new(analysis, provenance);
        let scans = analysis.sets.iter().flat_map(|set| &set.scans);
        let mut row = Self {
            moire,
            scans: scans.filter(|scan| scan.excluded.is_none()).count(),
            caveats: codes(analysis),
            ..Self::without_numbers(sample, provenance.failed.clone())
        };
        let means = results.sets.iter().filter_map(|set| set.mean.as_ref());
        let uncorrected = results.sets.iter().filter_map(|s| s.uncorrected.as_ref());
        let combined = results.combined.as_ref().map(|c| &c.twist_strain);
        let corrected = combined.or_else(|| means.map(|mean| &mean.twist_strain).next());
        let found = corrected.or_else(|| uncorrected.map(|mean| &mean.twist_strain).next());
        if let Some(drift) = results.sets.iter().find_map(|set| set.drift.as_ref()) {
            row.put_drift(drift);
        }
        let Some(found) = found else {
            row.failed.push(FailedInput {
                file: sample.to_owned(),
                error: match refusal(analysis) {
                    Some(why) => why.message(),
                    None => "no twist and strain explain the lattice".to_owned(),
                },
            });
            return row;
        };
        row.put(found);
        let serious = analysis
            .caveats
            .iter()
            .any(|c| c.severity() == Severity::Serious);
        let whole = row.failed.is_empty() && corrected.is_some();
        row.status = if whole && !serious {
            SampleStatus::Ok
        } else {
            SampleStatus::Doubtful
        };
        row
    }

    fn put(&mut self, found: &TwistStrainResult) {
        let (twist, strain) = (found.twist_deg, found.heterostrain_percent);
        self.twist_deg = twist.value;
        self.twist_sigma_deg = twist.sigma;
        self.twist_sigma_total_deg = twist.sigma_total;
        self.heterostrain_percent = strain.value;
        self.heterostrain_sigma_percent = strain.sigma;
        self.heterostrain_sigma_total_percent = strain.sigma_total;
    }

    fn put_drift(&mut self, drift: &DriftResult) {
        let (x, y) = (drift.x_nm_per_min, drift.y_nm_per_min);
        self.drift_x_nm_per_min = x.value;
        self.drift_x_sigma_nm_per_min = x.sigma;
        self.drift_y_nm_per_min = y.value;
        self.drift_y_sigma_nm_per_min = y.sigma;
    }

    /// All that failed, in one line.
    pub fn error(&self) -> String {
        let all = self.failed.iter();
        let words: Vec<String> = all
            .map(|failed| {
                let what = format!("{}: {}", failed.file, failed.error);
                what.replace(['\r', '\n'], " ")
            })
            .collect();
        words.join("; ")
    }
}

/// The codes of all caveats, each once.
fn codes(analysis: &Analysis) -> Vec<String> {
    let mut seen = BTreeSet::new();
    let codes = analysis.caveats.iter().map(moiregauge::Caveat::code);
    codes
        .filter(|code| seen.insert(*code))
        .map(str::to_owned)
        .collect()
}
