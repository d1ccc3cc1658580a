//! The tests of the crate as one program: it links once. `watch_memory` counts allocations and is a program of its own.

#[path = "../scene/mod.rs"]
mod scene;
#[path = "../../../moiregauge-report/tests/common/schema.rs"]
mod schema;
#[path = "../small/mod.rs"]
mod small;

mod beside_others;
mod cancelled;
mod growing;
mod sink;
mod watch;
mod watch_files;
