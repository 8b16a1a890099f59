//! Plain tables for the terminal: columns as wide as their widest cell, numbers right-aligned.
//!
//! Written by hand: table crates pad the last column and need more configuration than these few lines.

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

fn line(row: &[String], widths: &[usize], left: &impl Fn(usize) -> bool) -> String {
    let cells = row
        .iter()
        .zip(widths)
        .enumerate()
        .map(|(k, (cell, &width))| if left(k) { format!("{cell:<width$}") } else { format!("{cell:>width$}") });
    cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
}

/// A number with four significant digits, without an exponent between 1e-4 and 1e6; `-` where it is not finite.
pub fn number(x: f64) -> String {
    match x.abs() {
        _ if !x.is_finite() => "-".to_owned(),
        0.0 => "0".to_owned(),
        a if !(1e-4..1e6).contains(&a) => format!("{x:.3e}"),
        a => format!("{x:.*}", (3 - a.log10().floor() as i32).clamp(0, 6) as usize),
    }
}

/// A number as [`number`] writes it, or a dash where there is none.
pub fn maybe(x: Option<f64>) -> String {
    x.map_or_else(|| "-".to_owned(), number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_four_digits() {
        let shown: Vec<String> = [0.0, 1.0, -12.3456, 0.012345, 123456.7, 1e-9, f64::NAN].map(number).into();
        assert_eq!(shown, ["0", "1.000", "-12.35", "0.01235", "123457", "1.000e-9", "-"]);
    }

    #[test]
    fn columns_line_up() {
        let mut table = Table::new(&["name", "x"]);
        table.row(vec!["a".into(), "1".into()]);
        table.row(vec!["longer".into(), "1000".into()]);
        assert_eq!(table.render(), "name       x\n------  ----\na          1\nlonger  1000");
    }
}
