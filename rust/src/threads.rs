//! Thread pools of a wanted size.

use crate::error::{Error, Result};

/// Runs `work` on a pool of `threads` threads; 0 takes the process-wide pool (one thread a core).
pub fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> Result<T> {
    if threads == 0 {
        return Ok(work());
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|_| Error::Threads(threads))?;
    Ok(pool.install(work))
}
