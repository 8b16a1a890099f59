//! The robot as a tree of bodies: where they are, what they weigh, what each joint has to carry.

use super::spatial::{Inertia, Spatial};
use crate::assemble;
use nalgebra::{Isometry3, Matrix3, Rotation3, Unit, UnitQuaternion, Vector3};

/// How a body is carried. Joints and free bodies are counted apart.
pub(super) enum Carrier {
    /// By nothing: six degrees of freedom, the turning ones first. `pose` counts the free bodies.
    Free { pose: usize },
    /// By a hinge about this axis.
    Hinge { joint: usize, axis: Unit<Vector3<f64>> },
    /// By a slide along this axis.
    Slide { joint: usize, axis: Vector3<f64> },
}

/// A rigid body in the frame of the joint that carries it.
pub(super) struct Body {
    /// The body that carries it; none for those on the ground or in the air.
    pub(super) parent: Option<usize>,
    pub(super) carrier: Carrier,
    /// The joint's frame in the parent body's frame at q = 0.
    pub(super) rotation: Rotation3<f64>,
    pub(super) place: Vector3<f64>,
    pub(super) mass: f64,
    pub(super) com: Vector3<f64>,
    /// About the centre of mass, in the body's axes.
    pub(super) inertia: Matrix3<f64>,
}

/// Where everything is and how fast it moves.
#[derive(Clone)]
pub(super) struct Posture {
    /// Joint positions.
    pub(super) q: Vec<f64>,
    /// Poses of the free bodies.
    pub(super) poses: Vec<Isometry3<f64>>,
    /// Velocities of all degrees of freedom; those of free bodies are angular velocity and velocity of their frame's origin.
    pub(super) u: Vec<f64>,
}

/// Bodies, parents first, and what a posture makes of them. All vectors are in the world's axes about `origin`, which goes along
/// with a free root so that numbers stay small.
pub(super) struct Tree {
    pub(super) bodies: Vec<Body>,
    /// What bodies without a parent are bolted to.
    root: Isometry3<f64>,
    /// The first degree of freedom of each body.
    pub(super) first: Vec<usize>,
    /// For each degree of freedom the next one towards the root.
    pub(super) above: Vec<Option<usize>>,
    pub(super) origin: Vector3<f64>,
    pub(super) rotations: Vec<Rotation3<f64>>,
    pub(super) places: Vec<Vector3<f64>>,
    /// What each degree of freedom moves its body by.
    pub(super) axes: Vec<Spatial>,
    velocities: Vec<Spatial>,
    accelerations: Vec<Spatial>,
    inertias: Vec<Inertia>,
    forces: Vec<Spatial>,
}

impl Body {
    fn freedom(&self) -> usize {
        if matches!(self.carrier, Carrier::Free { .. }) { 6 } else { 1 }
    }

    fn inertia_at(&self, rotation: &Rotation3<f64>, place: &Vector3<f64>) -> Inertia {
        let com = place + rotation * self.com;
        let turned = rotation.matrix() * self.inertia * rotation.matrix().transpose();
        Inertia { mass: self.mass, first: com * self.mass, second: turned + assemble::steiner(self.mass, &com) }
    }
}

impl Tree {
    pub(super) fn new(bodies: Vec<Body>, root: Isometry3<f64>) -> Self {
        let (mut first, mut above) = (Vec::with_capacity(bodies.len()), Vec::new());
        for body in &bodies {
            let carrier = body.parent.map(|parent| last(&bodies, &first, parent));
            first.push(above.len());
            for k in 0..body.freedom() {
                above.push(if k == 0 { carrier } else { Some(above.len() - 1) });
            }
        }
        let (many, freedom) = (bodies.len(), above.len());
        let none = Inertia { mass: 0.0, first: Vector3::zeros(), second: Matrix3::zeros() };
        Tree {
            bodies,
            root,
            first,
            above,
            origin: Vector3::zeros(),
            rotations: vec![Rotation3::identity(); many],
            places: vec![Vector3::zeros(); many],
            axes: vec![Spatial::ZERO; freedom],
            velocities: vec![Spatial::ZERO; many],
            accelerations: vec![Spatial::ZERO; many],
            inertias: vec![none; many],
            forces: vec![Spatial::ZERO; many],
        }
    }

    /// Degrees of freedom.
    pub(super) fn freedom(&self) -> usize {
        self.above.len()
    }

    /// The last degree of freedom of a body: from there `above` leads through all that move it.
    pub(super) fn last(&self, body: usize) -> usize {
        last(&self.bodies, &self.first, body)
    }

    /// Poses, axes and inertias of all bodies.
    pub(super) fn place(&mut self, posture: &Posture) {
        self.origin = match self.bodies.first().map(|body| &body.carrier) {
            Some(&Carrier::Free { pose }) => posture.poses[pose].translation.vector,
            _ => Vector3::zeros(),
        };
        let root = (self.root.rotation.to_rotation_matrix(), self.root.translation.vector - self.origin);
        for (i, body) in self.bodies.iter().enumerate() {
            let (turned, moved) = body.parent.map_or(root, |parent| (self.rotations[parent], self.places[parent]));
            let (rotation, place) = (turned * body.rotation, moved + turned * body.place);
            let first = self.first[i];
            (self.rotations[i], self.places[i]) = match &body.carrier {
                Carrier::Hinge { joint, axis } => {
                    let along = rotation * axis.into_inner();
                    self.axes[first] = Spatial { angular: along, linear: place.cross(&along) };
                    (rotation * Rotation3::from_axis_angle(axis, posture.q[*joint]), place)
                }
                Carrier::Slide { joint, axis } => {
                    let along = rotation * axis;
                    self.axes[first] = Spatial { angular: Vector3::zeros(), linear: along };
                    (rotation, place + along * posture.q[*joint])
                }
                Carrier::Free { pose } => {
                    let pose = &posture.poses[*pose];
                    let place = pose.translation.vector - self.origin;
                    for (k, along) in [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().enumerate() {
                        self.axes[first + k] = Spatial { angular: along, linear: place.cross(&along) };
                        self.axes[first + 3 + k] = Spatial { angular: Vector3::zeros(), linear: along };
                    }
                    (pose.rotation.to_rotation_matrix(), place)
                }
            };
            self.inertias[i] = body.inertia_at(&self.rotations[i], &self.places[i]);
        }
    }

    /// What all have to be pushed by if nothing accelerates but `joints`, where that is given (recursive Newton-Euler). Makes the
    /// inertias composite.
    pub(super) fn carry(&mut self, u: &[f64], gravity: &Vector3<f64>, joints: Option<&[f64]>) {
        for (i, body) in self.bodies.iter().enumerate() {
            let dofs = self.first[i]..self.first[i] + body.freedom();
            let own = dofs.clone().fold(Spatial::ZERO, |sum, d| sum + self.axes[d] * u[d]);
            let (velocity, acceleration) = match body.parent {
                Some(parent) => (self.velocities[parent], self.accelerations[parent]),
                // Gravity acts as if the world were accelerated against it.
                None => (Spatial::ZERO, Spatial { angular: Vector3::zeros(), linear: -gravity }),
            };
            self.velocities[i] = velocity + own;
            // How the axes themselves change: a free body's turn about a point that moves, a joint's move with its body.
            let drift = if dofs.len() == 6 {
                let turning = Vector3::from_column_slice(&u[dofs.start..dofs.start + 3]);
                let moving = Vector3::from_column_slice(&u[dofs.start + 3..dofs.end]);
                Spatial { angular: Vector3::zeros(), linear: moving.cross(&turning) }
            } else {
                self.velocities[i].cross_motion(&own)
            };
            self.accelerations[i] = acceleration + drift;
            if let Some(joints) = joints {
                self.accelerations[i] = dofs.fold(self.accelerations[i], |sum, d| sum + self.axes[d] * joints[d]);
            }
            let momentum = self.inertias[i].times(&self.velocities[i]);
            let force = self.inertias[i].times(&self.accelerations[i]);
            self.forces[i] = force + self.velocities[i].cross_force(&momentum);
        }
        for i in (0..self.bodies.len()).rev() {
            if let Some(parent) = self.bodies[i].parent {
                self.forces[parent] = self.forces[parent] + self.forces[i];
                self.inertias[parent] = self.inertias[parent].plus(&self.inertias[i]);
            }
        }
    }

    /// What `carry` found for every degree of freedom, one after the other.
    pub(super) fn carried(&self) -> impl Iterator<Item = f64> + '_ {
        let of_body = |(i, body): (usize, &Body)| (self.first[i]..self.first[i] + body.freedom()).map(move |d| (i, d));
        self.bodies.iter().enumerate().flat_map(of_body).map(|(i, d)| self.axes[d].dot(&self.forces[i]))
    }

    /// The inertia matrix from composite inertias (Featherstone 2008, table 6.2): its lower triangle, zero where neither moves the
    /// other.
    pub(super) fn fill_matrix(&self, matrix: &mut [f64]) {
        let n = self.freedom();
        matrix.fill(0.0);
        for (i, body) in self.bodies.iter().enumerate() {
            for d in self.first[i]..self.first[i] + body.freedom() {
                let momentum = self.inertias[i].times(&self.axes[d]);
                let mut at = Some(d);
                while let Some(e) = at {
                    matrix[d * n + e] = self.axes[e].dot(&momentum);
                    at = self.above[e];
                }
            }
        }
    }
}

fn last(bodies: &[Body], first: &[usize], body: usize) -> usize {
    first[body] + bodies[body].freedom() - 1
}

impl Posture {
    /// Where everything is after `dt_s` at the velocities `u`, into `to`.
    pub(super) fn fly(&self, bodies: &[Body], first: &[usize], dt_s: f64, u: impl Fn(usize) -> f64, to: &mut Posture) {
        for (body, &d) in bodies.iter().zip(first) {
            match body.carrier {
                Carrier::Free { pose } => {
                    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(u(d), u(d + 1), u(d + 2)) * dt_s);
                    let from = &self.poses[pose];
                    let mut rotation = turn * from.rotation;
                    rotation.renormalize_fast();
                    let place = from.translation.vector + Vector3::new(u(d + 3), u(d + 4), u(d + 5)) * dt_s;
                    to.poses[pose] = Isometry3::from_parts(place.into(), rotation);
                }
                Carrier::Hinge { joint, .. } | Carrier::Slide { joint, .. } => {
                    to.q[joint] = self.q[joint] + dt_s * u(d);
                }
            }
        }
    }
}
