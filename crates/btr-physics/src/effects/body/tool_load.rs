//! What the robot holds: a tool, or a load in its gripper. Its place is on no drawing of the robot.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::robot::stretch::tip;
use crate::robot::{Base, Robot};
use nalgebra::{Point3, Vector3};

/// How far beside the link's end a search starts as well, as a share of the link's length.
const ASIDE: f64 = 0.3;

pub(in crate::effects) struct ToolLoad;

static SPEC: EffectSpec = EffectSpec {
    name: "tool_load",
    law: "a point mass at (x, y, z) in the link's frame, on a link that carries no joint",
    site: SiteKind::Link,
    cite: "Newton",
    symptom: "static errors that follow the posture, on this joint and on all that carry it; they grow with the reach",
    params: &[
        Param::new("mass", "kg", (0.0, 5.0), 0.1),
        Param::shape("x", "m", (-0.4, 0.4), 0.0),
        Param::shape("y", "m", (-0.4, 0.4), 0.0),
        Param::shape("z", "m", (-0.4, 0.4), 0.1),
    ],
    starts: &[&[0.0, 0.0, 0.1]],
    similar: &["payload", "end_payload", "com_offset", "link_inertia"],
    nested: &[],
};

impl Effect for ToolLoad {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn acts_on(&self, robot: &Robot, link: usize) -> bool {
        robot.base == Base::Fixed && !robot.carries_joint(link)
    }

    fn starts(&self, robot: &Robot, link: usize, _top_speed: Option<f64>) -> Vec<Vec<f64>> {
        // At the end of the link, and beside it: about a joint that rolls the link, only that makes a difference.
        let (end, aside) = (tip(robot, link), ASIDE * robot.extent_m(link));
        let across = |axis: Vector3<f64>| end.cross(&axis).try_normalize(f64::EPSILON);
        let first = across(Vector3::ith(end.iamin(), 1.0)).unwrap_or_else(Vector3::x);
        let second = across(first).unwrap_or_else(Vector3::y);
        let places = [Vector3::zeros(), first, -first, second, -second].map(|direction| end + direction * aside);
        places.iter().map(|place| place.as_slice().to_vec()).collect()
    }

    fn link(&self, p: &[f64], robot: &mut Robot, link: usize) {
        robot.links[link].add_point_mass(p[0], &Point3::new(p[1], p[2], p[3]));
    }
}
