//! A campaign that grows: scans come and go, settings change, and nothing is measured twice.

use std::path::{Path, PathBuf};

use moiregauge::campaign::{Analysis, analyse};
use moiregauge::scan::{MeasuredScan, sorted_moires};
use moiregauge::settings::{Settings, SettingsError};
use moiregauge_report::results::{NamedSet, Run, UserSpecified};
use moiregauge_report::{FailedInput, InputFile, Provenance};
use serde::{Deserialize, Serialize, Serializer};

use super::channel::Other;
use super::error::AnalyseError;
use super::failure::{Advice, no_advice};
use super::kept::{Heard, Kept, With};
use super::measure::{Inputs, Measured, given_again, measured};
use super::overlap::overlap;
use super::shown::show;
use crate::job::Job;
use crate::known::Known;
use crate::names::{in_words, with_words};
use crate::session::is_second_frame;
use crate::source::Places;
use crate::told::check_user_specified;
use crate::twice::distinct;

/// What came out, and of what.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The numbers.
    pub analysis: Analysis,
    /// The files, those that failed among them.
    pub provenance: Provenance,
}

/// Scans that are analysed together.
///
/// Measuring takes nearly all of the time of an analysis. A file is measured once for each content, settings of
/// measuring and what is known of it; everything else is done anew in milliseconds a scan.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "Written")]
pub struct Campaign {
    /// All that is written.
    of: Written,
    advice: Words,
    heard: Listener,
}

/// Who is given each file as soon as it is measured; not part of what is written.
#[derive(Clone, Default)]
struct Listener(Option<Heard>);

impl std::fmt::Debug for Listener {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Listener").field(&self.0.is_some()).finish()
    }
}

/// A campaign as it is written.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    settings: Settings,
    told: UserSpecified,
    sets: Vec<NamedSet>,
    inputs: Vec<PathBuf>,
    places: Places,
    left_out: Vec<FailedInput>,
    kept: Kept,
    illustrated: bool,
}

impl Serialize for Campaign {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.of.serialize(to)
    }
}

impl TryFrom<Written> for Campaign {
    type Error = SettingsError;

    fn try_from(of: Written) -> Result<Self, Self::Error> {
        of.settings.check()?;
        check_user_specified(&of.told)?;
        Ok(Self {
            of,
            advice: Words::default(),
            heard: Listener::default(),
        })
    }
}

/// How a front end words errors; not part of what is written.
#[derive(Clone, Copy, Debug)]
struct Words(Advice);

impl Default for Words {
    fn default() -> Self {
        Self(no_advice)
    }
}

impl Campaign {
    /// One without scans.
    ///
    /// # Errors
    /// Settings that make no sense.
    pub fn new(settings: Settings) -> Result<Self, SettingsError> {
        Self::try_from(Written {
            settings,
            told: UserSpecified::default(),
            sets: Vec::new(),
            inputs: Vec::new(),
            places: Places::new(),
            left_out: Vec::new(),
            kept: Kept::default(),
            illustrated: false,
        })
    }

    /// That of a run, with its scans.
    ///
    /// # Errors
    /// Settings that make no sense.
    pub fn of_run(
        run: &Run,
        inputs: &[PathBuf],
        places: &Places,
        advice: Advice,
    ) -> Result<Self, SettingsError> {
        let wanted = run.report;
        let mut campaign = Self::new(run.settings.clone())?
            .with_user_specified(run.known.clone())?
            .with_places(places.clone())
            .with_left_out(run.left_out.clone())
            .with_advice(advice)
            .illustrated(wanted.figures || wanted.png || wanted.html);
        campaign.of.sets.clone_from(&run.sets);
        campaign.add(inputs.iter().cloned());
        Ok(campaign)
    }

    /// Adds scans, in order. Second frames of files are left out where somebody told which frame to read.
    pub fn add(&mut self, scans: impl IntoIterator<Item = PathBuf>) {
        let told = self.of.told.frame_direction.is_some();
        let wanted = |scan: &PathBuf| !(told && is_second_frame(scan));
        self.of.inputs.extend(scans.into_iter().filter(wanted));
    }

    /// Removes a scan; whether it was there. What was measured of it is kept.
    pub fn remove(&mut self, scan: &Path) -> bool {
        let before = self.of.inputs.len();
        self.of.inputs.retain(|path| path != scan);
        self.of.inputs.len() < before
    }

    /// The same scans with other settings. What was measured stays where they do not change it.
    ///
    /// # Errors
    /// Settings that make no sense.
    pub fn with_settings(mut self, settings: Settings) -> Result<Self, SettingsError> {
        settings.check()?;
        self.of.settings = settings;
        Ok(self)
    }

    /// The same scans with other knowledge of them.
    ///
    /// # Errors
    /// What no file can be like.
    pub fn with_user_specified(mut self, told: UserSpecified) -> Result<Self, SettingsError> {
        check_user_specified(&told)?;
        self.of.told = told;
        Ok(self)
    }

    /// The same scans, some of which lie elsewhere than their names say.
    #[must_use]
    pub fn with_places(mut self, places: Places) -> Self {
        self.of.places = places;
        self
    }

    /// With names that were given and cannot be measured.
    #[must_use]
    pub fn with_left_out(mut self, left_out: Vec<FailedInput>) -> Self {
        self.of.left_out = left_out;
        self
    }

    /// With what a front end says that helps against errors.
    #[must_use]
    pub fn with_advice(mut self, advice: Advice) -> Self {
        self.advice = Words(advice);
        self
    }

    /// With somebody who is given each file as soon as it is measured.
    #[must_use]
    pub fn heard_by(mut self, heard: Option<Heard>) -> Self {
        self.heard = Listener(heard);
        self
    }

    /// Whether analyses hold the first image of every set, for figures.
    #[must_use]
    pub fn illustrated(mut self, illustrated: bool) -> Self {
        self.of.illustrated = illustrated;
        self
    }

    /// The same scans, whose files are not read again as long as their size and date are those of the last analysis:
    /// for folders that are watched.
    #[must_use]
    pub fn trusting_dates(mut self) -> Self {
        self.of.kept.trust_dates();
        self
    }

    /// Puts these scans, and names that cannot be measured, in the place of those before. What was measured is kept.
    pub(crate) fn replace(&mut self, scans: Vec<PathBuf>, left_out: Vec<FailedInput>) {
        self.of.inputs.clear();
        self.add(scans);
        self.of.left_out = left_out;
    }

    /// The measured scans behind an outcome with one moiré, all of the frame being used.
    pub(crate) fn behind(&self, outcome: &Outcome) -> Vec<&MeasuredScan> {
        let known = self.known();
        let with = With::new(&outcome.analysis.settings, &known, None);
        let of = |input: &InputFile| {
            let path = with_words(&self.of.inputs, &input.file)?;
            let key = with.key(path, &input.file, &input.sha256, &known);
            self.of.kept.get(&key)?.as_ref().ok()?.first()
        };
        outcome.provenance.inputs.iter().filter_map(of).collect()
    }

    /// Takes an orientation that was measured into the settings.
    pub(super) fn know_orientation(
        &mut self,
        known: heterostrain::strain::KnownOrientation,
    ) -> Result<(), SettingsError> {
        self.of.settings.lattice_angle = Some(known);
        self.of.settings.check()
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.of.settings
    }

    /// What is known of the scans.
    pub fn user_specified(&self) -> &UserSpecified {
        &self.of.told
    }

    /// The scans.
    pub fn inputs(&self) -> &[PathBuf] {
        &self.of.inputs
    }

    /// Sets made by hand.
    pub fn sets(&self) -> &[NamedSet] {
        &self.of.sets
    }

    /// Names that were given and cannot be measured.
    pub fn left_out(&self) -> &[FailedInput] {
        &self.of.left_out
    }

    /// What is known of the scans, and where they lie.
    #[must_use]
    pub fn known(&self) -> Known {
        Known::new(&self.of.told, &self.of.inputs).at(&self.of.places)
    }

    /// What helps against errors.
    pub(crate) fn advice(&self) -> Advice {
        self.advice.0
    }

    /// What was measured so far.
    pub fn kept(&self) -> &Kept {
        &self.of.kept
    }

    /// Takes what was measured by another campaign.
    pub fn take(&mut self, kept: Kept) {
        self.of.kept.extend(kept);
    }

    /// As [`Campaign::analyse`], without what is drawn at random where no estimate and no error depends on it: half of the
    /// time of many scans.
    pub(crate) fn analyse_without_draws(
        &mut self,
        job: &Job,
    ) -> Result<Vec<Outcome>, AnalyseError> {
        let asked = self.of.settings.clone();
        if asked.method.is_joint() {
            self.of.settings.drift_draws = 0;
            self.of.settings.strain_draws = 0;
        }
        let found = self.analyse(job);
        self.of.settings = asked;
        found
    }

    /// Analyses the scans, every moiré that they show by itself.
    ///
    /// # Errors
    /// [`AnalyseError`]; after [`AnalyseError::Cancelled`] what was measured is kept, and the next analysis goes on
    /// from there.
    pub fn analyse(&mut self, job: &Job) -> Result<Vec<Outcome>, AnalyseError> {
        let (inputs, repeated) = distinct(&self.of.inputs);
        let known = Known::new(&self.of.told, &inputs).at(&self.of.places);
        let mut failed = self.of.left_out.clone();
        let mut window = None;
        if self.of.settings.overlap {
            window = job.run(|| overlap(&inputs, &self.of.settings, &known))?;
            if window.is_none() {
                return Err(AnalyseError::NoCommonRegion { failed });
            }
        }
        let from = Inputs {
            files: &inputs,
            sets: &self.of.sets,
            known: &known,
            window: window.as_ref(),
            advice: self.advice.0,
            heard: self.heard.0.as_ref(),
        };
        let Measured { files, other } = measured(&from, &self.of.settings, &mut self.of.kept, job)?;
        let settings = other.as_ref().map_or(&self.of.settings, |o| &o.settings);
        let (mut scans, mut identities) = (Vec::new(), Vec::new());
        for (path, result) in inputs.iter().zip(files) {
            match result {
                Ok((moires, file)) => {
                    scans.push(moires);
                    identities.push(file);
                }
                Err(failure) => failed.push(FailedInput {
                    file: in_words(path),
                    error: failure.error,
                }),
            }
        }
        if scans.is_empty() {
            return Err(AnalyseError::Nothing { failed });
        }
        let provenance = provenance(settings, identities, failed);
        let mut caveats = given_again(&repeated);
        caveats.extend(other.as_ref().map(Other::caveat));
        let of_moire = |(moire, scans)| {
            let settings = &settings.of_moire(moire);
            let mut analysis = analyse(scans, settings);
            analysis.caveats.extend(caveats.iter().cloned());
            if self.of.illustrated {
                show(&mut analysis, &inputs, settings, &known);
            }
            Outcome {
                analysis,
                provenance: provenance.clone(),
            }
        };
        let moires = sorted_moires(scans).into_iter().enumerate();
        let outcomes: Vec<Outcome> = job.run(|| moires.map(of_moire).collect())?;
        match settings.grain {
            Some(grain) if outcomes.iter().all(|o| o.analysis.sets.is_empty()) => {
                let words = format!(
                    "no scan shows a grain {grain}: expected the number of one that has a set of its own"
                );
                Err(AnalyseError::NothingLeft(words))
            }
            _ => Ok(outcomes),
        }
    }
}

/// What was analysed; the record of the run comes later.
fn provenance(settings: &Settings, inputs: Vec<InputFile>, failed: Vec<FailedInput>) -> Provenance {
    Provenance {
        version: crate::VERSION.to_owned(),
        seed: settings.seed,
        inputs,
        failed,
        run: None,
    }
}
