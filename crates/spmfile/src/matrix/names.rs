//! Names of files: of channels, and of the log that belongs to them.

/// The name of a file of a channel, in parts.
pub(super) struct Name<'a> {
    /// What comes before the last `--`.
    pub(super) session: &'a str,
    /// `1_2` of the first run and its second frame.
    pub(super) frame: &'a str,
    /// As in `Z`, or `I(V)` of a curve.
    pub(super) channel: &'a str,
}

/// `session--1_2.Z_mtrx`; the first version of the program wrote `session--1_2_Z.mtrx`.
pub(super) fn parse(file_name: &str) -> Option<Name<'_>> {
    let (session, rest) = file_name.rsplit_once("--")?;
    let end = rest.len().checked_sub("_mtrx".len())?;
    let (rest, extension) = rest.split_at_checked(end)?;
    let mtrx = extension
        .strip_prefix(['_', '.'])
        .is_some_and(|word| word.eq_ignore_ascii_case("mtrx"));
    let (run, more) = rest.split_once('_')?;
    let (cycle, channel) = more.split_once(['.', '_'])?;
    let number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let whole = mtrx && number(run) && number(cycle) && !channel.is_empty();
    whole.then(|| Name {
        session,
        frame: &rest[..run.len() + 1 + cycle.len()],
        channel,
    })
}

/// The name of a part of the log that belongs to the file of a channel, counted from 1; `None` if the
/// name is not one of such files.
///
/// ```
/// # use spmfile::matrix::log_file;
/// assert_eq!(log_file("a_STM--3_1.Z_mtrx", 1).as_deref(), Some("a_STM_0001.mtrx"));
/// assert_eq!(log_file("a_STM_0001.mtrx", 1), None);
/// ```
pub fn log_file(file_name: &str, part: u32) -> Option<String> {
    Some(format!("{}_{part:04}.mtrx", parse(file_name)?.session))
}

/// Session and number of the frame of a file of a channel, the same for all channels of the frame, and
/// the name of the channel; `None` if the name is not one of such files.
pub fn frame_and_channel(file_name: &str) -> Option<(String, String)> {
    let name = parse(file_name)?;
    Some((
        format!("{}--{}", name.session, name.frame),
        name.channel.to_owned(),
    ))
}

/// Whether a channel's name is one of curves, as in `I(V)`.
pub fn is_curve(channel: &str) -> bool {
    channel.contains('(')
}
