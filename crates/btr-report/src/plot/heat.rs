//! Heat maps: numbers in a grid, coloured by size, each printed in its cell.

use super::svg::{escaped, opening};
use std::fmt::Write;

/// A grid of numbers with named rows and columns.
#[derive(Clone, Debug)]
pub(crate) struct Heat {
    /// Above the map.
    pub(crate) title: String,
    /// Names above the columns.
    pub(crate) columns: Vec<String>,
    /// Row names and their numbers: errors as a ratio, 1 at the noise floor.
    pub(crate) rows: Vec<(String, Vec<Option<f64>>)>,
}

/// Size of a cell, in px.
const CELL: (f64, f64) = (62.0, 24.0);
const LEFT: f64 = 215.0;
const LETTER: f64 = 6.6;
/// Minimum of the number at full colour, so that a map of small errors looks pale.
const LEAST_FULL: f64 = 10.0;

/// The map as an SVG document.
pub(crate) fn heat(map: &Heat) -> String {
    let widest = map.columns.iter().map(|name| name.chars().count()).max().unwrap_or(0) as f64 * LETTER;
    // Long names are rotated to fit narrow columns.
    let turned = widest > CELL.0 - 6.0;
    let top = 34.0 + if turned { widest * 0.75 + 12.0 } else { 20.0 };
    let title_width = 8.0 + 8.8 * map.title.chars().count() as f64;
    let turn_room = if turned { 0.75 * widest } else { 0.0 };
    let width = (LEFT + CELL.0 * map.columns.len() as f64 + turn_room + 12.0).max(title_width);
    let height = top + CELL.1 * map.rows.len() as f64 + 8.0;
    let mut out = opening((width, height), &map.title);
    let _ = writeln!(out, "<text class=\"title\" x=\"8\" y=\"20\">{}</text>", escaped(&map.title));
    for (k, name) in map.columns.iter().enumerate() {
        let (x, name) = (LEFT + CELL.0 * (k as f64 + 0.5), escaped(name));
        let _ = match turned {
            true => writeln!(out, "<text transform=\"translate({x:.1} {:.1}) rotate(-45)\">{name}</text>", top - 8.0),
            false => writeln!(out, "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{name}</text>", top - 8.0),
        };
    }
    let numbers = map.rows.iter().flat_map(|(_, numbers)| numbers.iter().flatten().copied());
    let full = numbers.filter(|x| x.is_finite()).fold(LEAST_FULL, f64::max);
    for (k, (name, numbers)) in map.rows.iter().enumerate() {
        let y = top + CELL.1 * k as f64;
        let text_y = y + CELL.1 / 2.0 + 4.0;
        let _ =
            writeln!(out, "<text x=\"{}\" y=\"{text_y:.1}\" text-anchor=\"end\">{}</text>", LEFT - 8.0, escaped(name));
        for (column, number) in numbers.iter().enumerate() {
            let strength = number.map_or(0.0, |number| strength(number, full));
            cell(&mut out, (LEFT + CELL.0 * column as f64, y), *number, strength);
        }
    }
    out + "</svg>\n"
}

fn cell(out: &mut String, (x, y): (f64, f64), number: Option<f64>, strength: f64) {
    let (width, height) = (CELL.0 - 2.0, CELL.1 - 2.0);
    let _ = writeln!(out, "<rect class=\"cell\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width}\" height=\"{height}\"/>");
    let _ = writeln!(
        out,
        "<rect class=\"heat\" fill-opacity=\"{strength:.2}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width}\" height=\"{height}\"/>"
    );
    let text = number.map_or_else(|| "–".to_owned(), short);
    let class = if strength > 0.6 { " class=\"hot\"" } else { "" };
    let (x, y) = (x + width / 2.0, y + height / 2.0 + 4.0);
    let _ = writeln!(out, "<text{class} x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\">{text}</text>");
}

/// Colour strength, 0 at 1 and 1 at `full`: logarithmic, as errors differ by orders of magnitude.
fn strength(number: f64, full: f64) -> f64 {
    (number.ln() / full.ln()).clamp(0.0, 1.0)
}

/// A number with as many digits as fit into a cell.
fn short(number: f64) -> String {
    match number {
        x if !x.is_finite() => "–".to_owned(),
        x if x < 9.95 => format!("{x:.1}"),
        x if x < 99_999.5 => format!("{x:.0}"),
        x => format!("{x:.0e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_in_its_cell_and_unknown_ones_are_dashes() {
        let rows = vec![("hold".to_owned(), vec![Some(1.04), None]), ("fast".to_owned(), vec![Some(250.3), Some(2e6)])];
        let map = Heat { title: "a < b".into(), columns: vec!["hip".into(), "a_rather_long_name".into()], rows };
        let svg = heat(&map);
        for text in [">1.0<", ">–<", ">250<", ">2e6<", ">hip<", ">a_rather_long_name<", ">hold<", "a &lt; b"] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        assert!(svg.contains("rotate(-45)") && svg.contains("fill-opacity=\"1.00\""), "{svg}");
    }
}
