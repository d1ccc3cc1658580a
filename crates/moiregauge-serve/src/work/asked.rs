//! What is asked: files, those left out, settings, what is told of the files; and the command that asks the same.

use std::path::PathBuf;

use moiregauge::settings::Settings;
use moiregauge_pipeline::names::in_words;
use moiregauge_pipeline::settings_on;
use moiregauge_report::Choice;
use moiregauge_report::results::{Run, UserSpecified};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::problem::{Answer, Problem};
use crate::roots::{File, Roots};
use crate::typed::user_specified_as_options;

/// The name of the settings file that goes with a command.
pub(crate) const SETTINGS_FILE: &str = "settings.toml";

/// What is asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Asked {
    /// No two have the same name.
    pub(crate) files: Vec<File>,
    /// The ids of those that are shown and not used.
    pub(crate) excluded: Vec<String>,
    /// Without these.
    pub(crate) settings: Settings,
    pub(crate) known: UserSpecified,
}

/// What a page changes. What is not there stays as it is.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Change {
    files: Option<Vec<String>>,
    excluded: Option<Vec<String>>,
    settings: Option<Map<String, Value>>,
    known: Option<UserSpecified>,
    /// Whether it is to be analysed.
    pub(crate) run: bool,
}

impl Asked {
    /// Nothing.
    pub(crate) fn nothing() -> Self {
        Self {
            files: Vec::new(),
            excluded: Vec::new(),
            settings: Settings::default(),
            known: UserSpecified::default(),
        }
    }

    /// The same with a change; checked.
    pub(crate) fn with(&self, change: Change, roots: &Roots) -> Answer<Self> {
        let mut asked = self.clone();
        if let Some(files) = change.files {
            let files: Answer<Vec<File>> = files.iter().map(|id| roots.file(id)).collect();
            asked.files = told_apart(files?);
        }
        if let Some(excluded) = change.excluded {
            asked.excluded = excluded;
        }
        let is_there = |id: &String| asked.files.iter().any(|file| file.id == *id);
        // Those that went with their files.
        asked.excluded.retain(is_there);
        if let Some(settings) = change.settings {
            let settings = settings_on(Settings::default(), settings);
            asked.settings = settings.map_err(|e| Problem::wrong(e).at("settings"))?;
        }
        if let Some(known) = change.known {
            asked.known = known;
        }
        asked.check()?;
        Ok(asked)
    }

    fn check(&self) -> Answer<()> {
        if self.files.is_empty() {
            return Err(Problem::wrong("there are no files").at("files"));
        }
        let wrong = |e: moiregauge::settings::SettingsError| Problem::wrong(&e).at(e.setting);
        self.effective().check().map_err(wrong)?;
        moiregauge_pipeline::check_user_specified(&self.known).map_err(wrong)?;
        if self.known.sensors.is_some() {
            return Err(Problem::wrong("a second file cannot be named here").at("known.sensors"));
        }
        Ok(())
    }

    /// The names of the files.
    pub(crate) fn inputs(&self) -> Vec<PathBuf> {
        self.files.iter().map(|file| file.name.clone()).collect()
    }

    /// The settings, with the files that are left out.
    pub(crate) fn effective(&self) -> Settings {
        let mut settings = self.settings.clone();
        for file in &self.files {
            let name = in_words(&file.name);
            if self.excluded.contains(&file.id) && !settings.exclude.contains(&name) {
                settings.exclude.push(name);
            }
        }
        settings
    }

    /// The arguments of the program that asks the same, without where results go.
    pub(crate) fn arguments(&self) -> Answer<Vec<String>> {
        let mut all = vec!["analyze".to_owned()];
        all.extend(self.files.iter().map(|file| in_words(&file.name)));
        if self.settings_file()?.is_some() {
            all.extend(["--config".to_owned(), SETTINGS_FILE.to_owned()]);
        }
        all.extend(user_specified_as_options(&self.known));
        Ok(all)
    }

    /// The settings that are not as usual, as TOML; none where all are.
    pub(crate) fn settings_file(&self) -> Answer<Option<String>> {
        let now = serde_json::to_value(self.effective()).map_err(Problem::fault)?;
        let usual = serde_json::to_value(Settings::default()).map_err(Problem::fault)?;
        let (Value::Object(now), Value::Object(usual)) = (now, usual) else {
            return Err(Problem::fault("settings must be a table"));
        };
        let differs = |name: &str| now.get(name) != usual.get(name);
        let layers = ["material", "substrate", "moire_layers", "layers_chosen"];
        let chosen = layers.into_iter().any(differs);
        let changed: Map<String, Value> = now
            .iter()
            // Who reads names of layers takes them for chosen, unless told otherwise.
            .filter(|(name, _)| differs(name) || (chosen && *name == "layers_chosen"))
            .map(|(name, value)| (name.clone(), value.clone()))
            .collect();
        if changed.is_empty() {
            return Ok(None);
        }
        // As settings, lest what is nothing stand in the file.
        let table: toml::Table = toml::Table::try_from(self.effective()).map_err(Problem::fault)?;
        let table: toml::Table = table
            .into_iter()
            .filter(|(name, _)| changed.contains_key(name))
            .collect();
        toml::to_string(&table).map(Some).map_err(Problem::fault)
    }

    /// The run that the program would record.
    pub(crate) fn run(&self) -> Answer<Run> {
        Ok(Run {
            command: "analyze".to_owned(),
            arguments: self.arguments()?,
            settings: self.effective(),
            known: self.known.clone(),
            sets: Vec::new(),
            atomic: None,
            survey_image: None,
            report: Choice::default(),
            export: Vec::new(),
            parquet: false,
            inputs: Vec::new(),
            other_files: Vec::new(),
            left_out: Vec::new(),
        })
    }
}

/// Files of the same name, from several drops, told apart by a number before it.
fn told_apart(mut files: Vec<File>) -> Vec<File> {
    let mut seen = std::collections::HashSet::new();
    files.retain(|file| seen.insert(file.id.clone()));
    let mut names = std::collections::HashSet::new();
    for file in &mut files {
        let name = file.name.clone();
        let mut number = 1;
        while !names.insert(file.name.clone()) {
            number += 1;
            file.name = PathBuf::from(format!("drop-{number}")).join(&name);
        }
    }
    files
}

/// A command line as shells take it.
pub(crate) fn quoted(arguments: &[String]) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./:=,+@%×".contains(c);
    let all = arguments.iter().map(|text| {
        if !text.is_empty() && text.chars().all(plain) {
            text.clone()
        } else {
            format!("'{}'", text.replace('\'', r"'\''"))
        }
    });
    all.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(id: &str, name: &str) -> File {
        File {
            id: id.to_owned(),
            name: name.into(),
            place: name.into(),
            root: "0".to_owned(),
        }
    }

    #[test]
    fn files_of_one_name_are_told_apart() {
        let all = [
            file("1", "a"),
            file("2", "a"),
            file("1", "a"),
            file("3", "b"),
        ];
        let names: Vec<_> = told_apart(all.to_vec())
            .into_iter()
            .map(|f| f.name)
            .collect();
        assert_eq!(names, ["a", "drop-2/a", "b"].map(PathBuf::from));
    }

    #[test]
    fn settings_files_say_what_is_not_as_usual() {
        let mut asked = Asked::nothing();
        asked.files = vec![file("1", "it's a.spm"), file("2", "b.spm")];
        assert_eq!(asked.settings_file().unwrap(), None);
        assert_eq!(
            quoted(&asked.arguments().unwrap()),
            r"analyze 'it'\''s a.spm' b.spm"
        );
        asked.known.size_nm = Some([70.0, 35.5]);
        assert_eq!(
            quoted(&asked.arguments().unwrap()),
            r"analyze 'it'\''s a.spm' b.spm --size 70nm×35.5nm"
        );
        asked.known.size_nm = None;
        asked.excluded = vec!["2".to_owned()];
        let options = r#"{"layers": "graphene/hBN", "by_hand": {"near_nm": 12.1}, "seed": 3, "frame_time_sigma_s": 0.3}"#;
        let options = serde_json::from_str(options).unwrap();
        asked.settings = settings_on(Settings::default(), options).unwrap();
        let text = asked.settings_file().unwrap().unwrap();
        assert!(
            !text.contains("strain_draws") && text.contains("exclude"),
            "{text}"
        );
        let read = moiregauge_pipeline::parse_settings(&text, "".as_ref()).unwrap();
        assert_eq!(read, asked.effective());
        assert!(
            asked
                .arguments()
                .unwrap()
                .ends_with(&["--config".to_owned(), SETTINGS_FILE.to_owned()])
        );
    }
}
