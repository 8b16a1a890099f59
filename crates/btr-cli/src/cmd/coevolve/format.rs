//! Formatting shared by the tables of a run.

use btr_report::table::number;

/// An interval, or a dash where there is none.
pub(super) fn span(interval: Option<[f64; 2]>) -> String {
    interval.map_or_else(|| "-".to_owned(), |[low, high]| format!("{} .. {}", number(low), number(high)))
}

/// A number of real tests in words.
pub(super) fn tests(count: usize) -> String {
    if count == 1 { "1 real test".to_owned() } else { format!("{count} real tests") }
}
