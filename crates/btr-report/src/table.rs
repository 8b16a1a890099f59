//! Plain tables for the terminal: columns as wide as their widest cell, numbers right-aligned.
//!
//! Written by hand: table crates pad the last column and need more configuration than these few lines.

pub use btr_lab::digits::{maybe, number, span};

/// Rows of text under a header.
pub struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    pub fn new(header: &[&str]) -> Self {
        Table { header: header.iter().map(|&h| h.to_owned()).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    /// Its header and its rows.
    pub fn into_parts(self) -> (Vec<String>, Vec<Vec<String>>) {
        (self.header, self.rows)
    }

    /// Whether the table has no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The table as text, one line per row: the first column left-aligned, the others right-aligned.
    pub fn render(&self) -> String {
        self.lines(|k| k == 0)
    }

    /// The table as text in lines of at most this many characters, where that is given: in a table that is wider, the
    /// first column has lines of its own, folded between its words.
    pub fn render_within(&self, columns: Option<usize>) -> String {
        let text = self.render();
        let widest = text.lines().map(|line| line.chars().count()).max().unwrap_or(0);
        match columns {
            Some(columns) if widest > columns && self.header.len() >= 3 => self.stacked(columns),
            _ => text,
        }
    }

    /// The table with the first column in lines of its own.
    fn stacked(&self, columns: usize) -> String {
        let rest = |row: &Vec<String>| std::iter::once(String::new()).chain(row.iter().skip(1).cloned()).collect();
        let others = Table { header: rest(&self.header), rows: self.rows.iter().map(rest).collect() }.render();
        let mut lines: Vec<String> = others.lines().map(str::to_owned).collect();
        for (k, row) in self.rows.iter().enumerate().rev() {
            lines.insert(k + 2, folded(row.first().map_or("", String::as_str), columns));
        }
        lines.join("\n")
    }

    /// These columns of the table.
    #[must_use]
    pub fn columns(&self, kept: &[usize]) -> Table {
        let of = |row: &Vec<String>| kept.iter().filter_map(|k| row.get(*k).cloned()).collect();
        Table { header: of(&self.header), rows: self.rows.iter().map(of).collect() }
    }

    /// The rows in lines of at most this many characters: all cells but the last, and that indented below.
    pub fn listed(&self, columns: usize) -> String {
        let entry = |row: &Vec<String>| {
            let (last, others) = row.split_last()?;
            let below = folded(last, columns.saturating_sub(4)).replace('\n', "\n    ");
            Some(format!("{}\n    {below}", others.join("  ")))
        };
        self.rows.iter().filter_map(entry).collect::<Vec<_>>().join("\n")
    }

    /// The table with its last column as the first.
    #[must_use]
    pub fn last_first(&self) -> Table {
        let last = self.header.len().saturating_sub(1);
        self.columns(&std::iter::once(last).chain(0..last).collect::<Vec<_>>())
    }

    /// The table as text, with the last column left-aligned and the others right-aligned: for long names.
    pub fn render_names_last(&self) -> String {
        self.lines(|k| k + 1 == self.header.len())
    }

    /// The table as text with every column left-aligned, for cells without numbers.
    pub fn render_left(&self) -> String {
        self.lines(|_| true)
    }

    fn lines(&self, left: impl Fn(usize) -> bool) -> String {
        let all = || std::iter::once(&self.header).chain(&self.rows);
        let width = |k: usize| all().filter_map(|r| r.get(k)).map(|c| c.chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.header.len()).map(width).collect();
        let mut lines: Vec<String> = all().map(|row| line(row, &widths, &left)).collect();
        lines.insert(1, widths.iter().map(|w| "-".repeat(*w)).collect::<Vec<_>>().join("  "));
        lines.join("\n")
    }
}

/// A text in lines of at most this many characters, as far as its words allow; further lines are indented.
fn folded(text: &str, columns: usize) -> String {
    let mut out = String::new();
    let mut used = 0;
    for word in text.split(' ') {
        let length = word.chars().count();
        let (gap, indented) = if used == 0 {
            ("", 0)
        } else if used + 1 + length > columns {
            ("\n    ", 4)
        } else {
            (" ", used + 1)
        };
        out += gap;
        out += word;
        used = indented + length;
    }
    out
}

fn line(row: &[String], widths: &[usize], left: &impl Fn(usize) -> bool) -> String {
    let cells = row
        .iter()
        .zip(widths)
        .enumerate()
        .map(|(k, (cell, &width))| if left(k) { format!("{cell:<width$}") } else { format!("{cell:>width$}") });
    cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let mut table = Table::new(&["name", "x"]);
        table.row(vec!["a".into(), "1".into()]);
        table.row(vec!["longer".into(), "1000".into()]);
        assert_eq!(table.render(), "name       x\n------  ----\na          1\nlonger  1000");
    }

    #[test]
    fn names_of_a_wide_table_have_lines_of_their_own() {
        let mut table = Table::new(&["name", "x", "y"]);
        table.row(vec!["a_long_name".into(), "1".into(), "2".into()]);
        assert_eq!(table.render_within(Some(17)), table.render());
        assert_eq!(table.render_within(None), table.render());
        assert_eq!(table.render_within(Some(16)), "  x  y\n  -  -\na_long_name\n  1  2");
        let mut table = Table::new(&["name", "x", "y"]);
        table.row(vec!["one and two for three".into(), "1".into(), "2".into()]);
        assert_eq!(table.render_within(Some(12)), "  x  y\n  -  -\none and two\n    for\n    three\n  1  2");
        let mut table = Table::new(&["name", "on", "what"]);
        table.row(vec!["a".into(), "b".into(), "one two three".into()]);
        assert_eq!(table.listed(12), "a  b\n    one two\n        three");
        let mut table = Table::new(&["name", "x", "y"]);
        table.row(vec!["a_long_name".into(), "1".into(), "2".into()]);
        assert_eq!(table.columns(&[2, 0]).render_left(), "y  name\n-  -----------\n2  a_long_name");
    }
}
