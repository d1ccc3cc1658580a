//! The threads of a job: a pool of its own, or the only one that there is.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use moiregauge::numbers::interrupt;
use rayon::ThreadPoolBuildError;

#[cfg(not(target_family = "wasm"))]
mod system {
    use rayon::{ThreadPool, ThreadPoolBuilder};

    use super::{Arc, AtomicBool, ThreadPoolBuildError, interrupt};

    /// Room on the stack of each thread, bytes: that of the first thread of a program.
    const STACK: usize = 8 << 20;

    /// A pool.
    #[derive(Clone)]
    pub(in crate::job) struct Threads(Arc<ThreadPool>);

    impl Threads {
        /// Number of threads that watch a flag; `None`: as many as there are processors.
        pub(in crate::job) fn new(
            threads: Option<usize>,
            flag: Arc<AtomicBool>,
        ) -> Result<Self, ThreadPoolBuildError> {
            let pool = ThreadPoolBuilder::new()
                .num_threads(threads.unwrap_or(0))
                .stack_size(STACK)
                .start_handler(move |_| {
                    interrupt::watch(Some(flag.clone()));
                })
                .build();
            Ok(Self(Arc::new(pool?)))
        }

        pub(in crate::job) fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
            self.0.install(work)
        }

        pub(in crate::job) fn count(&self) -> usize {
            self.0.current_num_threads()
        }
    }
}

#[cfg(target_family = "wasm")]
mod browser {
    use super::{Arc, AtomicBool, ThreadPoolBuildError, interrupt};

    /// The thread that asks.
    #[derive(Clone)]
    pub(in crate::job) struct Threads(Arc<AtomicBool>);

    impl Threads {
        /// The only one.
        pub(in crate::job) fn new(
            _: Option<usize>,
            flag: Arc<AtomicBool>,
        ) -> Result<Self, ThreadPoolBuildError> {
            Ok(Self(flag))
        }

        pub(in crate::job) fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
            let before = interrupt::watch(Some(Arc::clone(&self.0)));
            let done = work();
            interrupt::watch(before);
            done
        }

        pub(in crate::job) fn count(&self) -> usize {
            1
        }
    }
}

#[cfg(target_family = "wasm")]
pub(super) use browser::Threads;
#[cfg(not(target_family = "wasm"))]
pub(super) use system::Threads;
