//! The Nao of the paper's Table 1: 23 bodies of 4.34 kg in total, 22 motors.
//!
//! **Axes.** The table has y up, z forward, x to the robot's left; here x is forward, y left, z up: (x, y, z) of the
//! table becomes (z, x, y). All link frames are parallel to the world's at q = 0, the pose of the table: legs
//! straight, arms forward. Joints and links have the table's body names; the root is `Torso`.
//!
//! **Anchors.** The table gives positions of bodies, not of joints. As on the real robot, the three hip axes, the
//! two ankle axes, the two shoulder axes, the two elbow axes and the two neck axes meet in one point each:
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
//! So thigh and shank are 0.092 m and 0.100 m long and the ankle is 0.05 m above the sole. The shank's centre of mass
//! is half-way between knee and ankle. At the start the soles touch the ground (z = 0), the torso is at a height of
//! 0.35 m.
//!
//! **Chosen here**, since the table does not say: homogeneous bodies; the roll axis of the left ankle like the right
//! one's (the table's 0 1 0 would be a second yaw, a misprint); servos with kp 60 N·m/rad, kd 1 N·m·s/rad and 0.005
//! kg·m² of rotor inertia. The 1 cm spheres lie inside their neighbours' boxes and get no contact shape.
//!
//! **Motors** are those of Aldebaran's documentation ("H25 - Motors - V 3.2", doc.aldebaran.com/1-14/family/nao_h25/
//! motors_h25_v32.html; the head's as in V 3.3): no-load speeds and stall torques through the reduction ratios. Gear
//! losses are not published and left out, so that a real joint is somewhat weaker; the decrease of a motor's torque
//! with its speed is the effect `speed_torque_limit`. References are limited to the no-load speed.
//!
//! **Ranges** are those of `nao_description/urdf/naoV32_generated_urdf` in github.com/ros-naoqi/nao_robot, which has
//! these axes at this zero: rolls and yaws of the right side have the left side's ranges with opposite sign. Where its
//! two sides differ by less than 0.01 rad (ankles), both have the narrower range. Shoulder and elbow rolls would end
//! 0.0087 rad from zero; here they reach zero, for the pose of the table.

pub use crate::drive::{CONTROL_S, STEPS_PER_CONTROL};

use crate::robot::{Actuator, Base, Geometry, Joint, JointKind, Link, Robot, Shape};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// The eight bodies whose masses span the paper's search space.
pub const UNCERTAIN_MASSES: [&str; 8] =
    ["RShoulderRoll", "LShoulderRoll", "RHipRoll", "RHipPitch", "RKneePitch", "LHipRoll", "LHipPitch", "LKneePitch"];

/// A body of Table 1, in the table's axes.
struct TableBody {
    name: &'static str,
    parent: &'static str,
    mass_kg: f64,
    /// The joint's anchor in m.
    anchor: [f64; 3],
    axis: [f64; 3],
    /// Centre of the geometry in m.
    centre: [f64; 3],
    form: TableGeometry,
}

/// The table's geometries, sizes in m.
enum TableGeometry {
    Box([f64; 3]),
    Cylinder(f64, f64),
    Sphere(f64),
    /// A sphere inside its neighbours: inertia, but no contact shape.
    Hidden(f64),
}

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// The robot, standing with its soles on z = 0 and looking along x.
pub fn nao() -> Robot {
    let torso = [0.00, 0.07, -0.02];
    let mut bodies = vec![body("Torso", "", 1.22, torso, Y, torso, TableGeometry::Box([0.10, 0.18, 0.10]))];
    let neck = [0.00, 0.16, -0.02];
    bodies.push(body("HeadYaw", "Torso", 0.05, neck, Y, neck, TableGeometry::Cylinder(0.01, 0.08)));
    bodies.push(body("HeadPitch", "HeadYaw", 0.35, neck, X, [0.00, 0.22, 0.00], TableGeometry::Sphere(0.07)));
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
fn arm([pitch, roll, elbow_yaw, elbow_roll]: [&'static str; 4], side: f64) -> [TableBody; 4] {
    let shoulder = [side * 0.09, 0.14, -0.02];
    let elbow = [side * 0.10, 0.15, 0.07];
    let upper_arm = [side * 0.10, 0.14, 0.00];
    let forearm = [side * 0.10, 0.15, 0.12];
    [
        body(pitch, "Torso", 0.05, shoulder, X, shoulder, TableGeometry::Hidden(0.01)),
        body(roll, pitch, 0.11, shoulder, Y, upper_arm, TableGeometry::Box([0.07, 0.06, 0.08])),
        body(elbow_yaw, roll, 0.03, elbow, Z, elbow, TableGeometry::Hidden(0.01)),
        body(elbow_roll, elbow_yaw, 0.06, elbow, Y, forearm, TableGeometry::Box([0.05, 0.05, 0.11])),
    ]
}

/// The leg on the side of the table's x = `side`.
fn leg([yaw_pitch, roll, pitch, knee, ankle, foot]: [&'static str; 6], side: f64) -> [TableBody; 6] {
    let at = |up: f64, forward: f64| [side * 0.06, up, forward];
    let (hip, knee_at, ankle_at) = (at(-0.04, -0.03), at(-0.13, -0.01), at(-0.23, -0.01));
    let diagonal = [FRAC_1_SQRT_2, -side * FRAC_1_SQRT_2, 0.0];
    [
        body(yaw_pitch, "Torso", 0.10, hip, diagonal, hip, TableGeometry::Hidden(0.01)),
        body(roll, yaw_pitch, 0.14, hip, Z, hip, TableGeometry::Hidden(0.01)),
        body(pitch, roll, 0.29, hip, X, at(-0.09, -0.02), TableGeometry::Box([0.07, 0.14, 0.07])),
        body(knee, pitch, 0.42, knee_at, X, at(-0.18, -0.01), TableGeometry::Box([0.08, 0.11, 0.07])),
        body(ankle, knee, 0.06, ankle_at, X, ankle_at, TableGeometry::Hidden(0.01)),
        body(foot, ankle, 0.10, ankle_at, Z, at(-0.27, 0.02), TableGeometry::Box([0.08, 0.02, 0.16])),
    ]
}

fn body(
    name: &'static str,
    parent: &'static str,
    mass_kg: f64,
    anchor: [f64; 3],
    axis: [f64; 3],
    centre: [f64; 3],
    form: TableGeometry,
) -> TableBody {
    TableBody { name, parent, mass_kg, anchor, axis, centre, form }
}

/// Converts from the table's axes to x forward, y left, z up.
fn turned([x, y, z]: [f64; 3]) -> Vector3<f64> {
    Vector3::new(z, x, y)
}

fn link(body: &TableBody, bodies: &[TableBody]) -> Link {
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
            limits: range(body.name),
            speed_limit: motor(body.name).no_load_speed(),
            actuator: Actuator::Position { kp: 60.0, ki: 0.0, kd: 1.0, max_torque: motor(body.name).stall_torque() },
            ..Joint::new(body.name, JointKind::Revolute, origin, turned(body.axis))
        },
        mass_kg: body.mass_kg,
        com_m: Point3::from(com),
        inertia_kg_m2: geometry.inertia_kg_m2(body.mass_kg),
        shapes: if touches { vec![Shape { pose: Isometry3::translation_from(com), geometry }] } else { Vec::new() },
        mesh_boxes: vec![],
        foot: body.name.ends_with("AnkleRoll"),
    }
}

/// The geometry, and whether it has a contact shape. The cylinder is upright: along z here as in [`Geometry`].
fn geometry(form: &TableGeometry) -> (Geometry, bool) {
    match *form {
        TableGeometry::Box(sides) => (Geometry::Box { half_m: turned(sides) / 2.0 }, true),
        TableGeometry::Cylinder(radius_m, length_m) => {
            (Geometry::Cylinder { radius_m, half_length_m: length_m / 2.0 }, true)
        }
        TableGeometry::Sphere(radius_m) => (Geometry::Sphere { radius_m }, true),
        TableGeometry::Hidden(radius_m) => (Geometry::Sphere { radius_m }, false),
    }
}

/// A motor behind its gear.
struct GearMotor {
    no_load_rpm: f64,
    stall_mnm: f64,
    ratio: f64,
}

impl GearMotor {
    /// At the joint, in rad/s.
    fn no_load_speed(&self) -> f64 {
        self.no_load_rpm * TAU / 60.0 / self.ratio
    }

    /// At the joint, without gear losses, in N·m.
    fn stall_torque(&self) -> f64 {
        1e-3 * self.stall_mnm * self.ratio
    }
}

/// The motor of a body, by the name of its joint; the root has none, its value is ignored.
fn motor(name: &str) -> GearMotor {
    let re_max_24 = |ratio| GearMotor { no_load_rpm: 8000.0, stall_mnm: 59.5, ratio };
    let re_max_17 = |ratio| GearMotor { no_load_rpm: 11_900.0, stall_mnm: 15.1, ratio };
    match of_either_side(name) {
        "HipYawPitch" | "HipRoll" | "AnkleRoll" => re_max_24(201.3),
        "HipPitch" | "KneePitch" | "AnklePitch" => re_max_24(130.85),
        "HeadPitch" | "ShoulderRoll" | "ElbowRoll" => re_max_17(173.22),
        _ => re_max_17(150.27),
    }
}

/// The range of a body's joint, in rad.
fn range(name: &str) -> (f64, f64) {
    let (least, most) = match of_either_side(name) {
        "HeadPitch" => (-0.671_952, 0.514_872),
        "ShoulderRoll" => (0.0, 1.649_34),
        "ElbowRoll" => (-1.562_07, 0.0),
        "HipYawPitch" => (-1.145_29, 0.740_718),
        "HipRoll" => (-0.379_435, 0.790_46),
        "HipPitch" => (-1.535_89, 0.483_98),
        "KneePitch" => (-0.092_327_9, 2.112_55),
        "AnklePitch" => (-1.186_3, 0.922_581),
        "AnkleRoll" => (-0.397_761, 0.768_992),
        // The other joints of the head and the arms have symmetric ranges.
        _ => (-2.085_67, 2.085_67),
    };
    // The hips' yaw is one motor for both sides, about axes that mirror each other.
    let mirrored = name.starts_with('R') && (name.ends_with("Roll") || name.ends_with("ElbowYaw"));
    if mirrored { (-most, -least) } else { (least, most) }
}

/// The name without its side.
fn of_either_side(name: &str) -> &str {
    name.strip_prefix(['L', 'R']).unwrap_or(name)
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

    /// Joint `i`'s counterpart on the other side, and the sign of its angle in a pose mirrored in the plane between
    /// left and right: that of the axis, which is a pseudovector.
    fn mirrored(robot: &Robot, i: usize) -> (usize, f64) {
        let link = &robot.links[i];
        let other = match link.name.split_at(1) {
            ("L", rest) => format!("R{rest}"),
            ("R", rest) => format!("L{rest}"),
            _ => link.name.clone(),
        };
        let other = robot.link(&other).unwrap();
        let axis = link.joint.axis;
        let sign = Vector3::new(-axis.x, axis.y, -axis.z).dot(&robot.links[other].joint.axis);
        assert!((sign.abs() - 1.0).abs() < 1e-12, "{}", link.name);
        (other, sign)
    }

    #[test]
    fn a_pose_is_within_limits_if_and_only_if_its_mirror_image_is() {
        let robot = nao();
        for (i, link) in robot.movable() {
            let (other, sign) = mirrored(&robot, i);
            let (other, (low, high)) = (&robot.links[other].joint, link.joint.limits);
            let image = if sign > 0.0 { (low, high) } else { (-high, -low) };
            assert_eq!(image, other.limits, "{}", link.name);
            assert_eq!(link.joint.speed_limit.to_bits(), other.speed_limit.to_bits(), "{}", link.name);
            assert!((low..=high).contains(&0.0), "the pose of the table: {}", link.name);
        }
    }

    /// Degrees per second and N·m of the documentation of an older release (ii.tudelft.nl/naodoc, "Description of the
    /// motors").
    #[test]
    fn motors_match_the_manufacturers_speed_and_torque_at_the_joint() {
        let robot = nao();
        for (name, speed, torque) in
            [("LHipRoll", 238.45, 11.97), ("RKneePitch", 366.83, 7.78), ("LShoulderRoll", 412.19, 2.61)]
        {
            let joint = &robot.links[robot.link(name).unwrap()].joint;
            let Actuator::Position { max_torque, .. } = joint.actuator else { panic!("{name} has a servo") };
            assert!((joint.speed_limit.to_degrees() - speed).abs() < 0.02, "{name}: {}", joint.speed_limit);
            assert!((max_torque - torque).abs() < 0.01, "{name}: {max_torque}");
        }
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
