//! Changes in an XML file that leave the rest of it as it is: comments, order and layout.

use roxmltree::{Document, Node};
use std::ops::Range;

/// Changes of a text, by the places of what they replace.
#[derive(Default)]
pub(super) struct Changes(Vec<(Range<usize>, String)>);

impl Changes {
    /// Sets an attribute of an element, unless it has that value already; returns whether it changes.
    pub(super) fn set(&mut self, text: &str, element: Node, name: &str, value: &str) -> bool {
        match element.attribute_node(name) {
            Some(known) if is_same(known.value(), value) => return false,
            Some(known) => self.0.push((known.range_value(), value.to_owned())),
            None => {
                let last = element.attributes().map(|known| known.range().end).max();
                let end = last.unwrap_or_else(|| name_end(text, element));
                self.0.push((end..end, format!(" {name}=\"{value}\"")));
            }
        }
        true
    }

    /// Removes an attribute of an element, with the space before it.
    pub(super) fn remove(&mut self, text: &str, element: Node, name: &str) {
        if let Some(known) = element.attribute_node(name) {
            let space = text[..known.range().start].len() - text[..known.range().start].trim_end().len();
            self.0.push((known.range().start - space..known.range().end, String::new()));
        }
    }

    /// Adds a child before the others of an element: on a line of its own, if the element begins a line.
    pub(super) fn insert_child(&mut self, text: &str, element: Node, child: &str) {
        let line = |more: usize| {
            indent(text, element).map_or_else(String::new, |indent| format!("\n{}", " ".repeat(indent + more)))
        };
        let end = element.range().start + text.get(element.range()).map_or(0, start_tag_len);
        if text[..end].ends_with("/>") {
            let close = format!(">{}{child}{}</{}>", line(2), line(0), element.tag_name().name());
            self.0.push((end - 2..end, close));
        } else {
            self.0.push((end..end, format!("{}{child}", line(2))));
        }
    }

    /// The changed text.
    pub(super) fn apply(mut self, text: &str) -> String {
        // Stable: of several at one place, the first comes first.
        self.0.sort_by_key(|(range, _)| range.start);
        let (mut changed, mut done) = (String::with_capacity(text.len()), 0);
        for (range, new) in self.0 {
            changed.push_str(&text[done..range.start]);
            changed.push_str(&new);
            done = range.end;
        }
        changed + &text[done..]
    }
}

/// The child elements of this name.
pub(super) fn children<'a, 'i>(element: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    element.children().filter(move |child| child.has_tag_name(name))
}

/// The elements of this kind with this `name`.
pub(super) fn named<'a, 'i>(document: &'a Document<'i>, kind: &str, name: &str) -> Option<Node<'a, 'i>> {
    document.descendants().find(|node| node.has_tag_name(kind) && node.attribute("name") == Some(name))
}

/// Numbers of an attribute; `None` without it, or where it holds something else.
pub(super) fn numbers_of(element: Node, name: &str) -> Option<Vec<f64>> {
    element.attribute(name)?.split_whitespace().map(|number| number.parse().ok()).collect()
}

/// What two numbers may differ by, relative to them: numbers are written with ten digits.
pub(super) const ROUNDING: f64 = 1e-9;

/// Whether two values are the same text or the same numbers, of which a shorter list has 0 at its end.
pub(super) fn is_same(a: &str, b: &str) -> bool {
    let numbers = |text: &str| text.split_whitespace().map(|x| x.parse::<f64>().ok()).collect::<Option<Vec<f64>>>();
    let near = |a: f64, b: f64| (a - b).abs() <= ROUNDING * a.abs().max(b.abs());
    let all_near = |a: &[f64], b: &[f64]| {
        let at = |numbers: &[f64], k: usize| numbers.get(k).copied().unwrap_or(0.0);
        (0..a.len().max(b.len())).all(|k| near(at(a, k), at(b, k)))
    };
    a == b || numbers(a).zip(numbers(b)).is_some_and(|(a, b)| !a.is_empty() && !b.is_empty() && all_near(&a, &b))
}

/// Where the name of an element ends.
fn name_end(text: &str, element: Node) -> usize {
    let start = element.range().start + 1;
    let is_name = |c: char| !(c.is_whitespace() || c == '/' || c == '>');
    start + text[start..].find(|c| !is_name(c)).unwrap_or(0)
}

/// Length of the start tag at the beginning of a text, whose attributes may hold a `>`.
fn start_tag_len(text: &str) -> usize {
    let mut quote = None;
    for (i, c) in text.char_indices() {
        match (c, quote) {
            ('"' | '\'', None) => quote = Some(c),
            (c, Some(open)) if c == open => quote = None,
            ('>', None) => return i + 1,
            _ => {}
        }
    }
    text.len()
}

/// How far an element is indented; `None` where it does not begin a line.
fn indent(text: &str, element: Node) -> Option<usize> {
    let line = text[..element.range().start].rsplit('\n').next()?;
    line.trim().is_empty().then_some(line.len())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn what_is_not_changed_stays_as_it_is() {
        let text = "<?xml version=\"1.0\"?>\n<!-- <joint name='b'/> -->\n<robot>\n  <joint name='a > b'\n    damping = '1.0'/>\n\
                    \x20 <body name=\"x\"><!-- first --></body>\n</robot>\n";
        let document = Document::parse(text).unwrap();
        let joint = named(&document, "joint", "a > b").unwrap();
        let mut changes = Changes::default();
        assert!(changes.set(text, joint, "armature", "0.5"));
        assert!(!changes.set(text, joint, "damping", "1"));
        assert!(changes.set(text, joint, "damping", "2"));
        changes.insert_child(text, joint, "<limit/>");
        changes.insert_child(text, named(&document, "body", "x").unwrap(), "<inertial/>");
        let expected = "<?xml version=\"1.0\"?>\n<!-- <joint name='b'/> -->\n<robot>\n\
                        \x20 <joint name='a > b'\n    damping = '2' armature=\"0.5\">\n    <limit/>\n  </joint>\n\
                        \x20 <body name=\"x\">\n    <inertial/><!-- first --></body>\n</robot>\n";
        assert_eq!(changes.apply(text), expected);
    }

    #[test]
    fn what_stands_within_a_line_stays_there() {
        let text = "<a><b/><c x='1'></c></a>";
        let document = Document::parse(text).unwrap();
        let mut changes = Changes::default();
        document.root_element().children().for_each(|child| changes.insert_child(text, child, "<d/>"));
        assert_eq!(changes.apply(text), "<a><b><d/></b><c x='1'><d/></c></a>");
    }

    #[test]
    fn an_attribute_goes_with_the_space_before_it() {
        let text = "<inertial mass='1'\n  quat='1 0 0 0' pos='0 0 0'/>";
        let document = Document::parse(text).unwrap();
        let mut changes = Changes::default();
        changes.remove(text, document.root_element(), "quat");
        changes.remove(text, document.root_element(), "diaginertia");
        assert_eq!(changes.apply(text), "<inertial mass='1' pos='0 0 0'/>");
    }
}
