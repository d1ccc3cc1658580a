//! The documentation: everything it names exists, everything that exists is named, and its examples run.

mod links;
mod pages;
mod transcripts;
mod words;
