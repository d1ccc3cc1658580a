//! Why there is no server.

use std::net::SocketAddr;
use std::path::PathBuf;

/// Why there is no server.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// Others than this computer could connect.
    #[error(
        "other computers can reach {0}: expected an address of this computer alone (127.0.0.1, ::1), or a file with a \
         token"
    )]
    NotAlone(std::net::IpAddr),
    /// The file with the token.
    #[error("the token in {}: {reason}", file.display())]
    Token {
        /// Its name.
        file: PathBuf,
        /// What was expected and what was found.
        reason: String,
    },
    /// A folder that was named.
    #[error("{}: expected a folder, {reason}", folder.display())]
    Folder {
        /// Its name.
        folder: PathBuf,
        /// What was found.
        reason: String,
    },
    /// The folder of works.
    #[error("{}: another running server keeps its works there", .0.display())]
    InUse(PathBuf),
    /// The address cannot be had.
    #[error("cannot listen at {address}: {source}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// Why not.
        source: std::io::Error,
    },
    /// The system gives no threads, random numbers or temporary folder.
    #[error("cannot start: {0}")]
    System(std::io::Error),
}
