//! Everything that is written: beside its place first, and moved there when it is whole.
//!
//! # A folder of results: [`FolderSink`]
//! 1. The folder is made and its working folder [`UNFINISHED`] in it, whose file `lock` is locked. That tells at once
//!    whether the folder can be written, and that no other run is writing into it. The lock is one of the operating
//!    system: it ends with its process, however that ends.
//! 2. Files are written into `UNFINISHED/new` and synced. Nothing else changes yet.
//! 3. `UNFINISHED/intent.json` is written: what the folder will hold, and what of an earlier run is replaced or removed,
//!    each file with its hash.
//! 4. Stale files are removed, new ones renamed to their places, and [`MANIFEST`] last. Then the working folder goes.
//!
//! A run that ends before step 3 leaves the old results whole, and the next run sweeps up after it. One that ends in
//! step 4 is completed by the next run, whatever that run does: all that it needs is in the intent and in `new`.
//!
//! [`MANIFEST`] lists every file with its hash. Only files of that list that still have their hash are ever replaced or
//! removed, and only with `force`: files of others stay, and one that was changed is named and the run refused.
//! Results of another kind (a map where an analysis is) are refused, with `force`, too. Folders of versions that wrote no
//! manifest are known by their documents; with `force` files of the very names that are written are replaced in them, and
//! no others.
//!
//! Parts of a long run that is interrupted can be kept in the working folder ([`FolderSink::keep`]), each with its hash.
//!
//! # Single files: [`FileSink`]
//! Files are written into a working folder of their own beside their places and renamed; working folders of runs that
//! were killed are swept up. Nothing is written over without `force`, and inputs of the run never are.
//!
//! # Memory and archives: [`MemorySink`], [`ZipSink`]
//! The same files and the same list, for front ends without a folder. [`Sink`] is what all three have in common.
//!
//! Nothing here holds the time of day: the same results make the same manifest.

mod build;
mod error;
mod file;
mod folder;
mod keep;
mod manifest;
mod memory;
mod work;

pub use build::{build, calculated_by};
pub use error::SinkError;
pub use file::{FileSink, OneFile};
pub use folder::{FolderSink, Part, Target};
pub use keep::{Forget, Keep};
pub use manifest::{Entry, MANIFEST, Manifest};
pub use memory::{MemorySink, Sink, ZipSink, archive};
pub use work::UNFINISHED;
