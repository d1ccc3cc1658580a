//! The tests of the crate as one program: it links once.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/schema.rs"]
mod schema;

mod labels;
mod pictures;
mod results;
