#![no_main]

spmfile_fuzz::reader!(spmfile::Format::Hdf5);
