//! Contact detection with the floor and the ball, in closed form: the floor is a plane, and the point nearest to the
//! ball's centre is known for every primitive.

use super::linear_algebra::lanes::{Lanes, Mask};
use super::linear_algebra::spatial::Spatial;
use super::linear_algebra::vectors::{M3, V3};
use super::tree::Tree;
use pulp::Simd;

/// Maximum number of contact points of one shape with the floor.
const POINTS: usize = 8;

/// A shape on a body.
pub(super) struct Hull<S: Simd> {
    pub(super) body: usize,
    /// Index of the foot that it belongs to, if any.
    pub(super) foot: Option<usize>,
    pub(super) centre: V3<S>,
    pub(super) rotation: M3<S>,
    pub(super) form: Form<S>,
    /// Bounding radius about its centre, in m.
    pub(super) reach: Lanes<S>,
}

/// The form of a hull. Cylinders and capsules are aligned with its z axis.
pub(super) enum Form<S: Simd> {
    Box { half: V3<S> },
    Sphere { radius: Lanes<S> },
    Cylinder { radius: Lanes<S>, half_length: Lanes<S> },
    Capsule { radius: Lanes<S>, half_length: Lanes<S> },
}

/// The ball's contact properties.
pub(super) struct BallShape<S: Simd> {
    pub(super) body: usize,
    pub(super) radius: Lanes<S>,
    pub(super) friction: Lanes<S>,
    pub(super) restitution: Lanes<S>,
}

/// A contact point of two bodies, touching or about to touch.
#[derive(Clone, Copy)]
pub(super) struct ContactPoint<S: Simd> {
    /// The hull; none for the ball on the floor.
    pub(super) hull: Option<usize>,
    pub(super) body: usize,
    /// The other body; none for the floor.
    pub(super) other: Option<usize>,
    pub(super) point: V3<S>,
    /// Contact normal, from the other body to this one.
    pub(super) normal: V3<S>,
    /// Penetration depth in m; negative while there is a gap.
    pub(super) depth: Lanes<S>,
    /// Index among all possible contact points.
    pub(super) slot: usize,
    /// Candidates that have this contact.
    pub(super) mask: Mask<S>,
}

impl<S: Simd> ContactPoint<S> {
    /// Relative velocity of the two bodies at the contact point.
    #[inline(always)]
    pub(super) fn relative_velocity(&self, motions: &[Spatial<S>]) -> V3<S> {
        let own = motions[self.body].at(&self.point);
        self.other.map_or(own, |other| own - motions[other].at(&self.point))
    }

    /// A vector's components along the normal and two tangents. On the floor the tangents are the world's axes.
    #[inline(always)]
    pub(super) fn in_contact_frame(&self, simd: S, vector: &V3<S>) -> [Lanes<S>; 3] {
        if self.other.is_none() {
            return [vector.0[2], vector.0[0], vector.0[1]];
        }
        let side = across(simd, &self.normal);
        [self.normal.dot(vector), side.dot(vector), self.normal.cross(&side).dot(vector)]
    }
}

/// A unit vector perpendicular to another; x for a vertical one.
#[inline(always)]
fn across<S: Simd>(simd: S, normal: &V3<S>) -> V3<S> {
    let (x, y) = (V3::axis(simd, 0), V3::axis(simd, 1));
    let steep = normal.0[0].abs().less(Lanes::splat(simd, 0.7));
    let mut along = x;
    for k in 0..3 {
        along.0[k] = steep.select(x.0[k], y.0[k]);
    }
    let side = along - normal.times(normal.dot(&along));
    side.times(side.norm().recip())
}

/// Candidates for a hull's lowest points.
struct LowPoints<S: Simd> {
    points: [V3<S>; POINTS],
    count: usize,
}

impl<S: Simd> Hull<S> {
    /// Candidates for the lowest points, in the hull's axes; `up` is the vertical in these axes.
    #[inline(always)]
    fn low_points(&self, simd: S, up: &V3<S>) -> LowPoints<S> {
        let zero = Lanes::zero(simd);
        let mut points = [V3::zero(simd); POINTS];
        let count = match &self.form {
            Form::Box { half } => {
                let [x, y, z] = half.0;
                for (k, point) in points.iter_mut().enumerate() {
                    *point = V3([
                        if k & 1 == 0 { -x } else { x },
                        if k & 2 == 0 { -y } else { y },
                        if k & 4 == 0 { -z } else { z },
                    ]);
                }
                8
            }
            Form::Sphere { radius } => {
                points[0] = up.times(-*radius);
                1
            }
            Form::Capsule { radius, half_length } => {
                let low = up.times(-*radius);
                points[0] = low + V3([zero, zero, -*half_length]);
                points[1] = low + V3([zero, zero, *half_length]);
                2
            }
            Form::Cylinder { radius, half_length } => {
                // The lowest point of each rim and three more, so that the cylinder can stand on its end.
                let [x, y, _] = up.0;
                let tilt = (x * x + y * y).sqrt();
                let (leans, one) = (Lanes::splat(simd, 1e-9).less(tilt), Lanes::splat(simd, 1.0));
                let share = *radius / leans.select(tilt, one);
                let (x, y) = (leans.select(-x * share, *radius), leans.select(-y * share, zero));
                for (k, end) in [-*half_length, *half_length].into_iter().enumerate() {
                    points[4 * k] = V3([x, y, end]);
                    points[4 * k + 1] = V3([-y, x, end]);
                    points[4 * k + 2] = V3([-x, -y, end]);
                    points[4 * k + 3] = V3([y, -x, end]);
                }
                8
            }
        };
        LowPoints { points, count }
    }

    /// The hull's point nearest to a point outside, both in the hull's axes.
    #[inline(always)]
    fn nearest(&self, point: &V3<S>) -> V3<S> {
        let [x, y, z] = point.0;
        match &self.form {
            Form::Box { half } => {
                let [a, b, c] = half.0;
                V3([x.clamp(-a, a), y.clamp(-b, b), z.clamp(-c, c)])
            }
            Form::Sphere { radius } => point.times(*radius / point.norm()),
            Form::Capsule { radius, half_length } => {
                let centre = V3([x.like(0.0), x.like(0.0), z.clamp(-*half_length, *half_length)]);
                let away = *point - centre;
                centre + away.times(*radius / away.norm())
            }
            Form::Cylinder { radius, half_length } => {
                let shrink = (*radius / (x * x + y * y).sqrt()).min(x.like(1.0));
                V3([x * shrink, y * shrink, z.clamp(-*half_length, *half_length)])
            }
        }
    }
}

/// Height of the floor, if there is one, and the largest gap that counts as a contact.
#[derive(Clone, Copy)]
pub(super) struct Reach<S: Simd> {
    /// The floor's height in the tree's axes.
    pub(super) floor: Option<Lanes<S>>,
    /// Largest gap that counts as a contact, in m.
    pub(super) gap: Lanes<S>,
}

/// Finds all contact points, present and imminent.
#[inline(always)]
pub(super) fn find<S: Simd>(
    simd: S,
    tree: &Tree<S>,
    hulls: &[Hull<S>],
    ball: Option<&BallShape<S>>,
    reach: Reach<S>,
    contact_points: &mut Vec<ContactPoint<S>>,
) {
    contact_points.clear();
    let up = V3::axis(simd, 2);
    for (number, hull) in hulls.iter().enumerate() {
        let rotation = &tree.rotations[hull.body];
        let centre = tree.places[hull.body] + rotation.transform(&hull.centre);
        if let Some(floor) = reach.floor {
            let near = (centre.0[2] - hull.reach - floor).less(reach.gap);
            if near.any() {
                let rotated = rotation.product(&hull.rotation);
                let low = hull.low_points(simd, &rotated.row(2));
                for k in 0..low.count {
                    let point = centre + rotated.transform(&low.points[k]);
                    let depth = floor - point.0[2];
                    let mask = near.and((-reach.gap).less(depth));
                    if mask.any() {
                        let slot = number * (POINTS + 1) + k;
                        let (hull, body) = (Some(number), hull.body);
                        contact_points.push(ContactPoint {
                            hull,
                            body,
                            other: None,
                            point,
                            normal: up,
                            depth,
                            slot,
                            mask,
                        });
                    }
                }
            }
        }
        if let Some(ball) = ball {
            touch_ball(simd, tree, (number, hull, &centre), ball, reach.gap, contact_points);
        }
    }
    if let Some((ball, floor)) = ball.zip(reach.floor) {
        let [x, y, z] = tree.places[ball.body].0;
        let point = V3([x, y, z - ball.radius]);
        let depth = floor - point.0[2];
        let mask = (-reach.gap).less(depth);
        if mask.any() {
            let slot = hulls.len() * (POINTS + 1);
            contact_points.push(ContactPoint {
                hull: None,
                body: ball.body,
                other: None,
                point,
                normal: up,
                depth,
                slot,
                mask,
            });
        }
    }
}

/// Adds the contact of a hull, given with its number and its centre, with the ball.
#[inline(always)]
fn touch_ball<S: Simd>(
    simd: S,
    tree: &Tree<S>,
    (number, hull, centre): (usize, &Hull<S>, &V3<S>),
    ball: &BallShape<S>,
    gap: Lanes<S>,
    contact_points: &mut Vec<ContactPoint<S>>,
) {
    let middle = tree.places[ball.body];
    let near = ((middle - *centre).norm() - hull.reach - ball.radius).less(gap);
    if !near.any() {
        return;
    }
    let rotated = tree.rotations[hull.body].product(&hull.rotation);
    let inside = rotated.transform_transposed(&(middle - *centre));
    let point = *centre + rotated.transform(&hull.nearest(&inside));
    let away = point - middle;
    let distance = away.norm();
    // The contact normal is undefined when the ball's centre is inside the hull.
    let outside = Lanes::zero(simd).less(distance);
    let mask = near.and(outside).and((distance - ball.radius).less(gap));
    if mask.any() {
        let share = outside.select(distance, Lanes::splat(simd, 1.0)).recip();
        // Candidates without this contact need finite values all the same.
        let normal = V3::select(mask, &away.times(share), &V3::axis(simd, 2));
        let (point, depth) = (V3::select(mask, &point, &middle), ball.radius - distance);
        let slot = number * (POINTS + 1) + POINTS;
        let (hull, body, other) = (Some(number), hull.body, Some(ball.body));
        contact_points.push(ContactPoint { hull, body, other, point, normal, depth, slot, mask });
    }
}

/// Number of possible contact points.
pub(super) fn slots<S: Simd>(hulls: &[Hull<S>]) -> usize {
    hulls.len() * (POINTS + 1) + 1
}
