//! A robot as URDF text, for viewers and for other simulators.

use crate::robot::{Geometry, Joint, JointKind, Link, Robot, Shape};
use nalgebra::Isometry3;
use std::fmt::Write;

/// The robot as URDF: inertials, joints with limits and dynamics, primitives as visual and as collision, and the boxes
/// around the meshes of a link without primitives as visual. What URDF cannot express (actuators, rotor inertia, the
/// start) is left out.
pub fn to_urdf(robot: &Robot) -> String {
    urdf(robot, None)
}

/// The same for viewers that draw it in a colour: red, green, blue and opacity, from 0 to 1.
pub fn to_coloured_urdf(robot: &Robot, colour: [f64; 4]) -> String {
    urdf(robot, Some(colour))
}

fn urdf(robot: &Robot, colour: Option<[f64; 4]>) -> String {
    let material = colour.map(|[r, g, b, opacity]| {
        format!("<material name=\"{}\"><color rgba=\"{r} {g} {b} {opacity}\"/></material>", escaped(&robot.name))
    });
    let mut out = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", escaped(&robot.name));
    for link in &robot.links {
        push_link(&mut out, link, material.as_deref());
    }
    for link in &robot.links {
        if let Some(parent) = link.parent {
            push_joint(&mut out, &link.joint, &robot.links[parent].name, &link.name);
        }
    }
    out + "</robot>\n"
}

/// Appends a formatted line; writing to a string cannot fail.
macro_rules! line {
    ($out:expr, $($format:tt)*) => {{ let _ = writeln!($out, $($format)*); }};
}

fn push_link(out: &mut String, link: &Link, material: Option<&str>) {
    line!(out, "  <link name=\"{}\">", escaped(&link.name));
    if link.mass_kg > 0.0 {
        let (c, i) = (&link.com_m, &link.inertia_kg_m2);
        line!(out, "    <inertial>");
        line!(out, "      <origin xyz=\"{} {} {}\" rpy=\"0 0 0\"/>", c.x, c.y, c.z);
        line!(out, "      <mass value=\"{}\"/>", link.mass_kg);
        let (xx, xy, xz, yy, yz, zz) = (i.m11, i.m12, i.m13, i.m22, i.m23, i.m33);
        line!(out, "      <inertia ixx=\"{xx}\" ixy=\"{xy}\" ixz=\"{xz}\" iyy=\"{yy}\" iyz=\"{yz}\" izz=\"{zz}\"/>");
        line!(out, "    </inertial>");
    }
    for shape in &link.shapes {
        push_shape(out, shape, "visual", material);
        push_shape(out, shape, "collision", None);
    }
    for shape in link.mesh_boxes.iter().filter(|_| link.shapes.is_empty()) {
        push_shape(out, shape, "visual", material);
    }
    line!(out, "  </link>");
}

fn push_shape(out: &mut String, shape: &Shape, element: &str, material: Option<&str>) {
    line!(out, "    <{element}>");
    line!(out, "      {}", origin(&shape.pose));
    line!(out, "      <geometry>{}</geometry>", geometry(&shape.geometry, element));
    material.into_iter().for_each(|material| line!(out, "      {material}"));
    line!(out, "    </{element}>");
}

fn geometry(geometry: &Geometry, element: &str) -> String {
    let cylinder = |tag: &str, r: f64, half: f64| format!("<{tag} radius=\"{r}\" length=\"{}\"/>", 2.0 * half);
    match geometry {
        Geometry::Box { half_m: h } => format!("<box size=\"{} {} {}\"/>", 2.0 * h.x, 2.0 * h.y, 2.0 * h.z),
        Geometry::Sphere { radius_m } => format!("<sphere radius=\"{radius_m}\"/>"),
        Geometry::Cylinder { radius_m, half_length_m } => cylinder("cylinder", *radius_m, *half_length_m),
        // Viewers draw boxes, cylinders and spheres only; the collision shape stays a capsule.
        Geometry::Capsule { radius_m, half_length_m } if element == "visual" => {
            cylinder("cylinder", *radius_m, half_length_m + radius_m)
        }
        Geometry::Capsule { radius_m, half_length_m } => cylinder("capsule", *radius_m, *half_length_m),
    }
}

fn push_joint(out: &mut String, joint: &Joint, parent: &str, child: &str) {
    let limited = joint.limits.0.is_finite() && joint.limits.1.is_finite();
    let kind = match joint.kind {
        JointKind::Fixed => "fixed",
        JointKind::Revolute if limited => "revolute",
        JointKind::Revolute => "continuous",
        JointKind::Prismatic => "prismatic",
    };
    line!(out, "  <joint name=\"{}\" type=\"{kind}\">", escaped(&joint.name));
    line!(out, "    {}", origin(&joint.origin));
    line!(out, "    <parent link=\"{}\"/>", escaped(parent));
    line!(out, "    <child link=\"{}\"/>", escaped(child));
    if joint.kind != JointKind::Fixed {
        line!(out, "    <axis xyz=\"{} {} {}\"/>", joint.axis.x, joint.axis.y, joint.axis.z);
        line!(out, "    <dynamics damping=\"{}\" friction=\"{}\"/>", joint.damping, joint.dry_friction);
        if let Some(mimic) = &joint.mimic {
            let (leader, ratio, offset) = (escaped(&mimic.leader), mimic.ratio, mimic.offset);
            line!(out, "    <mimic joint=\"{leader}\" multiplier=\"{ratio}\" offset=\"{offset}\"/>");
        }
        // URDF requires a range for slides, and an effort and a velocity for every range; 0 would mean neither is
        // available.
        if limited || joint.kind == JointKind::Prismatic {
            let (lower, upper) = (joint.limits.0.max(-FAR), joint.limits.1.min(FAR));
            let velocity = joint.speed_limit.min(FAR);
            line!(out, "    <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"{FAR}\" velocity=\"{velocity}\"/>");
        }
    }
    line!(out, "  </joint>");
}

/// Represents "no limit" where URDF requires a number.
const FAR: f64 = 1e6;

fn origin(pose: &Isometry3<f64>) -> String {
    let (t, (roll, pitch, yaw)) = (&pose.translation, pose.rotation.euler_angles());
    format!("<origin xyz=\"{} {} {}\" rpy=\"{roll} {pitch} {yaw}\"/>", t.x, t.y, t.z)
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
