//! Files with several images: which of them is meant.
//!
//! The channel is chosen by name ([`choose_channel`]). Several images of one name and line direction (pages, frames) are
//! told apart by their order, and by that alone.

use spmfile::{LineDirection, Scan, sensor_axis};

use crate::scan::channel::{channels_by_preference, choose_channel, images_of, is_usual};
use crate::settings::knobs::Settings;

/// Words where a channel has several images in the file and nobody said which of them is meant.
pub(crate) fn first_of_several(scan: &Scan, name: &str, settings: &Settings) -> Option<String> {
    if settings.image.is_some() {
        return None;
    }
    let count = [LineDirection::Trace, LineDirection::Retrace]
        .map(|direction| images_of(scan, name, direction).len())
        .into_iter()
        .max()?;
    (count > 1).then(|| {
        format!("the file holds {count} images of {name:?}: the first of them is analysed, and the others are not")
    })
}

/// Words where a file holds channels of several names, none of them one of the usual ones, and nobody said which of them
/// is meant. `channels` are pairs of the name the user sees and the instrument's own.
pub fn unusual_channels(channels: &[(&str, &str)], wanted: Option<&str>) -> Option<String> {
    let all = channels_by_preference(channels);
    let [first, _, ..] = all[..] else {
        return None;
    };
    if wanted.is_some() || is_usual(channels) {
        return None;
    }
    let names: Vec<String> = all.iter().take(6).map(|name| format!("{name:?}")).collect();
    let more = if all.len() > names.len() { ", …" } else { "" };
    Some(format!(
        "the file holds {} images ({}{more}), none of which has the name of a channel that usually shows a moiré: the \
         first, {first:?}, is analysed, and the others are not",
        all.len(),
        names.join(", ")
    ))
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
        .collect()
}
