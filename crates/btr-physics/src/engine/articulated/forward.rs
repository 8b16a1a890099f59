//! Forward dynamics of a robot without contacts.

use super::build::world::World;
use super::linear_algebra::lanes::Lanes;
use super::linear_algebra::spatial::{factorise, solve};
use super::state::Articulated;
use crate::engine::{Dynamics, RobotState};
use crate::robot::Robot;
use crate::setup::Setup;
use nalgebra::Vector3;
use pulp::{Arch, Scalar};

/// Accelerations of a robot in a state, with these joint torques (N·m; N for slides, in the order of
/// [`movable`](Robot::movable)) and gravity in m/s². The result has first those of a floating root's frame, angular
/// (rad/s²) and then linear (m/s²), both in the world's axes; then those of the joints in rad/s² (m/s²). Armature is
/// included, and joints that mimic others are coupled to them; servos, friction, limits and contacts are not.
///
/// Composite-rigid-body algorithm, recursive Newton-Euler, and a sparse factorisation along the tree (R. Featherstone,
/// "Rigid Body Dynamics Algorithms", Springer 2008, chapters 5, 6 and 8).
pub fn forward_dynamics(robot: &Robot, gravity_m_s2: Vector3<f64>, state: &RobotState, torques: &[f64]) -> Vec<f64> {
    let setup = Setup { gravity_m_s2, ground: None, ball: None, ..Setup::default() };
    let simd = Scalar::new();
    let mut engine = Articulated::new(simd, Arch::Scalar, &[World::new(robot, &setup)]);
    engine.place(state);
    let (tree, s) = (&mut engine.tree, &mut engine.scratch);
    tree.place(simd, &engine.now);
    tree.newton_euler(simd, &engine.now.u, &engine.gravity, None, &mut s.bias_forces);
    tree.fill_matrix(&mut s.matrix);
    let own = [0.0; 6].into_iter().take(engine.root).chain(torques.iter().copied());
    for ((next, bias_force), torque) in s.next.iter_mut().zip(&s.bias_forces).zip(own) {
        *next = Lanes::splat(simd, torque) - *bias_force;
    }
    for (i, (_, link)) in robot.movable().enumerate() {
        let d = engine.root + i;
        s.matrix[d * tree.freedom() + d] += Lanes::splat(simd, link.joint.armature);
    }
    factorise(&mut s.matrix, &tree.paths);
    solve(&s.matrix, &tree.paths, &mut s.next);
    // The equations for velocities after an impulse also hold for accelerations under a force.
    engine.couple_followers(0.0);
    engine.impulses.apply(&engine.tree, &engine.scratch.matrix, &mut engine.scratch.next);
    engine.scratch.next.iter().map(|acceleration| acceleration.lane(0)).collect()
}
