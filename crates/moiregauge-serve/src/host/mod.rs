//! What the computer gives: threads, time, places of files. A browser gives one thread, and files in memory.

#[cfg(target_family = "wasm")]
mod browser;
#[cfg(target_family = "wasm")]
mod lines;
#[cfg(not(target_family = "wasm"))]
mod stream;
#[cfg(not(target_family = "wasm"))]
mod system;

#[cfg(target_family = "wasm")]
pub(crate) use browser::*;
#[cfg(not(target_family = "wasm"))]
pub(crate) use system::*;

#[cfg(target_family = "wasm")]
pub(crate) use lines::Hub;
#[cfg(not(target_family = "wasm"))]
pub(crate) use stream::Hub;
