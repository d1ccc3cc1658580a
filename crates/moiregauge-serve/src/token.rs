//! Secrets: the token of the address, and what a cookie holds.

use std::fmt::Write as _;
use std::path::Path;

use sha2::{Digest as _, Sha256};

use crate::error::ServeError;

/// Characters of a token in a file, at least: 128 bits as hexadecimal digits.
const SHORTEST: usize = 32;

/// A secret that is compared and never printed by accident.
pub(crate) struct Secret {
    text: String,
    hash: [u8; 32],
}

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Secret")
    }
}

impl Secret {
    /// 128 random bits, as hexadecimal digits.
    pub(crate) fn random() -> Result<Self, ServeError> {
        let mut bytes = [0_u8; 16];
        getrandom::fill(&mut bytes).map_err(|e| ServeError::System(std::io::Error::other(e)))?;
        let mut text = String::new();
        for byte in bytes {
            // Writing into a string cannot fail.
            let _ = write!(text, "{byte:02x}");
        }
        Ok(Self::of(text))
    }

    /// The first line of a file that nobody else can read.
    pub(crate) fn of_file(file: &Path) -> Result<Self, ServeError> {
        let refused = |reason: String| ServeError::Token {
            file: file.to_owned(),
            reason,
        };
        let metadata = std::fs::metadata(file).map_err(|e| refused(e.to_string()))?;
        if others_can_read(&metadata) {
            return Err(refused(
                "expected a file that only its owner can read (chmod 600), others can".to_owned(),
            ));
        }
        let text = moiregauge_pipeline::read_text(file).map_err(|e| refused(e.to_string()))?;
        let text = text.lines().next().unwrap_or_default().trim();
        let plain = text.bytes().all(|b| b.is_ascii_alphanumeric());
        if text.len() < SHORTEST || !plain {
            return Err(refused(format!(
                "expected {SHORTEST} letters and digits or more in the first line, found {} characters{}",
                text.chars().count(),
                if plain { "" } else { ", others among them" }
            )));
        }
        Ok(Self::of(text.to_owned()))
    }

    fn of(text: String) -> Self {
        Self {
            hash: Sha256::digest(&text).into(),
            text,
        }
    }

    /// The secret itself, for the address on the screen and the cookie.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// Whether this is it. Hashes are compared, all of their bytes: how long that takes tells nothing of the secret.
    pub(crate) fn is(&self, other: &str) -> bool {
        let other = Sha256::digest(other);
        let differing = self.hash.iter().zip(other).fold(0, |d, (a, b)| d | (a ^ b));
        std::hint::black_box(differing) == 0
    }
}

#[cfg(unix)]
fn others_can_read(metadata: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::PermissionsExt as _;
    metadata.permissions().mode() & 0o077 != 0
}

#[cfg(not(unix))]
fn others_can_read(_: &std::fs::Metadata) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn secrets_are_long_and_told_apart() {
        let (one, two) = (Secret::random().unwrap(), Secret::random().unwrap());
        assert_eq!(one.text().len(), 32);
        assert!(one.is(one.text()) && !one.is(two.text()) && !one.is(""));
        assert!(!one.is(&one.text()[..31]) && !one.is(&format!("{}0", one.text())));
        assert_eq!(format!("{one:?}"), "Secret");
    }

    #[cfg(unix)]
    #[test]
    fn files_with_tokens_are_private_and_long() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("token");
        let read = |text: &str, mode: u32| {
            std::fs::write(&file, text).unwrap();
            std::fs::set_permissions(&file, std::fs::Permissions::from_mode(mode)).unwrap();
            Secret::of_file(&file).map_err(|e| e.to_string())
        };
        let long = "0123456789abcdef0123456789abcdef\n";
        assert!(read(long, 0o600).unwrap().is(long.trim()));
        assert!(read(long, 0o644).unwrap_err().contains("chmod 600"));
        assert!(
            read("short\n", 0o600)
                .unwrap_err()
                .contains("found 5 characters")
        );
        assert!(read(&long.replace('0', "?"), 0o600).is_err());
    }
}
