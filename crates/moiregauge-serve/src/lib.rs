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
//!
//! # In a browser
//! Compiled to WebAssembly the same routes answer in memory (`Alone`), for a page on the same computer that holds program
//! and files itself: there is no address that others could ask, so the layers above are left out (`door`, `host`).
#![cfg_attr(
    target_family = "wasm",
    expect(dead_code, reason = "how a server ends, and what it hears of others")
)]

#[cfg(target_family = "wasm")]
mod alone;
mod api;
mod app;
mod body;
#[cfg(not(target_family = "wasm"))]
mod connection;
#[cfg(not(target_family = "wasm"))]
mod door;
mod error;
mod feed;
#[cfg(not(target_family = "wasm"))]
mod guard;
mod host;
mod lock;
mod options;
#[cfg(not(target_family = "wasm"))]
mod page;
mod paths;
mod problem;
mod roots;
#[cfg(not(target_family = "wasm"))]
mod run;
#[cfg(not(target_family = "wasm"))]
mod token;
mod typed;
mod work;

#[cfg(target_family = "wasm")]
pub use alone::Alone;
pub use error::ServeError;
pub use feed::Feed;
pub use options::Options;
#[cfg(not(target_family = "wasm"))]
pub use run::serve;
pub use typed::{map_as_options, user_specified_as_options};
