//! What separates the cells of a file, and the sign in its numbers. Spreadsheets in most of Europe write semicolons
//! between cells and commas in numbers.

use std::io::{self, BufRead};

/// The separators that are recognised; the first where a header has as many of another.
const SEPARATORS: [u8; 3] = *b",;\t";

/// How the cells of a file are written.
pub(super) struct Style {
    pub(super) separator: u8,
    /// Whether numbers have a comma in the place of a point; `None` before the first number that has either.
    has_commas: Option<bool>,
}

impl Style {
    /// The style by the beginning of a file, which is not consumed.
    ///
    /// # Errors
    /// A failed read.
    pub(super) fn of(bytes: &mut impl BufRead) -> io::Result<Self> {
        let beginning = bytes.fill_buf()?;
        let header = beginning.split(|byte| *byte == b'\n').next().unwrap_or_default();
        let count = |separator: u8| header.iter().filter(|byte| **byte == separator).count();
        // Of equal counts, `max_by_key` takes the last.
        let separator = SEPARATORS.into_iter().rev().max_by_key(|&separator| count(separator)).unwrap_or(b',');
        Ok(Style { separator, has_commas: None })
    }

    /// A cell's number, 1 and 0 for true and false; NaN for a missing sample. `None` for text, for infinities (no
    /// sensor measures those), and for a number that is written in another way than those before it.
    pub(super) fn number(&mut self, text: &str) -> Option<f64> {
        if self.separator != b',' && text.contains([',', '.']) {
            return self.broken_number(text);
        }
        finite(text).or_else(|| match text.trim() {
            missing if missing.is_empty() || missing.eq_ignore_ascii_case("nan") => Some(f64::NAN),
            yes if yes.eq_ignore_ascii_case("true") => Some(1.0),
            no if no.eq_ignore_ascii_case("false") => Some(0.0),
            trimmed => finite(trimmed),
        })
    }

    /// A number with a sign in it. Where others have points, a comma would be one between thousands.
    fn broken_number(&mut self, text: &str) -> Option<f64> {
        let has_comma = text.contains(',');
        if self.has_commas.is_some_and(|others| others != has_comma) {
            return None;
        }
        let number = finite(&text.trim().replacen(',', ".", 1))?;
        self.has_commas = Some(has_comma);
        Some(number)
    }
}

fn finite(text: &str) -> Option<f64> {
    text.parse().ok().filter(|x: &f64| x.is_finite())
}
