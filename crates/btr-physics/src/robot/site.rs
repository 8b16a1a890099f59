//! Patterns of site names: `knee`, `hip,knee`, `R*`, `*`.

/// Whether `name` matches `pattern`: a comma-separated list of names in which `*` matches any run of characters.
pub fn matches(pattern: &str, name: &str) -> bool {
    pattern.split(',').any(|part| glob(part.trim().as_bytes(), name.as_bytes()))
}

fn glob(pattern: &[u8], name: &[u8]) -> bool {
    match pattern.split_first() {
        None => name.is_empty(),
        Some((b'*', rest)) => (0..=name.len()).any(|skipped| glob(rest, &name[skipped..])),
        Some((first, rest)) => name.split_first().is_some_and(|(head, tail)| head == first && glob(rest, tail)),
    }
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn lists_and_wildcards_match() {
        assert!(matches("knee", "knee") && !matches("knee", "knees") && !matches("knees", "knee"));
        assert!(matches("*", "anything") && matches("R*Pitch", "RKneePitch") && !matches("R*Pitch", "LKneePitch"));
        assert!(matches("hip, knee", "knee") && !matches("", "knee"));
    }
}
