//! The text headers of Gwyddion's simple formats: a magic line, lines `Key = value`, NULs up to
//! the next multiple of a width, binary samples.

use crate::words::{self, Unread, one_line};

/// Keys and values of the header and the byte at which the samples begin.
///
/// The header ends with one to `padding` NULs, so that the samples begin at a multiple of `padding`.
pub(crate) type Header = (Vec<(String, String)>, usize);

/// Reads the header behind its first line.
pub(crate) fn header(bytes: &[u8], padding: usize) -> Result<Header, String> {
    let end = bytes
        .iter()
        .position(|&b| b == 0)
        .ok_or("expected a NUL behind the header, found none: the file was cut off inside it")?;
    let start = (end / padding + 1) * padding;
    let text = words::decode(&bytes[..end]);
    let fields = text
        .lines()
        .skip(1)
        .filter_map(|line| line.split_once('='))
        .map(|(key, value)| (key.trim().to_owned(), value.trim().to_owned()))
        .collect();
    let filled = bytes.get(end..start).unwrap_or(&bytes[end..]);
    if filled.iter().any(|&b| b != 0) {
        return Err(format!(
            "expected NULs from byte {end} to {start}, found other bytes"
        ));
    }
    Ok((fields, start))
}

/// Adds a line; the key keeps to its side of the `=`.
pub(crate) fn put(header: &mut String, key: &str, value: &str) {
    header.push_str(&one_line(key).replace('=', " "));
    header.push_str(" = ");
    header.push_str(&one_line(value));
    header.push('\n');
}

/// The value of a key.
pub(crate) fn get<'a>(fields: &'a [(String, String)], key: &str) -> Option<&'a str> {
    let (_, value) = fields.iter().find(|(k, _)| k == key)?;
    Some(value)
}

/// A finite number.
pub(crate) fn number(fields: &[(String, String)], key: &str, unread: &Unread) -> Option<f64> {
    unread.number(key, get(fields, key))
}

/// A count above 0.
pub(crate) fn count(fields: &[(String, String)], key: &str) -> Result<usize, String> {
    let text = get(fields, key).unwrap_or("");
    match text.parse() {
        Ok(n) if n > 0 => Ok(n),
        _ => Err(format!("expected a number {key} above 0, found {text:?}")),
    }
}

/// The fields that none of `keys` names, as metadata.
pub(crate) fn others(fields: Vec<(String, String)>, keys: &[&str]) -> Vec<(String, String)> {
    fields
        .into_iter()
        .filter(|(key, _)| {
            let stem = key.trim_end_matches(|c: char| c.is_ascii_digit());
            !keys.contains(&key.as_str()) && !keys.contains(&stem)
        })
        .collect()
}
