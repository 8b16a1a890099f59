//! The Nao of the paper's Table 1: 23 bodies of 4.34 kg in sum, 22 motors.
//!
//! **Axes.** The table has y up, z forward, x to the robot's left; here x is forward, y left, z up: (x, y, z) of the table
//! becomes (z, x, y). All link frames are parallel to the world's at q = 0, the pose of the table: legs stretched, arms
//! forward. Joints and links bear the table's body names; the root is `Torso`.
//!
//! **Anchors.** The table gives where bodies are, not where joints are. As on the real robot, the three hip axes, the two
//! ankle axes, the two shoulder axes, the two elbow axes and the two neck axes meet in one point each:
//!
//! | joint | forward, left (left side), up, m | chosen because |
//! |---|---|---|
//! | hips | −0.03, 0.06, −0.04 | the row of `HipRoll`; the thigh's row is then half-way to the knee |
//! | knee | −0.01, 0.06, −0.13 | its row, which cannot be the shank's centre: the box would reach into the thigh |
//! | ankle | −0.01, 0.06, −0.23 | the row of `AnklePitch` |
//! | sole | −0.06 … 0.10, 0.02 … 0.10, −0.28 | under the foot's box, centred 0.02, 0.06, −0.27 |
//! | shoulder | −0.02, 0.09, 0.14 | the row of `ShoulderPitch` |
//! | elbow | 0.07, 0.10, 0.15 | the row of `ElbowYaw` |
//! | neck | −0.02, 0.00, 0.16 | the row of `HeadYaw` |
//!
//! So thigh and shank are 0.092 m and 0.100 m long and the ankle is 0.05 m above the sole. The shank's centre of mass is
//! half-way between knee and ankle. At the start the soles touch the ground (z = 0), the torso is at a height of 0.35 m.
//!
//! **Chosen here**, since the table is silent: homogeneous bodies; the roll axis of the left ankle like the right one's (the
//! table's 0 1 0 would be a second yaw, a misprint); servos with kp 60 N·m/rad, kd 1 N·m·s/rad and 0.005 kg·m² of rotor
//! inertia, 10 N·m in the legs and 3 N·m elsewhere; no joint limits. The 1 cm spheres lie inside their neighbours' boxes and
//! get no contact shape.

use crate::robot::{Actuator, Base, Geometry, Joint, JointKind, Link, Robot, Shape};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use std::f64::consts::FRAC_1_SQRT_2;

/// Time between two references of the real robot's controller, in s (paper, 4.2.1).
pub const CONTROL_S: f64 = 0.055;
/// Physics steps between two references (paper, 4.2.1).
pub const STEPS_PER_CONTROL: usize = 7;
/// The eight bodies whose masses span the paper's search space.
pub const UNCERTAIN_MASSES: [&str; 8] =
    ["RShoulderRoll", "LShoulderRoll", "RHipRoll", "RHipPitch", "RKneePitch", "LHipRoll", "LHipPitch", "LKneePitch"];

/// A body of Table 1, in the table's axes.
struct Body {
    name: &'static str,
    parent: &'static str,
    mass_kg: f64,
    /// The joint's anchor in m.
    anchor: [f64; 3],
    axis: [f64; 3],
    /// Centre of the geometry in m.
    centre: [f64; 3],
    form: Form,
}

/// The table's geometries, sizes in m.
enum Form {
    Box([f64; 3]),
    Cylinder(f64, f64),
    Sphere(f64),
    /// A sphere inside its neighbours: inertia, but nothing to touch.
    Hidden(f64),
}

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// The robot, standing with its soles on z = 0 and looking along x.
pub fn nao() -> Robot {
    let torso = [0.00, 0.07, -0.02];
    let mut bodies = vec![body("Torso", "", 1.22, torso, Y, torso, Form::Box([0.10, 0.18, 0.10]))];
    let neck = [0.00, 0.16, -0.02];
    bodies.push(body("HeadYaw", "Torso", 0.05, neck, Y, neck, Form::Cylinder(0.01, 0.08)));
    bodies.push(body("HeadPitch", "HeadYaw", 0.35, neck, X, [0.00, 0.22, 0.00], Form::Sphere(0.07)));
    bodies.extend(arm(["RShoulderPitch", "RShoulderRoll", "RElbowYaw", "RElbowRoll"], -1.0));
    bodies.extend(arm(["LShoulderPitch", "LShoulderRoll", "LElbowYaw", "LElbowRoll"], 1.0));
    let right = ["RHipYawPitch", "RHipRoll", "RHipPitch", "RKneePitch", "RAnklePitch", "RAnkleRoll"];
    bodies.extend(leg(right, -1.0));
    let left = ["LHipYawPitch", "LHipRoll", "LHipPitch", "LKneePitch", "LAnklePitch", "LAnkleRoll"];
    bodies.extend(leg(left, 1.0));
    let start = Isometry3::translation(torso[2], torso[0], torso[1] + 0.28);
    let links = bodies.iter().map(|b| link(b, &bodies)).collect();
    Robot { name: "nao".to_owned(), base: Base::Floating, start, links }
}

/// The arm on the side of the table's x = `side`.
fn arm([pitch, roll, elbow_yaw, elbow_roll]: [&'static str; 4], side: f64) -> [Body; 4] {
    let shoulder = [side * 0.09, 0.14, -0.02];
    let elbow = [side * 0.10, 0.15, 0.07];
    let upper_arm = [side * 0.10, 0.14, 0.00];
    let forearm = [side * 0.10, 0.15, 0.12];
    [
        body(pitch, "Torso", 0.05, shoulder, X, shoulder, Form::Hidden(0.01)),
        body(roll, pitch, 0.11, shoulder, Y, upper_arm, Form::Box([0.07, 0.06, 0.08])),
        body(elbow_yaw, roll, 0.03, elbow, Z, elbow, Form::Hidden(0.01)),
        body(elbow_roll, elbow_yaw, 0.06, elbow, Y, forearm, Form::Box([0.05, 0.05, 0.11])),
    ]
}

/// The leg on the side of the table's x = `side`.
fn leg([yaw_pitch, roll, pitch, knee, ankle, foot]: [&'static str; 6], side: f64) -> [Body; 6] {
    let at = |up: f64, forward: f64| [side * 0.06, up, forward];
    let (hip, knee_at, ankle_at) = (at(-0.04, -0.03), at(-0.13, -0.01), at(-0.23, -0.01));
    let diagonal = [FRAC_1_SQRT_2, -side * FRAC_1_SQRT_2, 0.0];
    [
        body(yaw_pitch, "Torso", 0.10, hip, diagonal, hip, Form::Hidden(0.01)),
        body(roll, yaw_pitch, 0.14, hip, Z, hip, Form::Hidden(0.01)),
        body(pitch, roll, 0.29, hip, X, at(-0.09, -0.02), Form::Box([0.07, 0.14, 0.07])),
        body(knee, pitch, 0.42, knee_at, X, at(-0.18, -0.01), Form::Box([0.08, 0.11, 0.07])),
        body(ankle, knee, 0.06, ankle_at, X, ankle_at, Form::Hidden(0.01)),
        body(foot, ankle, 0.10, ankle_at, Z, at(-0.27, 0.02), Form::Box([0.08, 0.02, 0.16])),
    ]
}

fn body(
    name: &'static str,
    parent: &'static str,
    mass_kg: f64,
    anchor: [f64; 3],
    axis: [f64; 3],
    centre: [f64; 3],
    form: Form,
) -> Body {
    Body { name, parent, mass_kg, anchor, axis, centre, form }
}

/// From the table's axes to x forward, y left, z up.
fn turned([x, y, z]: [f64; 3]) -> Vector3<f64> {
    Vector3::new(z, x, y)
}

fn link(body: &Body, bodies: &[Body]) -> Link {
    let parent = bodies.iter().position(|b| b.name == body.parent);
    let parent_anchor = parent.map_or_else(Vector3::zeros, |p| turned(bodies[p].anchor));
    let anchor = turned(body.anchor);
    let com = turned(body.centre) - anchor;
    let (geometry, touches) = geometry(&body.form);
    let origin = Isometry3::translation_from(anchor - parent_anchor);
    Link {
        name: body.name.to_owned(),
        parent,
        joint: Joint {
            armature: 0.005,
            actuator: Actuator::Position { kp: 60.0, ki: 0.0, kd: 1.0, max_torque: max_torque(body.name) },
            ..Joint::new(body.name, JointKind::Revolute, origin, turned(body.axis))
        },
        mass_kg: body.mass_kg,
        com_m: Point3::from(com),
        inertia_kg_m2: geometry.inertia_kg_m2(body.mass_kg),
        shapes: if touches { vec![Shape { pose: Isometry3::translation_from(com), geometry }] } else { Vec::new() },
        foot: body.name.ends_with("AnkleRoll"),
    }
}

/// The geometry, and whether it can touch anything. The cylinder is upright: along z here as in [`Geometry`].
fn geometry(form: &Form) -> (Geometry, bool) {
    match *form {
        Form::Box(sides) => (Geometry::Box { half_m: turned(sides) / 2.0 }, true),
        Form::Cylinder(radius_m, length_m) => (Geometry::Cylinder { radius_m, half_length_m: length_m / 2.0 }, true),
        Form::Sphere(radius_m) => (Geometry::Sphere { radius_m }, true),
        Form::Hidden(radius_m) => (Geometry::Sphere { radius_m }, false),
    }
}

fn max_torque(name: &str) -> f64 {
    if ["Hip", "Knee", "Ankle"].iter().any(|part| name.contains(part)) { 10.0 } else { 3.0 }
}

/// A pure translation.
trait TranslationFrom {
    fn translation_from(v: Vector3<f64>) -> Self;
}

impl TranslationFrom for Isometry3<f64> {
    fn translation_from(v: Vector3<f64>) -> Self {
        Isometry3::from_parts(v.into(), UnitQuaternion::identity())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    #[test]
    fn table_1_sums() {
        let robot = nao();
        assert_eq!(robot.links.len(), 23);
        assert_eq!(robot.movable().count(), 22);
        assert!((robot.mass_kg() - 4.34).abs() < 1e-9, "{}", robot.mass_kg());
    }

    #[test]
    fn soles_touch_the_ground() {
        let robot = nao();
        for side in ["R", "L"] {
            let mut height = robot.start.translation.z;
            let mut at = robot.link(&format!("{side}AnkleRoll"));
            let sole = robot.links[at.unwrap()].com_m.z - 0.01;
            while let Some(i) = at {
                if robot.links[i].parent.is_some() {
                    height += robot.links[i].joint.origin.translation.z;
                }
                at = robot.links[i].parent;
            }
            assert!((height + sole).abs() < 1e-12, "{height} {sole}");
        }
    }
}
