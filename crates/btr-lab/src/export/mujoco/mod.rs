//! MJCF: attributes of joints, bodies and actuators in the user's own file.

mod step;

use super::facts::{JointFacts, changed_links, joints, none_of};
use super::request::{Exported, Request, number, numbers};
use super::rest;
use super::xml::{Changes, children, named, numbers_of};
use btr_physics::robot::Link;
use roxmltree::{Document, Node};

pub(super) fn write(request: &Request) -> Result<Exported, String> {
    let text = request.text;
    let document = Document::parse(text).map_err(|error| format!("not an XML file: {error}"))?;
    if !document.root_element().has_tag_name("mujoco") {
        return Err(format!("an MJCF file has a <mujoco>, not a <{}>", document.root_element().tag_name().name()));
    }
    let mut facts = joints(request.outline);
    if !facts.iter().any(|joint| named(&document, "joint", &joint.name).is_some()) {
        return Err(none_of(&facts));
    }
    let mut file = File { text, document: &document, changes: Changes::default(), exported: Exported::default() };
    facts.iter().for_each(|joint| file.joint(joint));
    changed_links(request).for_each(|link| file.link(link));
    let File { changes, mut exported, .. } = file;
    exported.text = changes.apply(text);
    exported.advice.extend(step::advice(&document, request.model.setup.dt_s));
    facts.iter_mut().for_each(JointFacts::leave_delay);
    let others = &request.outline.others;
    exported.left.extend(rest::lines(&facts, others));
    exported.effects = rest::document(&facts, others);
    Ok(exported)
}

struct File<'a, 'i> {
    text: &'a str,
    document: &'a Document<'i>,
    changes: Changes,
    exported: Exported,
}

impl<'a, 'i> File<'a, 'i> {
    fn joint(&mut self, joint: &JointFacts) {
        let Some(element) = named(self.document, "joint", &joint.name) else {
            let what = format!("{}: no such joint in the file; is it in one that this includes?", joint.name);
            self.exported.left.push(what);
            return;
        };
        let rest = if joint.is_hinge && self.is_in_degrees() { joint.rest.to_degrees() } else { joint.rest };
        let values = [
            ("armature", joint.armature),
            ("damping", joint.viscous),
            ("frictionloss", joint.coulomb),
            ("stiffness", joint.stiffness),
        ];
        // A value of 0 that the file does not state may override one of a default class.
        for (name, value) in values.into_iter().filter(|(name, value)| *value != 0.0 || element.has_attribute(*name)) {
            self.set(element, name, &number(value), &joint.name);
        }
        if joint.stiffness != 0.0 {
            self.set(element, "springref", &number(rest), &joint.name);
        }
        self.actuators(joint);
    }

    /// Sets an attribute, and says so if it changes.
    fn set(&mut self, element: Node, name: &str, value: &str, of: &str) {
        if self.changes.set(self.text, element, name, value) {
            self.exported.carried.push(format!("{of}: {name} {value}"));
        }
    }

    /// The limits and gains of the actuators of a joint.
    fn actuators(&mut self, joint: &JointFacts) {
        let all = children(self.document.root_element(), "actuator").flat_map(|actuators| actuators.children());
        let drives = |element: &Node<'a, 'i>| element.attribute("joint") == Some(joint.name.as_str());
        let mut driven = false;
        for element in all.filter(drives) {
            driven = true;
            // Forces and gains of an actuator are those before its gear.
            let gear = numbers_of(element, "gear").and_then(|gear| gear.first().copied()).unwrap_or(1.0);
            if joint.torque_limit.is_finite() {
                let force = number(joint.torque_limit / gear.abs());
                self.set(element, "forcerange", &format!("-{force} {force}"), &joint.name);
            }
            let Some((kp, kd)) = joint.gains.map(|(kp, kd)| (kp / (gear * gear), kd / (gear * gear))) else { continue };
            match element.tag_name().name() {
                "position" => {
                    self.set(element, "kp", &number(kp), &joint.name);
                    // A joint's own damping may stand for the servo's.
                    if kd != 0.0 || element.has_attribute("kv") {
                        self.set(element, "kv", &number(kd), &joint.name);
                    }
                }
                "general" => {
                    self.set(element, "biastype", "affine", &joint.name);
                    self.set(element, "gainprm", &number(kp), &joint.name);
                    self.set(element, "biasprm", &format!("0 {} {}", number(-kp), number(-kd)), &joint.name);
                }
                other => self.exported.left.push(format!("{}: gains of its servo, as <{other}>", joint.name)),
            }
        }
        if !driven && (joint.gains.is_some() || joint.torque_limit.is_finite()) {
            let what = format!("{}: its servo; the file has no actuator for this joint", joint.name);
            self.exported.left.push(what);
        }
    }

    fn link(&mut self, link: &Link) {
        let Some(body) = named(self.document, "body", &link.name) else {
            let what = format!("{}: no such body in the file; is it in one that this includes?", link.name);
            self.exported.left.push(what);
            return;
        };
        // btr's link has its frame at the joint, a body may have its joint others.
        let joint = children(body, "joint").next().and_then(|joint| numbers_of(joint, "pos"));
        let at = |k: usize| joint.as_ref().and_then(|pos| pos.get(k).copied()).unwrap_or(0.0);
        let (c, i) = (&link.com_m, &link.inertia_kg_m2);
        let pos = numbers([c.x + at(0), c.y + at(1), c.z + at(2)]);
        let inertia = numbers([i.m11, i.m22, i.m33, i.m12, i.m13, i.m23]);
        let mass = number(link.mass_kg);
        match children(body, "inertial").next() {
            Some(inertial) => {
                for (name, value) in [("mass", &mass), ("pos", &pos), ("fullinertia", &inertia)] {
                    self.changes.set(self.text, inertial, name, value);
                }
                ["diaginertia", "quat", "axisangle", "xyaxes", "zaxis", "euler"]
                    .iter()
                    .for_each(|name| self.changes.remove(self.text, inertial, name));
            }
            None => {
                let inertial = format!("<inertial pos=\"{pos}\" mass=\"{mass}\" fullinertia=\"{inertia}\"/>");
                self.changes.insert_child(self.text, body, &inertial);
            }
        }
        self.exported.carried.push(format!("{}: mass {:.4} kg, with its centre and inertia", link.name, link.mass_kg));
    }

    /// Whether the file's angles are in degrees, as they are unless it says otherwise.
    fn is_in_degrees(&self) -> bool {
        let compilers = children(self.document.root_element(), "compiler");
        compilers.filter_map(|compiler| compiler.attribute("angle")).last().is_none_or(|angle| angle != "radian")
    }
}
