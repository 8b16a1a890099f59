//! The robot as a tree of bodies: poses, inertias and recursive Newton-Euler.

use super::linear_algebra::lanes::Lanes;
use super::linear_algebra::spatial::{Inertia, Spatial, Symmetric};
use super::linear_algebra::vectors::{M3, V3};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion};
use pulp::Simd;

/// The joint that carries a body. Joints and free bodies are counted separately.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Carrier {
    /// No joint: six degrees of freedom, the rotational ones first. `pose` is the index of the free body.
    Free { pose: usize },
    /// A hinge.
    Hinge { joint: usize },
    /// A slide.
    Slide { joint: usize },
}

/// A rigid body in the frame of the joint that carries it.
pub(super) struct TreeBody<S: Simd> {
    /// Parent body; none for bodies on a fixed base and for free bodies.
    pub(super) parent: Option<usize>,
    pub(super) carrier: Carrier,
    /// The joint's frame in the parent body's frame at q = 0.
    pub(super) rotation: M3<S>,
    pub(super) place: V3<S>,
    /// The joint's axis in the parent body's frame.
    pub(super) axis: V3<S>,
    /// Matrices that sin q and 1 − cos q of a hinge multiply, added to `rotation`.
    pub(super) rodrigues: [M3<S>; 2],
    pub(super) mass: Lanes<S>,
    pub(super) com: V3<S>,
    /// About the centre of mass, in the body's axes.
    pub(super) inertia: Symmetric<S>,
}

/// Pose of a free body.
#[derive(Clone, Copy)]
pub(super) struct Pose<S: Simd> {
    /// A unit quaternion: real part, imaginary parts.
    quaternion: (Lanes<S>, V3<S>),
    pub(super) place: V3<S>,
}

/// Positions and velocities of all joints and free bodies.
#[derive(Clone)]
pub(super) struct Configuration<S: Simd> {
    /// Joint positions.
    pub(super) q: Vec<Lanes<S>>,
    /// Poses of the free bodies.
    pub(super) poses: Vec<Pose<S>>,
    /// Velocities of all degrees of freedom; those of free bodies are angular velocity and velocity of their frame's
    /// origin.
    pub(super) u: Vec<Lanes<S>>,
}

/// Bodies, parents first, and their kinematics in a configuration. All vectors are in the world's axes about `origin`,
/// which moves with a free root so that numbers stay small.
pub(super) struct Tree<S: Simd> {
    pub(super) bodies: Vec<TreeBody<S>>,
    /// Pose of the fixed base.
    root: (M3<S>, V3<S>),
    /// The first degree of freedom of each body.
    pub(super) first: Vec<usize>,
    /// For each degree of freedom the path from the root to it: all degrees of freedom that move it, itself last.
    pub(super) paths: Vec<Vec<usize>>,
    pub(super) origin: V3<S>,
    pub(super) rotations: Vec<M3<S>>,
    pub(super) places: Vec<V3<S>>,
    /// Motion subspace: spatial axis of each degree of freedom.
    pub(super) axes: Vec<Spatial<S>>,
    velocities: Vec<Spatial<S>>,
    accelerations: Vec<Spatial<S>>,
    inertias: Vec<Inertia<S>>,
    forces: Vec<Spatial<S>>,
}

impl<S: Simd> TreeBody<S> {
    #[inline(always)]
    pub(super) fn freedom(&self) -> usize {
        if matches!(self.carrier, Carrier::Free { .. }) { 6 } else { 1 }
    }

    #[inline(always)]
    fn inertia_at(&self, rotation: &M3<S>, place: &V3<S>) -> Inertia<S> {
        let com = *place + rotation.transform(&self.com);
        let second = self.inertia.rotated(rotation).plus(&Symmetric::of_point(self.mass, &com));
        Inertia { mass: self.mass, first: com.times(self.mass), second }
    }

    /// The joint's frame in the parent body's frame at q.
    #[inline(always)]
    fn rotation_at(&self, q: Lanes<S>) -> M3<S> {
        let (sine, cosine) = q.sin_cos();
        let rest = q.like(1.0) - cosine;
        let mut rotation = self.rotation;
        for i in 0..3 {
            for j in 0..3 {
                rotation.0[i][j] += sine * self.rodrigues[0].0[i][j] + rest * self.rodrigues[1].0[i][j];
            }
        }
        rotation
    }
}

impl<S: Simd> Tree<S> {
    pub(super) fn new(simd: S, bodies: Vec<TreeBody<S>>, root: (M3<S>, V3<S>)) -> Self {
        let (mut first, mut paths) = (Vec::with_capacity(bodies.len()), Vec::<Vec<usize>>::new());
        for body in &bodies {
            let mut path = body.parent.map_or_else(Vec::new, |parent| paths[last(&bodies, &first, parent)].clone());
            first.push(paths.len());
            for _ in 0..body.freedom() {
                path.push(paths.len());
                paths.push(path.clone());
            }
        }
        let (many, freedom) = (bodies.len(), paths.len());
        let zero = Spatial::zero(simd);
        let none = Inertia { mass: Lanes::zero(simd), first: V3::zero(simd), second: Symmetric::zero(simd) };
        Tree {
            bodies,
            root,
            first,
            paths,
            origin: V3::zero(simd),
            rotations: vec![M3::identity(simd); many],
            places: vec![V3::zero(simd); many],
            axes: vec![zero; freedom],
            velocities: vec![zero; many],
            accelerations: vec![zero; many],
            inertias: vec![none; many],
            forces: vec![zero; many],
        }
    }

    /// Degrees of freedom.
    #[inline(always)]
    pub(super) fn freedom(&self) -> usize {
        self.paths.len()
    }

    /// Path from the root to a body: the degrees of freedom that move it.
    #[inline(always)]
    pub(super) fn path_to(&self, body: usize) -> &[usize] {
        &self.paths[last(&self.bodies, &self.first, body)]
    }

    /// Poses, axes and inertias of all bodies.
    #[inline(always)]
    pub(super) fn place(&mut self, simd: S, posture: &Configuration<S>) {
        self.origin = V3::zero(simd);
        if let Some(Carrier::Free { pose }) = self.bodies.first().map(|body| body.carrier) {
            self.origin = posture.poses[pose].place;
        }
        let root = (self.root.0, self.root.1 - self.origin);
        for i in 0..self.bodies.len() {
            let body = &self.bodies[i];
            let (rotated, moved) = match body.parent {
                Some(parent) => (self.rotations[parent], self.places[parent]),
                None => root,
            };
            let place = moved + rotated.transform(&body.place);
            let first = self.first[i];
            match body.carrier {
                Carrier::Hinge { joint } => {
                    let along = rotated.transform(&body.axis);
                    self.axes[first] = Spatial { angular: along, linear: place.cross(&along) };
                    self.rotations[i] = rotated.product(&body.rotation_at(posture.q[joint]));
                    self.places[i] = place;
                }
                Carrier::Slide { joint } => {
                    let along = rotated.transform(&body.axis);
                    self.axes[first] = Spatial { angular: V3::zero(simd), linear: along };
                    self.rotations[i] = rotated.product(&body.rotation);
                    self.places[i] = place + along.times(posture.q[joint]);
                }
                Carrier::Free { pose } => {
                    let pose = &posture.poses[pose];
                    let place = pose.place - self.origin;
                    for k in 0..3 {
                        let along = V3::axis(simd, k);
                        self.axes[first + k] = Spatial { angular: along, linear: place.cross(&along) };
                        self.axes[first + 3 + k] = Spatial { angular: V3::zero(simd), linear: along };
                    }
                    self.rotations[i] = pose.rotation();
                    self.places[i] = place;
                }
            }
            self.inertias[i] = body.inertia_at(&self.rotations[i], &self.places[i]);
        }
    }

    /// Generalized forces for given accelerations of the degrees of freedom, zero where `joints` is absent (recursive
    /// Newton-Euler): inertial, velocity-dependent and gravity forces, into `bias_forces`. Makes the inertias
    /// composite.
    #[inline(always)]
    pub(super) fn newton_euler(
        &mut self,
        simd: S,
        u: &[Lanes<S>],
        gravity: &V3<S>,
        joints: Option<&[Lanes<S>]>,
        bias_forces: &mut [Lanes<S>],
    ) {
        // Gravity is equivalent to an upward acceleration of the world.
        let lifted = Spatial { angular: V3::zero(simd), linear: V3::zero(simd) - *gravity };
        for i in 0..self.bodies.len() {
            let body = &self.bodies[i];
            let (first, freedom) = (self.first[i], body.freedom());
            let mut own = self.axes[first].times(u[first]);
            for d in first + 1..first + freedom {
                own = own.plus(&self.axes[d].times(u[d]));
            }
            let (velocity, acceleration) = match body.parent {
                Some(parent) => (self.velocities[parent].plus(&own), self.accelerations[parent]),
                None => (own, lifted),
            };
            // Velocity-product acceleration: a free body's rotation axes pass through a moving point, a joint's axis
            // moves with its body.
            let drift = if freedom == 6 {
                let turning = V3([u[first], u[first + 1], u[first + 2]]);
                let moving = V3([u[first + 3], u[first + 4], u[first + 5]]);
                Spatial { angular: V3::zero(simd), linear: moving.cross(&turning) }
            } else {
                velocity.cross_motion(&own)
            };
            let mut acceleration = acceleration.plus(&drift);
            if let Some(joints) = joints {
                for d in first..first + freedom {
                    acceleration = acceleration.plus(&self.axes[d].times(joints[d]));
                }
            }
            let momentum = self.inertias[i].times(&velocity);
            let force = self.inertias[i].times(&acceleration);
            self.forces[i] = force.plus(&velocity.cross_force(&momentum));
            (self.velocities[i], self.accelerations[i]) = (velocity, acceleration);
        }
        for i in (0..self.bodies.len()).rev() {
            for d in self.first[i]..self.first[i] + self.bodies[i].freedom() {
                bias_forces[d] = self.axes[d].dot(&self.forces[i]);
            }
            if let Some(parent) = self.bodies[i].parent {
                self.forces[parent] = self.forces[parent].plus(&self.forces[i]);
                self.inertias[parent] = self.inertias[parent].plus(&self.inertias[i]);
            }
        }
    }

    /// Spatial velocity of every body.
    #[inline(always)]
    pub(super) fn motions(&self, u: &[Lanes<S>], motions: &mut [Spatial<S>]) {
        for i in 0..self.bodies.len() {
            let first = self.first[i];
            let mut motion = match self.bodies[i].parent {
                Some(parent) => motions[parent].add_times(&self.axes[first], u[first]),
                None => self.axes[first].times(u[first]),
            };
            for d in first + 1..first + self.bodies[i].freedom() {
                motion = motion.add_times(&self.axes[d], u[d]);
            }
            motions[i] = motion;
        }
    }

    /// The inertia matrix from composite inertias (Featherstone 2008, table 6.2): its lower triangle. Entries of
    /// degrees of freedom on different branches are zero and not written.
    #[inline(always)]
    pub(super) fn fill_matrix(&self, matrix: &mut [Lanes<S>]) {
        let n = self.freedom();
        for i in 0..self.bodies.len() {
            for d in self.first[i]..self.first[i] + self.bodies[i].freedom() {
                let momentum = self.inertias[i].times(&self.axes[d]);
                for &e in &self.paths[d] {
                    matrix[d * n + e] = self.axes[e].dot(&momentum);
                }
            }
        }
    }
}

#[inline(always)]
fn last<S: Simd>(bodies: &[TreeBody<S>], first: &[usize], body: usize) -> usize {
    first[body] + bodies[body].freedom() - 1
}

impl<S: Simd> Pose<S> {
    pub(super) fn of(simd: S, pose: impl Fn(usize) -> Isometry3<f64>) -> Self {
        let mut lanes = Pose { quaternion: (Lanes::zero(simd), V3::zero(simd)), place: V3::zero(simd) };
        (0..S::F64_LANES).for_each(|lane| lanes.set(lane, &pose(lane)));
        lanes
    }

    pub(super) fn set(&mut self, lane: usize, pose: &Isometry3<f64>) {
        let quaternion = pose.rotation.quaternion();
        self.quaternion.0.set(lane, quaternion.w);
        self.quaternion.1.set(lane, &quaternion.imag());
        self.place.set(lane, &pose.translation.vector);
    }

    pub(super) fn lane(&self, lane: usize) -> Isometry3<f64> {
        let quaternion = Quaternion::from_parts(self.quaternion.0.lane(lane), self.quaternion.1.lane(lane));
        Isometry3::from_parts(self.place.lane(lane).into(), UnitQuaternion::new_unchecked(quaternion))
    }

    #[inline(always)]
    fn rotation(&self) -> M3<S> {
        let (w, V3([x, y, z])) = self.quaternion;
        let (one, two) = (w.like(1.0), w.like(2.0));
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let (xy, xz, yz, wx, wy, wz) = (x * y, x * z, y * z, w * x, w * y, w * z);
        M3([
            [one - two * (yy + zz), two * (xy - wz), two * (xz + wy)],
            [two * (xy + wz), one - two * (xx + zz), two * (yz - wx)],
            [two * (xz - wy), two * (yz + wx), one - two * (xx + yy)],
        ])
    }

    /// The quaternion rotated by a rotation vector.
    #[inline(always)]
    fn rotated(&self, by: &V3<S>) -> (Lanes<S>, V3<S>) {
        let angle = by.norm();
        let half = angle * angle.like(0.5);
        let (sine, cosine) = half.sin_cos();
        // For a tiny angle the sine equals the angle.
        let small = angle.less(angle.like(1e-9));
        let share = small.select(angle.like(0.5), sine / small.select(angle.like(1.0), angle));
        let (axis, (w, v)) = (by.times(share), self.quaternion);
        let quaternion = (cosine * w - axis.dot(&v), v.times(cosine) + axis.times(w) + axis.cross(&v));
        // One Newton step normalises the quaternion.
        let length = quaternion.0 * quaternion.0 + quaternion.1.dot(&quaternion.1);
        let shrink = (length.like(3.0) - length) * length.like(0.5);
        (quaternion.0 * shrink, quaternion.1.times(shrink))
    }
}

impl<S: Simd> Configuration<S> {
    /// Integrates positions over `dt_s` at the velocities `u`, into `to`.
    #[inline(always)]
    pub(super) fn integrate(&self, tree: &Tree<S>, dt_s: f64, u: &[Lanes<S>], to: &mut Configuration<S>) {
        for (body, &d) in tree.bodies.iter().zip(&tree.first) {
            match body.carrier {
                Carrier::Free { pose } => {
                    let dt = u[d].like(dt_s);
                    let from = &self.poses[pose];
                    let (turning, moving) = (V3([u[d], u[d + 1], u[d + 2]]), V3([u[d + 3], u[d + 4], u[d + 5]]));
                    let quaternion = from.rotated(&turning.times(dt));
                    to.poses[pose] = Pose { quaternion, place: from.place + moving.times(dt) };
                }
                Carrier::Hinge { joint } | Carrier::Slide { joint } => {
                    to.q[joint] = self.q[joint] + u[d] * dt_s;
                }
            }
        }
    }
}
