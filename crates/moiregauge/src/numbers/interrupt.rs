//! One way out of a long calculation that nobody wants any more.
//!
//! Who starts a calculation lets its threads [`watch`] a flag; the calculation looks at the flag between pieces of work
//! ([`check`]) and unwinds with [`Interrupted`] when it is set. No function in between has to know of it, and a
//! calculation whose threads watch nothing is never interrupted. The unwinding calls no panic hook and prints nothing.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

thread_local! {
    static WATCHED: RefCell<Option<Arc<AtomicBool>>> = const { RefCell::new(None) };
}

/// What a calculation that was interrupted unwinds with; for [`std::panic::catch_unwind`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupted;

/// Lets this thread watch a flag, or none; returns the one that it watched before.
pub fn watch(flag: Option<Arc<AtomicBool>>) -> Option<Arc<AtomicBool>> {
    WATCHED.with(|watched| watched.replace(flag))
}

/// Whether the flag that this thread watches is set.
pub fn is_interrupted() -> bool {
    WATCHED.with_borrow(|flag| flag.as_ref().is_some_and(|f| f.load(Ordering::Relaxed)))
}

/// Ends the calculation if the flag that this thread watches is set. Called at least every 0.3 s of work.
///
/// It leads out of all functions up to the one that started the calculation, by unwinding with [`Interrupted`].
pub fn check() {
    if is_interrupted() {
        std::panic::resume_unwind(Box::new(Interrupted));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_watches_a_set_flag_unwinds() {
        check();
        let flag = Arc::new(AtomicBool::new(false));
        assert!(watch(Some(flag.clone())).is_none());
        check();
        flag.store(true, Ordering::Relaxed);
        let ended = std::panic::catch_unwind(check).unwrap_err();
        assert!(ended.is::<Interrupted>());
        assert!(watch(None).is_some());
        check();
    }
}
