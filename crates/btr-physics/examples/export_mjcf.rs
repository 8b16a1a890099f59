//! Exports a scene to MuJoCo: `export_mjcf <ant|nao|arm> <auto|rapier> <dt in s> <duration in s> <folder>` writes
//! `scene.xml` (masses, joints, servos, shapes, floor, step) and `log.csv` (btr's run on that engine: commands, joint
//! angles, base) to the folder.
//!
//! Fixed and free bases, hinges, slides and position servos are supported; as in btr, the robot touches the floor only.

#[path = "../benches/scenes/mod.rs"]
mod scenes;

use btr_io::{Meta, write_log};
use btr_physics::robot::{Actuator, Base, Geometry, Joint, JointKind, Link, Robot, Shape};
use btr_physics::setup::Setup;
use nalgebra::Isometry3;
use scenes::{ENGINES, NAMES, Scene};
use std::error::Error;
use std::fmt::Write;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, engine, dt_s, duration_s, folder] = arguments.as_slice() else {
        let (names, engines) = (NAMES.join("|"), ENGINES.join("|"));
        return Err(format!("usage: export_mjcf <{names}> <{engines}> <dt_s> <duration_s> <folder>").into());
    };
    let scene = Scene::new(name, engine, dt_s.parse()?, duration_s.parse()?)?;
    let folder = Path::new(folder);
    std::fs::write(folder.join("scene.xml"), to_mjcf(&scene.robot, &scene.setup))?;
    for log in scene.run_all(1)? {
        write_log(&folder.join("log.csv"), &log, &Meta::default())?;
    }
    Ok(())
}

/// Appends a formatted line; writing to a string cannot fail.
macro_rules! line {
    ($out:expr, $($format:tt)*) => {{ let _ = writeln!($out, $($format)*); }};
}

fn to_mjcf(robot: &Robot, setup: &Setup) -> String {
    let (mut out, g) = (String::new(), setup.gravity_m_s2);
    line!(out, "<mujoco model=\"{}\">", robot.name);
    line!(out, "<compiler angle=\"radian\" autolimits=\"true\"/>");
    line!(out, "<option timestep=\"{}\" integrator=\"implicitfast\" gravity=\"{} {} {}\"/>", setup.dt_s, g.x, g.y, g.z);
    line!(out, "<worldbody>");
    if let Some(ground) = &setup.ground {
        // MuJoCo uses the larger of the two coefficients, and the robot's would default to 1.
        let friction = ground.friction;
        line!(out, "<geom type=\"plane\" size=\"0 0 1\" friction=\"{friction}\" contype=\"1\" conaffinity=\"0\"/>");
        push_body(&mut out, robot, 0, friction);
    } else {
        push_body(&mut out, robot, 0, 1.0);
    }
    line!(out, "</worldbody>\n<actuator>");
    robot.movable().for_each(|(_, link)| push_servo(&mut out, &link.joint));
    out + "</actuator>\n</mujoco>\n"
}

/// Appends the link and its descendants.
fn push_body(out: &mut String, robot: &Robot, index: usize, friction: f64) {
    let link = &robot.links[index];
    let pose = if link.parent.is_some() { link.joint.origin } else { robot.start };
    line!(out, "<body name=\"{}\" {}>", link.name, placement(&pose));
    match (link.parent, robot.base) {
        (Some(_), _) => push_joint(out, &link.joint),
        (None, Base::Floating) => line!(out, "<freejoint/>"),
        (None, Base::Fixed) => {}
    }
    push_inertia(out, link);
    link.shapes.iter().for_each(|shape| push_shape(out, shape, friction));
    let children = (0..robot.links.len()).filter(|&i| robot.links[i].parent == Some(index));
    children.for_each(|child| push_body(out, robot, child, friction));
    line!(out, "</body>");
}

fn push_joint(out: &mut String, joint: &Joint) {
    let kind = match joint.kind {
        JointKind::Fixed => return,
        JointKind::Revolute => "hinge",
        JointKind::Prismatic => "slide",
    };
    let (a, (low, high)) = (joint.axis, joint.limits);
    let range = if low.is_finite() && high.is_finite() { format!("range=\"{low} {high}\"") } else { String::new() };
    line!(
        out,
        "<joint name=\"{}\" type=\"{kind}\" axis=\"{} {} {}\" armature=\"{}\" damping=\"{}\" \
         frictionloss=\"{}\" {range}/>",
        joint.name,
        a.x,
        a.y,
        a.z,
        joint.armature,
        joint.damping,
        joint.dry_friction
    );
}

fn push_inertia(out: &mut String, link: &Link) {
    let (c, i) = (&link.com_m, &link.inertia_kg_m2);
    line!(
        out,
        "<inertial pos=\"{} {} {}\" mass=\"{}\" fullinertia=\"{} {} {} {} {} {}\"/>",
        c.x,
        c.y,
        c.z,
        link.mass_kg,
        i.m11,
        i.m22,
        i.m33,
        i.m12,
        i.m13,
        i.m23
    );
}

fn push_shape(out: &mut String, shape: &Shape, friction: f64) {
    let form = match &shape.geometry {
        Geometry::Box { half_m: h } => format!("type=\"box\" size=\"{} {} {}\"", h.x, h.y, h.z),
        Geometry::Sphere { radius_m } => format!("type=\"sphere\" size=\"{radius_m}\""),
        Geometry::Cylinder { radius_m, half_length_m } => {
            format!("type=\"cylinder\" size=\"{radius_m} {half_length_m}\"")
        }
        Geometry::Capsule { radius_m, half_length_m } => {
            format!("type=\"capsule\" size=\"{radius_m} {half_length_m}\"")
        }
    };
    line!(out, "<geom {form} {} friction=\"{friction}\" contype=\"0\" conaffinity=\"1\"/>", placement(&shape.pose));
}

fn push_servo(out: &mut String, joint: &Joint) {
    if let Actuator::Position { kp, kd, max_torque, .. } = joint.actuator {
        let (name, limit) = (&joint.name, max_torque);
        line!(out, "<position joint=\"{name}\" kp=\"{kp}\" kv=\"{kd}\" forcerange=\"{} {limit}\"/>", -limit);
    }
}

fn placement(pose: &Isometry3<f64>) -> String {
    let (t, q) = (&pose.translation, &pose.rotation);
    format!("pos=\"{} {} {}\" quat=\"{} {} {} {}\"", t.x, t.y, t.z, q.w, q.i, q.j, q.k)
}
