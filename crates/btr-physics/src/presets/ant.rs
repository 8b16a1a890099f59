//! The ant of the paper's section 4.1: six legs of two segments, 18 PID-driven hinges.
//!
//! The paper gives the number of legs, segments and motors, the drive r_i = theta_i + a_i·sin(omega·t + psi_i), and
//! that the lengths of four of the twelve segments are unknown. Everything else is **chosen here**:
//!
//! - x forward, y left, z up; legs `L1 L2 L3` on the left and `R1 R2 R3` on the right, front to back, each pointing
//!   away from the trunk, the front and hind ones 35° forward and backward.
//! - Each leg has three hinges: `yaw` (about the vertical; swings the leg), `pitch` (raises the femur) and `knee`
//!   (raises the tibia). Between `yaw` and `pitch` there is a small coxa without length, since a joint has one axis.
//! - Trunk 24 × 10 × 4 cm, 0.6 kg; coxa 20 g; femur 8 cm, 50 g; tibia 10 cm, 40 g; 1.26 kg in total. Segments are
//!   capsules of 1 cm radius; the tip of a tibia is the foot.
//! - At rest the femora rise by 29° and the tibiae point 63° down, so that the trunk's belly is 4 cm above the ground.
//! - PID servos: kp 12 N·m/rad, ki 4 N·m/(rad·s), kd 0.3 N·m·s/rad, at most 3 N·m, with 0.0005 kg·m² of rotor inertia.
//! - omega is 1.5 strides per second. The unknown lengths are those of the two front legs' segments.

use crate::drive::Sine;
use crate::robot::{Actuator, Base, Geometry, Joint, JointKind, Link, Robot, Shape};
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// omega of the drive, in rad/s.
pub const OMEGA_RAD_S: f64 = 3.0 * PI;
/// Largest amplitude a_i of the paper's controller space, in rad.
pub const MAX_AMPLITUDE_RAD: f64 = 0.5;
/// The four segments whose lengths span the paper's search space.
pub const UNCERTAIN_LENGTHS: [&str; 4] = ["L1_femur", "L1_tibia", "R1_femur", "R1_tibia"];

/// theta of yaw, pitch and knee, in rad.
const CENTRES_RAD: [f64; 3] = [0.0, 0.5, -1.6];
const FEMUR_M: f64 = 0.08;
const TIBIA_M: f64 = 0.10;
const RADIUS_M: f64 = 0.01;

/// Placement of a leg: its name, its hip on the trunk in m, its heading in rad.
struct LegPlacement {
    name: &'static str,
    hip_m: [f64; 2],
    heading_rad: f64,
}

const SPLAY_RAD: f64 = 0.61;
const LEGS: [LegPlacement; 6] = [
    LegPlacement { name: "L1", hip_m: [0.10, 0.05], heading_rad: FRAC_PI_2 - SPLAY_RAD },
    LegPlacement { name: "L2", hip_m: [0.00, 0.05], heading_rad: FRAC_PI_2 },
    LegPlacement { name: "L3", hip_m: [-0.10, 0.05], heading_rad: FRAC_PI_2 + SPLAY_RAD },
    LegPlacement { name: "R1", hip_m: [0.10, -0.05], heading_rad: -FRAC_PI_2 + SPLAY_RAD },
    LegPlacement { name: "R2", hip_m: [0.00, -0.05], heading_rad: -FRAC_PI_2 },
    LegPlacement { name: "R3", hip_m: [-0.10, -0.05], heading_rad: -FRAC_PI_2 - SPLAY_RAD },
];

/// The ant with all lengths nominal, on its feet.
pub fn ant() -> Robot {
    let [_, pitch, knee] = CENTRES_RAD;
    let hip_height = -FEMUR_M * pitch.sin() - TIBIA_M * (pitch + knee).sin() + RADIUS_M;
    let mut links = vec![trunk()];
    for leg in &LEGS {
        add_leg(&mut links, leg);
    }
    Robot { name: "ant".to_owned(), base: Base::Floating, start: Isometry3::translation(0.0, 0.0, hip_height), links }
}

/// theta_i of the 18 joints, in rad, in their order: yaw, pitch, knee of `L1 L2 L3 R1 R2 R3`.
pub fn centres() -> Vec<f64> {
    CENTRES_RAD.repeat(LEGS.len())
}

/// The drive of the paper for a controller c = [a_1, psi_1, ..., a_18, psi_18], in rad.
pub fn drive(controller: Vec<f64>) -> Sine {
    Sine { centres: centres(), controller, omega_rad_s: OMEGA_RAD_S }
}

/// Alternating tripod gait: L1, R2, L3 step together, half a stride before the others. Walks along x.
pub fn tripod() -> Sine {
    let controller = LEGS.iter().enumerate().flat_map(|(i, leg)| {
        let phase = if i % 2 == 0 { 0.0 } else { PI };
        // A foot moves forward while it is up. On the left, forward is a negative rotation about the vertical.
        let forward = if leg.heading_rad > 0.0 { PI } else { 0.0 };
        let phase = if leg.heading_rad > 0.0 { phase } else { PI - phase };
        [0.35, phase + forward, 0.25, phase + FRAC_PI_2, 0.0, 0.0]
    });
    drive(controller.collect())
}

fn trunk() -> Link {
    let geometry = Geometry::Box { half_m: Vector3::new(0.12, 0.05, 0.02) };
    Link {
        name: "trunk".to_owned(),
        parent: None,
        joint: Joint::new("root", JointKind::Fixed, Isometry3::identity(), Vector3::z()),
        mass_kg: 0.6,
        com_m: Point3::origin(),
        inertia_kg_m2: geometry.inertia_kg_m2(0.6),
        shapes: vec![Shape { pose: Isometry3::identity(), geometry }],
        mesh_boxes: vec![],
        foot: false,
    }
}

fn add_leg(links: &mut Vec<Link>, leg: &LegPlacement) {
    let [yaw, pitch, knee] = CENTRES_RAD;
    let hip = Isometry3::from_parts(
        Translation3::new(leg.hip_m[0], leg.hip_m[1], 0.0),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), leg.heading_rad),
    );
    let coxa = Link {
        name: format!("{}_coxa", leg.name),
        parent: Some(0),
        joint: hinge(format!("{}_yaw", leg.name), hip, Vector3::z(), yaw),
        mass_kg: 0.02,
        com_m: Point3::origin(),
        inertia_kg_m2: Matrix3::from_diagonal_element(0.4 * 0.02 * RADIUS_M * RADIUS_M),
        shapes: Vec::new(),
        mesh_boxes: vec![],
        foot: false,
    };
    links.push(coxa);
    let pitch = hinge(format!("{}_pitch", leg.name), Isometry3::identity(), -Vector3::y(), pitch);
    links.push(segment(format!("{}_femur", leg.name), links.len() - 1, pitch, 0.05, FEMUR_M));
    let knee = hinge(format!("{}_knee", leg.name), Isometry3::translation(FEMUR_M, 0.0, 0.0), -Vector3::y(), knee);
    let tibia = segment(format!("{}_tibia", leg.name), links.len() - 1, knee, 0.04, TIBIA_M);
    links.push(Link { foot: true, ..tibia });
}

fn hinge(name: String, origin: Isometry3<f64>, axis: Vector3<f64>, start: f64) -> Joint {
    let actuator = Actuator::Position { kp: 12.0, ki: 4.0, kd: 0.3, max_torque: 3.0 };
    Joint { start, armature: 0.0005, actuator, ..Joint::new(name, JointKind::Revolute, origin, axis) }
}

/// A link with a capsule that extends from its joint along x.
fn segment(name: String, parent: usize, joint: Joint, mass_kg: f64, length_m: f64) -> Link {
    let geometry = Geometry::Capsule { radius_m: RADIUS_M, half_length_m: length_m / 2.0 };
    let along_x = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), FRAC_PI_2);
    let turn = along_x.to_rotation_matrix();
    Link {
        name,
        parent: Some(parent),
        joint,
        mass_kg,
        com_m: Point3::new(length_m / 2.0, 0.0, 0.0),
        inertia_kg_m2: turn * geometry.inertia_kg_m2(mass_kg) * turn.transpose(),
        shapes: vec![Shape {
            pose: Isometry3::from_parts(Translation3::new(length_m / 2.0, 0.0, 0.0), along_x),
            geometry,
        }],
        mesh_boxes: vec![],
        foot: false,
    }
}
