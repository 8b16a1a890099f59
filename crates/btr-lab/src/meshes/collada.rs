//! COLLADA (`.dae`): the geometries that its scene places. The direction that a file calls up is not used, as in ROS.

use super::bounds::{Bounds, point};
use nalgebra::{Matrix4, Unit, Vector3};
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::HashMap;

/// Elements of a file.
const MOST_NODES: u32 = 1_000_000;
/// Elements and vertices that a scene may place: a geometry many times, and nodes in each other.
const MOST_PLACED: usize = 20_000_000;

/// The box of a COLLADA file, in m.
///
/// # Errors
/// A file that is no COLLADA, or whose scene places nothing.
pub(super) fn bounds(bytes: &[u8]) -> Result<Bounds, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is no text".to_owned())?;
    let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| format!("it is no XML: {error}"))?;
    let unit = document.descendants().find(|node| is(*node, "unit")).and_then(|unit| unit.attribute("meter"));
    let metres = unit.and_then(|metres| metres.trim().parse::<f64>().ok()).unwrap_or(1.0);
    let mut scene = Scene {
        by_id: document.descendants().filter_map(|node| Some((node.attribute("id")?, node))).collect(),
        bounds: Bounds::none(),
        placed: 0,
    };
    let whole = Matrix4::new_scaling(metres);
    for visual in document.descendants().filter(|node| is(*node, "visual_scene")) {
        scene.place(visual, whole)?;
    }
    scene.bounds.known()
}

/// Whether a node is an element of this name.
fn is(node: Node, name: &str) -> bool {
    node.is_element() && node.tag_name().name() == name
}

struct Scene<'a, 'b> {
    by_id: HashMap<&'a str, Node<'a, 'b>>,
    bounds: Bounds,
    placed: usize,
}

impl<'a, 'b> Scene<'a, 'b> {
    /// Places what a node holds.
    fn place(&mut self, top: Node<'a, 'b>, whole: Matrix4<f64>) -> Result<(), String> {
        let mut open = vec![(top, whole)];
        while let Some((node, around)) = open.pop() {
            self.count(1)?;
            let place = node.children().filter_map(transform).fold(around, |place, own| place * own);
            for child in node.children().filter(Node::is_element) {
                match child.tag_name().name() {
                    "node" => open.push((child, place)),
                    "instance_node" => open.extend(self.named(child, "url").map(|node| (node, place))),
                    "instance_geometry" => self.geometry(child, &place)?,
                    _ => {}
                }
            }
        }
        Ok(())
    }

    fn count(&mut self, more: usize) -> Result<(), String> {
        self.placed += more;
        if self.placed > MOST_PLACED {
            Err(format!("its scene places more than {MOST_PLACED} vertices"))
        } else {
            Ok(())
        }
    }

    /// The element whose id an attribute names.
    fn named(&self, node: Node, attribute: &str) -> Option<Node<'a, 'b>> {
        self.by_id.get(node.attribute(attribute)?.trim_start_matches('#')).copied()
    }

    /// Places the vertices of a geometry.
    fn geometry(&mut self, instance: Node<'a, 'b>, place: &Matrix4<f64>) -> Result<(), String> {
        let Some(geometry) = self.named(instance, "url") else { return Ok(()) };
        self.count(geometry.descendants().count())?;
        let positions = geometry.descendants().filter(|node| is(*node, "input"));
        let positions = positions.filter(|input| input.attribute("semantic") == Some("POSITION"));
        for source in positions.filter_map(|input| self.named(input, "source")).collect::<Vec<_>>() {
            let numbers = source.descendants().find(|node| is(*node, "float_array"));
            let text = numbers.and_then(|node| node.text()).unwrap_or("");
            let mut words = text.split_ascii_whitespace().peekable();
            while words.peek().is_some() {
                self.count(1)?;
                self.bounds.include(&place.transform_point(&point(words.by_ref())?))?;
            }
        }
        Ok(())
    }
}

/// The transform that an element of a node states, if it states one.
fn transform(node: Node) -> Option<Matrix4<f64>> {
    let words = node.text().unwrap_or("").split_ascii_whitespace();
    let numbers: Vec<f64> = words.map_while(|word| word.parse().ok()).take(16).collect();
    match (node.tag_name().name(), &numbers[..]) {
        ("matrix", all) if all.len() == 16 => Some(Matrix4::from_row_slice(all)),
        ("translate", &[x, y, z]) => Some(Matrix4::new_translation(&Vector3::new(x, y, z))),
        ("scale", &[x, y, z]) => Some(Matrix4::new_nonuniform_scaling(&Vector3::new(x, y, z))),
        ("rotate", &[x, y, z, degrees]) => {
            let axis = Unit::try_new(Vector3::new(x, y, z), f64::EPSILON)?;
            Some(Matrix4::from_axis_angle(&axis, degrees.to_radians()))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::bounds;

    /// A file whose scene holds this, with a geometry `g` that has the corners (0, 0, 0) and (1, 2, 3).
    fn with(scene: &str) -> String {
        format!(
            "<COLLADA><geometry id=\"g\"><mesh><source id=\"s\"><float_array>0 0 0 1 2 3</float_array></source>\
             <vertices><input semantic=\"POSITION\" source=\"#s\"/></vertices></mesh></geometry>\
             <node id=\"n\"><translate>10 0 0</translate><instance_geometry url=\"#g\"/></node>\
             <visual_scene>{scene}</visual_scene></COLLADA>"
        )
    }

    #[test]
    fn nodes_move_what_they_hold() {
        let high = |scene: &str| bounds(with(scene).as_bytes()).unwrap().high;
        let turned =
            "<node><rotate>0 0 1 -90</rotate><node><scale>1 2 1</scale><instance_geometry url=\"#g\"/></node></node>";
        assert!((high(turned) - nalgebra::Point3::new(4.0, 0.0, 3.0)).norm() < 1e-12, "{}", high(turned));
        assert_eq!(high("<node><instance_node url=\"#n\"/></node>"), [11.0, 2.0, 3.0].into());
    }

    #[test]
    fn what_has_no_end_or_no_vertices_is_refused() {
        let told = |scene: &str| bounds(with(scene).as_bytes()).unwrap_err();
        assert_eq!(told("<node/>"), "it has no vertices");
        let endless = "<node id=\"m\"><instance_node url=\"#m\"/></node>";
        assert_eq!(told(endless), "its scene places more than 20000000 vertices");
    }
}
