//! The threads that a run has.

use rayon::{ThreadPool, ThreadPoolBuilder};

/// A pool of so many threads, or of as many as there are processors, and how many they are. Results do not depend on it.
///
/// # Errors
/// What the system says where it has not got them.
pub(crate) fn pool(threads: Option<usize>) -> Result<(ThreadPool, usize), String> {
    let threads = threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, |n| n.get()));
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    Ok((pool.map_err(|e| format!("{threads} threads cannot be started: {e}"))?, threads))
}
