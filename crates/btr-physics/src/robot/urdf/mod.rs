//! Reading and writing robots as URDF.
//!
//! Limitations: shapes are primitives, so collision meshes are left out with a warning ([`meshes`] lists them); planar,
//! floating and spherical joints are refused; `<transmission>` and `<safety_controller>` are not read. Every joint is
//! passive: the model file defines its actuator, whose `max_torque` is the limit of its torque; [`efforts`] lists what
//! the URDF states.

mod error;
mod export;
mod meshes;
mod numbers;
#[cfg(test)]
mod tests;

pub use error::{UrdfError, UrdfWarning};
pub use export::{to_coloured_urdf, to_urdf};
pub use meshes::{Mesh, meshes};

use super::{Actuator, Base, Geometry, Joint, JointKind, Link, Mimic, Robot, Shape};
use btr_core::limits::{DEEPEST_XML, MOST_LINKS};
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use xml::{Event, Parser};

/// A robot from a URDF text. The root stands at the world's origin.
///
/// # Errors
/// [`UrdfError`], which names the link or joint.
pub fn parse_urdf(text: &str, base: Base) -> Result<(Robot, Vec<UrdfWarning>), UrdfError> {
    let urdf = read(text)?;
    numbers::check(&urdf)?;
    let mut warnings = Vec::new();
    let mut links: Vec<Link> = Vec::new();
    for (index, carrier) in tree_order(&urdf)? {
        let parent = carrier.and_then(|j| links.iter().position(|l| l.name == j.parent.link));
        let joint = carrier.map_or(Ok(root_joint()), |j| joint(j, &mut warnings))?;
        links.push(link(&urdf.links[index], parent, joint, &mut warnings));
    }
    resolve_mimics(&mut links)?;
    check_carried_mass(&links)?;
    Ok((Robot { name: urdf.name, base, start: Isometry3::identity(), links }, warnings))
}

/// The limits of torque that a URDF states (`effort`, N·m; N for slides), by joint: above 0, and below what stands for
/// none. A robot has them only if its model says so.
///
/// # Errors
/// See [`parse_urdf`].
pub fn efforts(text: &str) -> Result<Vec<(String, f64)>, UrdfError> {
    const NONE: f64 = 1e5;
    let stated = read(text)?.joints.into_iter().map(|joint| (joint.name, joint.limit.effort));
    Ok(stated.filter(|(_, effort)| *effort > 0.0 && *effort < NONE).collect())
}

/// The links and joints as they are written.
fn read(text: &str) -> Result<urdf_rs::Robot, UrdfError> {
    check_depth(text)?;
    let urdf = urdf_rs::read_from_string(text).map_err(|e| UrdfError::Syntax { what: e.to_string() })?;
    if urdf.links.len() > MOST_LINKS {
        return Err(UrdfError::Links { links: urdf.links.len() });
    }
    Ok(urdf)
}

/// Refuses elements that lie so deep inside each other that reading them would overflow the stack. Broken XML is left
/// to the reader.
fn check_depth(text: &str) -> Result<(), UrdfError> {
    let mut parser = Parser::new();
    parser.feed_str(text);
    let mut depth = 0_usize;
    for event in parser {
        depth = match event {
            Ok(Event::ElementStart(_)) if depth == DEEPEST_XML => return Err(UrdfError::Deep),
            Ok(Event::ElementStart(_)) => depth + 1,
            Ok(Event::ElementEnd(_)) => depth.saturating_sub(1),
            Ok(_) => depth,
            Err(_) => return Ok(()),
        };
    }
    Ok(())
}

/// Indices of the links, parents before children and otherwise in the file's order, with the joints that carry them.
fn tree_order(urdf: &urdf_rs::Robot) -> Result<Vec<(usize, Option<&urdf_rs::Joint>)>, UrdfError> {
    unique("links", urdf.links.iter().map(|l| l.name.as_str()))?;
    unique("joints", urdf.joints.iter().map(|j| j.name.as_str()))?;
    let index_of = |joint: &urdf_rs::Joint, name: &str| {
        let found = urdf.links.iter().position(|l| l.name == name);
        found.ok_or_else(|| UrdfError::NoLink { joint: joint.name.clone(), link: name.to_owned() })
    };
    let mut carriers: Vec<Option<&urdf_rs::Joint>> = vec![None; urdf.links.len()];
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); urdf.links.len()];
    for joint in &urdf.joints {
        let (parent, child) = (index_of(joint, &joint.parent.link)?, index_of(joint, &joint.child.link)?);
        if let Some(first) = carriers[child].replace(joint) {
            let (first, second) = (first.name.clone(), joint.name.clone());
            return Err(UrdfError::TwoParents { link: joint.child.link.clone(), first, second });
        }
        children[parent].push(child);
    }
    let names = |links: Vec<usize>| links.into_iter().map(|i| urdf.links[i].name.clone()).collect();
    let roots: Vec<usize> = (0..carriers.len()).filter(|i| carriers[*i].is_none()).collect();
    let root = match roots[..] {
        [root] => root,
        [] if urdf.links.is_empty() => return Err(UrdfError::NoLinks),
        [] => return Err(UrdfError::NoRoot),
        _ => return Err(UrdfError::Roots { roots: names(roots) }),
    };
    let mut order = vec![root];
    let mut done = 0;
    while let Some(&link) = order.get(done) {
        order.extend(&children[link]);
        done += 1;
    }
    if order.len() < carriers.len() {
        let lost = (0..carriers.len()).filter(|i| !order.contains(i)).collect();
        return Err(UrdfError::Loop { links: names(lost) });
    }
    Ok(order.into_iter().map(|i| (i, carriers[i])).collect())
}

fn unique<'a>(what: &'static str, names: impl Iterator<Item = &'a str>) -> Result<(), UrdfError> {
    let mut seen = std::collections::BTreeSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(UrdfError::Twice { what, name: name.to_owned() });
        }
    }
    Ok(())
}

/// Placeholder joint of the root, which is ignored.
fn root_joint() -> Joint {
    Joint {
        name: String::new(),
        kind: JointKind::Fixed,
        origin: Isometry3::identity(),
        axis: Vector3::x(),
        limits: (f64::NEG_INFINITY, f64::INFINITY),
        speed_limit: f64::INFINITY,
        start: 0.0,
        armature: 0.0,
        damping: 0.0,
        dry_friction: 0.0,
        actuator: Actuator::Passive,
        sampling: None,
        mimic: None,
    }
}

fn joint(j: &urdf_rs::Joint, warnings: &mut Vec<UrdfWarning>) -> Result<Joint, UrdfError> {
    let kind = match j.joint_type {
        urdf_rs::JointType::Fixed => JointKind::Fixed,
        urdf_rs::JointType::Revolute | urdf_rs::JointType::Continuous => JointKind::Revolute,
        urdf_rs::JointType::Prismatic => JointKind::Prismatic,
        urdf_rs::JointType::Floating | urdf_rs::JointType::Planar | urdf_rs::JointType::Spherical => {
            let kind = format!("{:?}", j.joint_type).to_lowercase();
            return Err(UrdfError::Kind { joint: j.name.clone(), kind });
        }
    };
    let axis = Vector3::from(j.axis.xyz.0);
    let length = axis.norm();
    if kind != JointKind::Fixed && !(length.is_finite() && length > 1e-9) {
        return Err(UrdfError::Value { name: j.name.clone(), what: "length of the axis", value: length });
    }
    let limits = limits(j, kind, warnings);
    let (damping, dry_friction) = j.dynamics.as_ref().map_or((0.0, 0.0), |d| (d.damping, d.friction));
    let axis = if length > 1e-9 { axis / length } else { Vector3::x() };
    let (origin, start) = (pose(&j.origin), 0.0_f64.clamp(limits.0, limits.1));
    let mimic = j.mimic.as_ref().filter(|_| kind != JointKind::Fixed).map(|mimic| Mimic {
        leader: mimic.joint.clone(),
        ratio: mimic.multiplier.unwrap_or(1.0),
        offset: mimic.offset.unwrap_or(0.0),
    });
    // An absent velocity limit is parsed as zero, which is no valid limit of a moving joint.
    let speed_limit = if j.limit.velocity > 0.0 { j.limit.velocity } else { f64::INFINITY };
    let (name, moves) = (j.name.clone(), Joint { kind, origin, axis, limits, start, ..root_joint() });
    Ok(Joint { name, speed_limit, damping, dry_friction, mimic, ..moves })
}

/// Replaces a leader that is itself a follower by that one's leader.
fn resolve_mimics(links: &mut [Link]) -> Result<(), UrdfError> {
    let joints: Vec<Joint> = links.iter().skip(1).map(|link| link.joint.clone()).collect();
    for joint in links.iter_mut().map(|link| &mut link.joint) {
        let Some(mimic) = &mut joint.mimic else { continue };
        let first = mimic.leader.clone();
        let refuse = |why| Err(UrdfError::Mimic { joint: joint.name.clone(), leader: first.clone(), why });
        let mut passed = 0;
        loop {
            match joints.iter().find(|other| other.name == mimic.leader) {
                None => return refuse("does not exist, or follows one that does not"),
                Some(Joint { kind: JointKind::Fixed, .. }) => return refuse("is fixed, or follows one that is"),
                Some(_) if passed == joints.len() => return refuse("follows it in turn"),
                Some(Joint { mimic: None, .. }) => break,
                Some(Joint { mimic: Some(next), .. }) => {
                    mimic.offset += mimic.ratio * next.offset;
                    mimic.ratio *= next.ratio;
                    mimic.leader.clone_from(&next.leader);
                    passed += 1;
                }
            }
        }
    }
    Ok(())
}

/// The range of a joint. An absent `<limit>` is parsed as zeros, which is no valid range of a hinge or slide.
fn limits(j: &urdf_rs::Joint, kind: JointKind, warnings: &mut Vec<UrdfWarning>) -> (f64, f64) {
    let endless = (f64::NEG_INFINITY, f64::INFINITY);
    if kind == JointKind::Fixed || j.joint_type == urdf_rs::JointType::Continuous {
        return endless;
    }
    if j.limit.lower < j.limit.upper {
        return (j.limit.lower, j.limit.upper);
    }
    warnings.push(UrdfWarning::NoLimits { joint: j.name.clone() });
    endless
}

fn link(l: &urdf_rs::Link, parent: Option<usize>, joint: Joint, warnings: &mut Vec<UrdfWarning>) -> Link {
    let mass_kg = l.inertial.mass.value;
    let frame = pose(&l.inertial.origin);
    let i = &l.inertial.inertia;
    let inertia = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
    let turn = frame.rotation.to_rotation_matrix();
    let mut shapes = Vec::new();
    for collision in &l.collision {
        match geometry(&collision.geometry) {
            Ok(geometry) => shapes.push(Shape { pose: pose(&collision.origin), geometry }),
            Err(file) => warnings.push(UrdfWarning::Mesh { link: l.name.clone(), file }),
        }
    }
    if mass_kg > 0.0 && inertia == Matrix3::zeros() {
        warnings.push(UrdfWarning::PointMass { link: l.name.clone() });
    }
    let (com_m, inertia_kg_m2) = (Point3::from(frame.translation.vector), turn * inertia * turn.transpose());
    Link { name: l.name.clone(), parent, joint, mass_kg, com_m, inertia_kg_m2, shapes, mesh_boxes: vec![], foot: false }
}

/// The primitive, or the mesh's file as the error.
fn geometry(g: &urdf_rs::Geometry) -> Result<Geometry, String> {
    match g {
        urdf_rs::Geometry::Box { size } => Ok(Geometry::Box { half_m: Vector3::from(size.0) / 2.0 }),
        urdf_rs::Geometry::Sphere { radius } => Ok(Geometry::Sphere { radius_m: *radius }),
        urdf_rs::Geometry::Cylinder { radius, length } => {
            Ok(Geometry::Cylinder { radius_m: *radius, half_length_m: length / 2.0 })
        }
        urdf_rs::Geometry::Capsule { radius, length } => {
            Ok(Geometry::Capsule { radius_m: *radius, half_length_m: length / 2.0 })
        }
        urdf_rs::Geometry::Mesh { filename, .. } => Err(filename.clone()),
    }
}

fn pose(p: &urdf_rs::Pose) -> Isometry3<f64> {
    let [roll, pitch, yaw] = p.rpy.0;
    Isometry3::from_parts(
        Translation3::from(Vector3::from(p.xyz.0)),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

/// Checks that every movable joint carries mass: that of its link or of a descendant.
fn check_carried_mass(links: &[Link]) -> Result<(), UrdfError> {
    let mut carried_kg: Vec<f64> = links.iter().map(|l| l.mass_kg).collect();
    for i in (1..links.len()).rev() {
        if links[i].joint.kind != JointKind::Fixed && carried_kg[i] <= 0.0 {
            return Err(UrdfError::Massless { joint: links[i].joint.name.clone(), link: links[i].name.clone() });
        }
        if let Some(parent) = links[i].parent {
            carried_kg[parent] += carried_kg[i];
        }
    }
    Ok(())
}
