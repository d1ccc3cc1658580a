//! What is told of each new result: one object, in degrees, per cent, nm and nm/min.

use moiregauge::campaign::SetAnalysis;
use moiregauge_report::FailedInput;
use moiregauge_report::results::{DriftResult, ResultCaveat, SetResult};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mean::{Mean, Number};
use super::next::Next;
use super::until::UntilState;
use super::warnings::Warning;

/// Name and version of a line.
pub(super) const SCHEMA: &str = "moiregauge/watch/1";

/// What happened to a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Happened {
    /// It was there when the watch began.
    Start,
    /// It came.
    New,
    /// It was written anew; the frame that had its name is gone.
    Again,
    /// It was deleted, and its frame went with it.
    Gone,
    /// It cannot be read, and nothing happens to it any more.
    Unreadable,
    /// The folder cannot be listed, or can be again.
    Folder,
}

/// Velocity of the sample in the frame of the sensors, nm/min.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LineDrift {
    /// To the right, in the middle of the set.
    pub x_nm_per_min: Number,
    /// Up, in the middle of the set.
    pub y_nm_per_min: Number,
    /// At the time of the last frame, x and y; `null` where it is not known.
    pub now_nm_per_min: Option<[f64; 2]>,
    /// Its change, x and y, where the scans show one, nm/min².
    pub acceleration_nm_per_min2: Option<[Option<f64>; 2]>,
    /// The time constant with which it settles, where the scans show that, min.
    pub settling_min: Option<f64>,
    /// Whether it was given and not measured.
    pub given: bool,
}

impl LineDrift {
    fn new(drift: &DriftResult, set: Option<&SetAnalysis>) -> Self {
        let joint = drift.joint.as_ref();
        let last = set.and_then(|set| set.scans.iter().rev().find_map(|scan| scan.drift));
        Self {
            x_nm_per_min: drift.x_nm_per_min.into(),
            y_nm_per_min: drift.y_nm_per_min.into(),
            now_nm_per_min: last
                .map(|now| [60.0 * now.x, 60.0 * now.y])
                .filter(|now| now.iter().all(|v| v.is_finite())),
            acceleration_nm_per_min2: joint.and_then(|j| j.acceleration_nm_per_min2),
            settling_min: joint.and_then(|j| j.settling_min),
            given: drift.given,
        }
    }
}

/// The state after something happened to files: the numbers of the set to which the file belongs, by all its frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Line {
    /// `moiregauge/watch/1`.
    pub schema: String,
    /// What happened.
    pub event: Happened,
    /// The file, the last by time of several; as in `results.json`. `null` where it is about the folder.
    pub file: Option<String>,
    /// All files to which it happened at once.
    pub files: Vec<String>,
    /// When the file was saved, by the instrument's clock.
    pub acquired: Option<String>,
    /// Frames behind the numbers.
    pub frames: usize,
    /// Name of the set; `null` where there is none.
    pub set: Option<String>,
    /// Number of sets.
    pub sets: usize,
    /// Number of the moiré, from 1, the largest cell first.
    pub moire: usize,
    /// Twist by all frames of the set, corrected for drift; its numbers are `null` until the drift is known.
    pub twist_deg: Number,
    /// Magnitude of the heterostrain, likewise.
    pub heterostrain_percent: Number,
    /// The drift; its numbers are `null` until the frames tell it.
    pub drift: LineDrift,
    /// Where the drift is not known: twist and strain with what the drift did to them, which is in no error.
    pub uncorrected: Option<Mean>,
    /// All sets together, where there are several that can be combined.
    pub combined: Option<Mean>,
    /// What the next two frames would bring; `null` where that is not known.
    pub next: Option<Next>,
    /// How far the wish is; `null` without one.
    pub until: Option<UntilState>,
    /// What to do now, in words.
    pub advice: String,
    /// What is wrong with the way of scanning.
    pub warnings: Vec<Warning>,
    /// Doubts about the set, each once, as in `results.json`.
    pub caveats: Vec<ResultCaveat>,
    /// Files that should be scans and cannot be used.
    pub failed: Vec<FailedInput>,
    /// Why the file gives no number, or why there is none at all.
    pub error: Option<String>,
}

/// The JSON Schema (draft 2020-12) of [`Line`].
pub fn line_schema() -> serde_json::Value {
    let settings = schemars::generate::SchemaSettings::draft2020_12().for_serialize();
    let generator = settings.into_generator();
    generator.into_root_schema_for::<Line>().into()
}

impl Line {
    /// A line without numbers.
    pub(super) fn empty(event: Happened, files: Vec<String>) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            event,
            file: files.last().cloned(),
            files,
            acquired: None,
            frames: 0,
            set: None,
            sets: 0,
            moire: 1,
            twist_deg: Number::default(),
            heterostrain_percent: Number::default(),
            drift: LineDrift::default(),
            uncorrected: None,
            combined: None,
            next: None,
            until: None,
            advice: String::new(),
            warnings: Vec::new(),
            caveats: Vec::new(),
            failed: Vec::new(),
            error: None,
        }
    }

    /// Puts in the numbers of a set.
    pub(super) fn put(&mut self, result: &SetResult, set: &SetAnalysis) {
        self.set = Some(result.name.clone());
        self.frames = used(set);
        let file =
            |scan: &&moiregauge_report::results::ScanResult| Some(&scan.file) == self.file.as_ref();
        self.acquired = result
            .scans
            .iter()
            .find(file)
            .and_then(|scan| scan.acquired.clone());
        if let Some(mean) = result
            .mean
            .as_ref()
            .filter(|mean| mean.drift_assumed.is_none())
        {
            let Mean {
                twist_deg,
                heterostrain_percent,
            } = Mean::from(&mean.twist_strain);
            self.twist_deg = twist_deg;
            self.heterostrain_percent = heterostrain_percent;
        } else {
            let found = result.uncorrected.as_ref();
            self.uncorrected = found.map(|mean| Mean::from(&mean.twist_strain));
        }
        if let Some(drift) = &result.drift {
            self.drift = LineDrift::new(drift, Some(set));
        }
    }

    /// The numbers that a wish is about: those of all sets together where there are such.
    pub(super) fn best(&self) -> Mean {
        self.combined.unwrap_or(Mean {
            twist_deg: self.twist_deg,
            heterostrain_percent: self.heterostrain_percent,
        })
    }
}

/// Frames that a set uses.
pub(super) fn used(set: &SetAnalysis) -> usize {
    set.scans
        .iter()
        .filter(|scan| scan.excluded.is_none())
        .count()
}

/// What is kept of a line, for a picture of the numbers in time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// What happened.
    pub event: Happened,
    /// To which file.
    pub file: Option<String>,
    /// When the file was saved, by the instrument's clock.
    pub acquired: Option<String>,
    /// Name of the set.
    pub set: Option<String>,
    /// Number of the moiré.
    pub moire: usize,
    /// Frames behind the numbers.
    pub frames: usize,
    /// Twist, degrees.
    pub twist_deg: Number,
    /// Heterostrain, per cent.
    pub heterostrain_percent: Number,
    /// Drift, nm/min.
    pub drift: LineDrift,
}

impl From<&Line> for Point {
    fn from(line: &Line) -> Self {
        Self {
            event: line.event,
            file: line.file.clone(),
            acquired: line.acquired.clone(),
            set: line.set.clone(),
            moire: line.moire,
            frames: line.frames,
            twist_deg: line.twist_deg,
            heterostrain_percent: line.heterostrain_percent,
            drift: line.drift,
        }
    }
}
