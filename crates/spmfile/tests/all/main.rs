//! The tests of the crate as one program: it links once. `memory` counts allocations and is a program of its own.

#[path = "../common/mod.rs"]
mod common;
#[path = "../mutation/mod.rs"]
mod mutation;

mod conformance;
mod damaged;
mod exports;
mod formats;
mod instruments;
mod kinds;
mod mutations;
mod oddities;
mod opened;
mod reports;
mod round_trip;
mod whole_headers;
mod written_arrays;
