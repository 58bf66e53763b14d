//! What can go wrong.

/// A report could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The page's template could not be filled.
    #[error("the report's page cannot be rendered: {0}")]
    Template(#[from] askama::Error),
}
