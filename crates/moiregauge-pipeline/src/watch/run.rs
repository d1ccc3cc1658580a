//! The watch itself: folder → files that are whole → campaign → lines.

use std::path::{Path, PathBuf};

use super::files::{Files, Seen};
use super::line::{Happened, Line, Point};
use super::request::{WatchError, WatchRequest};
use super::tell::OfMoire;
use super::warnings;
use crate::campaign::{Advice, AnalyseError, Campaign, Kept, Outcome, in_words as error_in_words};
use crate::job::{Cancelled, Job};
use crate::known::Known;
use crate::names::{in_full, in_words};
use crate::opened::Opened;

/// A folder that is watched.
#[derive(Clone, Debug)]
pub struct Watch {
    request: WatchRequest,
    files: Files,
    campaign: Campaign,
    advice: Advice,
    history: Vec<Point>,
    /// The last line with numbers of each moiré, for what happens to the folder.
    told: Vec<Line>,
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
            .with_user_specified(request.told.clone())?
            .trusting_dates();
        Ok(Self {
            files: Files::new(&request.folder, request.patience),
            campaign,
            advice: crate::campaign::no_advice,
            history: Vec::new(),
            told: Vec::new(),
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

    /// What the lines told last, with all numbers, one for each moiré; analysed again, since a long watch would fill the
    /// memory with what nobody looks at.
    ///
    /// # Errors
    /// As [`Campaign::analyse`]: before the first frame there is nothing.
    pub fn outcomes(&mut self, job: &Job) -> Result<Vec<Outcome>, AnalyseError> {
        self.campaign.analyse(job)
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
            let known = Known::new(campaign.user_specified(), &[]);
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
        let (mut outcomes, mut error) = (Vec::new(), None);
        if !only_folder {
            let before = (
                self.campaign.inputs().to_vec(),
                self.campaign.left_out().to_vec(),
            );
            self.campaign
                .replace(seen.scans.clone(), seen.left_out.clone());
            match self.campaign.analyse_without_draws(job) {
                Ok(found) => outcomes = found,
                Err(AnalyseError::Cancelled(cancelled)) => {
                    self.steps -= 1;
                    self.campaign.replace(before.0, before.1);
                    self.untold = Some(seen);
                    return Err(cancelled);
                }
                Err(other) => error = Some(other),
            }
        }
        let lines = match &error {
            None => job.run(|| self.lines(&outcomes, &happened, &seen))?,
            Some(error) => nothing(&happened, &seen, error),
        };
        self.history.extend(lines.iter().map(Point::from));
        if let Some(line) = lines.iter().rev().find(|line| line.set.is_some()) {
            if !only_folder {
                self.last.clone_from(&line.file);
            }
            let last_of = |moire| lines.iter().rev().find(|line| line.moire == moire);
            self.told = (1..=line.moire).filter_map(last_of).cloned().collect();
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
    fn lines(&self, outcomes: &[Outcome], happened: &Happenings, seen: &Seen) -> Vec<Line> {
        let mut lines = Vec::new();
        for (number, outcome) in outcomes.iter().enumerate() {
            let last = self.last.as_deref();
            let mut of = OfMoire::new(&self.request, &self.campaign, last, outcome, seen);
            for (event, files, error) in happened {
                let names: Vec<String> = files.iter().map(|path| in_words(path)).collect();
                for (set, files) in of.shares(*event, names) {
                    let mut line = of.line(*event, set, files, error.clone());
                    line.moire = number + 1;
                    lines.push(line);
                }
            }
        }
        if outcomes.is_empty() {
            let of_folder = happened.iter().flat_map(|(event, _, error)| {
                let plain = || vec![Line::empty(*event, Vec::new())];
                let before = Some(self.told.clone()).filter(|told| !told.is_empty());
                let lines = before.unwrap_or_else(plain).into_iter();
                lines.map(|line| Line {
                    event: *event,
                    file: None,
                    files: Vec::new(),
                    acquired: None,
                    error: error.clone(),
                    ..line
                })
            });
            lines.extend(of_folder);
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
