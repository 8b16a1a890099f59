//! Errors in a parameter's name.

/// Errors in a parameter's name.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterError {
    /// No quantity, effect or effect's parameter of that name.
    #[error("`{name}` is not a parameter{}", did_you_mean(near))]
    Unknown {
        /// The given name.
        name: String,
        /// Similar names, most similar first.
        near: Vec<String>,
    },
    /// No joint or link matches the site.
    #[error("the robot has no {what} `{site}`{}", did_you_mean(near))]
    Site {
        /// Joint or link.
        what: &'static str,
        /// The given name.
        site: String,
        /// Similar names, most similar first.
        near: Vec<String>,
    },
    /// A quantity that the site does not have.
    #[error("`{name}`: {why}")]
    Absent {
        /// The parameter.
        name: String,
        /// Why the site lacks it.
        why: String,
    },
}

fn did_you_mean(near: &[String]) -> String {
    if near.is_empty() { String::new() } else { format!("; did you mean `{}`?", near.join("` or `")) }
}

/// Up to three of `known` that are similar to `name`.
pub(super) fn near(name: &str, known: impl Iterator<Item = String>) -> Vec<String> {
    let mut scored: Vec<(f64, String)> =
        known.map(|k| (strsim::jaro_winkler(name, &k), k)).filter(|(s, _)| *s > 0.8).collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    scored.into_iter().take(3).map(|(_, known)| known).collect()
}
