//! A folder that fills while somebody measures: each new frame is analysed with those before it.
//!
//! [`Watch::look`] is one step: it lists the folder, takes the files that are whole, analyses, and returns a [`Line`] for
//! each thing that happened. Whoever drives it (a terminal, a page) waits between two steps and shows the lines. The
//! numbers are at every moment those of an analysis of the folder as it is: the order in which files came changes nothing.
//!
//! - Nothing is watched by events of the system, which miss changes on network shares: the folder is listed again and again.
//! - A file is known by its path, size and date; dates are compared with each other only, never with a clock.
//! - A file is taken when it was unchanged for a step and can be read as its header promises. One that cannot is waited
//!   for, then told once; it is tried again when it changes, and from time to time.
//! - A file that is written anew is another frame under the old name: the old one goes at once, the new one comes when it
//!   is whole. A file that is gone takes its frame with it: deleting a frame is how it is taken back.
//! - Nothing is locked or written in the folder, and subfolders are not searched, so that results may lie in them.

mod files;
mod line;
mod mean;
mod next;
mod request;
mod run;
mod tell;
mod until;
mod warnings;

pub use line::{Happened, Line, LineDrift, Point, line_schema};
pub use mean::{Mean, Number};
pub use next::Next;
pub use request::{WatchError, WatchRequest};
pub use run::Watch;
pub use until::{NotUntil, Until, UntilState};
pub use warnings::Warning;
