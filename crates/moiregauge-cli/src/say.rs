//! Words to standard output, where the reader may have gone away (`moiregauge … | head`).

use std::io::{ErrorKind, Write as _};

/// Prints the text; a closed pipe is no error, anything else is.
pub(crate) fn say(text: &str) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}
