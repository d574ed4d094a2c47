//! Long work with Ctrl-C and a progress callback.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::error::Result;
use crate::monitor::{Monitor, Progress};
use crate::threads::with_threads;

/// How often the main thread looks for a signal: a person does not notice 50 ms.
const POLL: Duration = Duration::from_millis(50);

/// Runs `work` on its own thread while this one answers signals and forwards progress.
///
/// Python delivers Ctrl-C only to its main thread, which therefore must not do the work itself.
/// `progress(stage, fraction)` is called on the calling thread; an exception in it cancels the work.
pub(super) fn run<T: Send>(
    py: Python<'_>,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Monitor<'_>) -> Result<T> + Send,
) -> PyResult<T> {
    let cancel = AtomicBool::new(false);
    let progress: Option<Py<PyAny>> = progress.map(|p| p.clone().unbind());
    py.detach(|| {
        std::thread::scope(|scope| {
            let (sender, receiver) = mpsc::channel::<Progress>();
            let cancel = &cancel;
            let worker = scope.spawn(move || {
                let report = move |p| drop(sender.send(p));
                with_threads(threads, || work(&Monitor::new(cancel, &report)))?
            });
            let mut stopped: Option<PyErr> = None;
            loop {
                let event = receiver.recv_timeout(POLL);
                if event == Err(mpsc::RecvTimeoutError::Disconnected) {
                    break;
                }
                if stopped.is_some() {
                    continue;
                }
                let answer = Python::attach(|py| {
                    py.check_signals()?;
                    if let (Ok(event), Some(progress)) = (event, &progress) {
                        progress.call1(py, (event.stage, event.fraction))?;
                    }
                    Ok(())
                });
                if let Err(error) = answer {
                    cancel.store(true, Ordering::Relaxed);
                    stopped = Some(error);
                }
            }
            let result = worker.join().map_err(|_| {
                PyRuntimeError::new_err("internal error in a kernel; please report it")
            })?;
            match stopped {
                Some(error) => Err(error),
                None => Ok(result?),
            }
        })
    })
}
