//! Figures as SVG: panels with axes, lines, dots and a legend, readable on light and on dark paper.

pub(crate) mod axis;
pub(crate) mod heat;
mod panel;
pub(crate) mod paper;
pub(crate) mod rows;
mod svg;
mod title;

pub(crate) use panel::{Ink, Mark, Panel, Series, ShownState};
pub(crate) use svg::{escaped, figure};
