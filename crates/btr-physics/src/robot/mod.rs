//! A robot: links in a tree, joints between them, an actuator on each joint. Plain data, URDF's conventions.
//!
//! A link's frame is its joint's frame; at q = 0 it is `joint.origin` away from its parent's frame. Right-handed, SI
//! units, z up unless the robot's file says otherwise.

mod drawn;
pub mod kinematics;
mod neighbours;
pub(crate) mod point_mass;
pub mod site;
pub(crate) mod stretch;
pub mod urdf;

pub use drawn::DrawnBody;
pub use neighbours::{Neighbours, Side};

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

/// How the root is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Base {
    /// Bolted to the world.
    Fixed,
    /// Free to move in all six directions.
    Floating,
}

/// A tree of links; `links[0]` is the root, parents stand before their children.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// Name in reports.
    pub name: String,
    /// How the root is held.
    pub base: Base,
    /// Start pose of the root's frame, in the world.
    pub start: Isometry3<f64>,
    /// All links, root first.
    pub links: Vec<Link>,
}

/// A rigid body and the joint that carries it.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Unique in the robot.
    pub name: String,
    /// Index of the parent in [`Robot::links`]; `None` for the root only.
    pub parent: Option<usize>,
    /// The joint to the parent; the root's is ignored.
    pub joint: Joint,
    /// Mass in kg.
    pub mass_kg: f64,
    /// Centre of mass in the link's frame, in m.
    pub com_m: Point3<f64>,
    /// Inertia about the centre of mass in the link's axes, in kg·m².
    pub inertia_kg_m2: Matrix3<f64>,
    /// Contact shapes, in the link's frame; empty for a link without contact.
    pub shapes: Vec<Shape>,
    /// Boxes around its meshes, in the link's frame, where they are known: they are drawn and say where the link ends,
    /// and touch nothing.
    pub mesh_boxes: Vec<Shape>,
    /// Whether its contact force is a sensor (`foot_<link>_*`).
    pub foot: bool,
}

/// A convex body with its pose in the link's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Pose in the link's frame.
    pub pose: Isometry3<f64>,
    /// The geometry.
    pub geometry: Geometry,
}

/// Primitives, in m.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A box by its half sides.
    Box {
        /// Half of each side.
        half_m: Vector3<f64>,
    },
    /// A ball.
    Sphere {
        /// Its radius.
        radius_m: f64,
    },
    /// A cylinder along the local z axis.
    Cylinder {
        /// Its radius.
        radius_m: f64,
        /// Half its length.
        half_length_m: f64,
    },
    /// A cylinder with round caps along the local z axis.
    Capsule {
        /// Its radius.
        radius_m: f64,
        /// Half the length of its straight part.
        half_length_m: f64,
    },
}

/// Relative motion of two links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Not at all.
    Fixed,
    /// About the axis, in rad.
    Revolute,
    /// Along the axis, in m.
    Prismatic,
}

/// A joint with its actuator, friction, rotor inertia and limits.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Unique in the robot.
    pub name: String,
    /// Fixed, hinge or slide.
    pub kind: JointKind,
    /// The joint's frame in the parent's frame at q = 0.
    pub origin: Isometry3<f64>,
    /// Unit vector in the joint's frame.
    pub axis: Vector3<f64>,
    /// Smallest and largest position; infinite where unlimited.
    pub limits: (f64, f64),
    /// Speed limit of references, in rad/s (m/s); infinite where unlimited. Drives that plan a motion respect it; the
    /// dynamics do not use it.
    pub speed_limit: f64,
    /// Position at the start.
    pub start: f64,
    /// Rotor inertia seen at the joint, in kg·m² (kg for slides).
    pub armature: f64,
    /// Viscous friction, in N·m·s/rad (N·s/m).
    pub damping: f64,
    /// Coulomb friction that holds at rest, in N·m (N).
    pub dry_friction: f64,
    /// Its actuator.
    pub actuator: Actuator,
    /// Sampling of a digital servo; a servo without it works in continuous time.
    pub sampling: Option<Sampling>,
    /// The joint that it follows, if any.
    pub mimic: Option<Mimic>,
}

/// A gear or a linkage between two joints (URDF's `<mimic>`): q = ratio·q_leader + offset, as an ideal constraint
/// without play.
#[derive(Clone, Debug, PartialEq)]
pub struct Mimic {
    /// Name of the joint that is followed, which is not a follower itself.
    pub leader: String,
    /// Motion per unit motion of the leader.
    pub ratio: f64,
    /// Position when the leader is at zero, in rad (m).
    pub offset: f64,
}

/// Sampling of a digital servo: at fixed instants it reads the position and computes an output held until the next one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Time between two instants, in s: a multiple of the physics step.
    pub period_s: f64,
    /// Number of periods between the two readings whose difference gives the servo's velocity.
    pub velocity_over: u32,
}

/// Actuator that converts a command into a torque.
#[derive(Clone, Debug, PartialEq)]
pub enum Actuator {
    /// Nothing: the joint swings freely.
    Passive,
    /// tau = clamp(kp·(cmd − q) + ki·∫(cmd − q)dt − kd·dq, ±max_torque).
    Position {
        /// N·m/rad.
        kp: f64,
        /// N·m/(rad·s).
        ki: f64,
        /// N·m·s/rad.
        kd: f64,
        /// N·m.
        max_torque: f64,
    },
    /// tau = clamp(cmd, ±max_torque).
    Torque {
        /// N·m.
        max_torque: f64,
    },
    /// tau = kt·(V − kt·dq)/R, where V is the command itself, or supply·clamp(gain·(cmd − q), ±max_duty) with a loop.
    Voltage {
        /// Torque constant in N·m/A = V·s/rad.
        kt: f64,
        /// Winding resistance in ohm.
        resistance: f64,
        /// The position loop around it, if any.
        servo: Option<DutyLoop>,
    },
    /// The joint follows its measured motion with any torque required; without a measurement the command is the
    /// position.
    Prescribed,
}

/// A position loop that sets the duty cycle of a bridge.
#[derive(Clone, Debug, PartialEq)]
pub struct DutyLoop {
    /// Duty per rad of error.
    pub gain: f64,
    /// Largest duty, at most 1.
    pub max_duty: f64,
    /// Supply voltage in V.
    pub supply: f64,
}

/// A follower and its leader, as indices in [`Robot::movable`]: q = ratio·q_leader + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Follower {
    /// The follower.
    pub joint: usize,
    /// The leader.
    pub leader: usize,
    /// See [`Mimic::ratio`].
    pub ratio: f64,
    /// See [`Mimic::offset`].
    pub offset: f64,
}

impl Robot {
    /// The links whose joint can move, in order: the order of commands and joint states everywhere.
    pub fn movable(&self) -> impl Iterator<Item = (usize, &Link)> {
        self.links.iter().enumerate().skip(1).filter(|(_, link)| link.joint.kind != JointKind::Fixed)
    }

    /// The joints whose motion is prescribed: what is simulated of them is their torque.
    pub fn prescribed(&self) -> impl Iterator<Item = &Joint> {
        self.movable().map(|(_, link)| &link.joint).filter(|joint| joint.actuator == Actuator::Prescribed)
    }

    /// Whether the motion of the whole robot is prescribed: what acts in a joint shows in its own torque alone.
    pub fn is_prescribed(&self) -> bool {
        self.base == Base::Fixed && self.prescribed().count() == self.movable().count()
    }

    /// The joints that follow other existing joints.
    pub fn followers(&self) -> Vec<Follower> {
        let place = |name: &str| self.movable().position(|(_, link)| link.joint.name == name);
        let follower = |(joint, (_, link)): (usize, (usize, &Link))| {
            let Mimic { leader, ratio, offset } = link.joint.mimic.as_ref()?;
            Some(Follower { joint, leader: place(leader)?, ratio: *ratio, offset: *offset })
        };
        self.movable().enumerate().filter_map(follower).collect()
    }

    /// Lets the joint that carries a link count the other way round; its pose at zero stays.
    pub fn reverse(&mut self, link: usize) {
        let joint = &mut self.links[link].joint;
        joint.axis = -joint.axis;
        joint.limits = (-joint.limits.1, -joint.limits.0);
        joint.start = -joint.start;
        let name = joint.name.clone();
        if let Some(mimic) = &mut joint.mimic {
            (mimic.ratio, mimic.offset) = (-mimic.ratio, -mimic.offset);
        }
        let followers = self.links.iter_mut().filter_map(|link| link.joint.mimic.as_mut());
        followers.filter(|mimic| mimic.leader == name).for_each(|mimic| mimic.ratio = -mimic.ratio);
    }

    /// Sets the start positions of followers from those of their leaders.
    pub(crate) fn settle_followers(&mut self) {
        let movable: Vec<usize> = self.movable().map(|(link, _)| link).collect();
        for Follower { joint, leader, ratio, offset } in self.followers() {
            self.links[movable[joint]].joint.start = ratio * self.links[movable[leader]].joint.start + offset;
        }
    }

    /// Whether `links` is a tree with the root first and parents before their children.
    pub fn is_tree(&self) -> bool {
        let mut parents = self.links.iter().map(|link| link.parent).enumerate();
        parents.next() == Some((0, None)) && parents.all(|(i, parent)| parent.is_some_and(|parent| parent < i))
    }

    /// The index of a link by its name.
    pub fn link(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|link| link.name == name)
    }

    /// Whether a movable joint is further out than a link.
    pub(crate) fn carries_joint(&self, link: usize) -> bool {
        let is_below = |mut other: usize| {
            while let Some(parent) = self.links[other].parent {
                if parent == link {
                    return true;
                }
                other = parent;
            }
            false
        };
        self.movable().any(|(other, _)| is_below(other))
    }

    /// Sum of all masses, in kg.
    pub fn mass_kg(&self) -> f64 {
        self.links.iter().map(|link| link.mass_kg).sum()
    }
}

impl Geometry {
    /// Inertia of a homogeneous body of this geometry about its centre, in its own axes, in kg·m².
    pub fn inertia_kg_m2(&self, mass_kg: f64) -> Matrix3<f64> {
        let diagonal = match *self {
            Geometry::Box { half_m: h } => {
                Vector3::new(h.y * h.y + h.z * h.z, h.x * h.x + h.z * h.z, h.x * h.x + h.y * h.y) / 3.0
            }
            Geometry::Sphere { radius_m: r } => Vector3::repeat(0.4 * r * r),
            Geometry::Cylinder { radius_m: r, half_length_m: h } => {
                let across = r * r / 4.0 + h * h / 3.0;
                Vector3::new(across, across, r * r / 2.0)
            }
            Geometry::Capsule { radius_m: r, half_length_m: h } => capsule_gyration_m2(r, h),
        };
        Matrix3::from_diagonal(&(diagonal * mass_kg))
    }
}

/// Squared radii of gyration of a capsule along z: a cylinder and two hemispheres, weighted by volume.
fn capsule_gyration_m2(r: f64, h: f64) -> Vector3<f64> {
    let (cylinder, ball) = (2.0 * h, 4.0 / 3.0 * r);
    let share = cylinder / (cylinder + ball);
    let along = share * r * r / 2.0 + (1.0 - share) * 0.4 * r * r;
    let caps = 0.4 * r * r + h * h + 0.75 * h * r;
    let across = share * (r * r / 4.0 + h * h / 3.0) + (1.0 - share) * caps;
    Vector3::new(across, across, along)
}

impl Joint {
    /// A plain joint of this kind: unlimited, without friction, rotor or motor, starting at zero.
    pub fn new(name: impl Into<String>, kind: JointKind, origin: Isometry3<f64>, axis: Vector3<f64>) -> Self {
        Joint {
            name: name.into(),
            kind,
            origin,
            axis,
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

    /// The log channel to which its simulation is compared: the torque if its motion is prescribed.
    pub fn compared(&self) -> String {
        match self.actuator {
            Actuator::Prescribed => format!("tau_{}", self.name),
            _ => format!("q_{}", self.name),
        }
    }

    /// Unit of its position: rad, or m for slides.
    pub fn position_unit(&self) -> &'static str {
        if self.kind == JointKind::Prismatic { "m" } else { "rad" }
    }

    /// Unit of its velocity: rad/s, or m/s for slides.
    pub fn velocity_unit(&self) -> &'static str {
        if self.kind == JointKind::Prismatic { "m/s" } else { "rad/s" }
    }

    /// Unit of its torque: N·m, or N for slides.
    pub fn torque_unit(&self) -> &'static str {
        if self.kind == JointKind::Prismatic { "N" } else { "N·m" }
    }

    /// Unit of the command that its actuator takes.
    pub fn command_unit(&self) -> &'static str {
        match self.actuator {
            Actuator::Torque { .. } => self.torque_unit(),
            Actuator::Voltage { servo: None, .. } => "V",
            Actuator::Passive
            | Actuator::Position { .. }
            | Actuator::Voltage { servo: Some(_), .. }
            | Actuator::Prescribed => self.position_unit(),
        }
    }
}
