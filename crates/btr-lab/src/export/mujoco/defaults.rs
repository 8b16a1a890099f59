//! What the default classes of an MJCF file give its elements.

use super::super::xml::children;
use roxmltree::{Document, Node};

/// The elements by which a class states what actuators have: all of them set the same values.
const ACTUATORS: [&str; 10] =
    ["general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder", "muscle", "adhesion", "dcmotor"];

/// The value that an attribute of an element has where the element does not state it: that of its class, or of one
/// around it, or MuJoCo's own. `None` where it is in another file, or not known.
pub(super) fn default_of<'a>(document: &'a Document, element: Node, name: &str) -> Option<&'a str> {
    let is_class = |node: &Node| node.has_tag_name("default");
    let class =
        element.attribute("class").or_else(|| element.ancestors().find_map(|node| node.attribute("childclass")));
    let mut classes: Vec<Node> = Vec::new();
    if let Some(class) = class {
        let named = |node: &Node| is_class(node) && node.attribute("class") == Some(class);
        classes.extend(document.descendants().find(named)?.ancestors().filter(is_class));
    }
    // All classes at the top are one, and the last of them counts.
    let mut tops: Vec<Node> = children(document.root_element(), "default").collect();
    tops.reverse();
    classes.extend(tops);
    let tag = element.tag_name().name();
    classes.iter().find_map(|class| stated_in(class, tag, name)).unwrap_or_else(|| built_in(tag, name))
}

/// What MuJoCo itself gives a joint.
fn built_in(tag: &str, name: &str) -> Option<&'static str> {
    let is_zero = ["armature", "damping", "frictionloss", "stiffness", "springref"].contains(&name);
    (tag == "joint" && is_zero).then_some("0")
}

/// What a class itself states of an attribute: a value, or that it is not known, as another element may set it.
fn stated_in<'a>(class: &Node<'a, '_>, tag: &str, name: &str) -> Option<Option<&'a str>> {
    let is_other = |child: &Node| ACTUATORS.contains(&child.tag_name().name()) && !child.has_tag_name(tag);
    if ACTUATORS.contains(&tag) && class.children().any(|child| is_other(&child)) {
        return Some(None);
    }
    let of_tag = class.children().filter(|child| child.has_tag_name(tag));
    of_tag.filter_map(|child| child.attribute(name)).next_back().map(Some)
}
