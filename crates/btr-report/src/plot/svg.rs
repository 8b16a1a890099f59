//! Renders panels as SVG.

use super::axis::Axis;
use super::panel::{Ink, Mark, Panel, Series, ShownState};
use super::title::Title;
use std::fmt::Write;

/// A panel with its labels, and the plot inside it, in px.
const CELL: (f64, f64) = (460.0, 280.0);
const LEFT: f64 = 66.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 50.0;
const BOTTOM: f64 = 46.0;
/// Width of a letter of the legend, in px. The viewer chooses the font, so this is generous.
const LETTER: f64 = 7.2;

/// Colours for light paper, and for dark paper where the viewer asks for it. Blue and orange differ for the
/// colour-blind.
const STYLE: &str = "<style>
text{font:12px system-ui,-apple-system,'Segoe UI',Helvetica,Arial,sans-serif;fill:#333}
.title{font-size:14px;font-weight:600;fill:#111}.long{font-size:12px}
.paper{fill:#fff}.frame{fill:none;stroke:#999}.grid{stroke:#e6e6e6}.mark{stroke:#c4c4c4;stroke-dasharray:2 3}
.main{stroke:#0b62b0}.second{stroke:#d9730d}.third{stroke:#a3479c}.fourth{stroke:#0f857a}.alarm{stroke:#c5221f}.truth{stroke:#5c5c5c}
.over{paint-order:stroke;stroke:#fff;stroke-width:4px;stroke-linejoin:round}
.hidden{display:none}.line,.dots,.span,.stem{fill:none}.strong{font-weight:600}
.cell{fill:#eee}.heat{fill:#b3261e}.hot{fill:#fff}
.line{stroke-width:1.8;stroke-linejoin:round}.dashes{stroke-dasharray:6 4}.broad{stroke-width:5;stroke-opacity:.55}.dots{stroke-width:3.4;stroke-linecap:round}
.pin{stroke-width:8}.span{stroke-width:5;stroke-opacity:.45}.stem{stroke-width:1.4;stroke-opacity:.6}
@media(prefers-color-scheme:dark){text{fill:#c8c8c8}.title{fill:#eee}.paper{fill:#15181c}.frame{stroke:#666}
.grid{stroke:#2a2e34}.mark{stroke:#4a4f57}.main{stroke:#5aa9f0}.second{stroke:#f2a154}.third{stroke:#d68ad0}.fourth{stroke:#4cc3b3}.alarm{stroke:#f28b82}.truth{stroke:#a5a5a5}
.over{stroke:#15181c}.shade{filter:invert(1)}.cell{fill:#23272e}.heat{fill:#e0584e}}
</style>";

/// Appends a formatted line; writing to a string cannot fail.
macro_rules! line {
    ($out:expr, $($format:tt)*) => {{ let _ = writeln!($out, $($format)*); }};
}

/// A figure of panels, row by row with `columns` in each, as an SVG document.
pub(crate) fn figure(panels: &[Panel], columns: usize) -> String {
    let columns = columns.max(1);
    let rows = panels.len().div_ceil(columns);
    let (width, height) = (CELL.0 * columns.min(panels.len()) as f64, CELL.1 * rows as f64);
    let titles: Vec<&str> = panels.iter().map(|panel| panel.title.as_str()).collect();
    let mut out = opening((width, height), &titles.join("; "));
    for (i, panel) in panels.iter().enumerate() {
        let (x, y) = (CELL.0 * (i % columns) as f64, CELL.1 * (i / columns) as f64);
        line!(out, "<g transform=\"translate({x} {y})\">");
        Frame::new(panel).draw(panel, &mut out);
        line!(out, "</g>");
    }
    out + "</svg>\n"
}

/// The beginning of a document of this width and height in px, up to its paper. The title is for screen readers.
pub(super) fn opening((width, height): (f64, f64), title: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" viewBox=\"0 0 {width:.0} {height:.0}\" \
         width=\"{width:.0}\" height=\"{height:.0}\">\n<title>{}</title>\n{STYLE}\n\
         <rect class=\"paper\" width=\"{width:.0}\" height=\"{height:.0}\"/>\n",
        escaped(title)
    )
}

/// Maps values to positions on the page.
struct Frame {
    x: Axis,
    y: Axis,
}

impl Frame {
    fn new(panel: &Panel) -> Self {
        let points = || panel.series.iter().flat_map(|s| &s.points);
        let x = points().map(|p| p.0).chain(panel.marks_x.iter().copied());
        let y = points().map(|p| p.1).chain(panel.show_y.iter().copied());
        Frame { x: Axis::over(x, 6, 0.0), y: Axis::over(y, 5, 0.06) }
    }

    fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let (width, height) = (CELL.0 - LEFT - RIGHT, CELL.1 - TOP - BOTTOM);
        (LEFT + width * self.x.share(x), TOP + height * (1.0 - self.y.share(y)))
    }

    fn draw(&self, panel: &Panel, out: &mut String) {
        let (right, bottom) = (CELL.0 - RIGHT, CELL.1 - BOTTOM);
        for (x, text) in self.x.ticks() {
            let (x, _) = self.at((x, 0.0));
            line!(out, "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{bottom}\"/>");
            line!(out, "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{text}</text>", bottom + 16.0);
        }
        for (y, text) in self.y.ticks() {
            let (_, y) = self.at((0.0, y));
            line!(out, "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{right}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>");
            line!(out, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>", LEFT - 6.0, y + 4.0);
        }
        for x in &panel.marks_x {
            let (x, _) = self.at((*x, 0.0));
            line!(out, "<line class=\"mark\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{bottom}\"/>");
        }
        let (width, height) = (right - LEFT, bottom - TOP);
        let time = panel.over_log.map_or_else(String::new, |log| {
            format!(" data-log=\"{log}\" data-from=\"{}\" data-to=\"{}\"", self.x.min, self.x.max)
        });
        line!(out, "<rect class=\"frame\" x=\"{LEFT}\" y=\"{TOP}\" width=\"{width}\" height=\"{height}\"{time}/>");
        for series in &panel.series {
            of_state(series, out, |out| self.draw_series(series, out));
        }
        labels(panel, out);
        legend(panel, out);
    }

    fn draw_series(&self, series: &Series, out: &mut String) {
        let look = stroke(series.ink, class(series.mark));
        let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
        if series.mark == Mark::Dots {
            // Dots are the round ends of zero-length lines: one element for all of them keeps the file small.
            let dots = series.points.iter().filter(|p| finite(p)).map(|p| self.at(*p));
            let path: String = dots.map(|(x, y)| format!("M{x:.1} {y:.1}h.01")).collect();
            line!(out, "<path {look} d=\"{path}\"/>");
            return;
        }
        for run in series.points.split(|p| !finite(p)).filter(|run| !run.is_empty()) {
            let points: Vec<String> = run.iter().map(|p| self.at(*p)).map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            line!(out, "<polyline {look} points=\"{}\"/>", points.join(" "));
        }
    }
}

/// What `draw` writes of a series, for the player to show and to hide.
fn of_state(series: &Series, out: &mut String, draw: impl FnOnce(&mut String)) {
    let Some(ShownState { number, hidden }) = series.state else { return draw(out) };
    let class = if hidden { " class=\"hidden\"" } else { "" };
    line!(out, "<g data-state=\"{number}\"{class}>");
    draw(out);
    line!(out, "</g>");
}

/// The classes of a mark.
fn class(mark: Mark) -> &'static str {
    match mark {
        Mark::Line => "line",
        Mark::Broad => "line broad",
        Mark::Dashes => "line dashes",
        Mark::Dots => "dots",
    }
}

/// The attributes of a stroke: the classes of its ink and its mark, and its colour where it is a shade.
pub(super) fn stroke(ink: Ink, mark: &str) -> String {
    let name = match ink {
        Ink::Main => "main",
        Ink::Second => "second",
        Ink::Third => "third",
        Ink::Fourth => "fourth",
        Ink::Alarm => "alarm",
        Ink::Truth => "truth",
        Ink::Shade(shade) => {
            let grey = (215.0 * shade.clamp(0.0, 1.0)).round() as u8;
            return format!("class=\"shade {mark}\" stroke=\"#{grey:02x}{grey:02x}{grey:02x}\"");
        }
    };
    format!("class=\"{name} {mark}\"")
}

fn labels(panel: &Panel, out: &mut String) {
    let middle_x = (LEFT + CELL.0 - RIGHT) / 2.0;
    let middle_y = (TOP + CELL.1 - BOTTOM) / 2.0;
    let title = title(panel);
    for (words, y) in title.lines() {
        line!(out, "<text class=\"{}\" x=\"{LEFT}\" y=\"{y}\">{}</text>", title.class(), escaped(words));
    }
    let x_label = escaped(&panel.x_label);
    line!(out, "<text x=\"{middle_x}\" y=\"{}\" text-anchor=\"middle\">{x_label}</text>", CELL.1 - 10.0);
    let y_label = escaped(&panel.y_label);
    line!(out, "<text transform=\"translate(16 {middle_y}) rotate(-90)\" text-anchor=\"middle\">{y_label}</text>");
}

/// The legend, between title and frame, where it covers no data. Names of series that are hidden until they are chosen
/// stand in one place, to the right of the title.
fn legend(panel: &Panel, out: &mut String) {
    let mut x = LEFT;
    line!(out, "<g class=\"legend\">");
    for series in &panel.series {
        let Some(name) = &series.name else { continue };
        if series.state.is_some_and(|state| state.hidden) {
            of_state(series, out, |out| beside_title(&title(panel), name, series, out));
            continue;
        }
        let y = TOP - 12.0;
        let (from, length) = if series.mark == Mark::Dots { (x + 10.0, 0.01) } else { (x, 20.0) };
        of_state(series, out, |out| {
            let look = stroke(series.ink, class(series.mark));
            line!(out, "<path {look} d=\"M{from} {y}h{length}\"/>");
            line!(out, "<text x=\"{}\" y=\"{}\">{}</text>", x + 25.0, y + 4.0, escaped(name));
        });
        x += 42.0 + LETTER * name.chars().count() as f64;
    }
    line!(out, "</g>");
}

fn title(panel: &Panel) -> Title {
    Title::new(&panel.title, CELL.0 - LEFT - RIGHT)
}

/// A legend's entry at the right end of the title's last line, shortened to what the title leaves.
fn beside_title(title: &Title, name: &str, series: &Series, out: &mut String) {
    let (right, y) = (CELL.0 - RIGHT, title.baseline);
    let most = ((title.rest - 40.0) / LETTER).max(4.0) as usize;
    let short: String = match name.chars().count() > most {
        true => name.chars().take(most - 1).chain(['…']).collect(),
        false => name.to_owned(),
    };
    let look = stroke(series.ink, class(series.mark));
    line!(out, "<path {look} d=\"M{} {}h20\"/>", right - 20.0, y - 4.0);
    line!(out, "<text x=\"{}\" y=\"{y}\" text-anchor=\"end\">{}</text>", right - 25.0, escaped(&short));
}

/// Text with markup characters escaped.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(series: Vec<Series>) -> String {
        figure(&[Panel { title: "a < b & c".into(), series, ..Panel::default() }], 2)
    }

    #[test]
    fn missing_samples_are_gaps() {
        let points = vec![(0.0, 0.0), (1.0, 1.0), (2.0, f64::NAN), (3.0, 0.0), (4.0, 1.0)];
        let svg = drawn(vec![Series::nameless(Ink::Main, Mark::Line, points.clone())]);
        assert_eq!(svg.matches("<polyline").count(), 2);
        let svg = drawn(vec![Series::nameless(Ink::Shade(0.0), Mark::Dots, points)]);
        assert_eq!(svg.matches("h.01").count(), 4);
        assert!(!svg.contains("NaN"), "{svg}");
    }

    #[test]
    fn names_are_in_the_legend_and_markup_in_titles_is_text() {
        let svg = drawn(vec![Series::new("best", Ink::Main, Mark::Line, vec![(0.0, 0.0)])]);
        assert!(svg.contains(">best</text>") && svg.contains(">a &lt; b &amp; c</text>"), "{svg}");
    }
}
