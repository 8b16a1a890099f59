//! Where bodies touch the floor or the ball. There is nothing else to touch, so closed forms do: the floor is a plane, and what
//! is nearest to a ball's centre is known for every primitive.

use super::tree::Tree;
use crate::robot::Geometry;
use nalgebra::{Isometry3, Rotation3, Vector3};

/// Points of one shape that may touch at the same time.
const POINTS: usize = 8;

/// A shape on a body.
pub(super) struct Hull {
    pub(super) body: usize,
    /// The foot that it belongs to, if any.
    pub(super) foot: Option<usize>,
    pose: Isometry3<f64>,
    rotation: Rotation3<f64>,
    geometry: Geometry,
    /// No point of it is further from its centre, in m.
    reach: f64,
}

/// The ball, as others touch it.
pub(super) struct Round {
    pub(super) body: usize,
    pub(super) radius: f64,
    pub(super) friction: f64,
    pub(super) restitution: f64,
}

/// Two bodies that touch or are about to.
#[derive(Clone, Copy)]
pub(super) struct Touch {
    /// The hull that touches; none for the ball on the floor.
    pub(super) hull: Option<usize>,
    pub(super) body: usize,
    /// The other body; none for the floor.
    pub(super) other: Option<usize>,
    pub(super) point: Vector3<f64>,
    /// From the other to the body.
    pub(super) normal: Vector3<f64>,
    /// In m; negative while there still is a gap.
    pub(super) depth: f64,
    /// Which of all points that could ever touch this is.
    pub(super) slot: usize,
}

impl Hull {
    pub(super) fn new(body: usize, foot: Option<usize>, pose: Isometry3<f64>, geometry: Geometry) -> Self {
        let reach = match geometry {
            Geometry::Box { half_m } => half_m.norm(),
            Geometry::Sphere { radius_m } => radius_m,
            Geometry::Cylinder { radius_m, half_length_m } => radius_m.hypot(half_length_m),
            Geometry::Capsule { radius_m, half_length_m } => radius_m + half_length_m,
        };
        Hull { body, foot, rotation: pose.rotation.to_rotation_matrix(), pose, geometry, reach }
    }

    /// Calls `tell` with every point (number, place) that may be the lowest one, in the hull's axes; `up` is the vertical there.
    fn low_points(&self, up: &Vector3<f64>, mut tell: impl FnMut(usize, Vector3<f64>)) {
        match self.geometry {
            Geometry::Box { half_m } => {
                for k in 0..8 {
                    let sign = |bit: usize| if k >> bit & 1 == 0 { -1.0 } else { 1.0 };
                    tell(k, half_m.component_mul(&Vector3::new(sign(0), sign(1), sign(2))));
                }
            }
            Geometry::Sphere { radius_m } => tell(0, -up * radius_m),
            Geometry::Capsule { radius_m, half_length_m } => {
                for (k, end) in [-half_length_m, half_length_m].into_iter().enumerate() {
                    tell(k, Vector3::new(0.0, 0.0, end) - up * radius_m);
                }
            }
            Geometry::Cylinder { radius_m, half_length_m } => {
                // The lowest point of each rim and three more, so that it can stand on its end.
                let tilt = up.x.hypot(up.y);
                let (x, y) = if tilt > 1e-9 { (-up.x / tilt, -up.y / tilt) } else { (1.0, 0.0) };
                for (k, end) in [-half_length_m, half_length_m].into_iter().enumerate() {
                    for (l, (x, y)) in [(x, y), (-y, x), (-x, -y), (y, -x)].into_iter().enumerate() {
                        tell(4 * k + l, Vector3::new(radius_m * x, radius_m * y, end));
                    }
                }
            }
        }
    }

    /// The point of the hull that is nearest to one outside, both in the hull's axes.
    fn nearest(&self, point: &Vector3<f64>) -> Vector3<f64> {
        match self.geometry {
            Geometry::Box { half_m } => point.zip_map(&half_m, |x, half| x.clamp(-half, half)),
            Geometry::Sphere { radius_m } => point * (radius_m / point.norm()),
            Geometry::Capsule { radius_m, half_length_m } => {
                let centre = Vector3::new(0.0, 0.0, point.z.clamp(-half_length_m, half_length_m));
                let away = point - centre;
                centre + away * (radius_m / away.norm())
            }
            Geometry::Cylinder { radius_m, half_length_m } => {
                let shrink = (radius_m / point.x.hypot(point.y)).min(1.0);
                Vector3::new(point.x * shrink, point.y * shrink, point.z.clamp(-half_length_m, half_length_m))
            }
        }
    }
}

/// Where the floor is, if there is one, and how near to it or to a ball things may come before they count.
#[derive(Clone, Copy)]
pub(super) struct Reach {
    /// The floor's height in the tree's axes.
    pub(super) floor: Option<f64>,
    /// In m.
    pub(super) gap: f64,
}

/// All that touches or may do so soon.
pub(super) fn find(tree: &Tree, hulls: &[Hull], ball: Option<&Round>, reach: Reach, touches: &mut Vec<Touch>) {
    touches.clear();
    for (number, hull) in hulls.iter().enumerate() {
        let turned = tree.rotations[hull.body] * hull.rotation;
        let centre = tree.places[hull.body] + tree.rotations[hull.body] * hull.pose.translation.vector;
        if let Some(floor) = reach.floor.filter(|floor| centre.z - hull.reach - floor < reach.gap) {
            let up = turned.matrix().row(2).transpose();
            hull.low_points(&up, |k, low| {
                let point = centre + turned * low;
                let depth = floor - point.z;
                if depth > -reach.gap {
                    let slot = number * (POINTS + 1) + k;
                    let (hull, body) = (Some(number), hull.body);
                    touches.push(Touch { hull, body, other: None, point, normal: Vector3::z(), depth, slot });
                }
            });
        }
        let Some(ball) = ball else { continue };
        let middle = tree.places[ball.body];
        if (middle - centre).norm() - hull.reach - ball.radius < reach.gap {
            let inside = turned.inverse() * (middle - centre);
            let point = centre + turned * hull.nearest(&inside);
            let away = point - middle;
            let distance = away.norm();
            // A ball whose centre is inside has no side on which it could be pushed out.
            if distance > 0.0 && distance - ball.radius < reach.gap {
                let (normal, depth) = (away / distance, ball.radius - distance);
                let slot = number * (POINTS + 1) + POINTS;
                let (hull, body, other) = (Some(number), hull.body, Some(ball.body));
                touches.push(Touch { hull, body, other, point, normal, depth, slot });
            }
        }
    }
    if let Some((ball, floor)) = ball.zip(reach.floor) {
        let point = tree.places[ball.body] - Vector3::z() * ball.radius;
        let (body, depth) = (ball.body, floor - point.z);
        if depth > -reach.gap {
            let slot = hulls.len() * (POINTS + 1);
            touches.push(Touch { hull: None, body, other: None, point, normal: Vector3::z(), depth, slot });
        }
    }
}

/// How many slots there are.
pub(super) fn slots(hulls: &[Hull]) -> usize {
    hulls.len() * (POINTS + 1) + 1
}
