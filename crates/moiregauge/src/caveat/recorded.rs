//! Doubts that were written down with a measured scan, and read again.

use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::caveat::{Caveat, Doubt, Explained, explained};

/// A doubt by its code and its words, without the numbers in them.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedDoubt {
    explained: &'static Explained,
    message: String,
}

impl RecordedDoubt {
    /// What it means and what to do.
    pub(super) fn explained(&self) -> &'static Explained {
        self.explained
    }
}

impl fmt::Display for RecordedDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for RecordedDoubt {}

/// A caveat as it stands in documents.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    code: String,
    message: String,
    #[serde(rename = "where")]
    place: String,
}

impl Serialize for Caveat {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let written = Written {
            code: self.code().to_owned(),
            message: self.message(),
            place: self.place.clone(),
        };
        written.serialize(to)
    }
}

/// Reads its code, words and place; the numbers in the words stay words.
impl<'a> Deserialize<'a> for Caveat {
    fn deserialize<D: Deserializer<'a>>(from: D) -> Result<Self, D::Error> {
        let Written {
            code,
            message,
            place,
        } = Written::deserialize(from)?;
        let known = explained().find(|explained| explained.code == code);
        let explained = known.ok_or_else(|| {
            serde::de::Error::custom(format!("{code:?} is the code of no caveat"))
        })?;
        Ok(Self {
            doubt: Doubt::Recorded(RecordedDoubt { explained, message }),
            place,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caveat::FileDoubt;

    #[test]
    fn recorded_caveats_say_the_same() {
        let caveat = Caveat::new(FileDoubt::ReaderDoubt("a \"b\"".to_owned()), "file");
        let text = serde_json::to_string(&caveat).unwrap();
        let back: Caveat = serde_json::from_str(&text).unwrap();
        assert!(back.says_the_same(&caveat));
        assert_eq!(
            (&back.place, back.severity()),
            (&caveat.place, caveat.severity())
        );
        assert_eq!(serde_json::to_string(&back).unwrap(), text);
        let wrong = text.replace(caveat.code(), "nothing");
        assert!(serde_json::from_str::<Caveat>(&wrong).is_err());
    }
}
