//! Locks that a panic does not break.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// A lock; what a thread that panicked left is whole, since nothing is changed in steps.
pub(crate) fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}
