//! An analysis → the lines that tell it, with what to do now.

use moiregauge::campaign::{Analysis, SetAnalysis};
use moiregauge::scan::MeasuredScan;
use moiregauge_report::results::{ResultCaveat, SetResult};
use moiregauge_report::{FailedInput, Results, two_digits};

use super::files::Seen;
use super::line::{Happened, Line, used};
use super::mean::Mean;
use super::next::{Next, Outlook, is_out_of_reach};
use super::request::WatchRequest;
use super::until::UntilState;
use super::warnings;
use crate::campaign::{Campaign, Outcome};

/// Errors that two more frames make smaller by less than this share are hardly worth the time of two frames.
const HARDLY: f64 = 0.05;

/// The numbers of one moiré, for all lines of a step.
pub(super) struct OfMoire<'a> {
    request: &'a WatchRequest,
    /// The file of the last line about a set.
    last: Option<&'a str>,
    analysis: &'a Analysis,
    results: Results,
    seen: &'a Seen,
    scans: Vec<&'a MeasuredScan>,
}

impl<'a> OfMoire<'a> {
    pub(super) fn new(
        request: &'a WatchRequest,
        campaign: &'a Campaign,
        last: Option<&'a str>,
        outcome: &'a Outcome,
        seen: &'a Seen,
    ) -> Self {
        // Which of several lattices of a file is which, and what a region leaves of it, is not known here.
        let settings = &request.settings;
        let plain = settings.moires == 1 && !settings.overlap;
        Self {
            request,
            last,
            analysis: &outcome.analysis,
            results: Results::new(&outcome.analysis, &outcome.provenance),
            seen,
            scans: if plain {
                campaign.behind(outcome)
            } else {
                Vec::new()
            },
        }
    }

    /// The set that has a file.
    fn set_of(&self, file: &str) -> Option<usize> {
        let has = |set: &SetAnalysis| set.scans.iter().any(|scan| scan.file == file);
        self.analysis.sets.iter().position(has)
    }

    /// Which set is told with which files: files that came by their sets, everything else with the set of the last line.
    pub(super) fn shares(
        &self,
        event: Happened,
        files: Vec<String>,
    ) -> Vec<(Option<usize>, Vec<String>)> {
        let before = self.last.and_then(|file| self.set_of(file));
        let usual = before.or_else(|| self.analysis.sets.len().checked_sub(1));
        if !matches!(event, Happened::Start | Happened::New | Happened::Again) {
            return vec![(usual, files)];
        }
        let mut shares: Vec<(Option<usize>, Vec<String>)> = Vec::new();
        for file in self.by_time(files) {
            let set = self.set_of(&file).or(usual);
            match shares
                .iter_mut()
                .find(|(of, _)| *of == set || event == Happened::Start)
            {
                // The set of the last file is told.
                Some(share) => {
                    share.0 = set;
                    share.1.push(file);
                }
                None => shares.push((set, vec![file])),
            }
        }
        shares
    }

    /// Files in order of time; those that are in no set come first.
    fn by_time(&self, mut files: Vec<String>) -> Vec<String> {
        let scans: Vec<_> = self
            .analysis
            .sets
            .iter()
            .flat_map(|set| &set.scans)
            .collect();
        files.sort_by_key(|file| {
            let scan = scans.iter().find(|scan| scan.file == *file);
            scan.map(|scan| (scan.acquired.is_none(), scan.acquired))
        });
        files
    }

    /// One line: what happened, and the numbers of a set.
    pub(super) fn line(
        &mut self,
        event: Happened,
        set: Option<usize>,
        files: Vec<String>,
        error: Option<String>,
    ) -> Line {
        let mut line = Line::empty(event, files);
        line.sets = self.analysis.sets.len();
        line.failed.clone_from(&self.results.failed);
        let own = |failed: &&FailedInput| Some(&failed.file) == line.file.as_ref();
        line.error = error.or_else(|| {
            line.failed
                .iter()
                .find(own)
                .map(|failed| failed.error.clone())
        });
        line.warnings
            .extend(warnings::of_waiting(&self.seen.waiting));
        let Some((set, result)) = set.map(|i| (&self.analysis.sets[i], &self.results.sets[i]))
        else {
            return line;
        };
        line.put(result, set);
        let combined = self.results.combined.as_ref().filter(|_| line.sets > 1);
        line.combined = combined.map(|all| Mean::from(&all.twist_strain));
        line.caveats = caveats(&self.results.caveats, result);
        line.warnings
            .extend(warnings::of_set(self.analysis, set, &self.scans));
        self.outlook(&mut line, set);
        line
    }

    /// What more frames would bring, and what to do.
    fn outlook(&self, line: &mut Line, set: &SetAnalysis) {
        let best = line.best();
        let frames = match line.combined {
            Some(_) => self.analysis.sets.iter().map(used).sum(),
            None => line.frames,
        };
        let outlook = Outlook::new(set, &self.scans, frames, best, &self.analysis.settings);
        line.next = outlook.as_ref().and_then(Outlook::next);
        let wanted = self.request.until;
        if wanted.is_any() {
            let reached = wanted.is_met_by(&best);
            let out_of_reach = is_out_of_reach(&wanted, &best);
            let needed = outlook.as_ref().filter(|_| !reached && !out_of_reach);
            line.until = Some(UntilState {
                wanted,
                reached,
                frames_needed: if reached {
                    Some(0)
                } else {
                    needed.and_then(|o| o.frames_needed(&wanted))
                },
                out_of_reach,
            });
        }
        line.advice = advice(line, &best);
    }
}

/// Doubts about a set and its files.
fn caveats(all: &[ResultCaveat], set: &SetResult) -> Vec<ResultCaveat> {
    let concerns = |caveat: &&ResultCaveat| {
        caveat.place == set.name
            || caveat.place == "analysis"
            || set.scans.iter().any(|scan| scan.file == caveat.place)
    };
    all.iter().filter(concerns).cloned().collect()
}

/// What to do now.
fn advice(line: &Line, best: &Mean) -> String {
    if line.until.is_some_and(|until| until.reached) {
        return "the wanted errors are reached: stop now".to_owned();
    }
    let Some(next) = line.next else {
        return if best.twist_deg.value.is_some() {
            String::new()
        } else {
            "no drift yet. Take frames up and down in turn".to_owned()
        };
    };
    let bring = brought(&next);
    if best.twist_deg.value.is_none() {
        return format!("no drift yet. With two more frames, up and down in turn: {bring}");
    }
    let wish = match line.until {
        Some(until) if until.out_of_reach => {
            "; the wanted errors are out of reach, because calibration and model alone exceed them"
                .to_owned()
        }
        Some(until) => until.frames_needed.map_or_else(
            || "; many more frames are needed to reach the wanted errors".to_owned(),
            |n| format!("; {n} more frames may reach the wanted errors"),
        ),
        None => String::new(),
    };
    if wish.is_empty() && is_hardly_less(&next, best) {
        return format!(
            "two more frames give {bring}, hardly less than now. Most of this error is calibration and model: stop now"
        );
    }
    format!("two more frames give {bring}{wish}")
}

fn brought(next: &Next) -> String {
    let twist = next
        .twist_sigma_total_deg
        .map(|s| format!("± {}°", two_digits(s)));
    let strain = next
        .strain_sigma_total_percent
        .map(|s| format!("± {} %", two_digits(s)));
    let both: Vec<String> = twist.into_iter().chain(strain).collect();
    both.join(", ")
}

fn is_hardly_less(next: &Next, now: &Mean) -> bool {
    let hardly = |now: Option<f64>, then: Option<f64>| {
        now.zip(then)
            .is_none_or(|(now, then)| then > (1.0 - HARDLY) * now)
    };
    hardly(now.twist_deg.sigma_total, next.twist_sigma_total_deg)
        && hardly(
            now.heterostrain_percent.sigma_total,
            next.strain_sigma_total_percent,
        )
}
