//! Files with several images: which of them is meant.
//!
//! The channel is chosen by name ([`choose_channel`]). Several images of one name and line direction (pages, frames) are
//! told apart by their order, and by that alone.

use spmfile::{Channel, LineDirection, Scan, sensor_axis};

use super::channel::{channels_by_preference, choose_channel, is_usual, stem};
use crate::caveat::ImageChoice;
use crate::settings::Settings;

/// The images of a channel in one line direction, main scan lines where there are any, in the order of the file.
pub(super) fn images_of<'a>(
    scan: &'a Scan,
    name: &str,
    direction: LineDirection,
) -> Vec<&'a Channel> {
    let wanted = |c: &&Channel| {
        stem(&c.name) == stem(name) && c.line_direction.unwrap_or(LineDirection::Trace) == direction
    };
    let all: Vec<&Channel> = scan.channels.iter().filter(wanted).collect();
    let main = |c: &&Channel| c.scan_line.as_deref().is_none_or(|s| s == "Main");
    let mains: Vec<&Channel> = all.iter().copied().filter(main).collect();
    if mains.is_empty() { all } else { mains }
}

/// Says so where a channel has several images in the file and nobody said which of them is meant.
pub(super) fn first_of_several(
    scan: &Scan,
    name: &str,
    settings: &Settings,
) -> Option<ImageChoice> {
    if settings.image.is_some() {
        return None;
    }
    let count = [LineDirection::Trace, LineDirection::Retrace]
        .map(|direction| images_of(scan, name, direction).len())
        .into_iter()
        .max()?;
    (count > 1).then(|| ImageChoice::First {
        channel: name.to_owned(),
        count,
    })
}

/// Says so where a file holds channels of several names, none of them one of the usual ones, and nobody said which of them
/// is meant. `channels` are pairs of the name the user sees and the instrument's own.
pub fn unusual_channels(channels: &[(&str, &str)], wanted: Option<&str>) -> Option<ImageChoice> {
    let all = channels_by_preference(channels);
    let [first, _, ..] = all[..] else {
        return None;
    };
    if wanted.is_some() || is_usual(channels) {
        return None;
    }
    let names: Vec<String> = all.iter().take(6).map(|name| format!("{name:?}")).collect();
    let more = if all.len() > names.len() { ", …" } else { "" };
    Some(ImageChoice::UnusualNames {
        count: all.len(),
        names: format!("{}{more}", names.join(", ")),
        first: first.to_owned(),
    })
}

/// What of a file with several images is analysed, in words; nothing where that is clear.
pub fn image_choice(scan: &Scan, settings: &Settings) -> Vec<String> {
    let names: Vec<(&str, &str)> = scan
        .channels
        .iter()
        .filter(|c| sensor_axis(&c.name, &c.internal_name).is_none())
        .map(|c| (c.name.as_str(), c.internal_name.as_str()))
        .collect();
    let wanted = settings.channel.as_deref();
    let name = choose_channel(&names, wanted);
    let pages = name.and_then(|name| first_of_several(scan, name, settings));
    unusual_channels(&names, wanted)
        .into_iter()
        .chain(pages)
        .map(|choice| choice.to_string())
        .collect()
}
