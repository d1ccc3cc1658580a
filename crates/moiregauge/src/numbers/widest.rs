//! Loops for the widest vectors of a processor.

/// Runs a loop that is compiled for the widest vectors that this machine has. Products and sums stay separate
/// and in their order, so that all machines give the same bits.
#[inline]
pub fn widest<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
