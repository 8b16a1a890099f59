//! Implementation of [`Dynamics`].

use super::joint_forces;
use super::prescribed::InverseDynamics;
use super::state::{Articulated, Coupling};
use super::step::{ABSURD_SPEED, Steps};
use crate::engine::{BaseState, Dof, Dynamics, RobotState};
use nalgebra::{Point3, Vector3};
use pulp::Simd;

impl<S: Simd> Dynamics for Articulated<S> {
    fn lanes(&self) -> usize {
        self.joint_states.len()
    }

    fn select_lane(&mut self, lane: usize) {
        self.lane = lane;
    }

    fn positions(&self) -> &[f64] {
        &self.joint_states[self.lane].q
    }

    fn velocities(&self) -> &[f64] {
        &self.joint_states[self.lane].dq
    }

    fn place(&mut self, state: &RobotState) {
        let root = [state.base.angular_rad_s, state.base.velocity_m_s];
        let root = root.iter().flat_map(|v| v.iter().copied()).take(self.root);
        let mut velocities: Vec<f64> = root.chain(state.joints.iter().map(|&(_, dq)| dq)).collect();
        for lane in self.selected_lanes() {
            for Coupling { joint, leader, ratio, .. } in &self.followers {
                velocities[self.root + joint] = ratio.lane(lane) * velocities[self.root + leader];
            }
            for ((now, before), &velocity) in self.now.u.iter_mut().zip(&mut self.before).zip(&velocities) {
                // The last acceleration is kept: it extrapolates the midpoint of the next step.
                before.set(lane, before.lane(lane) + (velocity - now.lane(lane)));
                now.set(lane, velocity);
            }
            for (now, &(q, _)) in self.now.q.iter_mut().zip(&state.joints) {
                now.set(lane, q);
            }
            for Coupling { joint, leader, ratio, offset } in &self.followers {
                let q = *ratio * self.now.q[*leader] + *offset;
                self.now.q[*joint].set(lane, q.lane(lane));
            }
            if self.root > 0 {
                self.now.poses[0].set(lane, &state.base.pose);
            }
        }
        self.publish_states();
    }

    fn set_joint(&mut self, joint: usize, dof: &Dof) {
        for lane in self.selected_lanes() {
            let inner = &mut self.inner[joint];
            if dof.motor.is_none() {
                inner.constant.set(lane, dof.torque.constant);
                inner.stiffness.set(lane, dof.torque.stiffness);
                inner.damping.set(lane, dof.torque.damping);
            }
            inner.dry_friction.set(lane, dof.dry_friction);
            // It never changes during a run, and storing into a lane is slow.
            if dof.creep.rate > 0.0 {
                inner.creep[0].set(lane, dof.creep.rate);
                inner.creep[1].set(lane, dof.creep.time_s);
            }
            inner.armature.set(lane, dof.armature);
            if dof.motor.is_some() || self.motors[joint].is_some() {
                joint_forces::set(&mut self.motors[joint], inner, lane, dof);
            }
        }
        self.prescribed[joint] = dof.prescribed;
    }

    fn midpoint(&self) -> bool {
        true
    }

    fn enforces_bounds(&self) -> bool {
        true
    }

    fn supports_prescribed(&self) -> bool {
        // Prescribed motions need a single candidate without substeps, and forces from the floor or a linkage would
        // have to be known beforehand.
        let pushed = self.root > 0 || self.ball.is_some() || !self.followers.is_empty();
        self.joint_states.len() == 1 && self.substeps == 1 && !pushed
    }

    fn prescribed_torques(&mut self, torques: &mut [f64]) {
        let (simd, arch) = (self.simd, self.arch);
        let inverse_dynamics = InverseDynamics { engine: self, torques };
        if S::IS_SCALAR { arch.dispatch(inverse_dynamics) } else { simd.vectorize(inverse_dynamics) }
    }

    fn step(&mut self) {
        if S::IS_SCALAR { self.arch.dispatch(Steps(self)) } else { self.simd.vectorize(Steps(self)) }
    }

    fn base(&self) -> BaseState {
        if self.root == 0 {
            let pose = self.fixed[self.lane];
            return BaseState { pose, velocity_m_s: Vector3::zeros(), angular_rad_s: Vector3::zeros() };
        }
        let part = |first: usize| Vector3::from_fn(|k, _| self.now.u[first + k].lane(self.lane));
        BaseState { pose: self.now.poses[0].lane(self.lane), velocity_m_s: part(3), angular_rad_s: part(0) }
    }

    fn foot_force_n(&self, foot: usize) -> f64 {
        self.foot_impulses[foot].lane(self.lane) / (self.dt_s * self.substeps as f64)
    }

    fn ball(&self) -> Option<Point3<f64>> {
        self.ball.as_ref().and_then(|_| self.now.poses.last()).map(|pose| Point3::from(pose.place.lane(self.lane)))
    }

    fn trouble(&self) -> Option<String> {
        if !self.diverged.lane(self.lane) {
            return None;
        }
        let diverged = |x: f64| !x.is_finite() || x.abs() > ABSURD_SPEED;
        let mut joints = self.velocities().iter().enumerate();
        if let Some((joint, dq)) = joints.find(|(_, dq)| diverged(**dq)) {
            return Some(format!("joint `{}` moves at {dq:.1e} per second", self.names[joint]));
        }
        let BaseState { velocity_m_s: velocity, angular_rad_s: angular, .. } = self.base();
        Some(format!("the base moves at {} m/s and turns at {} rad/s", velocity.norm(), angular.norm()))
    }
}
