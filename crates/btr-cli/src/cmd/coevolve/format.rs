//! Phrases that several tables share.

use btr_report::table::number;

/// From where to where.
pub(super) fn span(interval: Option<[f64; 2]>) -> String {
    interval.map_or_else(|| "-".to_owned(), |[low, high]| format!("{} .. {}", number(low), number(high)))
}

/// So many real tests.
pub(super) fn tests(count: usize) -> String {
    if count == 1 { "1 real test".to_owned() } else { format!("{count} real tests") }
}
