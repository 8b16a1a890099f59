//! What people look at: HTML reports, figures as SVG, tables and sentences for the terminal.

pub mod figures;
pub mod html;
pub mod plot;
pub mod table;
pub mod text;
