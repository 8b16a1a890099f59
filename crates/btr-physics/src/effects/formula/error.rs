//! What is wrong with a law.

/// What is wrong with a law.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FormulaError {
    /// It cannot be read.
    #[error("the law cannot be read: {0}")]
    Syntax(String),
    /// A name that is neither a variable nor a parameter.
    #[error("the law's `{name}` is not known; there are {}", known.join(", "))]
    Unknown {
        /// The name.
        name: String,
        /// Variables and parameters.
        known: Vec<String>,
    },
    /// A parameter that the law does not have.
    #[error("`{0}` does not occur in the law")]
    Unused(String),
    /// A parameter that cannot have this name.
    #[error("`{0}` means something else in every law")]
    Taken(String),
    /// A function that did not come with the model.
    #[error("the law `{0}` is a function, and there is none of that name here")]
    Absent(String),
}
