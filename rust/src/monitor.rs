//! Progress out of a kernel, cancellation into it.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// One step of long work.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// What is being done, for a person.
    pub stage: String,
    /// Share of the whole that is done, 0 to 1.
    pub fraction: f64,
}

/// What a kernel needs of its caller while it runs: a place to report to and a flag to obey.
pub struct Monitor<'a> {
    cancel: &'a AtomicBool,
    report: &'a (dyn Fn(Progress) + Sync),
}

static NEVER: AtomicBool = AtomicBool::new(false);

impl<'a> Monitor<'a> {
    /// A monitor that reads `cancel` and reports to `report`.
    pub fn new(cancel: &'a AtomicBool, report: &'a (dyn Fn(Progress) + Sync)) -> Self {
        Self { cancel, report }
    }

    /// A monitor that hears nothing and never cancels.
    pub fn silent() -> Monitor<'static> {
        Monitor { cancel: &NEVER, report: &|_| () }
    }

    /// An error if the caller wants the work to stop. Costs a relaxed load: call it per row or site.
    pub fn check(&self) -> Result<()> {
        if self.cancel.load(Ordering::Relaxed) { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// Tells the caller how far the work is.
    pub fn report(&self, stage: impl Into<String>, fraction: f64) {
        (self.report)(Progress { stage: stage.into(), fraction });
    }
}
