//! Sets of real samples, class by class: how many are answered, and how many of the answers are right.

use std::fmt::Write as _;

use heterostrain::TotalEstimate;
use moiregauge::campaign::{Analysis, Combined, analyse};
use moiregauge::numbers::interrupt;
use moiregauge::scan::measure_scan;
use moiregauge::settings::Settings;
use moiregauge::simulate::{
    SampleFeature, SimulateError, Simulation, Simulator, TRIED, Truth, vary,
};
use moiregauge::spectrum::Method;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::error::ValidateError;
use super::request::{ValidateRequest, check_sets};
use crate::job::Job;
use crate::sink::{Sink, SinkError};

/// Distance from the truth beyond which an answer is wrong, total σ.
const WRONG_SIGMAS: f64 = 5.0;

/// Every set of a validation with real samples.
pub const SAMPLES_FILE: &str = "samples.csv";

/// Which real samples are tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SamplesRequest {
    /// Classes as in `edge:share=0.6,angle=30`; `all` stands for one of each.
    pub samples: Vec<String>,
    /// What is not drawn: size, pixels and number of scans among them.
    pub conditions: Simulation,
    /// Estimator of the lattice vectors.
    pub method: Method,
    /// Number of sets of each sample.
    pub sets: u32,
    /// Seed of all that is drawn.
    pub seed: u64,
}

impl Default for SamplesRequest {
    /// One of each class, 20 sets of four small frames.
    fn default() -> Self {
        let ValidateRequest {
            conditions,
            method,
            seed,
            ..
        } = ValidateRequest::default();
        Self {
            samples: vec!["all".to_owned()],
            conditions,
            method,
            sets: 20,
            seed,
        }
    }
}

impl SamplesRequest {
    /// Refuses what cannot be simulated.
    ///
    /// # Errors
    /// Which setting makes no sense.
    pub fn check(&self) -> Result<(), ValidateError> {
        check_sets(self.sets, 1)?;
        samples_of(&self.samples)?;
        Ok(())
    }
}

/// What came of real samples.
#[derive(Clone, Debug, Serialize)]
pub struct Tallies {
    /// One for each sample.
    pub samples: Vec<Tally>,
}

/// All sets of one sample.
#[derive(Clone, Debug, Serialize)]
pub struct Tally {
    /// As it was given.
    pub sample: String,
    /// Sets with an answer.
    pub answered: usize,
    /// Answers with a caveat.
    pub doubted: usize,
    /// Answers further from the truth than five total σ; without moiré every answer.
    pub wrong: usize,
    /// Root mean square of errors over their statistical σ.
    pub rms_pull: Option<f64>,
    /// Median error of the twist.
    pub median_error_deg: Option<f64>,
    /// Every set.
    pub outcomes: Vec<Outcome>,
}

/// What came of one set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// The seed that makes the set again.
    pub seed: u64,
    /// The twist.
    pub answer: Option<Answer>,
    /// Codes of the caveats, each once.
    pub caveats: Vec<String>,
}

/// The twist that was found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Answer {
    /// The twist.
    pub twist_deg: f64,
    /// Its statistical σ.
    pub sigma_deg: f64,
    /// With calibration and model.
    pub total_sigma_deg: f64,
    /// The true one; `None` where there is no moiré.
    pub truth_deg: Option<f64>,
}

/// Simulates sets of real samples (edges, holes, grains, bends) whose open numbers are drawn, analyses them, and
/// counts how many are answered, refused, wrong.
///
/// # Errors
/// [`ValidateError`].
pub fn validate_samples(request: &SamplesRequest, job: &Job) -> Result<Tallies, ValidateError> {
    request.check()?;
    let given = samples_of(&request.samples)?;
    let count = request.sets as usize;
    let stage = job.stage("validating", "sets", given.len() * count);
    let one = |index: usize| {
        interrupt::check();
        let seed = request.seed.wrapping_add((index % count) as u64);
        let sample = &given[index / count];
        let outcome = outcome(&request.conditions, sample, request.method, seed);
        stage.step();
        outcome
    };
    let all = (0..given.len() * count).into_par_iter().map(one);
    let outcomes: Vec<Outcome> = job.run(|| all.collect::<Result<_, ValidateError>>())??;
    drop(stage);
    let samples = given.into_iter().zip(outcomes.chunks(count));
    Ok(Tallies {
        samples: samples
            .map(|(sample, outcomes)| Tally::new(sample, outcomes.to_vec()))
            .collect(),
    })
}

/// The samples that are asked for; `all` stands for one of each class.
fn samples_of(given: &[String]) -> Result<Vec<String>, SimulateError> {
    let mut samples: Vec<String> = Vec::new();
    for text in given {
        if text == "all" {
            samples.extend(TRIED.map(str::to_owned));
        } else {
            SampleFeature::parse(text)?;
            samples.push(text.clone());
        }
    }
    Ok(samples)
}

/// One set of a sample whose open numbers are drawn, analysed.
fn outcome(
    base: &Simulation,
    sample: &str,
    method: Method,
    seed: u64,
) -> Result<Outcome, ValidateError> {
    let mut set = base.clone();
    set.features.extend(SampleFeature::parse(sample)?);
    vary(&mut set, seed);
    let settings = Settings {
        method,
        material: set.sample.material.clone(),
        substrate: set.sample.substrate.clone(),
        strain_convention: set.sample.strain_convention,
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    };
    let simulator = Simulator::new(set).map_err(|source| ValidateError::Sample {
        sample: sample.to_owned(),
        source,
    })?;
    let measured = (0..simulator.frames()).filter_map(|i| {
        let name = Simulator::file_name(i);
        measure_scan(&name, &simulator.frame(i), &settings, None).ok()
    });
    let analysis = analyse(measured.collect(), &settings);
    let mut caveats: Vec<String> = analysis
        .caveats
        .iter()
        .map(|caveat| caveat.code().to_owned())
        .collect();
    caveats.sort();
    caveats.dedup();
    let truth = simulator.truth();
    Ok(Outcome {
        seed,
        answer: headline(&analysis).map(|found| {
            let twist = found.value.to_degrees();
            Answer {
                twist_deg: twist,
                sigma_deg: found.statistical.to_degrees(),
                total_sigma_deg: found.total.to_degrees(),
                truth_deg: true_twist(&truth, twist),
            }
        }),
        caveats,
    })
}

/// The twist of all scans together, corrected for drift.
fn headline(analysis: &Analysis) -> Option<TotalEstimate> {
    let combined = analysis.combined.as_ref().map(Combined::twist);
    let first = || Some(analysis.sets.first()?.mean.as_ref()?.twist());
    combined.or_else(first)
}

/// Of several grains, the one that lies nearest to what was found: an answer has to be one of them.
fn true_twist(truth: &Truth, found: f64) -> Option<f64> {
    let Some(sample) = &truth.sample else {
        return Some(truth.twist_deg);
    };
    let grains = sample.grains.iter().filter_map(|grain| grain.mean);
    grains
        .map(|mean| mean.twist_deg)
        .min_by(|a, b| (a - found).abs().total_cmp(&(b - found).abs()))
}

impl Answer {
    fn error(&self) -> Option<f64> {
        Some(self.twist_deg - self.truth_deg?)
    }

    /// Where there is no moiré every answer is wrong.
    fn is_wrong(&self) -> bool {
        self.error()
            .is_none_or(|error| error.abs() > WRONG_SIGMAS * self.total_sigma_deg)
    }
}

impl Tally {
    fn new(sample: String, outcomes: Vec<Outcome>) -> Self {
        let answers = || outcomes.iter().filter_map(|one| one.answer.as_ref());
        let doubted = outcomes.iter().filter(|one| {
            let doubts = !one.caveats.is_empty();
            one.answer.is_some() && doubts
        });
        let pulls = answers().filter_map(|a| Some(a.error()? / a.sigma_deg));
        let squares: Vec<f64> = pulls.map(|pull| pull * pull).collect();
        let rms = || (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        let errors = answers().filter_map(|a| Some(a.error()?.abs()));
        let mut errors: Vec<f64> = errors.collect();
        errors.sort_by(f64::total_cmp);
        Self {
            sample,
            answered: answers().count(),
            doubted: doubted.count(),
            wrong: answers().filter(|answer| answer.is_wrong()).count(),
            rms_pull: (!squares.is_empty()).then(rms),
            median_error_deg: errors.get(errors.len() / 2).copied(),
            outcomes,
        }
    }
}

impl Tallies {
    /// Writes the table of all sets.
    ///
    /// # Errors
    /// [`SinkError`].
    pub fn write(&self, sink: &dyn Sink) -> Result<(), SinkError> {
        sink.write(SAMPLES_FILE, rows(&self.samples).as_bytes())
    }
}

/// Every set, with what makes it again.
fn rows(tallies: &[Tally]) -> String {
    let mut text = String::from(
        "sample,seed,answered,twist_deg,twist_sigma_deg,twist_total_sigma_deg,true_twist_deg,beyond_5_sigma,caveats\n",
    );
    for tally in tallies {
        for one in &tally.outcomes {
            let _ = write!(text, "\"{}\",{}", tally.sample, one.seed);
            let _ = match one.answer {
                Some(a) => write!(
                    text,
                    ",yes,{},{},{},{},{}",
                    a.twist_deg,
                    a.sigma_deg,
                    a.total_sigma_deg,
                    a.truth_deg.map_or(String::new(), |truth| truth.to_string()),
                    if a.is_wrong() { "yes" } else { "no" },
                ),
                None => write!(text, ",no,,,,,"),
            };
            let _ = writeln!(text, ",{}", one.caveats.join(" "));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(twist: f64, truth: Option<f64>) -> Outcome {
        Outcome {
            seed: 1,
            answer: Some(Answer {
                twist_deg: twist,
                sigma_deg: 0.01,
                total_sigma_deg: 0.02,
                truth_deg: truth,
            }),
            caveats: Vec::new(),
        }
    }

    /// Two right, one beyond five total σ, one without moiré, one refused.
    #[test]
    fn answers_are_counted() {
        let refused = Outcome {
            answer: None,
            caveats: vec!["a".to_owned()],
            ..outcome(0.0, None)
        };
        let outcomes = vec![
            outcome(1.01, Some(1.0)),
            outcome(1.09, Some(1.0)),
            outcome(1.11, Some(1.0)),
            outcome(1.0, None),
            refused,
        ];
        let tally = Tally::new("edge".to_owned(), outcomes);
        assert_eq!((tally.answered, tally.wrong, tally.doubted), (4, 2, 0));
        // 1, 9 and 11 σ.
        let pull = ((1.0 + 81.0 + 121.0) / 3.0f64).sqrt();
        assert!((tally.rms_pull.unwrap() - pull).abs() < 1e-9);
        assert!((tally.median_error_deg.unwrap() - 0.09).abs() < 1e-12);
        assert_eq!(rows(&[tally]).lines().count(), 6);
    }

    #[test]
    fn all_is_one_of_each_class() {
        let all = samples_of(&["all".to_owned()]).unwrap();
        assert!(all.len() > 20 && all.iter().all(|s| SampleFeature::parse(s).is_ok()));
        assert!(samples_of(&["edges".to_owned()]).is_err());
    }
}
