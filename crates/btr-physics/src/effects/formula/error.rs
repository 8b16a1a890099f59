//! Errors in a user's law.

/// Why a law is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FormulaError {
    /// The expression has a syntax error.
    #[error("the law cannot be read: {0}")]
    Syntax(String),
    /// A name that is neither a variable nor a parameter.
    #[error("the law contains the unknown name `{name}`; known names: {}", known.join(", "))]
    Unknown {
        /// The name.
        name: String,
        /// Variables and parameters.
        known: Vec<String>,
    },
    /// A parameter that does not occur in the law.
    #[error("`{0}` does not occur in the law")]
    Unused(String),
    /// A parameter whose name is reserved.
    #[error("`{0}` is a reserved name in laws")]
    Taken(String),
    /// A neighbouring joint's quantity in a law on a reading.
    #[error("a law on a reading cannot contain `{0}`: an encoder reads its own joint only")]
    NotInReading(String),
    /// A function that was not supplied with the model.
    #[error("the law `{0}` is a function, but no function of that name was given")]
    Absent(String),
}
