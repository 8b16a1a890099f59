//! Rows of marks on a common scale: an error ladder, candidates, values between their bounds.

use super::axis::{Axis, decades};
use super::panel::Ink;
use super::svg::{escaped, opening, stroke};
use std::fmt::Write;

/// A mark in a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Pin {
    /// A value.
    Dot(Ink, f64),
    /// An interval.
    Span(Ink, f64, f64),
    /// The change from one value to another.
    Stem(Ink, f64, f64),
}

/// A row.
#[derive(Clone, Debug, Default)]
pub(crate) struct Row {
    /// Label on the left.
    pub(crate) name: String,
    /// Marks, drawn in this order.
    pub(crate) pins: Vec<Pin>,
    /// Note on the right.
    pub(crate) note: String,
    /// Whether the row is emphasised.
    pub(crate) strong: bool,
}

/// The scale of all rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RowScale {
    /// Logarithmic; values that are not positive are left out.
    Ratio,
    /// From one bound (0) to the other (1).
    Bounds,
    /// Linear.
    Amount,
}

/// A chart of rows.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    /// Title above the rows.
    pub(crate) title: String,
    /// Label below the scale, with the unit.
    pub(crate) label: String,
    /// Header of the notes.
    pub(crate) notes: String,
    /// The scale.
    pub(crate) scale: RowScale,
    /// Vertical lines with their names.
    pub(crate) lines: Vec<(Ink, f64, String)>,
    /// Names of the inks of dots.
    pub(crate) legend: Vec<(Ink, String)>,
    /// The rows from top to bottom.
    pub(crate) rows: Vec<Row>,
    /// Whether dots of the same ink are joined from row to row.
    pub(crate) joined: bool,
}

/// Height of a row, width of the scale, room above and below it, in px.
const ROW: f64 = 26.0;
const SCALE: f64 = 420.0;
const TOP: f64 = 68.0;
const BOTTOM: f64 = 46.0;
/// Space between names, scale and notes, in px.
const GAP: f64 = 14.0;
/// Vertical distance of the inks of a legend within a row, in px.
const LANE: f64 = 7.0;
/// Minimum range of a logarithmic scale, so that small differences look small.
const LEAST_RATIO: [f64; 2] = [0.8, 3.0];
/// Width of a letter in px: a generous estimate, as the viewer chooses the font.
const LETTER: f64 = 8.0;

/// The rows as an SVG document.
pub(crate) fn rows(of: &Rows) -> String {
    RowFrame::new(of).draw(of)
}

/// Positions on the page.
struct RowFrame {
    left: f64,
    right: f64,
    bottom: f64,
    width: f64,
    scale: RowScale,
    axis: Axis,
}

impl RowFrame {
    fn new(of: &Rows) -> Self {
        let widest = |texts: &mut dyn Iterator<Item = &String>| {
            texts.map(|text| text.chars().count()).max().unwrap_or(0) as f64 * LETTER
        };
        let left = widest(&mut of.rows.iter().map(|row| &row.name)).max(90.0) + GAP;
        let notes = widest(&mut of.rows.iter().map(|row| &row.note).chain([&of.notes]));
        let right = left + SCALE;
        let values = of.rows.iter().flat_map(|row| &row.pins).flat_map(|pin| match *pin {
            Pin::Dot(_, x) => [x, x],
            Pin::Span(_, a, b) | Pin::Stem(_, a, b) => [a, b],
        });
        let values = values.chain(of.lines.iter().map(|line| line.1));
        let axis = match of.scale {
            RowScale::Ratio => Axis::over(values.chain(LEAST_RATIO).filter(|x| *x > 0.0).map(f64::log10), 6, 0.03),
            RowScale::Bounds => Axis::over([0.0, 1.0].into_iter(), 4, 0.03),
            RowScale::Amount => Axis::over(values.chain([0.0]), 6, 0.03),
        };
        let legend = of.legend.iter().map(|(_, name)| name).chain(of.lines.iter().map(|(.., name)| name));
        let legend = left + legend.map(|name| entry_width(name)).sum::<f64>();
        let width = (right + GAP + notes + 8.0).max(8.8 * of.title.chars().count() as f64).max(legend);
        RowFrame { left, right, bottom: TOP + ROW * of.rows.len() as f64 + 8.0, width, scale: of.scale, axis }
    }

    /// `None` where a value is outside the domain of the scale.
    fn at(&self, x: f64) -> Option<f64> {
        let place = match self.scale {
            RowScale::Ratio => x.log10(),
            RowScale::Bounds | RowScale::Amount => x,
        };
        place.is_finite().then(|| self.left + SCALE * self.axis.share(place).clamp(0.0, 1.0))
    }

    fn middle(row: usize) -> f64 {
        TOP + ROW * (row as f64 + 0.5) + 4.0
    }

    fn draw(&self, of: &Rows) -> String {
        let mut out = opening((self.width, self.bottom + BOTTOM), &of.title);
        let _ = writeln!(out, "<text class=\"title\" x=\"8\" y=\"20\">{}</text>", escaped(&of.title));
        self.grid(&mut out);
        for (ink, x, _) in &of.lines {
            let (class, bottom) = (stroke(*ink, "line dashes"), self.bottom);
            if let Some(x) = self.at(*x) {
                let _ = writeln!(out, "<line {class} x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{bottom:.1}\"/>");
            }
        }
        if of.joined {
            of.legend.iter().for_each(|(ink, _)| self.join(*ink, of, &mut out));
        }
        for (k, row) in of.rows.iter().enumerate() {
            self.row(k, row, of, &mut out);
        }
        self.words(of, &mut out);
        out + "</svg>\n"
    }

    fn grid(&self, out: &mut String) {
        let ticks = match self.scale {
            RowScale::Ratio => decades(&self.axis),
            RowScale::Amount => self.axis.ticks(),
            RowScale::Bounds => [(0.0, "lower bound"), (0.5, "middle"), (1.0, "upper bound")]
                .map(|(x, name)| (x, name.to_owned()))
                .to_vec(),
        };
        let (left, right, bottom) = (self.left, self.right, self.bottom);
        for (x, text) in ticks {
            let x = left + SCALE * self.axis.share(x);
            let _ = writeln!(out, "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{bottom:.1}\"/>");
            let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{text}</text>", bottom + 16.0);
        }
        let (width, height) = (right - left, bottom - TOP);
        let _ = writeln!(
            out,
            "<rect class=\"frame\" x=\"{left:.1}\" y=\"{TOP}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
        );
    }

    /// The dots of one ink, from row to row.
    fn join(&self, ink: Ink, of: &Rows, out: &mut String) {
        let lane = lane(of, ink);
        let dot = |pin: &Pin| if let Pin::Dot(of, x) = *pin { (of == ink).then(|| self.at(x)).flatten() } else { None };
        let dots = of.rows.iter().enumerate().filter_map(|(k, row)| Some((row.pins.iter().find_map(dot)?, k)));
        let points: Vec<String> = dots.map(|(x, k)| format!("{x:.1},{:.1}", Self::middle(k) + lane)).collect();
        if points.len() > 1 {
            let _ = writeln!(out, "<polyline {} points=\"{}\"/>", stroke(ink, "line"), points.join(" "));
        }
    }

    fn row(&self, k: usize, row: &Row, of: &Rows, out: &mut String) {
        let y = Self::middle(k);
        let class = if row.strong { " class=\"strong\"" } else { "" };
        let (name, note) = (escaped(&row.name), escaped(&row.note));
        let (text_y, end, start) = (y + 4.0, self.left - GAP / 2.0, self.right + GAP);
        let _ = writeln!(out, "<text{class} x=\"{end:.1}\" y=\"{text_y:.1}\" text-anchor=\"end\">{name}</text>");
        let _ = writeln!(out, "<text{class} x=\"{start:.1}\" y=\"{text_y:.1}\">{note}</text>");
        for pin in &row.pins {
            let (Pin::Dot(ink, _) | Pin::Span(ink, ..) | Pin::Stem(ink, ..)) = *pin;
            self.pin(*pin, y + lane(of, ink), out);
        }
    }

    fn pin(&self, pin: Pin, y: f64, out: &mut String) {
        let line = |ink, class: &str, from: f64, to: f64| {
            let (from, to) = (self.at(from)?, self.at(to)?);
            // A line without visible length is covered by its dot.
            if (from - to).abs() < 0.1 {
                return None;
            }
            let look = stroke(ink, class);
            Some(format!("<path {look} d=\"M{from:.1} {y:.1}L{to:.1} {y:.1}\"/>"))
        };
        let drawn = match pin {
            Pin::Dot(ink, x) => self.at(x).map(|x| dot(ink, x, y)),
            Pin::Span(ink, from, to) => line(ink, "span", from, to),
            Pin::Stem(ink, from, to) => line(ink, "stem", from, to),
        };
        drawn.into_iter().for_each(|drawn| _ = writeln!(out, "{drawn}"));
    }

    /// The label of the scale, the header of the notes, and the legend.
    fn words(&self, of: &Rows, out: &mut String) {
        let middle = (self.left + self.right) / 2.0;
        let (label, notes) = (escaped(&of.label), escaped(&of.notes));
        let _ = writeln!(
            out,
            "<text x=\"{middle:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
            self.bottom + 36.0
        );
        let _ = writeln!(out, "<text x=\"{:.1}\" y=\"{}\">{notes}</text>", self.right + GAP, TOP - 7.0);
        let (mut x, y) = (self.left, 42.0);
        let dots = of.legend.iter().map(|(ink, name)| (dot(*ink, 12.0, 0.0), name));
        let dashes = |ink| format!("<path {} d=\"M0 0h20\"/>", stroke(ink, "line dashes"));
        for (mark, name) in dots.chain(of.lines.iter().map(|(ink, _, name)| (dashes(*ink), name))) {
            let _ = writeln!(
                out,
                "<g class=\"legend\" transform=\"translate({x:.1} {y})\">{mark}<text x=\"26\" y=\"4\">{}</text></g>",
                escaped(name)
            );
            x += entry_width(name);
        }
    }
}

/// Vertical offset of an ink's marks from the middle of a row, in px.
fn lane(of: &Rows, ink: Ink) -> f64 {
    let place = of.legend.iter().position(|(listed, _)| *listed == ink);
    place.map_or(0.0, |k| LANE * (k as f64 - (of.legend.len() as f64 - 1.0) / 2.0))
}

/// Width of a legend entry with its mark, in px.
fn entry_width(name: &str) -> f64 {
    42.0 + 0.9 * LETTER * name.chars().count() as f64
}

fn dot(ink: Ink, x: f64, y: f64) -> String {
    // The round end of a zero-length line, as for all dots.
    format!("<path {} d=\"M{x:.1} {y:.1}h.01\"/>", stroke(ink, "dots pin"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(scale: RowScale, pins: Vec<Pin>) -> String {
        let row = Row { name: "a < b".into(), pins, note: "1.0".into(), strong: true };
        let lines = vec![(Ink::Truth, 1.0, "noise floor".into())];
        let legend = vec![(Ink::Main, "learnt".into())];
        let rows_of = vec![row.clone(), row];
        let (title, label, notes) = ("Fall".into(), "error".into(), String::new());
        rows(&Rows { title, label, notes, scale, lines, legend, rows: rows_of, joined: true })
    }

    #[test]
    fn values_outside_the_scale_are_left_out() {
        let svg = drawn(RowScale::Ratio, vec![Pin::Dot(Ink::Main, 10.0), Pin::Dot(Ink::Second, 0.0)]);
        assert_eq!(svg.matches("dots pin").count(), 2 + 1, "two rows and the legend: {svg}");
        let svg =
            drawn(RowScale::Ratio, vec![Pin::Span(Ink::Main, f64::INFINITY, 1.0), Pin::Stem(Ink::Main, 1.0, 2.0)]);
        assert!(
            !svg.contains("span\"") && svg.contains("stem\"") && !svg.contains("NaN") && !svg.contains("inf"),
            "{svg}"
        );
    }

    #[test]
    fn names_are_text_and_lines_are_in_the_legend() {
        let svg = drawn(RowScale::Bounds, vec![Pin::Dot(Ink::Main, 0.3)]);
        for text in [">a &lt; b<", ">noise floor<", ">learnt<", ">lower bound<", "<title>Fall</title>"] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        assert_eq!(svg.matches("<polyline").count(), 1, "{svg}");
    }
}
