//! Doubts that were written down with a measured scan, and read again.

use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::caveat::kinds::size;
use crate::caveat::{Caveat, Doubt, Explained, explained};
use crate::numbers::exact;

/// A doubt by its code, its words and its size.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedDoubt {
    explained: &'static Explained,
    message: String,
    size: Option<f64>,
}

impl RecordedDoubt {
    /// How large it is, beside others of its code.
    pub(super) fn size(&self) -> Option<f64> {
        self.size
    }

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
    #[serde(default, with = "exact", skip_serializing_if = "Option::is_none")]
    size: Option<f64>,
}

impl Serialize for Caveat {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let written = Written {
            code: self.code().to_owned(),
            message: self.message(),
            place: self.place.clone(),
            size: size(&self.doubt),
        };
        written.serialize(to)
    }
}

/// Reads its code, words, place and size; the numbers in the words stay words.
impl<'a> Deserialize<'a> for Caveat {
    fn deserialize<D: Deserializer<'a>>(from: D) -> Result<Self, D::Error> {
        let Written {
            code,
            message,
            place,
            size,
        } = Written::deserialize(from)?;
        let known = explained().find(|explained| explained.code == code);
        let explained = known.ok_or_else(|| {
            serde::de::Error::custom(format!("{code:?} is the code of no caveat"))
        })?;
        let doubt = RecordedDoubt {
            explained,
            message,
            size,
        };
        Ok(Self::new(Doubt::Recorded(doubt), place))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caveat::{FileDoubt, LatticeDoubt};

    #[test]
    fn recorded_caveats_say_the_same() {
        let caveat = Caveat::new(FileDoubt::ReaderDoubt("a \"b\"".to_owned()), "file");
        says_the_same_when_read(&caveat);
        let window = 0.1 + 0.2;
        let sized = Caveat::new(LatticeDoubt::GroundTakenOff { window }, "file");
        let back = says_the_same_when_read(&sized);
        assert_eq!(size(&back.doubt), Some(window));
    }

    fn says_the_same_when_read(caveat: &Caveat) -> Caveat {
        let text = serde_json::to_string(caveat).unwrap();
        let back: Caveat = serde_json::from_str(&text).unwrap();
        assert!(back.says_the_same(caveat));
        assert_eq!(
            (&back.place, back.severity()),
            (&caveat.place, caveat.severity())
        );
        assert_eq!(serde_json::to_string(&back).unwrap(), text);
        let wrong = text.replace(caveat.code(), "nothing");
        assert!(serde_json::from_str::<Caveat>(&wrong).is_err());
        back
    }
}
