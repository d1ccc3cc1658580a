//! What every long call takes: threads of its own, a way to stop it, somebody to tell.

mod cancel;
mod events;
mod pool;
mod threads;

pub use cancel::{Cancel, Cancelled};
pub use events::{Event, Events, Quiet};
pub use pool::{Job, JobError, Stage};
