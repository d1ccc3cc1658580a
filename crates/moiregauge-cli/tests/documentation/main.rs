//! The documentation: what it says of the program is there, what the program has is in it, and its examples run.

mod links;
mod pages;
mod transcripts;
mod words;
