//! One thing that a sample or an instrument has besides a perfect lattice, with its numbers.

use std::collections::BTreeMap;

use rand::RngExt as _;
use serde::{Deserialize, Serialize};

use crate::simulate::classes::{CLASSES, Key, SampleClass, sample_class};
use crate::simulate::error::SimulateError;

/// A class of the table [`CLASSES`] and the numbers that differ from the usual ones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct SampleFeature {
    /// Name of the class.
    pub class: String,
    /// Its numbers, by their keys.
    #[serde(flatten)]
    pub values: BTreeMap<String, f64>,
}

impl SampleFeature {
    /// The classes of a text like `edge:share=0.4,angle=30+glitches`, checked.
    ///
    /// # Errors
    /// [`SimulateError::Setting`] names what is not known or out of its range.
    pub fn parse(text: &str) -> Result<Vec<Self>, SimulateError> {
        text.split('+').map(Self::parse_one).collect()
    }

    fn parse_one(text: &str) -> Result<Self, SimulateError> {
        let (class, rest) = text.split_once(':').unwrap_or((text, ""));
        let mut values = BTreeMap::new();
        for pair in rest.split(',').filter(|pair| !pair.trim().is_empty()) {
            let number = pair
                .split_once('=')
                .and_then(|(key, value)| Some((key.trim(), value.trim().parse::<f64>().ok()?)));
            let Some((key, value)) = number else {
                return Err(refused(
                    format!("sample {}", class.trim()),
                    "numbers like share=0.4, separated by commas",
                    pair,
                ));
            };
            values.insert(key.to_owned(), value);
        }
        let feature = Self {
            class: class.trim().to_owned(),
            values,
        };
        feature.check()?;
        Ok(feature)
    }

    /// Refuses classes, keys and values that do not exist.
    pub(crate) fn check(&self) -> Result<(), SimulateError> {
        let Some(class) = sample_class(&self.class) else {
            let names: Vec<&str> = CLASSES.iter().map(|class| class.name).collect();
            let expected = format!("one of {}", names.join(", "));
            return Err(refused("class of the sample", expected, &self.class));
        };
        for (name, value) in &self.values {
            let setting = format!("sample {}", class.name);
            let Some(key) = class.key(name) else {
                let names: Vec<&str> = class.keys.iter().map(|key| key.name).collect();
                let expected = if names.is_empty() {
                    "no numbers".to_owned()
                } else {
                    format!("one of {}", names.join(", "))
                };
                return Err(refused(setting, expected, name));
            };
            let [least, most] = key.allowed;
            if !(least..=most).contains(value) {
                let setting = format!("{setting}: {name}");
                return Err(refused(setting, format!("{least} to {most}"), value));
            }
        }
        Ok(())
    }

    /// The number of this key; the usual one where none is given.
    pub(crate) fn value(&self, key: &str) -> f64 {
        let given = self.values.get(key).copied();
        let usual = || Some(sample_class(&self.class)?.key(key)?.usual);
        given.or_else(usual).unwrap_or(f64::NAN)
    }

    /// Draws the numbers that are not given.
    pub(crate) fn vary(&mut self, rng: &mut impl rand::Rng) {
        let keys = sample_class(&self.class).map_or(&[][..], |class: &SampleClass| class.keys);
        for Key { name, drawn, .. } in keys {
            let [low, high] = *drawn;
            // Drawn whether or not it is needed: what is given changes no other number.
            let value = low + (high - low) * rng.random::<f64>();
            let value = if *name == "count" {
                value.round()
            } else {
                value
            };
            self.values.entry((*name).to_owned()).or_insert(value);
        }
    }
}

/// To five digits behind the point: what is drawn is to be read by people.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e5).round() / 1e5
}

fn refused(
    setting: impl Into<String>,
    expected: impl Into<String>,
    found: impl std::fmt::Debug,
) -> SimulateError {
    SimulateError::Feature {
        setting: setting.into(),
        expected: expected.into(),
        found: format!("{found:?}"),
    }
}
