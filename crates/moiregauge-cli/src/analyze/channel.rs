//! Another channel, where the usual one shows no lattice in any scan.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use moiregauge::caveat::{Caveat, ChannelReason, FileDoubt};
use moiregauge::scan::{MeasureError, channels_by_preference};
use moiregauge::settings::Settings;
use spmfile::{ChannelInfo, ReadError};

use crate::input::Known;

/// A channel to try instead, as settings that name it.
pub(super) struct Other {
    pub(super) settings: Settings,
    /// The channels that were tried before.
    tried: Vec<String>,
}

impl Other {
    /// Says so.
    pub(super) fn caveat(&self) -> Caveat {
        let doubt = FileDoubt::ChannelChosen {
            channel: self.settings.channel.clone().unwrap_or_default(),
            why: ChannelReason::NoLatticeIn(self.tried.join(" or ")),
        };
        Caveat::new(doubt, "analysis")
    }
}

/// The other channels of the scans, best first, where the user named none, no scan could be measured, and the
/// images are to blame.
pub(super) fn another<T>(
    inputs: &[PathBuf],
    measured: &[anyhow::Result<T>],
    (settings, known): (&Settings, &Known),
) -> Option<Vec<Other>> {
    let no_lattice = |result: &anyhow::Result<T>| {
        let error = result.as_ref().err()?.downcast_ref()?;
        matches!(error, MeasureError::Lattice { .. }).then_some(())
    };
    if settings.channel.is_some() || measured.iter().any(Result::is_ok) {
        return None;
    }
    let first = measured.iter().position(|r| no_lattice(r).is_some())?;
    let path = inputs.get(first)?;
    let names = names(
        path,
        &moiregauge_pipeline::read(known.place(path)).ok()?,
        known,
    )
    .ok()?;
    let names: Vec<_> = names
        .iter()
        .map(|(a, b)| (a.as_str(), b.as_str()))
        .collect();
    let all = channels_by_preference(&names);
    let others = (1..all.len()).map(|i| Other {
        settings: Settings {
            channel: Some(all[i].to_owned()),
            ..settings.clone()
        },
        tried: all[..i].iter().map(|&name| name.to_owned()).collect(),
    });
    Some(others.collect())
}

/// The same for a file on disk; `None` where it cannot be read.
pub(crate) fn channel_names(path: &Path, known: &Known) -> Option<Vec<(String, String)>> {
    names(
        path,
        &moiregauge_pipeline::read(known.place(path)).ok()?,
        known,
    )
    .ok()
}

/// The names of the channels of a file, the user's and the instrument's own, without those that the user
/// calls position sensors.
pub(super) fn names(
    path: &Path,
    bytes: &[u8],
    known: &Known,
) -> Result<Vec<(String, String)>, ReadError> {
    let channels = RefCell::new(Vec::new());
    known.decode(path, bytes, &|channel: &ChannelInfo| {
        channels
            .borrow_mut()
            .push((channel.name.clone(), channel.internal_name.clone()));
        false
    })?;
    let mut channels = channels.into_inner();
    channels.retain(|(name, internal)| !known.names_sensor(name, internal));
    Ok(channels)
}
