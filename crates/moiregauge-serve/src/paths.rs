//! Names of files that come from a browser.

use std::path::PathBuf;

/// Folders within folders, at most.
const DEEPEST: usize = 32;
/// Bytes of a name, at most: what file systems take.
const LONGEST: usize = 255;
/// What is no file on Windows, with any extension.
const DEVICES: [&str; 6] = ["con", "prn", "aux", "nul", "conin$", "conout$"];

/// A path below a folder, parts divided by `/`; the reason where it could be anything else on any system.
///
/// Nothing is looked at on the disk: links are found by whoever opens the path.
pub(crate) fn below(text: &str) -> Result<PathBuf, String> {
    let mut path = PathBuf::new();
    if text.is_empty() {
        return Ok(path);
    }
    let parts: Vec<&str> = text.split('/').collect();
    if parts.len() > DEEPEST {
        return Err(format!("more than {DEEPEST} folders within each other"));
    }
    for part in parts {
        check(part)?;
        path.push(part);
    }
    Ok(path)
}

/// Refuses a part of a path that is no plain name.
fn check(part: &str) -> Result<(), String> {
    let refused = |why: &str| Err(format!("{part:?} {why}"));
    if part.is_empty() || part == "." || part == ".." {
        return refused("is not a name below the folder");
    }
    if part.len() > LONGEST {
        return Err(format!("a name is longer than {LONGEST} bytes"));
    }
    if part
        .chars()
        .any(|c| c.is_control() || "\\:<>\"|?*".contains(c))
    {
        return refused("has a character that is not allowed in file names on all systems");
    }
    if part.ends_with([' ', '.']) {
        return refused("ends with a blank or a dot");
    }
    let stem = part.split('.').next().unwrap_or(part).trim_end();
    let stem = stem.to_lowercase();
    let numbered = stem.strip_prefix("com").or(stem.strip_prefix("lpt"));
    let numbered = numbered.is_some_and(|n| n.chars().count() == 1 && n.chars().all(is_port));
    if numbered || DEVICES.contains(&stem.as_str()) {
        return refused("is the name of a device");
    }
    Ok(())
}

fn is_port(c: char) -> bool {
    c.is_ascii_digit() || "¹²³".contains(c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_names_lie_below() {
        for good in [
            "",
            "a.spm",
            "set 1/scän.001",
            "a/b/c/d.gwy",
            "..a",
            "console.txt",
            "com10",
            "compass.nid",
        ] {
            assert!(below(good).is_ok(), "{good}");
        }
        let long = "a".repeat(256);
        let deep = "a/".repeat(40) + "a";
        for bad in [
            "..",
            "a/../b",
            "../a",
            "/etc/passwd",
            "a//b",
            "./a",
            "a/",
            "C:/x",
            "a\\b",
            "\\\\?\\C:\\x",
            "\\\\host\\share",
            "CON",
            "con.spm",
            "a/NUL/b",
            "Com1",
            "lpt9.txt",
            "COM¹",
            "file:stream",
            "a\0b",
            "a\nb",
            "a.",
            "a ",
            "a|b",
            "a*",
            "nul .txt",
            &long,
            &deep,
        ] {
            assert!(below(bad).is_err(), "{bad}");
        }
    }
}
