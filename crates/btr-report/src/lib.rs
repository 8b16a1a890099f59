//! HTML reports, figures as SVG, and the tables and sentences of the terminal.

pub mod base_parameters;
mod best_test;
pub mod bounds;
pub mod fell;
pub mod figures;
pub mod finding;
pub mod html;
mod paths;
pub mod plot;
pub mod run_tables;
mod subject;
pub mod table;
pub mod text;

pub use subject::Subject;
