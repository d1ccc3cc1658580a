//! The measured lines of a scan, which all copies of the scan share.

use std::ops::Deref;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::scan::measured::MeasuredLine;

/// What the lines of one scan gave, one entry for each line direction. They are nearly all that a measured scan is, and nothing
/// changes them once the scan is put together: copies share them.
#[derive(Clone, Debug)]
pub struct MeasuredLines(Arc<[MeasuredLine]>);

impl From<Vec<MeasuredLine>> for MeasuredLines {
    fn from(lines: Vec<MeasuredLine>) -> Self {
        Self(lines.into())
    }
}

impl Deref for MeasuredLines {
    type Target = [MeasuredLine];

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl<'a> IntoIterator for &'a MeasuredLines {
    type Item = &'a MeasuredLine;
    type IntoIter = std::slice::Iter<'a, MeasuredLine>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl Serialize for MeasuredLines {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(to)
    }
}

impl<'de> Deserialize<'de> for MeasuredLines {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Vec::deserialize(from).map(Self::from)
    }
}
