//! A scan → the bytes of a file.

use super::read::KEYS;
use crate::export::{ExportError, base_values, from_the_top};
use crate::fields;
use crate::labels;
use crate::scan::{Channel, Scan};

/// The bytes of a `.gsf` file with one channel of `scan`.
///
/// Values are in SI base units and single precision; the rest of the scan's header and the lines of
/// `log` (what was done with the data) are kept as further keys.
///
/// # Errors
/// The samples do not fill the lines of the channel.
pub fn write(scan: &Scan, channel: &Channel, log: &[String]) -> Result<Vec<u8>, ExportError> {
    write_between(scan, channel, log, &|| ())
}

/// The same; `between` is called before each line.
pub(crate) fn write_between(
    scan: &Scan,
    channel: &Channel,
    log: &[String],
    between: &dyn Fn(),
) -> Result<Vec<u8>, ExportError> {
    let (values, unit) = base_values(channel)?;
    let mut header = "Gwyddion Simple Field 1.0\n".to_owned();
    let mut put = |key: &str, value: &str| fields::put(&mut header, key, value);
    put("XRes", &channel.columns.to_string());
    put("YRes", &channel.rows.to_string());
    if let Some([width, height]) = channel.edges_nm() {
        let metres = |nm: f64| format!("{:e}", nm / 1e9);
        put("XReal", &metres(width));
        put("YReal", &metres(height));
        put("XOffset", &metres(scan.offset_nm[0] - 0.5 * width));
        put("YOffset", &metres(scan.offset_nm[1] - 0.5 * height));
        put("XYUnits", "m");
    }
    put("ZUnits", &unit);
    put("Title", &channel.name);
    let lines = [labels::describe(scan), labels::describe_channel(channel)].concat();
    // Keys of the format in the header of another one would contradict those above.
    let others = scan.metadata.iter().filter(|(key, _)| {
        let stem = key.trim_end_matches(|c: char| c.is_ascii_digit());
        !KEYS.contains(&stem)
    });
    for (key, value) in lines.iter().chain(others) {
        put(key, value);
    }
    for (step, text) in log.iter().enumerate() {
        put(&format!("log {}", step + 1), text);
    }
    let mut bytes = header.into_bytes();
    bytes.resize((bytes.len() / 4 + 1) * 4, 0);
    for line in from_the_top(&values, channel, between) {
        bytes.extend(line.iter().flat_map(|&value| (value as f32).to_le_bytes()));
    }
    Ok(bytes)
}
