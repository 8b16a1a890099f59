//! Robots that are bolted down and touch nothing, in minimal coordinates.
//!
//! Joint-space dynamics from the composite-rigid-body and the recursive Newton-Euler algorithm (R. Featherstone, "Rigid
//! Body Dynamics Algorithms", Springer 2008, chapters 5 and 6), with all spatial quantities in the world's axes about the
//! world's origin, so that composite inertias are plain sums.
//!
//! A step is the implicit midpoint rule for servos, springs and dampers, with inertia, gravity and velocity forces taken at
//! the middle that the past predicts: second order. Joints so stiff that the rule would let them ring are advanced by
//! backward Euler instead. Dry friction and joint limits are impulses within bounds that stop a joint where they can
//! (projected Gauss-Seidel on the inverse inertia).

mod course;
mod spatial;

use crate::assemble::{self, Body};
use crate::engine::{BaseState, Dof, Dynamics, State};
use crate::robot::{JointKind, Robot};
use crate::sim::Setup;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Unit, Vector3};
use spatial::{Inertia, Spatial, factorise, solve};

/// Faster than this (m/s, rad/s) is a blow-up.
const ABSURD_SPEED: f64 = 1e4;
/// Sweeps over friction and limits, at most.
const SWEEPS: usize = 60;
/// Relative change of the velocities at which the sweeps have converged.
const SETTLED: f64 = 1e-13;

/// A robot on a fixed base.
pub(crate) struct Articulated {
    bodies: Vec<Moving>,
    root: Isometry3<f64>,
    gravity: Vector3<f64>,
    dt_s: f64,
    substeps: usize,
    q: Vec<f64>,
    dq: Vec<f64>,
    /// Velocities one step ago.
    before: Vec<f64>,
    dofs: Vec<Dof>,
    names: Vec<String>,
    scratch: Scratch,
}

/// A body on its joint; the joint has the same index.
struct Moving {
    /// The joint that carries it; none for those on the root.
    parent: Option<usize>,
    /// The joint's frame in the parent body's frame at q = 0.
    origin: Isometry3<f64>,
    axis: Unit<Vector3<f64>>,
    slides: bool,
    limits: (f64, f64),
    mass: f64,
    com: Vector3<f64>,
    /// About the centre of mass, in the body's axes.
    inertia: Matrix3<f64>,
}

/// Memory for a step, allocated once.
struct Scratch {
    rotations: Vec<Rotation3<f64>>,
    places: Vec<Vector3<f64>>,
    axes: Vec<Spatial>,
    velocities: Vec<Spatial>,
    accelerations: Vec<Spatial>,
    /// Accelerations of the joints; empty while they are what is asked for.
    joints: Vec<f64>,
    inertias: Vec<Inertia>,
    forces: Vec<Spatial>,
    /// Row by row: first the mass matrix, then its Cholesky factor.
    matrix: Vec<f64>,
    /// What the joints do in a step; the inverse's columns of those with friction or at a limit.
    next: Vec<f64>,
    columns: Vec<f64>,
    /// Positions and velocities in the middle of the step.
    middle: Vec<(f64, f64)>,
    /// How implicit each joint is: 0.5 for the midpoint, 1 for backward Euler.
    share: Vec<f64>,
    rows: Vec<Row>,
}

/// A bounded impulse on one joint.
#[derive(Clone, Copy)]
struct Row {
    joint: usize,
    /// The velocity that it tries to bring about.
    wanted: f64,
    least: f64,
    most: f64,
    impulse: f64,
}

impl Articulated {
    /// Whether this engine can simulate the robot: nothing of it may be free to fall or meant to touch anything.
    pub(crate) fn can(robot: &Robot, setup: &Setup) -> bool {
        robot.base == crate::robot::Base::Fixed && setup.ground.is_none() && setup.ball.is_none()
    }

    /// The robot in its start state.
    pub(crate) fn new(robot: &Robot, setup: &Setup) -> Self {
        let bodies: Vec<Moving> = assemble::bodies(robot).iter().skip(1).map(|body| Moving::new(body, robot)).collect();
        let n = bodies.len();
        let joints = || robot.movable().map(|(_, link)| &link.joint);
        let dq: Vec<f64> = (0..n).map(|i| setup.start_velocities.get(i).copied().unwrap_or(0.0)).collect();
        Articulated {
            root: robot.start,
            gravity: setup.gravity_m_s2,
            dt_s: setup.dt_s / setup.substeps as f64,
            substeps: setup.substeps,
            q: joints().map(|joint| joint.start).collect(),
            before: dq.clone(),
            dq,
            dofs: vec![Dof::default(); n],
            names: joints().map(|joint| joint.name.clone()).collect(),
            scratch: Scratch::new(n),
            bodies,
        }
    }

    /// Where the joints will be in the middle of the step if they go on as they did.
    fn predict(&mut self) {
        let half = 0.5 * self.dt_s;
        for (i, middle) in self.scratch.middle.iter_mut().enumerate() {
            *middle = (self.q[i] + half * self.dq[i], 1.5 * self.dq[i] - 0.5 * self.before[i]);
        }
    }

    /// Poses, joint axes and inertias of all bodies in the world.
    fn place(&mut self) {
        let s = &mut self.scratch;
        for (i, body) in self.bodies.iter().enumerate() {
            let (rotation, place) = match body.parent {
                Some(parent) => (s.rotations[parent], s.places[parent]),
                None => (self.root.rotation.to_rotation_matrix(), self.root.translation.vector),
            };
            let place = place + rotation * body.origin.translation.vector;
            let rotation = rotation * body.origin.rotation.to_rotation_matrix();
            let axis = rotation * body.axis.into_inner();
            if body.slides {
                s.rotations[i] = rotation;
                s.places[i] = place + axis * s.middle[i].0;
                s.axes[i] = Spatial { angular: Vector3::zeros(), linear: axis };
            } else {
                s.rotations[i] = rotation * Rotation3::from_axis_angle(&body.axis, s.middle[i].0);
                s.places[i] = place;
                s.axes[i] = Spatial { angular: axis, linear: place.cross(&axis) };
            }
            s.inertias[i] = body.inertia_at(&s.rotations[i], &s.places[i]);
        }
    }

    /// Fills `forces` with what each joint has to carry if no joint accelerates (or as `joints` says, where that is filled), and
    /// makes `inertias` composite.
    fn carry(&mut self) {
        let s = &mut self.scratch;
        for (i, body) in self.bodies.iter().enumerate() {
            let own = s.axes[i] * s.middle[i].1;
            let (velocity, acceleration) = match body.parent {
                Some(parent) => (s.velocities[parent], s.accelerations[parent]),
                // Gravity acts as if the root were accelerated against it.
                None => (Spatial::ZERO, Spatial { angular: Vector3::zeros(), linear: -self.gravity }),
            };
            s.velocities[i] = velocity + own;
            s.accelerations[i] = acceleration + s.velocities[i].cross_motion(&own);
            if let Some(&joint) = s.joints.get(i) {
                s.accelerations[i] = s.accelerations[i] + s.axes[i] * joint;
            }
            let momentum = s.inertias[i].times(&s.velocities[i]);
            s.forces[i] = s.inertias[i].times(&s.accelerations[i]) + s.velocities[i].cross_force(&momentum);
        }
        for i in (0..self.bodies.len()).rev() {
            if let Some(parent) = self.bodies[i].parent {
                s.forces[parent] = s.forces[parent] + s.forces[i];
                s.inertias[parent] = s.inertias[parent].plus(&s.inertias[i]);
            }
        }
    }

    /// The joint-space inertia matrix, from composite inertias; only its lower triangle.
    fn fill_matrix(&mut self) {
        let (s, n) = (&mut self.scratch, self.bodies.len());
        s.matrix.fill(0.0);
        for i in 0..n {
            let momentum = s.inertias[i].times(&s.axes[i]);
            let mut at = Some(i);
            while let Some(j) = at {
                s.matrix[i * n + j] = s.axes[j].dot(&momentum);
                at = self.bodies[j].parent;
            }
        }
    }

    /// One step of `dt_s`: implicit in everything that acts inside the joints.
    fn advance(&mut self) {
        let (dt, n) = (self.dt_s, self.bodies.len());
        self.predict();
        self.foresee();
        self.place();
        self.carry();
        self.fill_matrix();
        self.balance();
        self.lead();
        factorise(&mut self.scratch.matrix, n);
        solve(&self.scratch.matrix, n, &mut self.scratch.next);
        self.stop();
        for i in 0..n {
            let (old, new, share) = (self.dq[i], self.scratch.next[i], self.scratch.share[i]);
            self.q[i] += dt * ((1.0 - share) * old + share * new);
            self.before[i] = old;
            self.dq[i] = new;
        }
        self.arrive();
    }

    /// The linear equations for the velocities at the step's end: `matrix`·dq' = `next`.
    ///
    /// With the share h of the end in the step's mean state, a joint's torque is c − k·(q + dt·h·v) − d·v at the mean velocity
    /// v = (1 − h)·dq + h·dq'.
    fn balance(&mut self) {
        let (dt, n, s) = (self.dt_s, self.bodies.len(), &mut self.scratch);
        for i in 0..n {
            let dof = &self.dofs[i];
            s.matrix[i * n + i] += dof.armature;
            s.next[i] = dt * (dof.torque.constant - dof.torque.stiffness * self.q[i] - s.axes[i].dot(&s.forces[i]));
        }
        for i in 0..n {
            for j in 0..n {
                let inertia = if j <= i { s.matrix[i * n + j] } else { s.matrix[j * n + i] };
                s.next[i] += inertia * self.dq[j];
            }
        }
        for i in 0..n {
            let torque = &self.dofs[i].torque;
            let implicit = dt * torque.damping + dt * dt * torque.stiffness;
            let rings = implicit >= s.matrix[i * n + i];
            s.share[i] = if rings { 1.0 } else { 0.5 };
            let resistance = dt * torque.damping + dt * dt * s.share[i] * torque.stiffness;
            s.next[i] -= (1.0 - s.share[i]) * resistance * self.dq[i];
            s.matrix[i * n + i] += s.share[i] * resistance;
        }
    }

    /// Dry friction and joint limits: impulses within their bounds that stop joints as far as they can.
    fn stop(&mut self) {
        let (dt, n, s) = (self.dt_s, self.bodies.len(), &mut self.scratch);
        s.rows.clear();
        let free = |(_, (dof, _)): &(usize, (&Dof, &Moving))| dof.course.is_none();
        for (i, (dof, body)) in self.dofs.iter().zip(&self.bodies).enumerate().filter(free) {
            let (lower, upper) = ((body.limits.0 - self.q[i]) / dt, (body.limits.1 - self.q[i]) / dt);
            if dof.dry_friction > 0.0 {
                let most = dt * dof.dry_friction;
                s.rows.push(Row { joint: i, wanted: 0.0, least: -most, most, impulse: 0.0 });
            }
            if s.next[i] < lower || s.next[i] > upper {
                // It must end the step at the limit, not halfway beyond.
                s.share[i] = 1.0;
            }
            if s.next[i] < lower {
                s.rows.push(Row { joint: i, wanted: lower, least: 0.0, most: f64::INFINITY, impulse: 0.0 });
            }
            if s.next[i] > upper {
                s.rows.push(Row { joint: i, wanted: upper, least: f64::NEG_INFINITY, most: 0.0, impulse: 0.0 });
            }
        }
        for (k, row) in s.rows.iter().enumerate() {
            let column = &mut s.columns[k * n..(k + 1) * n];
            column.fill(0.0);
            column[row.joint] = 1.0;
            solve(&s.matrix, n, column);
        }
        for _ in 0..SWEEPS {
            let mut largest = 0.0f64;
            for (k, row) in s.rows.iter_mut().enumerate() {
                let column = &s.columns[k * n..(k + 1) * n];
                let impulse = row.impulse + (row.wanted - s.next[row.joint]) / column[row.joint];
                let change = impulse.clamp(row.least, row.most) - row.impulse;
                row.impulse += change;
                for (next, effect) in s.next.iter_mut().zip(column) {
                    *next += effect * change;
                }
                largest = largest.max((change * column[row.joint]).abs() / (1.0 + s.next[row.joint].abs()));
            }
            if largest <= SETTLED {
                break;
            }
        }
    }
}

impl Moving {
    fn new(body: &Body, robot: &Robot) -> Self {
        let joint = &robot.links[body.link].joint;
        Moving {
            parent: body.parent.checked_sub(1),
            origin: body.origin,
            axis: Unit::new_normalize(joint.axis),
            slides: joint.kind == JointKind::Prismatic,
            limits: joint.limits,
            mass: body.mass_kg,
            com: body.com_m.coords,
            inertia: body.inertia_kg_m2,
        }
    }

    fn inertia_at(&self, rotation: &Rotation3<f64>, place: &Vector3<f64>) -> Inertia {
        let com = place + rotation * self.com;
        let turned = rotation.matrix() * self.inertia * rotation.matrix().transpose();
        Inertia { mass: self.mass, first: com * self.mass, second: turned + assemble::steiner(self.mass, &com) }
    }
}

impl Scratch {
    fn new(n: usize) -> Self {
        let none = Inertia { mass: 0.0, first: Vector3::zeros(), second: Matrix3::zeros() };
        Scratch {
            rotations: vec![Rotation3::identity(); n],
            places: vec![Vector3::zeros(); n],
            axes: vec![Spatial::ZERO; n],
            velocities: vec![Spatial::ZERO; n],
            accelerations: vec![Spatial::ZERO; n],
            joints: Vec::with_capacity(n),
            inertias: vec![none; n],
            forces: vec![Spatial::ZERO; n],
            matrix: vec![0.0; n * n],
            next: vec![0.0; n],
            // Friction and one limit for each joint at most.
            columns: vec![0.0; 2 * n * n],
            middle: vec![(0.0, 0.0); n],
            share: vec![0.5; n],
            rows: Vec::with_capacity(2 * n),
        }
    }
}

impl Dynamics for Articulated {
    fn positions(&self) -> &[f64] {
        &self.q
    }

    fn velocities(&self) -> &[f64] {
        &self.dq
    }

    fn place(&mut self, state: &State) {
        for (i, &(q, dq)) in state.joints.iter().enumerate() {
            // Where nothing jumps, what the velocity was before goes on counting.
            self.before[i] += dq - self.dq[i];
            (self.q[i], self.dq[i]) = (q, dq);
        }
    }

    fn set_joint(&mut self, joint: usize, dof: &Dof) {
        self.dofs[joint] = *dof;
    }

    fn midway(&self) -> bool {
        true
    }

    fn leads(&self) -> bool {
        // Substeps would have to share a course.
        self.substeps == 1
    }

    fn needed(&mut self, torques: &mut [f64]) {
        self.inverse(torques);
    }

    fn step(&mut self) {
        for _ in 0..self.substeps {
            self.advance();
        }
    }

    fn base(&self) -> BaseState {
        BaseState { pose: self.root, velocity_m_s: Vector3::zeros(), angular_rad_s: Vector3::zeros() }
    }

    fn foot_force_n(&self, _foot: usize) -> f64 {
        0.0
    }

    fn ball(&self) -> Option<Point3<f64>> {
        None
    }

    fn trouble(&self) -> Option<String> {
        let wild = |i: &usize| !self.dq[*i].is_finite() || self.dq[*i].abs() > ABSURD_SPEED || !self.q[*i].is_finite();
        let joint = (0..self.q.len()).find(wild)?;
        Some(format!("joint `{}` moves at {:.1e} per second", self.names[joint], self.dq[joint]))
    }
}
