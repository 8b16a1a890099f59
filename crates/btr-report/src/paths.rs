//! Paths as arguments of a command that is printed: a pattern where a shell has expanded one, most likely.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Paths from which a pattern is shorter.
const MANY: usize = 3;

/// The paths as a shell takes them: `DIR/PREFIX*SUFFIX` where that is all of them, in the order of a shell.
pub(crate) fn arguments(paths: &[PathBuf]) -> String {
    pattern(paths).unwrap_or_else(|| {
        let words = paths.iter().map(|path| shell_word(&path.display().to_string()));
        words.collect::<Vec<_>>().join(" ")
    })
}

/// A word as a shell takes it.
pub(crate) fn shell_word(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "_-./@#:=,+".contains(c);
    if word.chars().all(plain) { word.to_owned() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

/// The pattern of one star that matches these files on disk, and no other.
fn pattern(paths: &[PathBuf]) -> Option<String> {
    let folder = paths.first()?.parent()?;
    let names: Option<Vec<&str>> =
        paths.iter().map(|path| path.file_name().filter(|_| path.parent() == Some(folder))?.to_str()).collect();
    let names = names.filter(|names| names.len() >= MANY && names.is_sorted())?;
    let prefix = names.iter().copied().reduce(common_prefix)?;
    let rests = names.iter().map(|name| &name[prefix.len()..]);
    let suffix = rests.reduce(common_suffix)?;
    let on_disk = std::fs::read_dir(if folder == Path::new("") { Path::new(".") } else { folder }).ok()?;
    let matches = |name: &OsStr| {
        let name = name.to_str()?;
        let between = name.strip_prefix(prefix)?.strip_suffix(suffix)?;
        (!(prefix.is_empty() && between.starts_with('.'))).then(|| name.to_owned())
    };
    let mut matched: Vec<String> = on_disk.filter_map(|entry| matches(&entry.ok()?.file_name())).collect();
    matched.sort();
    let pattern = format!("{}*{suffix}", folder.join(prefix).display());
    (matched == names && shell_word(&pattern.replacen('*', "", 1)) == pattern.replacen('*', "", 1)).then_some(pattern)
}

fn common_prefix<'a>(a: &'a str, b: &str) -> &'a str {
    let same =
        a.char_indices().zip(b.chars()).find(|((_, x), y)| x != y).map_or(a.len().min(b.len()), |((at, _), _)| at);
    &a[..same]
}

fn common_suffix<'a>(a: &'a str, b: &str) -> &'a str {
    let same = a.char_indices().rev().zip(b.chars().rev()).take_while(|((_, x), y)| x == y).last();
    same.map_or("", |((at, _), _)| &a[at..])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_pattern_stands_for_all_files_that_it_matches_and_no_others() {
        let folder = std::env::temp_dir().join(format!("btr-paths-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let all = ["held_1.csv", "learn_1.csv", "learn_10.csv", "learn_2.csv"].map(|name| folder.join(name));
        all.iter().for_each(|path| std::fs::write(path, "").unwrap());
        let listed = all[1..].iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(" ");
        assert_eq!(arguments(&all[1..]), format!("{}/learn_*.csv", folder.display()));
        // In another order, or with one more on disk, it would not be the same.
        assert!(!arguments(&[all[2].clone(), all[1].clone(), all[3].clone()]).contains('*'));
        std::fs::write(folder.join("learn_3.csv"), "").unwrap();
        assert_eq!(arguments(&all[1..]), listed);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn words_are_quoted_where_a_shell_would_read_more_into_them() {
        assert_eq!(shell_word("robots/arm.toml"), "robots/arm.toml");
        assert_eq!(shell_word("mass@*"), "'mass@*'");
        assert_eq!(shell_word("my log's.csv"), "'my log'\\''s.csv'");
    }
}
