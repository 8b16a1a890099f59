//! Suggestions for misspelt names.

use btr_core::text::Text;

/// A question with the known names that may have been meant: the one most similar to `wrong`, or else those of which
/// one word is similar.
pub fn suggestion<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let known: Vec<&str> = known.into_iter().collect();
    let by_word = || known.iter().copied().filter(|name| nearest(wrong, name.split('_')).is_some()).collect();
    let names: Vec<&str> = nearest(wrong, known.iter().copied()).map_or_else(by_word, |name| vec![name]);
    (!names.is_empty()).then(|| format!("did you mean `{}`?", names.join("` or `")))
}

/// What to do about a name that is unknown: the known names that may have been meant, or else all of them.
pub fn remedy<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> Text {
    let known: Vec<&str> = known.into_iter().collect();
    let near = suggestion(wrong, known.iter().copied());
    near.unwrap_or_else(|| format!("known: {}", known.join(", "))).into()
}

/// The known name most similar to `wrong`, if any is similar enough and another one.
pub fn nearest<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let scored =
        known.into_iter().filter(|name| *name != wrong).map(|name| (name, strsim::damerau_levenshtein(wrong, name)));
    let (name, distance) = scored.min_by_key(|(_, distance)| *distance)?;
    (distance <= wrong.len().max(name.len()) / 3 + 1).then_some(name)
}
