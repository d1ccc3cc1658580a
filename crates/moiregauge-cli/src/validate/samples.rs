//! Sets of real samples, class by class: how many are answered, and how many of the answers are right.

use std::fmt::Write as _;

use anyhow::Context as _;
use heterostrain::TotalEstimate;
use moiregauge::campaign::{Analysis, Combined, analyse};
use moiregauge::scan::measure_scan;
use moiregauge::settings::Settings;
use moiregauge::simulate::{SampleFeature, Simulation, Simulator, TRIED, Truth, vary};
use moiregauge::spectrum::Method;

/// An answer further from the truth than so many total σ is wrong.
const WRONG_SIGMAS: f64 = 5.0;

/// What came of one set.
#[derive(Clone, Debug)]
pub(super) struct Outcome {
    /// `moiregauge simulate --sample … --vary --seed` makes the set again.
    seed: u64,
    answer: Option<Answer>,
    /// Codes of the caveats, each once.
    caveats: Vec<String>,
}

/// The twist that was found, degrees.
#[derive(Clone, Copy, Debug)]
struct Answer {
    twist: f64,
    sigma: f64,
    total: f64,
    /// `None` where there is no moiré.
    truth: Option<f64>,
}

/// All sets of one class.
pub(super) struct Tally {
    pub(super) sample: String,
    pub(super) outcomes: Vec<Outcome>,
}

/// The samples that are asked for; `all` stands for one of each class.
pub(super) fn samples_of(given: &[String]) -> anyhow::Result<Vec<String>> {
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
pub(super) fn outcome(
    base: &Simulation,
    sample: &str,
    method: Method,
    seed: u64,
) -> anyhow::Result<Outcome> {
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
    let simulator = Simulator::new(set).with_context(|| format!("sample {sample}"))?;
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
                twist,
                sigma: found.statistical.to_degrees(),
                total: found.total.to_degrees(),
                truth: true_twist(&truth, twist),
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
        Some(self.twist - self.truth?)
    }

    /// Where there is no moiré every answer is wrong.
    fn is_wrong(&self) -> bool {
        self.error()
            .is_none_or(|error| error.abs() > WRONG_SIGMAS * self.total)
    }
}

impl Tally {
    fn answers(&self) -> impl Iterator<Item = &Answer> {
        self.outcomes.iter().filter_map(|one| one.answer.as_ref())
    }

    /// Errors over their statistical σ, root mean square.
    fn rms_pull(&self) -> Option<f64> {
        let pulls = self.answers().filter_map(|a| Some(a.error()? / a.sigma));
        let squares: Vec<f64> = pulls.map(|pull| pull * pull).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }

    fn median_error(&self) -> Option<f64> {
        let errors = self.answers().filter_map(|a| Some(a.error()?.abs()));
        let mut errors: Vec<f64> = errors.collect();
        errors.sort_by(f64::total_cmp);
        errors.get(errors.len() / 2).copied()
    }

    fn line(&self) -> String {
        let answered = self.answers().count();
        let wrong = self.answers().filter(|answer| answer.is_wrong()).count();
        let doubted = self.outcomes.iter().filter(|one| {
            let doubts = !one.caveats.is_empty();
            one.answer.is_some() && doubts
        });
        let share = match answered {
            0 => "–".to_owned(),
            n => format!("{:.0}", 100.0 * doubted.count() as f64 / n as f64),
        };
        let number = |value: Option<f64>, digits: usize| {
            value.map_or("–".to_owned(), |v| format!("{v:.digits$}"))
        };
        format!(
            "{:18} {:>6} {:>9} {:>8} {:>12} {:>9} {:>15} {:>12}\n",
            self.sample,
            self.outcomes.len(),
            answered,
            self.outcomes.len() - answered,
            wrong,
            number(self.rms_pull(), 2),
            number(self.median_error(), 5),
            share,
        )
    }
}

/// One line for each sample.
pub(super) fn table(tallies: &[Tally]) -> String {
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
        text += &tally.line();
    }
    text += "beyond 5 σ: of the total σ of the twist; without moiré every answer. Pulls are of the statistical σ.\n\
             Of grains, the one that is nearest to the answer is taken for the truth.\n";
    text
}

/// Every set, with what makes it again.
pub(super) fn rows(tallies: &[Tally]) -> String {
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
                    a.twist,
                    a.sigma,
                    a.total,
                    a.truth.map_or(String::new(), |truth| truth.to_string()),
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
                twist,
                sigma: 0.01,
                total: 0.02,
                truth,
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
        let tally = Tally {
            sample: "edge".to_owned(),
            outcomes: vec![
                outcome(1.01, Some(1.0)),
                outcome(1.09, Some(1.0)),
                outcome(1.11, Some(1.0)),
                outcome(1.0, None),
                refused,
            ],
        };
        assert_eq!(tally.answers().filter(|a| a.is_wrong()).count(), 2);
        // 1, 9 and 11 σ.
        let pull = ((1.0 + 81.0 + 121.0) / 3.0f64).sqrt();
        assert!((tally.rms_pull().unwrap() - pull).abs() < 1e-9);
        assert!((tally.median_error().unwrap() - 0.09).abs() < 1e-12);
        let words: Vec<String> = tally.line().split_whitespace().map(str::to_owned).collect();
        assert_eq!(words, ["edge", "5", "4", "1", "2", "8.23", "0.09000", "0"]);
        assert_eq!(rows(&[tally]).lines().count(), 6);
    }

    #[test]
    fn all_is_one_of_each_class() {
        let all = samples_of(&["all".to_owned()]).unwrap();
        assert!(all.len() > 20 && all.iter().all(|s| SampleFeature::parse(s).is_ok()));
        assert!(samples_of(&["edges".to_owned()]).is_err());
    }
}
