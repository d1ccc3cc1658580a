#![no_main]

spmfile_fuzz::reader!(spmfile::Format::Iso28632);
