//! Robots from URDF, and to URDF.
//!
//! Limitations: shapes are primitives, so meshes are left out with a warning, of collision as of visual; a `<mimic>` joint
//! moves freely, with a warning; planar, floating and spherical joints are refused; `<transmission>`, `<safety_controller>`
//! and velocity limits are not read. Every joint is passive: the model's file says what drives it.

mod export;
#[cfg(test)]
mod tests;

pub use export::to_urdf;

use crate::robot::{Actuator, Base, Geometry, Joint, JointKind, Link, Robot, Shape};
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};

/// Why a URDF gives no robot.
#[derive(Debug, thiserror::Error)]
pub enum UrdfError {
    /// The file could not be read.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not XML, or not URDF.
    #[error("not a URDF: {what}")]
    Syntax {
        /// What the parser said.
        what: String,
    },
    /// A kind of joint that btr does not simulate.
    #[error("joint `{joint}`: {kind} joints are not simulated; split it into hinges and slides")]
    Kind {
        /// The joint.
        joint: String,
        /// Its type.
        kind: String,
    },
    /// A link that a joint names and nobody defines.
    #[error("joint `{joint}` names the link `{link}`, which does not exist")]
    NoLink {
        /// The joint.
        joint: String,
        /// The link.
        link: String,
    },
    /// Two links or two joints with one name.
    #[error("two {what} are called `{name}`")]
    Twice {
        /// Links or joints.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A link that hangs on two joints.
    #[error("link `{link}` hangs on the joints `{first}` and `{second}`; a robot is a tree")]
    TwoParents {
        /// The link.
        link: String,
        /// One joint.
        first: String,
        /// The other.
        second: String,
    },
    /// No root, or several.
    #[error("{} links have no parent ({}); a robot has one root", roots.len(), roots.join(", "))]
    Roots {
        /// The links without a parent.
        roots: Vec<String>,
    },
    /// Links that hang on each other in a ring.
    #[error("the links {} hang on each other in a loop", links.join(", "))]
    Loop {
        /// The links that the root does not reach.
        links: Vec<String>,
    },
    /// A number that no body can have.
    #[error("{what} of `{name}` is {value}, which is no {what}")]
    Value {
        /// The link or joint.
        name: String,
        /// Which quantity.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A joint that moves nothing: no mass beyond it.
    #[error("joint `{joint}` moves `{link}`, which has no mass and carries none; give it an <inertial>")]
    Massless {
        /// The joint.
        joint: String,
        /// The link it moves.
        link: String,
    },
}

/// What was left out of a robot.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UrdfWarning {
    /// A mesh.
    #[error("link `{link}`: the mesh `{file}` is left out; only primitives touch things")]
    Mesh {
        /// The link.
        link: String,
        /// The mesh's file.
        file: String,
    },
    /// A joint that should follow another one.
    #[error("joint `{joint}` should mimic `{leader}`; it moves on its own")]
    Mimic {
        /// The joint.
        joint: String,
        /// The joint it should follow.
        leader: String,
    },
    /// A hinge or slide without a range.
    #[error("joint `{joint}` has no limits; it moves without end")]
    NoLimits {
        /// The joint.
        joint: String,
    },
}

/// A robot from a URDF file.
///
/// # Errors
/// [`UrdfError`], which names the link or joint.
pub fn load_urdf(path: &Path, base: Base) -> Result<(Robot, Vec<UrdfWarning>), UrdfError> {
    let text = std::fs::read_to_string(path).map_err(|source| UrdfError::File { path: path.to_owned(), source })?;
    parse_urdf(&text, base)
}

/// A robot from a URDF text. The root stands at the world's origin.
///
/// # Errors
/// [`UrdfError`], which names the link or joint.
pub fn parse_urdf(text: &str, base: Base) -> Result<(Robot, Vec<UrdfWarning>), UrdfError> {
    let urdf = urdf_rs::read_from_string(text).map_err(|e| UrdfError::Syntax { what: e.to_string() })?;
    let mut warnings = Vec::new();
    let mut links: Vec<Link> = Vec::new();
    for (index, carrier) in tree_order(&urdf)? {
        let parent = carrier.and_then(|j| links.iter().position(|l| l.name == j.parent.link));
        let joint = carrier.map_or(Ok(root_joint()), |j| joint(j, &mut warnings))?;
        links.push(link(&urdf.links[index], parent, joint, &mut warnings)?);
    }
    check_carried_mass(&links)?;
    Ok((Robot { name: urdf.name, base, start: Isometry3::identity(), links }, warnings))
}

/// Indices of the links, parents before children and else in the file's order, with the joints that carry them.
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
    let [root] = roots[..] else { return Err(UrdfError::Roots { roots: names(roots) }) };
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

/// The root hangs on nothing; its joint is ignored.
fn root_joint() -> Joint {
    Joint {
        name: String::new(),
        kind: JointKind::Fixed,
        origin: Isometry3::identity(),
        axis: Vector3::x(),
        limits: (f64::NEG_INFINITY, f64::INFINITY),
        start: 0.0,
        armature: 0.0,
        damping: 0.0,
        dry_friction: 0.0,
        actuator: Actuator::Passive,
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
    if let Some(mimic) = &j.mimic {
        warnings.push(UrdfWarning::Mimic { joint: j.name.clone(), leader: mimic.joint.clone() });
    }
    let axis = Vector3::from(j.axis.xyz.0);
    let length = axis.norm();
    if kind != JointKind::Fixed && !(length.is_finite() && length > 1e-9) {
        return Err(UrdfError::Value { name: j.name.clone(), what: "length of the axis", value: length });
    }
    let limits = limits(j, kind, warnings);
    let (damping, dry_friction) = j.dynamics.as_ref().map_or((0.0, 0.0), |d| (d.damping, d.friction));
    for (what, value) in [("damping", damping), ("friction", dry_friction)] {
        not_negative(&j.name, what, value)?;
    }
    let axis = if length > 1e-9 { axis / length } else { Vector3::x() };
    let (origin, start) = (pose(&j.origin), 0.0_f64.clamp(limits.0, limits.1));
    Ok(Joint { name: j.name.clone(), kind, origin, axis, limits, start, damping, dry_friction, ..root_joint() })
}

/// The range of a joint. An absent `<limit>` reads as zeros, which no hinge or slide means.
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

fn link(
    l: &urdf_rs::Link,
    parent: Option<usize>,
    joint: Joint,
    warnings: &mut Vec<UrdfWarning>,
) -> Result<Link, UrdfError> {
    let mass_kg = l.inertial.mass.value;
    not_negative(&l.name, "mass", mass_kg)?;
    let frame = pose(&l.inertial.origin);
    let i = &l.inertial.inertia;
    for (what, value) in [("ixx", i.ixx), ("iyy", i.iyy), ("izz", i.izz)] {
        not_negative(&l.name, what, value)?;
    }
    let own = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
    let turn = frame.rotation.to_rotation_matrix();
    let mut shapes = Vec::new();
    for collision in &l.collision {
        match geometry(&collision.geometry) {
            Ok(geometry) => shapes.push(Shape { pose: pose(&collision.origin), geometry }),
            Err(file) => warnings.push(UrdfWarning::Mesh { link: l.name.clone(), file }),
        }
    }
    let (com_m, inertia_kg_m2) = (Point3::from(frame.translation.vector), turn * own * turn.transpose());
    Ok(Link { name: l.name.clone(), parent, joint, mass_kg, com_m, inertia_kg_m2, shapes, foot: false })
}

/// The primitive, or the file of the mesh.
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

fn not_negative(name: &str, what: &'static str, value: f64) -> Result<(), UrdfError> {
    if value >= 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(UrdfError::Value { name: name.to_owned(), what, value })
}

/// A joint that moves needs something with mass to move: the link or one that hangs on it.
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
