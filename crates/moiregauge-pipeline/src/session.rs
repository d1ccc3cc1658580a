//! Scans that are spread over several files: Omicron Matrix, whose log lies beside the images.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use spmfile::matrix::{frame_and_channel, is_curve, log_file};
use spmfile::{ChannelInfo, Format, FrameDirection, ReadError, Scan};

use crate::content::Content;
use crate::source::Source;

fn refused(reason: String) -> ReadError {
    ReadError::Unsupported {
        format: "Omicron Matrix",
        reason,
    }
}

/// Reads the frame upwards, or the one that is wanted, with the log of the session beside the file.
///
/// # Errors
/// As [`spmfile::matrix::read`], and where there is no log.
pub fn read(
    file: &Source,
    bytes: &[u8],
    frame: Option<FrameDirection>,
    wanted: &dyn Fn(&ChannelInfo) -> bool,
) -> Result<Scan, ReadError> {
    let name = file.path().file_name().unwrap_or_default();
    let name = name.to_string_lossy();
    let parts = log(file, &name)?;
    let parts: Vec<&[u8]> = parts.iter().map(Content::bytes).collect();
    spmfile::matrix::read(bytes, &parts, &name, frame, wanted)
}

/// The parts of the log, as many as there are.
fn log(file: &Source, name: &str) -> Result<Vec<Content>, ReadError> {
    let mut parts = Vec::new();
    for number in 1.. {
        // A name that tells no log is refused by the reader, in its words.
        let Some(log) = log_file(name, number) else {
            break;
        };
        match file.beside(&log).content() {
            Ok(bytes) => parts.push(bytes),
            Err(error) if error.is_missing() && number > 1 => break,
            Err(error) if error.is_missing() => {
                return Err(refused(format!(
                    "its lines, size and scale are in the log of its session: expected the file {log} beside it, found \
                     none"
                )));
            }
            Err(error) => return Err(refused(format!("{log} beside it: {error}"))),
        }
    }
    Ok(parts)
}

/// The parts of the log beside a file of a session on the disk; none beside any other file.
pub fn log_files(path: &Path) -> Vec<PathBuf> {
    let logs = Source::disk(path).logs();
    logs.iter().map(|log| log.path().to_owned()).collect()
}

/// Of the scans found in a folder, sorted by name, those to read: of a frame whose channels are files of
/// their own one file, that of Z where there is one, and no curves.
pub fn one_per_frame(files: Vec<(PathBuf, Format)>) -> Vec<PathBuf> {
    let mut kept = Vec::new();
    let mut places = BTreeMap::new();
    for (file, format) in files {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let parts = frame_and_channel(&name);
        let Some((frame, channel)) = parts.filter(|_| format == Format::OmicronMatrix) else {
            kept.push(file);
            continue;
        };
        if is_curve(&channel) {
            continue;
        }
        match places.get(&frame) {
            Some(&place) if channel == "Z" => kept[place] = file,
            Some(_) => {}
            None => {
                places.insert(frame, kept.len());
                kept.push(file);
            }
        }
    }
    kept
}

/// Files apart that are another channel of a frame among those before: with the first file of the frame.
///
/// Measured both, they would count as two frames.
pub fn channels_of_one_frame(files: Vec<PathBuf>) -> (Vec<PathBuf>, Vec<(PathBuf, PathBuf)>) {
    let (mut kept, mut others) = (Vec::new(), Vec::new());
    let mut first: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
    for file in files {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let frame = frame_and_channel(&name).map(|(frame, _)| file.with_file_name(frame));
        if let Some(other) = frame.as_ref().and_then(|frame| first.get(frame)) {
            others.push((file, other.clone()));
            continue;
        }
        if let Some(frame) = frame {
            first.insert(frame, file.clone());
        }
        kept.push(file);
    }
    (kept, others)
}

/// What stands behind the name of a file whose frame downwards is meant.
const DOWN: &str = " (down)";

/// The file of an input: of the name of its second frame, the file itself.
pub fn file_of(input: &Path) -> &Path {
    let first = input.to_str().and_then(|name| name.strip_suffix(DOWN));
    first
        .filter(|name| name.ends_with("_mtrx"))
        .map_or(input, Path::new)
}

/// Whether an input is the second frame of a file.
pub fn is_second_frame(input: &Path) -> bool {
    file_of(input) != input
}

/// Behind each file that holds a whole frame downwards beside the one upwards the name of that frame: `NAME--1_1.Z_mtrx (down)`.
pub fn with_second_frames(files: Vec<PathBuf>) -> Vec<PathBuf> {
    let both = files.into_iter().flat_map(|file| {
        let second = second_frame(&file);
        [Some(file), second].into_iter().flatten()
    });
    both.collect()
}

/// The name of the second frame of a file, if it is there and whole.
pub fn second_frame(file: &Path) -> Option<PathBuf> {
    let name = file.file_name()?.to_str()?;
    if is_curve(&frame_and_channel(name)?.1) {
        return None;
    }
    let source = Source::disk(file);
    let content = source.content().ok()?;
    read(
        &source,
        content.bytes(),
        Some(FrameDirection::Down),
        &|_| false,
    )
    .ok()?;
    Some(file.with_file_name(format!("{name}{DOWN}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_folder_one_file_of_each_frame() {
        let kept = |names: &[&str]| -> Vec<String> {
            let format = |path: &Path| match path.extension() {
                Some(other) if other == "spm" => Format::NanoScope,
                _ => Format::OmicronMatrix,
            };
            let files = names.iter().map(PathBuf::from);
            let kept = one_per_frame(files.map(|file| (file.clone(), format(&file))).collect());
            kept.iter().map(|f| f.display().to_string()).collect()
        };
        let names = [
            "a--1_1.I(V)_mtrx",
            "a--1_1.I_mtrx",
            "a--1_1.Z_mtrx",
            "a--1_2.Aux_mtrx",
            "a--1_2.I_mtrx",
            "b--1_1.Z_mtrx",
            "c--1_1.I.spm",
            "odd",
        ];
        let expected = [
            "a--1_1.Z_mtrx",
            "a--1_2.Aux_mtrx",
            "b--1_1.Z_mtrx",
            "c--1_1.I.spm",
            "odd",
        ];
        assert_eq!(kept(&names), expected);
        let (kept_files, others) = channels_of_one_frame(names.iter().map(PathBuf::from).collect());
        assert_eq!(kept_files.len(), 5);
        assert_eq!(
            others[1],
            ("a--1_1.Z_mtrx".into(), "a--1_1.I(V)_mtrx".into())
        );
        assert!(kept(&["a--1_1.I(V)_mtrx"]).is_empty());
    }
}
