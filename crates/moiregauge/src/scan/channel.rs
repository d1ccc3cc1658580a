//! Which channel shows the moiré.

use std::collections::HashSet;

use rayon::prelude::*;
use spmfile::{Channel, LineDirection, Scan};

use crate::frame::background::{Background, take_background_off};
use crate::frame::image::Image;
use crate::scan::measured::MeasureError;
use crate::settings::knobs::{Lines, Settings};

/// Channels in which moirés are usually seen, best first.
const USUAL: [&str; 14] = [
    "TR Phase",
    "TR Amplitude",
    "Phase",
    "Amplitude",
    "Friction",
    "Lateral Deflection",
    "Current",
    "Adhesion",
    "Amplitude Error",
    "Height Sensor",
    "Height",
    "Topography",
    "Z-Axis",
    "Z",
];

/// Lines that are converted together.
const LINES: usize = 32;

/// The channel to analyse: the one asked for, or the first usual one, or the first that is no
/// position sensor. `None` where there is no such channel.
///
/// `channels` are pairs of the name the user sees and the instrument's own. Names are compared by [`plain_name`], and one
/// without line direction stands for both (`Phase` for `PhaseTrace` and `PhaseRetrace`). Returns the name the user sees.
pub fn choose_channel<'a>(
    channels: &[(&'a str, &'a str)],
    wanted: Option<&str>,
) -> Option<&'a str> {
    let find = |wanted: &str| {
        let wanted = plain_name(wanted);
        channels
            .iter()
            .find(|(name, internal)| plain_name(name) == wanted || plain_name(internal) == wanted)
            .or_else(|| channels.iter().find(|(name, _)| stem(name) == wanted))
            .map(|(name, _)| *name)
    };
    match wanted {
        Some(wanted) => find(wanted),
        None => channels_by_preference(channels).first().copied(),
    }
}

/// All channels that can show the moiré, the usual ones first: one name for each, whatever its line
/// directions.
pub fn channels_by_preference<'a>(channels: &[(&'a str, &'a str)]) -> Vec<&'a str> {
    let usual = USUAL
        .iter()
        .filter_map(|name| choose_channel(channels, Some(name)));
    let others = channels
        .iter()
        .filter(|(name, internal)| spmfile::sensor_axis(name, internal).is_none())
        .map(|(name, _)| *name);
    let mut known = HashSet::new();
    usual
        .chain(others)
        .filter(|name| known.insert(stem(name)))
        .collect()
}

/// Whether one of them has the name of a channel in which moirés are usually seen.
pub(crate) fn is_usual(channels: &[(&str, &str)]) -> bool {
    USUAL
        .iter()
        .any(|name| choose_channel(channels, Some(name)).is_some())
}

/// A name for comparing: lower case, letters and digits only, and the sign and the point of a number, as the images of
/// a grid differ in nothing else.
pub fn plain_name(name: &str) -> String {
    let mut before = None;
    let mut rest = name.chars().peekable();
    let mut plain = String::new();
    while let Some(c) = rest.next() {
        let digit_follows = rest.peek().is_some_and(char::is_ascii_digit);
        let of_number = match c {
            '-' => digit_follows && matches!(before, None | Some(' ' | '(')),
            '.' => digit_follows && before.is_some_and(|b| b.is_ascii_digit()),
            _ => c.is_alphanumeric(),
        };
        if of_number {
            plain.extend(c.to_lowercase());
        }
        before = Some(c);
    }
    plain
}

/// The plain name without the line direction that some instruments put behind it: what trace and
/// retrace of one quantity have in common.
pub(crate) fn stem(name: &str) -> String {
    let plain = plain_name(name);
    let stem = ["retrace", "trace", "forward", "backward"]
        .iter()
        .find_map(|word| plain.strip_suffix(word))
        .filter(|stem| !stem.is_empty());
    stem.map_or_else(|| plain.clone(), str::to_owned)
}

/// The values of a channel as an image.
pub(crate) fn image_of(channel: &Channel) -> Image {
    let (rows, columns) = (channel.rows, channel.columns);
    let mut values = vec![0.0; rows * columns];
    let parts = values.par_chunks_mut((LINES * columns).max(1)).enumerate();
    parts.for_each(|(part, values)| {
        let first = part * LINES;
        values.copy_from_slice(&channel.lines(first..(first + LINES).min(rows)));
    });
    Image::new(rows, columns, values)
}

/// The same without its background.
pub(crate) fn flat_image_of(channel: &Channel, background: Background) -> Image {
    let mut image = image_of(channel);
    take_background_off(&mut image, background);
    image
}

/// The images to measure: the chosen channel in the chosen line directions, main scan line first.
pub(crate) fn channels<'a>(
    scan: &'a Scan,
    settings: &Settings,
) -> Result<Vec<&'a Channel>, MeasureError> {
    let names: Vec<(&str, &str)> = scan
        .channels
        .iter()
        .map(|c| (c.name.as_str(), c.internal_name.as_str()))
        .collect();
    let Some(name) = choose_channel(&names, settings.channel.as_deref()) else {
        let mut present: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
        present.dedup();
        return Err(MeasureError::NoChannel {
            wanted: settings.channel.clone().unwrap_or_default(),
            present: present.join(", "),
        });
    };
    let number = settings.image.unwrap_or(1);
    let of = |direction| images_of(scan, name, direction);
    let all = [LineDirection::Trace, LineDirection::Retrace].map(of);
    let found = all.iter().map(Vec::len).max().unwrap_or(0);
    if settings.image.is_some() && !(1..=found).contains(&number) {
        return Err(MeasureError::NoSuchImage {
            channel: name.to_owned(),
            wanted: number,
            found,
        });
    }
    let [trace, retrace] = all.map(|images| images.get(number.wrapping_sub(1)).copied());
    let lacking = |wanted, present| MeasureError::NoLine {
        channel: name.to_owned(),
        wanted,
        present,
    };
    let chosen = match settings.line {
        Lines::Trace => vec![trace.ok_or(lacking("trace", "retrace"))?],
        Lines::Retrace => vec![retrace.ok_or(lacking("retrace", "trace"))?],
        Lines::Both => trace.into_iter().chain(retrace).collect(),
    };
    Ok(chosen)
}

/// The images of a channel in one line direction, main scan lines where there are any, in the order of the file.
pub(crate) fn images_of<'a>(
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

#[cfg(test)]
mod tests {
    use super::*;

    const CHANNELS: [(&str, &str); 4] = [
        ("X Sensor", "Xsensor"),
        ("Height Sensor", "ZSensor"),
        ("TR Amplitude", "TRAmplitude"),
        ("TR Phase", "TRPhase"),
    ];

    #[test]
    fn names_are_found_in_any_spelling() {
        let choose = |wanted| choose_channel(&CHANNELS, wanted);
        assert_eq!(choose(None), Some("TR Phase"));
        assert_eq!(choose(Some("tr_amplitude")), Some("TR Amplitude"));
        assert_eq!(choose(Some("zsensor")), Some("Height Sensor"));
        assert_eq!(choose(Some("Current")), None);
        let odd = [("Xsensor", ""), ("Deflection μ", "")];
        assert_eq!(choose_channel(&odd, None), Some("Deflection μ"));
    }

    #[test]
    fn every_channel_is_offered_once() {
        let stm = [
            ("LIA Current", ""),
            ("LIA Current", ""),
            ("Current", ""),
            ("Topography", ""),
        ];
        assert_eq!(
            channels_by_preference(&stm),
            ["Current", "Topography", "LIA Current"]
        );
        assert_eq!(
            channels_by_preference(&CHANNELS),
            ["TR Phase", "TR Amplitude", "Height Sensor"]
        );
    }

    /// The slices of a grid of spectra.
    #[test]
    fn signs_and_points_of_numbers_count() {
        let slices = ["-1.25", "-0.5", "0.5", "1.25", "12.5"].map(|v| format!("LI X ({v} V)"));
        let channels: Vec<(&str, &str)> = slices.iter().map(|name| (name.as_str(), "")).collect();
        for name in &slices {
            assert_eq!(choose_channel(&channels, Some(name)), Some(name.as_str()));
        }
        let half = choose_channel(&channels, Some("li x -0.5v"));
        assert_eq!(half, Some("LI X (-0.5 V)"));
        assert_eq!(channels_by_preference(&channels).len(), slices.len());
        assert_eq!(plain_name("Z-Axis"), plain_name("z axis"));
        assert_eq!(plain_name("Phase-2."), "phase2");
    }

    #[test]
    fn line_directions_in_names_do_not_count() {
        let igor = [
            ("HeightTrace", ""),
            ("HeightRetrace", ""),
            ("PhaseRetrace", ""),
        ];
        assert_eq!(choose_channel(&igor, None), Some("PhaseRetrace"));
        assert_eq!(choose_channel(&igor, Some("height")), Some("HeightTrace"));
        assert_eq!(
            choose_channel(&igor, Some("heightretrace")),
            Some("HeightRetrace")
        );
        assert_eq!(
            choose_channel(&[("Z (Forward)", "")], None),
            Some("Z (Forward)")
        );
        assert_eq!(stem("Z (Backward)"), stem("Z (Forward)"));
        assert_eq!(stem("Trace"), "trace");
        assert_ne!(stem("Amplitude Error"), stem("Amplitude"));
    }
}
