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
    /// Label above the marks, on the left.
    pub(crate) name: String,
    /// Marks, drawn in this order.
    pub(crate) pins: Vec<Pin>,
    /// Note above the marks, on the right.
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

/// Height of a row's marks and of a line of its words, which are above them, in px.
const MARKS: f64 = 24.0;
const WORDS: f64 = 16.0;
/// Width of the scale, which fits on a narrow screen, room above and below it, in px.
const SCALE: f64 = 430.0;
const TOP: f64 = 68.0;
const BOTTOM: f64 = 46.0;
/// Space beside the scale, in px.
const SIDE: f64 = 8.0;
/// Vertical distance of the inks of a legend within a row, in px.
const LANE: f64 = 7.0;
/// Minimum range of a logarithmic scale, so that small differences look small.
const LEAST_RATIO: [f64; 2] = [0.8, 3.0];
/// Width of a letter in px: a generous estimate, as the viewer chooses the font.
const LETTER: f64 = 7.2;

/// The rows as an SVG document.
pub(crate) fn rows(of: &Rows) -> String {
    RowFrame::new(of).draw(of)
}

/// Positions on the page.
struct RowFrame {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    width: f64,
    /// Height of a row.
    row: f64,
    /// Whether notes have a line below the names: beside them there is no room.
    stacked: bool,
    /// Where the entries of the legend begin, from the first one on.
    legend: Vec<(f64, f64)>,
    scale: RowScale,
    axis: Axis,
}

impl RowFrame {
    fn new(of: &Rows) -> Self {
        let letters = |row: &Row| (row.name.chars().count() + row.note.chars().count() + 2) as f64;
        let stacked = of.rows.iter().any(|row| LETTER * letters(row) > SCALE);
        let row = MARKS + WORDS * if stacked { 2.0 } else { 1.0 };
        let (left, right) = (SIDE, SIDE + SCALE);
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
        let names = of.legend.iter().map(|(_, name)| name).chain(of.lines.iter().map(|(.., name)| name));
        let legend = places(names, right - left);
        let width = (right + SIDE).max(8.8 * of.title.chars().count() as f64);
        let top = TOP + legend.last().map_or(0.0, |(_, y)| *y);
        let bottom = top + row * of.rows.len() as f64 + 8.0;
        RowFrame { left, right, top, bottom, width, row, stacked, legend, scale: of.scale, axis }
    }

    /// `None` where a value is outside the domain of the scale.
    fn at(&self, x: f64) -> Option<f64> {
        let place = match self.scale {
            RowScale::Ratio => x.log10(),
            RowScale::Bounds | RowScale::Amount => x,
        };
        place.is_finite().then(|| self.left + SCALE * self.axis.share(place).clamp(0.0, 1.0))
    }

    /// Where the marks of a row are.
    fn middle(&self, row: usize) -> f64 {
        self.top + self.row * (row as f64 + 1.0) - 0.5 * MARKS + 4.0
    }

    fn draw(&self, of: &Rows) -> String {
        let mut out = opening((self.width, self.bottom + BOTTOM), &of.title);
        let _ = writeln!(out, "<text class=\"title\" x=\"8\" y=\"20\">{}</text>", escaped(&of.title));
        self.grid(&mut out);
        for (ink, x, _) in &of.lines {
            let (class, top, bottom) = (stroke(*ink, "line dashes"), self.top, self.bottom);
            if let Some(x) = self.at(*x) {
                let _ = writeln!(out, "<line {class} x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{top}\" y2=\"{bottom:.1}\"/>");
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
        let (left, right, top, bottom) = (self.left, self.right, self.top, self.bottom);
        for (x, text) in ticks {
            let x = left + SCALE * self.axis.share(x);
            let _ = writeln!(out, "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{top}\" y2=\"{bottom:.1}\"/>");
            let half = 0.5 * LETTER * text.chars().count() as f64;
            let (x, y) = (x.clamp(half, self.width - half), bottom + 16.0);
            let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\">{text}</text>");
        }
        let (width, height) = (right - left, bottom - top);
        let _ = writeln!(
            out,
            "<rect class=\"frame\" x=\"{left:.1}\" y=\"{top}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
        );
    }

    /// The dots of one ink, from row to row.
    fn join(&self, ink: Ink, of: &Rows, out: &mut String) {
        let lane = lane(of, ink);
        let dot = |pin: &Pin| if let Pin::Dot(of, x) = *pin { (of == ink).then(|| self.at(x)).flatten() } else { None };
        let dots = of.rows.iter().enumerate().filter_map(|(k, row)| Some((row.pins.iter().find_map(dot)?, k)));
        let points: Vec<String> = dots.map(|(x, k)| format!("{x:.1},{:.1}", self.middle(k) + lane)).collect();
        if points.len() > 1 {
            let _ = writeln!(out, "<polyline {} points=\"{}\"/>", stroke(ink, "line"), points.join(" "));
        }
    }

    fn row(&self, k: usize, row: &Row, of: &Rows, out: &mut String) {
        let y = self.middle(k);
        let class = if row.strong { " class=\"over strong\"" } else { " class=\"over\"" };
        let (name, note) = (escaped(&row.name), escaped(&row.note));
        let (begin, end, note_y) = (self.left + 6.0, self.right - 6.0, y - 0.5 * MARKS);
        let name_y = if self.stacked { note_y - WORDS } else { note_y };
        let _ = writeln!(out, "<text{class} x=\"{begin:.1}\" y=\"{name_y:.1}\">{name}</text>");
        let _ = writeln!(out, "<text{class} x=\"{end:.1}\" y=\"{note_y:.1}\" text-anchor=\"end\">{note}</text>");
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
        let (end, y) = (self.right - 6.0, self.top - 7.0);
        let _ = writeln!(out, "<text x=\"{end:.1}\" y=\"{y}\" text-anchor=\"end\">{notes}</text>");
        let dots = of.legend.iter().map(|(ink, name)| (dot(*ink, 12.0, 0.0), name));
        let dashes = |ink| format!("<path {} d=\"M0 0h20\"/>", stroke(ink, "line dashes"));
        let entries = dots.chain(of.lines.iter().map(|(ink, _, name)| (dashes(*ink), name)));
        for ((mark, name), (x, y)) in entries.zip(&self.legend) {
            let (x, y) = (self.left + x, 42.0 + y);
            let _ = writeln!(
                out,
                "<g class=\"legend\" transform=\"translate({x:.1} {y})\">{mark}<text x=\"26\" y=\"4\">{}</text></g>",
                escaped(name)
            );
        }
    }
}

/// Vertical offset of an ink's marks from the middle of a row, in px.
fn lane(of: &Rows, ink: Ink) -> f64 {
    let place = of.legend.iter().position(|(listed, _)| *listed == ink);
    place.map_or(0.0, |k| LANE * (k as f64 - (of.legend.len() as f64 - 1.0) / 2.0))
}

/// Where the entries of a legend begin, in lines of at most this width.
fn places<'a>(names: impl Iterator<Item = &'a String>, width: f64) -> Vec<(f64, f64)> {
    let (mut x, mut y) = (0.0, 0.0);
    let place = |name: &'a String| {
        let wide = entry_width(name);
        if x > 0.0 && x + wide > width {
            (x, y) = (0.0, y + WORDS);
        }
        let begin = (x, y);
        x += wide;
        begin
    };
    names.map(place).collect()
}

/// Width of a legend entry with its mark, in px.
fn entry_width(name: &str) -> f64 {
    42.0 + LETTER * name.chars().count() as f64
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
    fn a_chart_fits_on_a_narrow_screen() {
        let row =
            Row { name: "a_long_name@joint".into(), note: "0.3805 kg (0.3046 .. 0.4754)".into(), ..Row::default() };
        let lines: Vec<_> = ["noise floor", "training logs, without any", "held-out logs"]
            .map(|name| (Ink::Truth, 1.0, name.to_owned()))
            .into();
        let chart = |row: Row| {
            let of = Rows {
                title: "Fall".into(),
                label: "error".into(),
                notes: String::new(),
                scale: RowScale::Ratio,
                lines: lines.clone(),
                legend: Vec::new(),
                rows: vec![row],
                joined: false,
            };
            RowFrame::new(&of)
        };
        let (short, long) = (chart(row.clone()), chart(Row { note: row.note.repeat(2), ..row }));
        assert!(short.width < 460.0 && long.width < 460.0);
        assert_eq!((short.stacked, long.stacked), (false, true), "a long note has a line of its own");
        assert_eq!(short.legend.iter().map(|(_, y)| *y).collect::<Vec<_>>(), [0.0, 0.0, WORDS]);
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
