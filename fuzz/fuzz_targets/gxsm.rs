#![no_main]

spmfile_fuzz::reader!(spmfile::Format::Gxsm);
