//! The watch itself: folder → files that are whole → campaign → lines.

use std::path::{Path, PathBuf};

use moiregauge::campaign::{Analysis, SetAnalysis};
use moiregauge_report::results::{ResultCaveat, SetResult};
use moiregauge_report::{FailedInput, Results, two_digits};

use super::files::{Files, Seen};
use super::line::{Happened, Line, Mean, Point, used};
use super::next::{Next, Outlook, is_out_of_reach};
use super::request::{WatchError, WatchRequest};
use super::until::UntilState;
use super::warnings;
use crate::campaign::{Advice, AnalyseError, Campaign, Kept, Outcome, in_words as error_in_words};
use crate::job::{Cancelled, Job};
use crate::known::Known;
use crate::names::{in_full, in_words};
use crate::opened::Opened;

/// Errors that two more frames make smaller by less than this share are hardly worth the time of two frames.
const HARDLY: f64 = 0.05;

/// A folder that is watched.
#[derive(Clone, Debug)]
pub struct Watch {
    request: WatchRequest,
    files: Files,
    campaign: Campaign,
    advice: Advice,
    outcomes: Vec<Outcome>,
    history: Vec<Point>,
    /// Steps so far.
    steps: usize,
    /// The file of the last line about a set, for events that belong to none.
    last: Option<String>,
    reached: bool,
    /// What was seen and not told, since the step was stopped.
    untold: Option<Seen>,
}

/// What happened in a step, to which files.
type Happenings = Vec<(Happened, Vec<PathBuf>, Option<String>)>;

impl Watch {
    /// A watch that has not looked yet.
    ///
    /// # Errors
    /// [`WatchError`].
    pub fn new(request: WatchRequest) -> Result<Self, WatchError> {
        if !request.folder.is_dir() {
            return Err(WatchError::NoFolder(request.folder));
        }
        let campaign = Campaign::new(request.settings.clone())?
            .with_told(request.told.clone())?
            .trusting_dates();
        Ok(Self {
            files: Files::new(&request.folder, request.patience),
            campaign,
            advice: crate::campaign::no_advice,
            outcomes: Vec::new(),
            history: Vec::new(),
            steps: 0,
            last: None,
            reached: false,
            untold: None,
            request,
        })
    }

    /// With what a front end says that helps against errors.
    #[must_use]
    pub fn with_advice(mut self, advice: Advice) -> Self {
        self.campaign = self.campaign.with_advice(advice);
        self.advice = advice;
        self
    }

    /// Takes scans that an earlier watch has measured; those whose files are the same are not measured again.
    pub fn take(&mut self, kept: Kept) {
        self.campaign.take(kept);
    }

    /// What was measured so far, to be kept outside the folder.
    pub fn kept(&self) -> &Kept {
        self.campaign.kept()
    }

    /// What is watched.
    pub fn request(&self) -> &WatchRequest {
        &self.request
    }

    /// The last analysis, one for each moiré; empty before the first frame.
    pub fn outcomes(&self) -> &[Outcome] {
        &self.outcomes
    }

    /// What was told so far, without words.
    pub fn history(&self) -> &[Point] {
        &self.history
    }

    /// Whether the errors that were wished for are reached.
    pub fn is_reached(&self) -> bool {
        self.reached
    }

    /// One step: what happened since the last one, with the numbers of now. Files that are there at the first step make one
    /// line; later each set that gets frames makes one, and each file that is gone or cannot be read.
    ///
    /// # Errors
    /// [`Cancelled`]; what was measured is kept, and the next step goes on.
    pub fn look(&mut self, job: &Job) -> Result<Vec<Line>, Cancelled> {
        job.check()?;
        let mut seen = {
            let (files, campaign, advice) = (&mut self.files, &self.campaign, self.advice);
            // Whether all is there depends on no other file.
            let known = Known::new(campaign.told(), &[]);
            let whole = |path: &Path| {
                let read = Opened::new(path, &known).and_then(|o| o.reading(campaign.settings()));
                read.map(drop)
                    .map_err(|error| error_in_words(&error, advice))
            };
            job.run(|| files.look(&whole))?
        };
        if let Some(before) = self.untold.take() {
            seen = before.and_then(seen);
        }
        self.steps += 1;
        let happened = self.happened(&seen);
        if happened.is_empty() {
            return Ok(Vec::new());
        }
        let only_folder = happened
            .iter()
            .all(|(event, ..)| *event == Happened::Folder);
        let mut error = None;
        if !only_folder {
            let before = (
                self.campaign.inputs().to_vec(),
                self.campaign.left_out().to_vec(),
            );
            self.campaign
                .replace(seen.scans.clone(), seen.left_out.clone());
            match self.campaign.analyse(job) {
                Ok(outcomes) => self.outcomes = outcomes,
                Err(AnalyseError::Cancelled(cancelled)) => {
                    self.steps -= 1;
                    self.campaign.replace(before.0, before.1);
                    self.untold = Some(seen);
                    return Err(cancelled);
                }
                Err(other) => {
                    self.outcomes.clear();
                    error = Some(other);
                }
            }
        }
        let lines = match &error {
            None => job.run(|| self.lines(&happened, &seen))?,
            Some(error) => nothing(&happened, &seen, error),
        };
        self.history.extend(lines.iter().map(Point::from));
        if let Some(line) = lines.iter().rev().find(|line| line.set.is_some()) {
            self.last.clone_from(&line.file);
        }
        let states = || lines.iter().filter_map(|line| line.until);
        self.reached = states().next().is_some() && states().all(|state| state.reached);
        Ok(lines)
    }

    /// What is to be told of a step.
    fn happened(&self, seen: &Seen) -> Happenings {
        let inputs = self.campaign.inputs();
        let mut all: Happenings = Vec::new();
        if let Some(words) = &seen.folder {
            all.push((Happened::Folder, Vec::new(), Some(words.clone())));
        }
        // Whatever was analysed and is no scan of the folder any more; what is being written anew is waited for.
        let gone = inputs.iter().filter(|path| seen.gone.contains(path));
        let gone: Vec<PathBuf> = gone.cloned().collect();
        if !gone.is_empty() {
            all.push((Happened::Gone, gone, None));
        }
        for failed in &seen.given_up {
            all.push((
                Happened::Unreadable,
                vec![PathBuf::from(&failed.file)],
                Some(failed.error.clone()),
            ));
        }
        let given_up = |path: &PathBuf| {
            seen.given_up
                .iter()
                .any(|failed| failed.file == in_words(path))
        };
        let came = seen.scans.iter().filter(|path| !given_up(path));
        let came = came.filter(|path| seen.fresh.contains(path) || !inputs.contains(path));
        let (again, new): (Vec<PathBuf>, Vec<PathBuf>) =
            came.cloned().partition(|path| inputs.contains(path));
        // The first step sees the files, the second that they do not change.
        let first = if self.steps <= 2 && self.history.is_empty() {
            Happened::Start
        } else {
            Happened::New
        };
        for (event, files) in [(Happened::Again, again), (first, new)] {
            if !files.is_empty() {
                all.push((event, files, None));
            }
        }
        all
    }

    /// The lines of a step, moiré by moiré.
    fn lines(&self, happened: &Happenings, seen: &Seen) -> Vec<Line> {
        let mut lines = Vec::new();
        for (number, outcome) in self.outcomes.iter().enumerate() {
            let mut of = OfMoire::new(self, outcome, seen);
            for (event, files, error) in happened {
                let names: Vec<String> = files.iter().map(|path| in_words(path)).collect();
                for (set, files) in of.shares(*event, names) {
                    let mut line = of.line(*event, set, files, error.clone());
                    line.moire = number + 1;
                    lines.push(line);
                }
            }
        }
        if self.outcomes.is_empty() {
            lines.extend(happened.iter().map(|(event, files, error)| Line {
                error: error.clone(),
                ..Line::empty(*event, files.iter().map(|path| in_words(path)).collect())
            }));
        }
        lines
    }
}

/// Lines where no file gives a number.
fn nothing(happened: &Happenings, seen: &Seen, error: &AnalyseError) -> Vec<Line> {
    let failed = match error {
        AnalyseError::Nothing { failed } | AnalyseError::NoCommonRegion { failed } => {
            failed.clone()
        }
        _ => Vec::new(),
    };
    let of = |(event, files, why): &(Happened, Vec<PathBuf>, Option<String>)| {
        let mut line = Line::empty(*event, files.iter().map(|path| in_words(path)).collect());
        let own = failed
            .iter()
            .find(|failed| Some(&failed.file) == line.file.as_ref());
        line.error = why
            .clone()
            .or_else(|| own.map(|failed| failed.error.clone()));
        line.error.get_or_insert_with(|| in_full(error));
        line.failed.clone_from(&failed);
        line.warnings.extend(warnings::of_waiting(&seen.waiting));
        line
    };
    happened.iter().map(of).collect()
}

impl Seen {
    /// Both steps as one.
    fn and_then(self, next: Self) -> Self {
        let mut fresh = self.fresh;
        fresh.extend(next.fresh);
        let mut given_up = self.given_up;
        given_up.extend(next.given_up);
        let mut gone = self.gone;
        gone.extend(next.gone);
        Self {
            fresh,
            given_up,
            gone,
            folder: next.folder.or(self.folder),
            ..next
        }
    }
}

/// The numbers of one moiré, for all lines of a step.
struct OfMoire<'a> {
    watch: &'a Watch,
    analysis: &'a Analysis,
    results: Results,
    seen: &'a Seen,
    scans: Vec<&'a moiregauge::scan::MeasuredScan>,
}

impl<'a> OfMoire<'a> {
    fn new(watch: &'a Watch, outcome: &'a Outcome, seen: &'a Seen) -> Self {
        // Which of several lattices of a file is which, and what a region leaves of it, is not known here.
        let settings = &watch.request.settings;
        let plain = settings.moires == 1 && !settings.overlap;
        Self {
            watch,
            analysis: &outcome.analysis,
            results: Results::new(&outcome.analysis, &outcome.provenance),
            seen,
            scans: if plain {
                watch.campaign.behind(outcome)
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
    fn shares(&self, event: Happened, files: Vec<String>) -> Vec<(Option<usize>, Vec<String>)> {
        let before = self.watch.last.as_ref().and_then(|file| self.set_of(file));
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
    fn line(
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
        let wanted = self.watch.request.until;
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

/// Doubts about a set and its files, each once.
fn caveats(all: &[ResultCaveat], set: &SetResult) -> Vec<ResultCaveat> {
    let concerns = |caveat: &&ResultCaveat| {
        caveat.place == set.name
            || caveat.place == "analysis"
            || set.scans.iter().any(|scan| scan.file == caveat.place)
    };
    let mut kept: Vec<ResultCaveat> = Vec::new();
    for caveat in all.iter().filter(concerns) {
        let same =
            |other: &ResultCaveat| other.code == caveat.code && other.message == caveat.message;
        if !kept.iter().any(same) {
            kept.push(caveat.clone());
        }
    }
    kept
}

/// What to do now.
fn advice(line: &Line, best: &Mean) -> String {
    if line.until.is_some_and(|until| until.reached) {
        return "what was wished for is reached: stop now".to_owned();
    }
    let Some(next) = line.next else {
        return if best.twist_deg.value.is_some() {
            String::new()
        } else {
            "no drift yet: take frames with the slow axis up and down in turn".to_owned()
        };
    };
    let bring = brought(&next);
    if best.twist_deg.value.is_none() {
        return format!(
            "no drift yet; with two more frames, the slow axis up and down in turn: {bring}"
        );
    }
    let wish = match line.until {
        Some(until) if until.out_of_reach => {
            "; what is wished for is out of reach, since calibration and model alone make more"
                .to_owned()
        }
        Some(until) => until.frames_needed.map_or_else(
            || "; what is wished for is far away".to_owned(),
            |n| format!("; {n} more may reach what is wished for"),
        ),
        None => String::new(),
    };
    if wish.is_empty() && is_hardly_less(&next, best) {
        return format!("two more frames bring {bring}, hardly less than now: stop now");
    }
    format!("two more frames bring {bring}{wish}")
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
