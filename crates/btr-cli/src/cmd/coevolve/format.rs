//! Formatting shared by the tables of a run.

pub(super) use btr_report::run_tables::span;
