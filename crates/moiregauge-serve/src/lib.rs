//! The page of moiregauge: a local server over the same calls as the program.
//!
//! HTTP in, documents and images out; what is calculated stands in `moiregauge-pipeline` and below. The page itself is
//! the folder `page`, compiled in.
//!
//! # Who may ask
//! Everything that a page of somebody else, a program of another user or a wrong address could try is refused in layers:
//! the name of the host (`guard`), the origin of the page, a token that only the terminal knows (`token`), limits on
//! bodies, connections and times (`body`, `connection`), and paths that stay below the folders named at the start
//! (`roots`).

mod api;
mod app;
mod body;
mod connection;
mod error;
mod events;
mod feed;
mod guard;
mod lock;
mod options;
mod page;
mod paths;
mod problem;
mod roots;
mod run;
mod token;
mod work;

pub use error::ServeError;
pub use feed::Feed;
pub use options::{Options, Words};
pub use run::serve;
