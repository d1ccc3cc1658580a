//! The text header: sections of `\key: value` lines between `\*Section` lines.
//!
//! In: the bytes of the file. Out: borrowed names and values, nothing interpreted. Keys are
//! compared without case, because `Scan size` became `Scan Size` between versions.

use std::borrow::Cow;
use std::collections::HashMap;

use memchr::memmem;

use crate::words::{self, one_line};

/// Real headers have 20 to 100 kB; beyond this no header is looked for.
const LONGEST: usize = 4 << 20;
const END: &[u8] = b"\\*File list end";

/// The header's bytes and whether its line ends are CRLF.
pub(super) struct HeaderText<'a> {
    pub(super) text: Cow<'a, str>,
    /// Length in the file, in bytes.
    pub(super) length: usize,
    pub(super) crlf: bool,
}

/// One `\*Name` section.
pub(super) struct Section<'a> {
    pub(super) name: &'a str,
    entries: Vec<(&'a str, &'a str)>,
}

/// The header as text, or `None` where it has no end.
pub(super) fn header_text(bytes: &[u8]) -> Option<HeaderText<'_>> {
    let head = &bytes[..bytes.len().min(LONGEST)];
    let length = memmem::find(head, END)?;
    let raw = &head[..length];
    Some(HeaderText {
        text: words::decode(raw),
        length: length + END.len(),
        crlf: memmem::find(raw, b"\r\n").is_some(),
    })
}

/// Splits a header into its sections, in file order.
pub(super) fn sections(text: &str) -> Vec<Section<'_>> {
    let mut sections: Vec<Section<'_>> = Vec::new();
    for line in text.lines() {
        // Notes may run over several lines: those do not begin with a backslash.
        let Some(line) = line.strip_prefix('\\') else {
            continue;
        };
        if let Some(name) = line.strip_prefix('*') {
            sections.push(Section {
                name: name.trim(),
                entries: Vec::new(),
            });
        } else if let (Some(section), Some(entry)) = (sections.last_mut(), split_entry(line)) {
            section.entries.push(entry);
        }
    }
    sections
}

/// `key: value`; in `@2:Z scale: …` the first colon belongs to the key.
fn split_entry(line: &str) -> Option<(&str, &str)> {
    let group = match line.as_bytes() {
        [b'@', digit, b':', ..] if digit.is_ascii_digit() => 3,
        _ => 0,
    };
    let colon = group + line[group..].find(':')?;
    Some((line[..colon].trim(), line[colon + 1..].trim()))
}

impl<'a> Section<'a> {
    /// Whether the section is called `name`.
    pub(super) fn is(&self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name)
    }

    /// The value of `key`.
    pub(super) fn get(&self, key: &str) -> Option<&'a str> {
        self.entries
            .iter()
            .find(|(k, _)| k.eq_ignore_ascii_case(key))
            .map(|&(_, value)| value)
    }

    /// The values of `@N:key` for any digit N.
    pub(super) fn grouped<'s>(&'s self, key: &'s str) -> impl Iterator<Item = &'a str> + 's {
        self.entries.iter().filter_map(move |&(k, value)| {
            let [b'@', digit, b':', rest @ ..] = k.as_bytes() else {
                return None;
            };
            let same = digit.is_ascii_digit() && rest.eq_ignore_ascii_case(key.as_bytes());
            same.then_some(value)
        })
    }

    /// How often `key` occurs.
    pub(super) fn count(&self, key: &str) -> usize {
        let same = |(k, _): &&(&str, &str)| k.eq_ignore_ascii_case(key);
        self.entries.iter().filter(same).count()
    }
}

/// Every line of a header as a name and a value, so that formats which keep names and values lose nothing.
///
/// A name is that of the section, a colon and the key; it occurs once: a second section or key of the same name has
/// ` (2)` behind it. Further lines of a note are entries of their own, and so is a section without any.
pub(super) fn all_lines(text: &str) -> Vec<(String, String)> {
    let mut lines = Vec::new();
    let mut names = Names::default();
    let (mut section, mut key) = (String::new(), String::new());
    let (mut below, mut continued) = (0, 1);
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let (name, value) = if let Some(name) = line.strip_prefix("\\*") {
            if below == 0 && !section.is_empty() {
                lines.push((std::mem::take(&mut section), String::new()));
            }
            section = names.unique(name.trim());
            (key, below, continued) = (String::new(), 0, 1);
            continue;
        } else if let Some(line) = line.strip_prefix('\\') {
            let (name, value) = split_entry(line).unwrap_or((line.trim(), ""));
            (key, continued) = (name.to_owned(), 1);
            (format!("{section}: {name}"), value)
        } else {
            continued += 1;
            (format!("{section}: {key}, line {continued}"), line.trim())
        };
        below += 1;
        lines.push((names.unique(&name), value.to_owned()));
    }
    if below == 0 && !section.is_empty() {
        lines.push((section, String::new()));
    }
    lines
}

/// Names that were given away, with how often.
#[derive(Default)]
struct Names(HashMap<String, usize>);

impl Names {
    /// The name, with a number behind it where it is taken. Formats with lines `key = value` need an `=` for
    /// themselves.
    fn unique(&mut self, name: &str) -> String {
        let name = one_line(name).replace('=', " ");
        let mut free = name.clone();
        while self.0.contains_key(&free) {
            let count = self.0.entry(name.clone()).or_insert(1);
            *count += 1;
            free = format!("{name} ({count})");
        }
        self.0.insert(free.clone(), 1);
        free
    }
}

/// The value of `key` in the first section called `section` that has it.
pub(super) fn lookup<'a>(sections: &[Section<'a>], section: &str, key: &str) -> Option<&'a str> {
    sections
        .iter()
        .filter(|s| s.is(section))
        .find_map(|s| s.get(key))
}

/// The number at the start of a value, and the text after it.
pub(super) fn leading_number(value: &str) -> Option<(f64, &str)> {
    let value = value.trim_start();
    let end = value.find(char::is_whitespace).unwrap_or(value.len());
    let number: f64 = value[..end].parse().ok()?;
    number.is_finite().then(|| (number, value[end..].trim()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_values_and_groups() {
        let text = "\\*File list\r\n\\Version: 0x09700105\r\n\\Note: first\r\nsecond line\r\n\\*Ciao image list\r\n\\@2:Z scale: V [Sens. A] (1 V/LSB) 2 V\r\n\\Capture mode : Single\r\n";
        let sections = sections(text);
        assert_eq!(sections.len(), 2);
        assert_eq!(
            lookup(&sections, "file LIST", "version"),
            Some("0x09700105")
        );
        assert_eq!(
            sections[1].grouped("z Scale").next(),
            Some("V [Sens. A] (1 V/LSB) 2 V")
        );
        assert_eq!(sections[1].get("capture mode"), Some("Single"));
    }

    #[test]
    fn every_line_has_a_name_of_its_own() {
        let text = "\\*File list\r\n\\Note: first\r\nsecond\r\n\r\nthird\r\n\\*Empty list\r\n\\*Ciao image list\r\n\
                    \\@2:Z scale: V 2\r\n\\a=b: 1\r\n\\Odd\r\n\\*Ciao image list\r\n\\Odd\r\n\\Odd\r\n\\*Last\r\n";
        let expected = [
            ("File list: Note", "first"),
            ("File list: Note, line 2", "second"),
            ("File list: Note, line 3", "third"),
            ("Empty list", ""),
            ("Ciao image list: @2:Z scale", "V 2"),
            ("Ciao image list: a b", "1"),
            ("Ciao image list: Odd", ""),
            ("Ciao image list (2): Odd", ""),
            ("Ciao image list (2): Odd (2)", ""),
            ("Last", ""),
        ]
        .map(|(key, value)| (key.to_owned(), value.to_owned()));
        assert_eq!(all_lines(text), expected);
    }

    #[test]
    fn windows_1252_is_decoded() {
        let bytes = b"\\*File list\r\n\\A: 5 \xba\r\n\\*File list end";
        let header = header_text(bytes).expect("has an end");
        assert!(header.text.contains("5 º"));
        assert!(header.crlf);
        assert_eq!(header.length, bytes.len());
    }

    #[test]
    fn numbers_must_be_finite() {
        assert_eq!(leading_number(" 1.5 nm"), Some((1.5, "nm")));
        assert_eq!(leading_number("inf nm"), None);
        assert_eq!(leading_number("nm"), None);
    }
}
