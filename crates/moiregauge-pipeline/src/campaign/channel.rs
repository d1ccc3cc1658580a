//! Another channel, where the usual one shows no lattice in any scan.

use std::path::PathBuf;

use moiregauge::caveat::{Caveat, ChannelReason, FileDoubt};
use moiregauge::scan::channels_by_preference;
use moiregauge::settings::Settings;

use super::failure::Failure;
use crate::known::Known;
use crate::opened::Opened;

/// Largest number of other channels that are tried.
const MOST_TRIED: usize = 16;

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
/// images are to blame; none otherwise.
pub(super) fn others<T>(
    inputs: &[PathBuf],
    measured: &[Result<T, Failure>],
    settings: &Settings,
    known: &Known,
) -> Vec<Other> {
    let no_lattice = |result: &Result<T, Failure>| result.as_ref().is_err_and(|f| f.no_lattice);
    if settings.channel.is_some() || measured.iter().any(Result::is_ok) {
        return Vec::new();
    }
    let mut both = inputs.iter().zip(measured);
    let first = both.find(|(_, result)| no_lattice(result));
    let Some(opened) = first.and_then(|(path, _)| Opened::new(path, known).ok()) else {
        return Vec::new();
    };
    let names = opened.names();
    // Of the many slices of a grid some are tried, evenly.
    let all = channels_by_preference(&names);
    let step = all.len().saturating_sub(1).div_ceil(MOST_TRIED).max(1);
    let all: Vec<&str> = all
        .iter()
        .copied()
        .take(1)
        .chain(all.iter().copied().skip(1).step_by(step))
        .collect();
    let others = (1..all.len()).map(|i| Other {
        settings: Settings {
            channel: Some(all[i].to_owned()),
            ..settings.clone()
        },
        tried: all[..i].iter().map(|&name| name.to_owned()).collect(),
    });
    others.collect()
}
