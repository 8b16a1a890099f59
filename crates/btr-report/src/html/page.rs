//! A page as sections of blocks, and their HTML.

use super::player;
use super::player::Player;
use crate::plot::escaped;
use std::fmt::Write;

/// A report.
pub(super) struct Report {
    /// Heading and window title.
    pub(super) title: String,
    /// The sections in order.
    pub(super) sections: Vec<Section>,
    /// Stands after the first section.
    pub(super) player: Option<Player>,
}

/// A section of a report.
pub(super) struct Section {
    /// Heading and entry in the contents.
    pub(super) title: String,
    /// The blocks in order.
    pub(super) blocks: Vec<Block>,
}

/// A block of a section.
pub(super) enum Block {
    /// The main result, highlighted.
    Lead(String),
    /// A paragraph.
    Text(String),
    /// Preformatted text to type or paste.
    Code(String),
    /// A bulleted list.
    List(Vec<String>),
    /// A table; the first column is text, the others numbers.
    Table {
        /// The header row.
        header: Vec<String>,
        /// The other rows.
        rows: Vec<Vec<String>>,
    },
    /// SVG documents side by side, scaled to the width of the page.
    Plots(Vec<String>),
    /// SVG documents in their own size, scrolled where they are too wide.
    Maps(Vec<String>),
}

const STYLE: &str = "
:root{color-scheme:light dark;--ink:#222;--soft:#666;--paper:#fff;--line:#ddd;--head:#f4f5f7}
@media(prefers-color-scheme:dark){:root{--ink:#d6d6d6;--soft:#999;--paper:#15181c;--line:#333840;--head:#1e2228}}
body{margin:0 auto;max-width:84rem;padding:1rem;background:var(--paper);color:var(--ink);
font:16px/1.5 system-ui,-apple-system,'Segoe UI',Helvetica,Arial,sans-serif}
h1{font-size:1.5rem;margin:.5rem 0}h2{font-size:1.2rem;margin:2.2rem 0 .6rem;border-bottom:1px solid var(--line)}
nav a{display:inline-block;margin:0 1rem .3rem 0;color:inherit}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,24rem),1fr));gap:.6rem}
.plots svg{width:100%;height:auto;max-width:38rem}.maps{display:flex;flex-wrap:wrap;gap:1rem}
.scroll{overflow-x:auto;max-width:100%}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.9rem}
th,td{padding:.25rem .7rem;border-bottom:1px solid var(--line);text-align:right;white-space:nowrap}
th:first-child,td:first-child{text-align:left}th{background:var(--head)}
@media(max-width:40rem){table{font-size:.75rem}th,td{padding:.25rem .2rem;white-space:normal}
td:first-child{overflow-wrap:anywhere}}
.lead{font-size:1.15rem;padding:.7rem 1rem;border-left:5px solid #0b62b0;background:var(--head)}
pre{padding:.6rem 1rem;background:var(--head);white-space:pre-wrap;font-size:.85rem}
footer{margin-top:3rem;color:var(--soft);font-size:.85rem}";

impl Report {
    /// The whole document.
    pub(super) fn html(&self) -> String {
        let title = escaped(&self.title);
        let scripts =
            self.player.as_ref().map_or_else(String::new, |_| format!("; script-src {}", Player::script_source()));
        let look = self.player.as_ref().map_or("", |_| player::STYLE);
        let mut out = format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'{scripts}\"/>\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
             <title>{title}</title>\n<style>{STYLE}{look}</style>\n</head>\n<body>\n<h1>{title}</h1>\n<nav>"
        );
        for (k, section) in self.sections.iter().enumerate() {
            push(&mut out, format_args!("<a href=\"#s{k}\">{}</a>", escaped(&section.title)));
        }
        out.push_str("</nav>\n");
        for (k, section) in self.sections.iter().enumerate() {
            push(&mut out, format_args!("<section id=\"s{k}\">\n<h2>{}</h2>\n", escaped(&section.title)));
            section.blocks.iter().for_each(|block| block.write(&mut out));
            out.push_str("</section>\n");
            if let Some(player) = self.player.as_ref().filter(|_| k == 0) {
                out.push_str(&player.html());
            }
        }
        push(&mut out, format_args!("<footer>btr {}</footer>\n</body>\n</html>\n", env!("CARGO_PKG_VERSION")));
        out
    }
}

impl Block {
    pub(super) fn write(&self, out: &mut String) {
        match self {
            Block::Lead(text) => push(out, format_args!("<p class=\"lead\">{}</p>\n", escaped(text))),
            Block::Code(text) => push(out, format_args!("<pre>{}</pre>\n", escaped(text))),
            Block::Text(text) => push(out, format_args!("<p>{}</p>\n", escaped(text))),
            Block::List(lines) => {
                let items: String = lines.iter().map(|line| format!("<li>{}</li>\n", escaped(line))).collect();
                push(out, format_args!("<ul>\n{items}</ul>\n"));
            }
            Block::Table { header, rows } => {
                let row = |cells: &[String], tag: &str| {
                    let cells: String = cells.iter().map(|c| format!("<{tag}>{}</{tag}>", escaped(c))).collect();
                    format!("<tr>{cells}</tr>\n")
                };
                let body: String = rows.iter().map(|cells| row(cells, "td")).collect();
                push(out, format_args!("<div class=\"scroll\"><table>\n{}{body}</table></div>\n", row(header, "th")));
            }
            Block::Plots(plots) => push(out, format_args!("<div class=\"plots\">\n{}</div>\n", plots.concat())),
            Block::Maps(maps) => {
                let maps: String = maps.iter().map(|map| format!("<div class=\"scroll\">{map}</div>\n")).collect();
                push(out, format_args!("<div class=\"maps\">\n{maps}</div>\n"));
            }
        }
    }
}

/// Appends text; writing to a string cannot fail.
fn push(out: &mut String, text: std::fmt::Arguments) {
    let _ = out.write_fmt(text);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_loads_nothing_and_escapes_names() {
        let table = Block::Table { header: vec!["a".into()], rows: vec![vec!["<b>".into()]] };
        let blocks = vec![Block::Text("x & y".into()), table, Block::List(vec!["<i>".into()])];
        let report =
            Report { title: "<script>".into(), sections: vec![Section { title: "one".into(), blocks }], player: None };
        let html = report.html();
        assert!(html.contains("default-src 'none'") && !html.contains("<script") && !html.contains("http:"), "{html}");
        assert!(html.contains("x &amp; y") && html.contains("<td>&lt;b&gt;</td>") && html.contains("href=\"#s0\""));
    }
}
