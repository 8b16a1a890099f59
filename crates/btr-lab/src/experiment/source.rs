//! Reading a file into [`File`], with errors that name file, line, column and remedy.

use super::file::File;
use super::stated;
use super::stated::Misstated;
use crate::robot_format::RobotFormat;
use crate::suggest::nearest;
use btr_core::text::{Mention, Text};
use btr_physics::effects::Laws;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// What the standard input is called in messages.
pub(super) const STDIN: &str = "<stdin>";

/// What is wrong with a model or experiment file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", self.text())]
pub struct FileError {
    /// The file; empty where the message names it.
    pub path: PathBuf,
    /// Line from 1; 0 when the whole file is meant.
    pub line: usize,
    /// Column from 1; 0 when the whole line is meant.
    pub column: usize,
    /// What is wrong.
    pub message: Text,
    /// The remedy.
    pub help: Option<Text>,
}

impl FileError {
    /// The error as a text.
    pub fn text(&self) -> Text {
        Text::from(place(&self.path, self.line, self.column)) + self.message.clone()
    }
}

fn place(path: &Path, line: usize, column: usize) -> String {
    let path = path.display();
    match (line, column) {
        (0, _) if path.to_string().is_empty() => String::new(),
        (0, _) => format!("{path}: "),
        (line, 0) => format!("{path}:{line}: "),
        (line, column) => format!("{path}:{line}:{column}: "),
    }
}

fn unreadable(path: &Path, message: String) -> FileError {
    let help = Some("give the path of a model or experiment file (TOML); robots/ has examples".into());
    FileError { path: path.to_owned(), line: 0, column: 0, message: message.into(), help }
}

/// A file that is no TOML: of a robot's description, how to make a model of it.
fn not_toml(path: &Path) -> FileError {
    match RobotFormat::of(path) {
        None => unreadable(path, "not a TOML file".to_owned()),
        Some(format) => {
            let message = format!("{}, not a model file, which also says how the robot is driven", format.words());
            let help = Some(Mention::NewModel(path.display().to_string()).into());
            FileError { help, ..unreadable(path, message) }
        }
    }
}

/// Text with the name of its file, for error messages.
#[derive(Clone, Debug)]
pub struct Source {
    /// The file.
    pub path: PathBuf,
    /// All of it.
    pub text: String,
    /// The functions that its laws name; provided by the calling program, if any.
    pub laws: Laws,
}

impl Source {
    /// A text without functions for its laws.
    pub fn new(path: impl Into<PathBuf>, text: impl Into<String>) -> Self {
        Source { path: path.into(), text: text.into(), laws: Laws::default() }
    }

    /// Reads a file.
    ///
    /// # Errors
    /// A file that does not exist or is not text.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let refused = |message: String| unreadable(path, message);
        if path.is_file() && path.extension().is_some_and(|ending| ending != "toml") {
            return Err(not_toml(path));
        }
        let text = btr_io::read_text(path).map_err(|e| {
            let help =
                (e.kind() == ErrorKind::InvalidInput).then(|| Text::from("name a regular file, or ") + Mention::Pipe);
            let error = refused(e.to_string());
            FileError { help: help.or(error.help.clone()), ..error }
        })?;
        Ok(Source::new(path, text))
    }

    /// Reads the standard input. Paths in it are relative to the working folder.
    ///
    /// # Errors
    /// A text that is too long or no text.
    pub fn read_stdin() -> Result<Self, FileError> {
        let path = Path::new(STDIN);
        let text = btr_io::read_text_from(std::io::stdin().lock()).map_err(|e| unreadable(path, e.to_string()))?;
        Ok(Source::new(path, text))
    }

    /// The folder to which paths in the file are relative.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// Applies `key=value` settings: dotted keys, values in TOML (bare words count as strings).
    ///
    /// # Errors
    /// A setting without `=`, or a key that runs into a value.
    pub fn set(&mut self, settings: &[String]) -> Result<(), FileError> {
        if settings.is_empty() {
            return Ok(());
        }
        let mut document =
            self.text.parse::<toml_edit::DocumentMut>().map_err(|e| self.at_span(e.span(), e.message()))?;
        for setting in settings {
            apply_setting(&mut document, setting).map_err(|why| {
                let message = Text::from(Mention::Setting(setting.clone())) + ": " + why;
                FileError { message, ..self.at_span(None, "") }
            })?;
        }
        self.text = document.to_string();
        Ok(())
    }

    /// The typed file.
    ///
    /// # Errors
    /// Syntax, unknown keys (with a suggestion), wrong types, numbers that make no sense: at their line.
    pub fn parse(&self) -> Result<File, FileError> {
        let file = toml::from_str(&self.text).map_err(|e| self.refused(&e))?;
        stated::check(&file, &self.text).map_err(|e| self.misstated(&e))?;
        Ok(file)
    }

    /// Checks that the text's numbers are finite.
    ///
    /// # Errors
    /// The first one that is not, at its line.
    pub(super) fn check_finite(&self) -> Result<(), FileError> {
        stated::check_finite(&self.text).map_err(|e| self.misstated(&e))
    }

    fn misstated(&self, error: &Misstated) -> FileError {
        let keys: Vec<&str> = error.keys.iter().map(String::as_str).collect();
        self.error(&keys, &error.message, error.help.clone().map(Text::from))
    }

    /// An error of serde about the text, at its place and with a suggestion.
    pub(super) fn refused(&self, error: &toml::de::Error) -> FileError {
        let message = in_plain_words(error.message());
        FileError { help: did_you_mean(error.message()), ..self.at_span(error.span(), &message) }
    }

    /// An error about the value at a path of keys.
    pub fn error(&self, keys: &[&str], message: &str, help: Option<Text>) -> FileError {
        let span = toml_edit::Document::parse(self.text.as_str()).ok().and_then(|d| span_of(d.as_item(), keys));
        FileError { help, ..self.at_span(span, message) }
    }

    fn at_span(&self, span: Option<std::ops::Range<usize>>, message: &str) -> FileError {
        let (line, column) = span.map_or((0, 0), |s| line_and_column(&self.text, s.start));
        FileError { path: self.path.clone(), line, column, message: message.trim_end().into(), help: None }
    }
}

/// The span of the deepest key of the path that exists.
fn span_of(root: &toml_edit::Item, keys: &[&str]) -> Option<std::ops::Range<usize>> {
    let (mut item, mut span) = (root, None);
    for key in keys {
        let next = match key.parse::<usize>() {
            Ok(index) => item.get(index),
            Err(_) => None,
        };
        let found = item.as_table_like().and_then(|table| table.get_key_value(key));
        if let Some((name, value)) = found {
            span = name.span().or_else(|| value.span()).or(span);
            item = value;
        } else if let Some(value) = next {
            span = value.span().or(span);
            item = value;
        } else {
            break;
        }
    }
    span
}

fn line_and_column(text: &str, at: usize) -> (usize, usize) {
    let before = &text[..at.min(text.len())];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
    (line, column)
}

fn apply_setting(document: &mut toml_edit::DocumentMut, setting: &str) -> Result<(), String> {
    let (key, value) = setting.split_once('=').ok_or("expected key=value")?;
    let keys = keys_of(key.trim()).ok_or_else(|| format!("`{key}` is no name of a value"))?;
    let value = value.trim().parse::<toml_edit::Value>().unwrap_or_else(|_| value.trim().into());
    let mut item = document.as_item_mut();
    for key in &keys[..keys.len().saturating_sub(1)] {
        let table = item.as_table_like_mut().ok_or_else(|| format!("`{key}` is not inside a table"))?;
        item = table.entry(key.get()).or_insert(toml_edit::table());
    }
    let last = keys.last().ok_or("expected key=value")?;
    let table = item.as_table_like_mut().ok_or("the key runs into a value")?;
    table.insert(last.get(), toml_edit::value(value));
    Ok(())
}

/// The parts of a dotted key. Quotes are optional for parts without a dot, even where TOML requires them: shells remove
/// quotes, and `parameters.mass@bob.value` is unambiguous.
fn keys_of(dotted: &str) -> Option<Vec<toml_edit::Key>> {
    let is_bare = |part: &str| part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    let quoted = |part: &str| match part {
        part if is_bare(part) || part.contains(['"', '\'']) => part.to_owned(),
        part => format!("\"{part}\""),
    };
    let spelt_out = || dotted.split('.').map(quoted).collect::<Vec<_>>().join(".");
    toml_edit::Key::parse(dotted).or_else(|_| toml_edit::Key::parse(&spelt_out())).ok()
}

/// Replaces the Rust types in serde's messages by plain words.
fn in_plain_words(message: &str) -> String {
    let types = [
        ("expected f64", "expected a number"),
        ("expected u64", "expected a whole number"),
        ("expected u32", "expected a whole number"),
        ("expected usize", "expected a whole number"),
        ("expected an array of length 2", "expected two numbers"),
    ];
    types.iter().fold(message.to_owned(), |text, (theirs, plain)| text.replace(theirs, plain))
}

/// A suggestion from serde's message "unknown field `x`, expected one of `a`, `b`": the nearest known name.
fn did_you_mean(message: &str) -> Option<Text> {
    let mut quoted = message.split('`').skip(1).step_by(2);
    if !(message.starts_with("unknown field") || message.starts_with("unknown variant")) {
        return None;
    }
    let wrong = quoted.next()?;
    let known: Vec<&str> = quoted.collect();
    nearest(wrong, known.iter().copied()).map(|name| format!("did you mean `{name}`?").into())
}
