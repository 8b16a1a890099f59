//! Formatting shared by the tables of a run.

pub(super) use btr_report::run_tables::span;

/// A number of real tests in words.
pub(super) fn tests(count: usize) -> String {
    if count == 1 { "1 real test".to_owned() } else { format!("{count} real tests") }
}
