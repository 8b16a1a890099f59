//! MJCF: attributes of joints, bodies and actuators in the user's own file.

mod defaults;
mod mobility;
mod step;

use super::facts::{JointFacts, changed_bodies, joints, none_of};
use super::request::{Exported, Request, number, numbers};
use super::rest;
use super::xml::{Changes, ROUNDING, children, is_same, named, numbers_of};
use btr_physics::robot::Link;
use defaults::default_of;
use mobility::{mobilities, rate, softness};
use roxmltree::{Document, Node};

pub(super) fn write(request: &Request) -> Result<Exported, String> {
    let text = request.text;
    let document = Document::parse(text).map_err(|error| format!("not an XML file: {error}"))?;
    if !document.root_element().has_tag_name("mujoco") {
        let root = document.root_element().tag_name().name();
        return Err(format!("an MJCF file has a <mujoco>, not a <{root}>; docs/howto/export.md makes one of a URDF"));
    }
    let mut facts = joints(request.outline);
    if !facts.iter().any(|joint| named(&document, "joint", &joint.name).is_some()) {
        return Err(none_of(&facts));
    }
    let mobilities = mobilities(request.model);
    let step_s = step::of(&document);
    let mut file = File { text, document: &document, changes: Changes::default(), exported: Exported::default() };
    for (joint, mobility) in facts.iter_mut().zip(&mobilities) {
        let creep = mobility.and_then(|mobility| Some((joint.take_creep()?, mobility)));
        let friction = match creep {
            Some(((creep, time_s), mobility)) => Softness::Creeps(softness(creep, time_s, mobility, step_s)),
            None if joint.rests_by_friction() => Softness::Rests,
            None => Softness::Unknown,
        };
        file.joint(joint, &friction);
    }
    let has = |name: &str| named(&document, "body", name).is_some();
    changed_bodies(request, has).iter().for_each(|link| file.link(link));
    let File { changes, mut exported, .. } = file;
    exported.text = changes.apply(text);
    let rates = facts.iter().zip(&mobilities).filter_map(|(joint, mobility)| Some((joint, rate(joint, (*mobility)?))));
    let fastest = rates.max_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(joint, rate)| (joint.name.as_str(), rate));
    exported.advice.extend(step::advice(&document, request.model.setup.dt_s, fastest));
    exported.advice.extend(from_geoms(&document));
    facts.iter_mut().for_each(JointFacts::leave_delay);
    let others = &request.outline.others;
    exported.left.extend(rest::lines(&facts, others));
    exported.effects = rest::document(&facts, others);
    Ok(exported)
}

/// Softness of dry friction that hardly creeps: MuJoCo's own lets a joint that rests slide under its load. Time
/// constants below two steps count as two.
const HARD_FRICTION: [(&str, &str); 2] =
    [("solreffriction", "0.001 1"), ("solimpfriction", "0.9999 0.9999 0.001 0.5 2")];

/// How dry friction gives way.
enum Softness {
    /// At this time constant (s) and impedance.
    Creeps([f64; 2]),
    /// Not at all.
    Rests,
    /// The model has none, or does not say.
    Unknown,
}

struct File<'a, 'i> {
    text: &'a str,
    document: &'a Document<'i>,
    changes: Changes,
    exported: Exported,
}

impl<'a, 'i> File<'a, 'i> {
    fn joint(&mut self, joint: &JointFacts, friction: &Softness) {
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
        for (name, value) in values {
            // What the model does not have may be known to a default class: an armature, from a data sheet.
            if value == 0.0 && !element.has_attribute(name) {
                self.tell_default(element, name, &joint.name);
            } else {
                self.set(element, name, &number(value), &joint.name);
            }
        }
        if joint.stiffness != 0.0 {
            self.set(element, "springref", &number(rest), &joint.name);
        }
        self.friction(element, joint, friction);
        self.actuators(joint);
        self.tell_limit(element, joint);
    }

    /// Says that the file limits a joint's torque more than the model, as MuJoCo does with the effort of a URDF.
    fn tell_limit(&mut self, element: Node<'a, 'i>, joint: &JointFacts) {
        let Some(range) = self.known(element, "actuatorfrcrange") else { return };
        let most = range.iter().fold(0.0, |most: f64, end| most.max(end.abs()));
        if most > 0.0 && most < joint.torque_limit {
            let (name, most) = (&joint.name, number(most));
            self.exported.advice.push(format!(
                "{name}: actuatorfrcrange limits its torque to {most} N·m (MuJoCo makes it of a URDF's effort), and the \
                 model does not: remove it if it is a placeholder"
            ));
        }
    }

    /// How soft a joint's dry friction is.
    fn friction(&mut self, element: Node<'a, 'i>, joint: &JointFacts, softness: &Softness) {
        // How soft the friction is that the file has was chosen with it.
        let known = self.known(element, "frictionloss").is_some_and(|loss| loss.iter().any(|loss| *loss != 0.0));
        match softness {
            Softness::Creeps([time_s, impedance]) => {
                let values = [numbers([*time_s, 1.0]), numbers([*impedance, *impedance, 0.001, 0.5, 2.0])];
                for ((name, _), value) in HARD_FRICTION.iter().zip(values) {
                    self.set(element, name, &value, &joint.name);
                }
            }
            Softness::Rests if !known => {
                for (name, hard) in HARD_FRICTION {
                    if !element.has_attribute(name) && default_of(self.document, element, name).is_none() {
                        self.set(element, name, hard, &joint.name);
                    }
                }
            }
            Softness::Rests | Softness::Unknown => {}
        }
        if let Some(torque) = joint.presliding().filter(|torque| *torque != 0.0) {
            self.exported.advice.push(format!(
                "{}: {} N·m of its frictionloss stand for presliding_friction, without the bending before it slides",
                joint.name,
                number(torque)
            ));
        }
    }

    /// Says that a default class gives an attribute that is 0 in the model.
    fn tell_default(&mut self, element: Node, name: &str, of: &str) {
        if let Some(value) = default_of(self.document, element, name).filter(|value| !is_same(value, "0")) {
            let told = format!("{of}: {name} is 0 in the model, and the {value} of its default class stays");
            self.exported.advice.push(told);
        }
    }

    /// Sets an attribute, and says so if it changes.
    fn set(&mut self, element: Node, name: &str, value: &str, of: &str) {
        let default = || default_of(self.document, element, name);
        if !element.has_attribute(name) && default().is_some_and(|known| is_same(known, value)) {
            return;
        }
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
            if joint.torque_limit.is_finite() && !self.is_limited_to(element, joint.torque_limit / gear.abs()) {
                let force = number(joint.torque_limit / gear.abs());
                self.set(element, "forcerange", &format!("-{force} {force}"), &joint.name);
            }
            let Some((kp, kd)) = joint.gains.map(|(kp, kd)| (kp / (gear * gear), kd / (gear * gear))) else { continue };
            match element.tag_name().name() {
                "position" => {
                    self.set(element, "kp", &number(kp), &joint.name);
                    // A joint's own damping may stand for the servo's.
                    if kd != 0.0 || element.has_attribute("kv") {
                        // The compiled model has one of them.
                        self.changes.remove(self.text, element, "dampratio");
                        self.set(element, "kv", &number(kd), &joint.name);
                    }
                }
                "general" => {
                    self.set(element, "biastype", "affine", &joint.name);
                    let (gain, bias) = self.scaled(element, kp);
                    self.set(element, "gainprm", &number(gain), &joint.name);
                    self.set(element, "biasprm", &numbers([bias, -kp, -kd]), &joint.name);
                }
                other => self.exported.left.push(format!("{}: gains of its servo, as <{other}>", joint.name)),
            }
        }
        if !driven && (joint.gains.is_some() || joint.torque_limit.is_finite()) {
            let what = format!("{}: its servo; the file has no actuator for this joint", joint.name);
            self.exported.left.push(what);
        }
    }

    /// Gain and constant bias of a general actuator with the stiffness `kp`: what its control means is kept.
    fn scaled(&self, element: Node, kp: f64) -> (f64, f64) {
        let known = |name: &str, k: usize| Some(*self.known(element, name)?.get(k)?);
        match known("biasprm", 1) {
            Some(stiffness) if stiffness < 0.0 => {
                let ratio = -kp / stiffness;
                (known("gainprm", 0).unwrap_or(1.0) * ratio, known("biasprm", 0).unwrap_or(0.0) * ratio)
            }
            _ => (kp, 0.0),
        }
    }

    /// Whether the range of a motor's control keeps its force within a limit already.
    fn is_limited_to(&self, element: Node, force: f64) -> bool {
        let stated = |name: &str| element.attribute(name).or_else(|| default_of(self.document, element, name));
        let compilers = children(self.document.root_element(), "compiler");
        let off = compilers.filter_map(|compiler| compiler.attribute("autolimits")).last() == Some("false");
        let is_limited = match stated("ctrllimited") {
            Some("true") => true,
            Some("false") => false,
            _ => !off,
        };
        let range = self.known(element, "ctrlrange").filter(|_| is_limited && element.has_tag_name("motor"));
        !element.has_attribute("forcerange")
            && range.is_some_and(|range| range.iter().all(|end| end.abs() <= force * (1.0 + ROUNDING)))
    }

    /// The numbers of an attribute, or those of its class.
    fn known(&self, element: Node, name: &str) -> Option<Vec<f64>> {
        let text = element.attribute(name).or_else(|| default_of(self.document, element, name))?;
        text.split_whitespace().map(|number| number.parse().ok()).collect()
    }

    fn link(&mut self, link: &Link) {
        let Some(body) = named(self.document, "body", &link.name) else {
            let what = format!("{}: no such body in the file; is it in one that this includes?", link.name);
            self.exported.left.push(what);
            return;
        };
        if !moves(body) {
            return;
        }
        // btr's link has its frame at the joint, a body may have its joint others.
        let joint = children(body, "joint").next().and_then(|joint| numbers_of(joint, "pos"));
        let at = |k: usize| joint.as_ref().and_then(|pos| pos.get(k).copied()).unwrap_or(0.0);
        let (c, i) = (&link.com_m, &link.inertia_kg_m2);
        let pos = numbers([c.x + at(0), c.y + at(1), c.z + at(2)]);
        let inertia = numbers([i.m11, i.m22, i.m33, i.m12, i.m13, i.m23]);
        let mass = number(link.mass_kg);
        match children(body, "inertial").next() {
            Some(inertial) => {
                // The file has one of the two, in the axes of the body; what is diagonal stays so.
                let off_diagonal = [i.m12, i.m13, i.m23].iter().fold(0.0, |most: f64, x| most.max(x.abs()));
                let is_diagonal = inertial.has_attribute("diaginertia") && off_diagonal <= ROUNDING * i.trace();
                let diagonal = numbers([i.m11, i.m22, i.m33]);
                let (stated, value, other) = match is_diagonal {
                    true => ("diaginertia", &diagonal, "fullinertia"),
                    false => ("fullinertia", &inertia, "diaginertia"),
                };
                for (name, value) in [("mass", &mass), ("pos", &pos), (stated, value)] {
                    self.changes.set(self.text, inertial, name, value);
                }
                [other, "quat", "axisangle", "xyaxes", "zaxis", "euler"]
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

/// That the compiler computes what bodies weigh from their shapes, whatever the file states of it.
fn from_geoms(document: &Document) -> Option<String> {
    let compilers = children(document.root_element(), "compiler");
    let stated = compilers.filter_map(|compiler| compiler.attribute("inertiafromgeom")).last();
    (stated == Some("true")).then(|| {
        "inertiafromgeom: the compiler takes masses from shapes, not those written here: set it to \"auto\"".to_owned()
    })
}

/// Whether a body moves: it, or one that carries it, has a joint. What one weighs that is fixed to the world does not
/// act.
fn moves(body: Node) -> bool {
    let is_body = |node: &Node| node.has_tag_name("body");
    let is_joint = |node: &Node| node.has_tag_name("joint") || node.has_tag_name("freejoint");
    // A joint may be in a frame of its body.
    let has_joint = |body: Node| {
        let mut joints = body.descendants().filter(is_joint);
        joints.any(|joint| joint.ancestors().find(is_body) == Some(body))
    };
    body.ancestors().filter(is_body).any(has_joint)
}
