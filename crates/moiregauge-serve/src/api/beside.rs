//! Work beside the threads that answer.

use crate::problem::{Answer, Problem};

/// Work that reads files or calculates, beside the threads that answer.
pub(crate) async fn beside<T: Send + 'static>(
    work: impl FnOnce() -> Answer<T> + Send + 'static,
) -> Answer<T> {
    let done = tokio::task::spawn_blocking(work).await;
    done.unwrap_or_else(|_| Err(Problem::fault("a fault of moiregauge, please report it")))
}
