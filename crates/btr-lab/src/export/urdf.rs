//! URDF: inertials, `<dynamics>`, and `<limit effort>`.

use super::facts::{JointFacts, changed_links, joints, none_of};
use super::request::{Exported, Request, number, numbers};
use super::rest;
use super::xml::{Changes, children, named};
use btr_physics::robot::Link;
use roxmltree::{Document, Node};

pub(super) fn write(request: &Request) -> Result<Exported, String> {
    let text = request.text;
    let document = Document::parse(text).map_err(|error| format!("not an XML file: {error}"))?;
    if !document.root_element().has_tag_name("robot") {
        return Err(format!("a URDF has a <robot>, not a <{}>", document.root_element().tag_name().name()));
    }
    let mut facts = joints(request.outline);
    if !facts.iter().any(|joint| named(&document, "joint", &joint.name).is_some()) {
        return Err(none_of(&facts));
    }
    let mut file = File { text, changes: Changes::default(), exported: Exported::default() };
    for joint in &facts {
        match named(&document, "joint", &joint.name) {
            Some(element) => file.joint(element, joint),
            None => file.exported.left.push(format!("{}: no such joint in the file", joint.name)),
        }
    }
    for link in changed_links(request) {
        match named(&document, "link", &link.name) {
            Some(element) => file.link(element, link),
            None => file.exported.left.push(format!("{}: no such link in the file", link.name)),
        }
    }
    let others = &request.outline.others;
    let File { changes, mut exported, .. } = file;
    exported.text = changes.apply(text);
    facts.iter_mut().for_each(JointFacts::leave_dynamics);
    exported.left.extend(rest::lines(&facts, others));
    exported.left.extend(facts.iter().filter_map(rest::gains));
    exported.effects = rest::document(&facts, others);
    Ok(exported)
}

/// The effort that stands for no limit, in N·m (N).
const NO_LIMIT: f64 = 1e9;

struct File<'a> {
    text: &'a str,
    changes: Changes,
    exported: Exported,
}

impl File<'_> {
    fn joint(&mut self, element: Node, joint: &JointFacts) {
        let dynamics = [("damping", joint.viscous), ("friction", joint.coulomb)];
        self.set(element, "dynamics", &dynamics, joint);
        match children(element, "limit").next() {
            Some(_) if joint.torque_limit.is_finite() => {
                self.set(element, "limit", &[("effort", joint.torque_limit)], joint);
            }
            Some(limit) if joint.has_motor => self.unlimit(limit, joint),
            _ => {}
        }
    }

    /// Lets the file state no limit of torque, as the model has none. URDF requires the attribute, and 0 is no torque
    /// at all to some readers.
    fn unlimit(&mut self, limit: Node, joint: &JointFacts) {
        let stated = limit.attribute("effort").and_then(|effort| effort.trim().parse::<f64>().ok());
        let Some(effort) = stated.filter(|effort| *effort > 0.0 && *effort < NO_LIMIT) else { return };
        self.changes.set(self.text, limit, "effort", &number(NO_LIMIT));
        self.exported.advice.push(format!(
            "{}: the model has no limit of torque, so the file's effort {effort} became {}, which stands for none",
            joint.name,
            number(NO_LIMIT)
        ));
    }

    /// Sets attributes of a joint's child, which is added where one of them is not 0.
    fn set(&mut self, element: Node, child: &'static str, values: &[(&str, f64)], joint: &JointFacts) {
        let found = children(element, child).next();
        for (name, value) in values {
            let changed = match found {
                // What the file leaves out is 0.
                Some(child) if child.attribute(*name).is_none() && *value == 0.0 => false,
                Some(child) => self.changes.set(self.text, child, name, &number(*value)),
                None => *value != 0.0,
            };
            if changed {
                self.exported.carried.push(format!("{}: {child} {name} {value:.4}", joint.name));
            }
        }
        if found.is_none() && values.iter().any(|(_, value)| *value != 0.0) {
            let attributes: Vec<String> =
                values.iter().map(|(name, value)| format!("{name}=\"{}\"", number(*value))).collect();
            self.changes.insert_child(self.text, element, &format!("<{child} {}/>", attributes.join(" ")));
        }
    }

    fn link(&mut self, element: Node, link: &Link) {
        let (c, i) = (&link.com_m, &link.inertia_kg_m2);
        let origin = [("xyz", numbers([c.x, c.y, c.z])), ("rpy", "0 0 0".to_owned())];
        let mass = [("value", number(link.mass_kg))];
        let inertia = [("ixx", i.m11), ("ixy", i.m12), ("ixz", i.m13), ("iyy", i.m22), ("iyz", i.m23), ("izz", i.m33)];
        let inertia = inertia.map(|(name, value)| (name, number(value)));
        let parts: [(&'static str, &[(&str, String)]); 3] =
            [("origin", &origin), ("mass", &mass), ("inertia", &inertia)];
        match children(element, "inertial").next() {
            Some(inertial) => {
                for (tag, attributes) in parts {
                    match children(inertial, tag).next() {
                        Some(child) => attributes.iter().for_each(|(name, value)| {
                            self.changes.set(self.text, child, name, value);
                        }),
                        None => self.changes.insert_child(self.text, inertial, &written(tag, attributes)),
                    }
                }
            }
            None => {
                let inside: String = parts.iter().map(|(tag, attributes)| written(tag, attributes)).collect();
                self.changes.insert_child(self.text, element, &format!("<inertial>{inside}</inertial>"));
            }
        }
        self.exported.carried.push(format!("{}: mass {:.4} kg, with its centre and inertia", link.name, link.mass_kg));
    }
}

fn written(tag: &str, attributes: &[(&str, String)]) -> String {
    let attributes: Vec<String> = attributes.iter().map(|(name, value)| format!("{name}=\"{value}\"")).collect();
    format!("<{tag} {}/>", attributes.join(" "))
}
