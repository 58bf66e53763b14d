//! What can go wrong with a port.

/// An operation of the middleware that failed.
#[derive(Debug, thiserror::Error)]
#[error("{operation} of topic {topic}: {cause}")]
pub struct RuntimeError {
    /// What was tried.
    pub operation: &'static str,
    /// For which topic.
    pub topic: &'static str,
    /// What the middleware said.
    pub cause: String,
}

impl RuntimeError {
    /// Wraps what the middleware said.
    pub(crate) fn of(
        operation: &'static str,
        topic: &'static str,
    ) -> impl FnOnce(Box<dyn core::fmt::Debug>) -> Self {
        move |cause| Self { operation, topic, cause: format!("{cause:?}") }
    }
}

/// Attaches operation and topic to an error of the middleware.
pub(crate) trait Context<T> {
    fn context(self, operation: &'static str, topic: &'static str) -> Result<T, RuntimeError>;
}

impl<T, E: core::fmt::Debug + 'static> Context<T> for Result<T, E> {
    fn context(self, operation: &'static str, topic: &'static str) -> Result<T, RuntimeError> {
        self.map_err(|error| RuntimeError::of(operation, topic)(Box::new(error)))
    }
}
