//! The program from outside: what a user types, what comes out, what it says when it cannot.

mod acceptance;
mod by_hand;
mod calibration;
mod campaigns;
mod common;
mod explained;
mod figures;
mod formats;
mod hard;
mod identity;
mod inputs;
mod interrupted;
mod layers;
mod maps;
mod names;
mod odd_files;
mod options;
mod outputs;
mod published;
mod real_images;
mod refusals;
mod repeats;
mod results;
mod round_trip;
mod same_bytes;
mod scanner;
#[path = "../../../moiregauge-report/tests/common/schema.rs"]
mod schema;
mod senses;
mod serving;
mod sessions;
mod several;
mod several_images;
mod stopped;
mod stripes;
mod surveys;
mod validation;
mod watching;
/// Made-up sessions of Omicron Matrix, as the tests of the reader have them.
#[path = "../../../spmfile/src/matrix/read/tests/writer.rs"]
mod writer;
