//! Results on stdout, and errors: in colour and in lines that fit where that is a terminal, as they are in a pipe.
//!
//! `NO_COLOR` and `CLICOLOR_FORCE` are honoured by anstream, which strips the styles where they are not wanted.

use anstyle::{AnsiColor, Style};
use btr_core::text::printable;
use btr_identify::quality::Severity;
use btr_report::table::Table;
use terminal_size::{Width, terminal_size_of};

/// Prose is not wider than this on any terminal.
const WIDEST: usize = 100;
/// Prose on a narrower terminal is left to the terminal.
const NARROWEST: usize = 20;
/// Further indentation of wrapped lines.
const HANGING: usize = 2;

/// How a line is shown.
#[derive(Clone, Copy)]
pub(crate) enum Tone {
    Plain,
    /// The verdict.
    Lead,
    /// Explanations.
    Note,
    Fine,
    Doubtful,
    Bad,
}

impl From<Severity> for Tone {
    fn from(severity: Severity) -> Self {
        match severity {
            Severity::Fine => Tone::Fine,
            Severity::Doubtful => Tone::Doubtful,
            Severity::Bad => Tone::Bad,
        }
    }
}

impl Tone {
    fn style(self) -> Style {
        let colour = |colour: AnsiColor| Style::new().fg_color(Some(colour.into()));
        match self {
            Tone::Plain => Style::new(),
            Tone::Lead => Style::new().bold(),
            Tone::Note => Style::new().dimmed(),
            Tone::Fine => colour(AnsiColor::Green),
            Tone::Doubtful => colour(AnsiColor::Yellow),
            Tone::Bad => colour(AnsiColor::Red),
        }
    }
}

/// Columns of the terminal; `None` for anything else.
fn columns() -> Option<usize> {
    let (Width(columns), _) = terminal_size_of(std::io::stdout())?;
    Some(usize::from(columns)).filter(|columns| *columns >= NARROWEST)
}

/// Prints prose.
pub(crate) fn say(tone: Tone, text: &str) {
    show(tone, &columns().map_or_else(|| text.to_owned(), |columns| wrapped(text, columns.min(WIDEST))));
}

/// Prints prose as a note.
pub(crate) fn note(text: &str) {
    say(Tone::Note, text);
}

/// Prints text as it is: commands, TOML.
pub(crate) fn show(tone: Tone, text: &str) {
    let (style, text) = (tone.style(), printable(text));
    for line in text.split('\n') {
        if line.is_empty() {
            anstream::println!();
        } else {
            anstream::println!("{style}{line}{style:#}");
        }
    }
}

/// Prints a message on stderr, with a coloured word before it.
pub(crate) fn complain(tone: Tone, word: &str, message: &str) {
    let style = tone.style().bold();
    anstream::eprintln!("{style}{word}:{style:#} {}", printable(message));
}

/// Prints lines as they are.
pub(crate) fn lines(lines: &[String]) {
    lines.iter().for_each(|line| show(Tone::Plain, line));
}

/// Prints a table.
pub(crate) fn table(table: &Table) {
    show(Tone::Plain, &table.render_within(columns()));
}

/// Prints a table without numbers; on a narrower terminal, its last column has lines of its own.
pub(crate) fn table_left(table: &Table) {
    let text = table.render_left();
    let widest = text.lines().map(|line| line.chars().count()).max().unwrap_or(0);
    match columns() {
        Some(columns) if widest > columns => show(Tone::Plain, &table.listed(columns)),
        _ => show(Tone::Plain, &text),
    }
}

/// Prints a table whose last column has long names; on a narrower terminal, these have lines of their own.
pub(crate) fn names_last(table: &Table) {
    let text = table.render_names_last();
    let widest = text.lines().map(|line| line.chars().count()).max().unwrap_or(0);
    match columns() {
        Some(columns) if widest > columns => show(Tone::Plain, &table.last_first().render_within(Some(columns))),
        _ => show(Tone::Plain, &text),
    }
}

/// The text with lines of at most this many characters, as far as its words allow. What follows the first line is
/// indented further.
fn wrapped(text: &str, columns: usize) -> String {
    text.split('\n').map(|line| wrapped_line(line, columns)).collect::<Vec<_>>().join("\n")
}

fn wrapped_line(line: &str, columns: usize) -> String {
    let indent = line.chars().take_while(|c| *c == ' ').count();
    let hanging = indent + HANGING;
    let (mut out, mut used) = (" ".repeat(indent), indent);
    for (k, word) in line.trim_start().split(' ').enumerate() {
        let width = word.chars().count();
        if k > 0 && used + 1 + width > columns {
            out.push('\n');
            out.push_str(&" ".repeat(hanging));
            used = hanging;
        } else if k > 0 {
            out.push(' ');
            used += 1;
        }
        out.push_str(word);
        used += width;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prose_is_wrapped_between_words() {
        assert_eq!(wrapped("one two three\n  four five six", 11), "one two\n  three\n  four five\n    six");
        assert_eq!(wrapped("a_word_that_is_longer and more", 10), "a_word_that_is_longer\n  and more");
        assert_eq!(wrapped("fits  as it is", 20), "fits  as it is");
    }
}
