//! The paths in a model file, rewritten when the file moves to another folder.

use crate::experiment::Source;
use std::path::{Component, Path, PathBuf};
use toml_edit::{DocumentMut, TomlError, Value};

/// Prefix of the line that names the schema for editors; only the first line counts.
const SCHEMA: &str = "#:schema";

/// Keys with paths relative to the file's folder: one path, or a list. Those of `package_paths` are of folders.
const NAMES_FILES: [(&str, &str); 7] = [
    ("robot", "urdf"),
    ("robot", "package_paths"),
    ("logs", "index"),
    ("drive", "log"),
    ("reality", "index"),
    ("reality", "files"),
    ("reality", "held_out"),
];

/// The text with the path in its schema line rewritten from relative to `folder` to relative to `into`; without that
/// line if the schema does not exist.
pub(super) fn with_schema(text: &str, folder: &Path, into: &Path) -> String {
    let Some((line, rest)) = text.split_once('\n') else { return text.to_owned() };
    let Some(schema) = line.strip_prefix(SCHEMA).map(str::trim) else { return text.to_owned() };
    match folder.join(schema) {
        _ if schema.contains("://") => text.to_owned(),
        file if file.is_file() => format!("{SCHEMA} {}\n{rest}", relative_path(into, &file).display()),
        _ => rest.to_owned(),
    }
}

/// The text of a model file in `folder`, rewritten for the folder `into`.
///
/// # Errors
/// A text that is not TOML.
pub fn moved(text: &str, folder: &Path, into: &Path) -> Result<String, TomlError> {
    let mut document = text.parse::<DocumentMut>()?;
    anchor(&mut document, folder, into);
    Ok(with_schema(&document.to_string(), folder, into))
}

/// The files that a model file names; none if the text is not TOML, which parsing it reports.
pub fn named_files(source: &Source) -> Vec<PathBuf> {
    let mut files = Vec::new();
    if let Ok(mut document) = source.text.parse::<DocumentMut>() {
        each_named_file(&mut document, |_, value| files.extend(value.as_str().map(|path| source.folder().join(path))));
    }
    files
}

/// Rewrites the paths in a document from relative to `folder` to relative to `into`. Absolute paths stay unchanged.
pub(super) fn anchor(document: &mut DocumentMut, folder: &Path, into: &Path) {
    each_named_file(document, |_, value| {
        let Some(path) = value.as_str().map(Path::new).filter(|path| path.is_relative()) else { return };
        let path = relative_path(into, &folder.join(path));
        let decor = value.decor().clone();
        *value = path.to_string_lossy().into_owned().into();
        *value.decor_mut() = decor;
    });
}

/// Visits the paths in a document with their keys.
pub(crate) fn each_named_file(document: &mut DocumentMut, mut visit: impl FnMut(&str, &mut Value)) {
    for (section, key) in NAMES_FILES {
        let mut visit = |value: &mut Value| visit(key, value);
        let item = document.get_mut(section).and_then(|section| section.get_mut(key));
        match item.and_then(|item| item.as_value_mut()) {
            Some(Value::Array(list)) => list.iter_mut().for_each(&mut visit),
            Some(one) => visit(one),
            None => {}
        }
    }
}

/// The relative path from a folder to a file or folder; absolute if the two have only the root in common.
pub fn relative_path(from: &Path, file: &Path) -> PathBuf {
    let from = real(from);
    // A path that ends in `..` has no name.
    let file = match file.file_name() {
        Some(name) => real(file.parent().unwrap_or(file)).join(name),
        None => real(file),
    };
    let common = from.components().zip(file.components()).take_while(|(a, b)| a == b).count();
    if common <= 1 {
        return file;
    }
    let up = from.components().skip(common).map(|_| Component::ParentDir);
    let path: PathBuf = up.chain(file.components().skip(common)).collect();
    if path.as_os_str().is_empty() { ".".into() } else { path }
}

/// The canonical path of a folder; the absolute path as written if the folder does not exist yet.
fn real(folder: &Path) -> PathBuf {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let absolute = || std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    folder.canonicalize().unwrap_or_else(|_| absolute())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_schema_line_is_rewritten_or_dropped() {
        let lab = tempfile::tempdir().unwrap();
        let (from, into) = (lab.path().join("robots"), lab.path().join("runs/monday"));
        std::fs::create_dir_all(&from).unwrap();
        let text = "#:schema ../btr.schema.json\nname = \"arm\"\n";
        let moved = |text: &str| moved(text, &from, &into).unwrap();
        assert_eq!(moved(text), "name = \"arm\"\n");
        std::fs::write(lab.path().join("btr.schema.json"), "{}").unwrap();
        std::fs::create_dir_all(&into).unwrap();
        assert_eq!(moved(text), "#:schema ../../btr.schema.json\nname = \"arm\"\n");
        let remote = "#:schema https://example.org/btr.json\nname = \"arm\"\n";
        assert_eq!(moved(remote), remote);
    }

    #[test]
    fn moving_a_file_rewrites_its_folders_of_packages() {
        let moved = |folders: &str, into: &str| {
            let text = format!("[robot]\npackage_paths = {folders}\n");
            moved(&text, Path::new("/lab/robots"), Path::new(into)).unwrap().replace("[robot]\npackage_paths = ", "")
        };
        assert_eq!(
            moved("[\".\", \"..\", \"../ros\"]", "/lab/runs"),
            "[\"../robots\", \"../robots/..\", \"../robots/../ros\"]\n"
        );
        assert_eq!(moved("[\".\", \"/opt/ros\"]", "/lab/robots"), "[\".\", \"/opt/ros\"]\n");
    }

    #[test]
    fn moving_a_file_rewrites_its_relative_paths() {
        let text = "[robot]\nurdf = \"arm.urdf\" # its shape\n[logs]\nindex = \"logs/index.csv\"\n\
                    [reality]\nfiles = [\"a.csv\", \"/b.csv\"]\n";
        let from = Path::new("/lab/robots");
        let moved = |into: &str| moved(text, from, Path::new(into)).unwrap();
        assert_eq!(moved("/lab/robots"), text);
        let expected = "[robot]\nurdf = \"../../robots/arm.urdf\" # its shape\n[logs]\n\
                      index = \"../../robots/logs/index.csv\"\n\
                      [reality]\nfiles = [\"../../robots/a.csv\", \"/b.csv\"]\n";
        assert_eq!(moved("/lab/runs/monday"), expected);
        let expected = "[robot]\nurdf = \"/lab/robots/arm.urdf\" # its shape\n[logs]\n\
                      index = \"/lab/robots/logs/index.csv\"\n\
                      [reality]\nfiles = [\"/lab/robots/a.csv\", \"/b.csv\"]\n";
        assert_eq!(moved("/tmp"), expected);
    }
}
