//! One set of scans of one sample, size and rate: drift, mean lattice, every scan before and after correction.

pub(crate) mod about;
pub(crate) mod analyse;
pub(crate) mod assumed;
pub(crate) mod bare;
pub(crate) mod common;
pub(crate) mod drift;
pub(crate) mod ground;
pub(crate) mod headers;
pub(crate) mod joint;
pub(crate) mod mean;
pub(crate) mod moire;
pub(crate) mod published;
pub(crate) mod ruler;
pub(crate) mod scan;
pub(crate) mod solved;
