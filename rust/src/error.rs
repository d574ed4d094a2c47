//! The one error type of the crate.

/// Why a kernel could not do its work.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A parameter is outside what is allowed.
    #[error("{parameter} = {value}: {allowed}")]
    Parameter {
        /// Name of the parameter as the caller knows it.
        parameter: &'static str,
        /// The value that was given.
        value: String,
        /// What is allowed, as the end of the sentence.
        allowed: String,
    },
    /// The caller asked to stop (Ctrl-C).
    #[error("cancelled")]
    Cancelled,
    /// The thread pool could not be started.
    #[error("could not start {0} threads")]
    Threads(usize),
}

/// Result of a kernel.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// A parameter error.
    pub fn parameter(
        parameter: &'static str,
        value: impl std::fmt::Debug,
        allowed: impl Into<String>,
    ) -> Self {
        Self::Parameter { parameter, value: format!("{value:?}"), allowed: allowed.into() }
    }
}
