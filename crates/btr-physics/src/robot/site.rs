//! Patterns of site names: `knee`, `hip,knee`, `R*`, `*`; `knee#2` is the second instance of an effect at the knee.

/// Whether `name` matches `pattern`: a comma-separated list of names in which `*` matches any run of characters. The
/// number of an instance is no part of a name.
pub fn matches(pattern: &str, name: &str) -> bool {
    let (sites, number) = instance(pattern);
    let any = |list: &str| list.split(',').any(|part| glob(part.trim().as_bytes(), name.as_bytes()));
    // A name may end like a number.
    any(sites) || (number > 1 && any(pattern))
}

/// The sites of `SITES#NUMBER`, and the number. The first instance is written without one.
pub fn instance(pattern: &str) -> (&str, usize) {
    let numbered = pattern.rsplit_once('#').and_then(|(sites, number)| Some((sites, number.parse().ok()?)));
    numbered.filter(|(_, number)| *number > 1).unwrap_or((pattern, 1))
}

/// The site of an effect's instance with this number.
pub fn numbered(sites: &str, number: usize) -> String {
    if number > 1 { format!("{sites}#{number}") } else { sites.to_owned() }
}

/// Whether a site may stand for several: a list, or a name with `*`.
pub fn is_pattern(site: &str) -> bool {
    site.contains([',', '*'])
}

/// Whether a whole name matches a pattern in which `*` matches any run of characters; nothing else has a meaning.
pub fn is_like(pattern: &str, name: &str) -> bool {
    glob(pattern.as_bytes(), name.as_bytes())
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
    use super::{instance, is_like, matches, numbered};

    #[test]
    fn a_whole_name_has_no_parts() {
        assert!(is_like("mass@*", "mass@bob") && is_like("cogging.*@*", "cogging.order@elbow#2"));
        assert!(is_like("kp@hip,knee", "kp@hip,knee") && !is_like("kp@hip,knee", "kp@hip"));
        assert!(is_like("a@elbow#2", "a@elbow#2") && !is_like("a@elbow#2", "a@elbow"));
    }

    #[test]
    fn lists_and_wildcards_match() {
        assert!(matches("knee", "knee") && !matches("knee", "knees") && !matches("knees", "knee"));
        assert!(matches("*", "anything") && matches("R*Pitch", "RKneePitch") && !matches("R*Pitch", "LKneePitch"));
        assert!(matches("hip, knee", "knee") && !matches("", "knee"));
    }

    #[test]
    fn instances_are_at_the_same_site() {
        assert!(matches("knee#2", "knee") && matches("hip,knee#3", "hip") && !matches("knee#2", "hip"));
        assert!(matches("link#2", "link#2"), "a name that ends like a number");
        for (pattern, sites, number) in [("knee", "knee", 1), ("knee#2", "knee", 2), ("hip,knee#12", "hip,knee", 12)] {
            assert_eq!(instance(pattern), (sites, number));
            assert_eq!(numbered(sites, number), pattern);
        }
        for none in ["knee#1", "knee#0", "knee#", "knee#a", "knee#-2"] {
            assert_eq!(instance(none), (none, 1));
        }
    }
}
