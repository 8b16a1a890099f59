//! Physics of btr: robots, motors, sensors, physical effects, drives and tasks, simulated on btr's own engine or on
//! Rapier.
//!
//! - [`robot`]: robots as plain data in URDF's conventions; [`presets`] has an ant, a Nao and a pendulum.
//! - [`drive`]: sources of joint references. References depend on the controller alone: they are computed for the
//!   robot at its own values, whatever is simulated, because a controller must not know what is being identified.
//! - [`actuation`]: motors, from a command to a torque.
//! - [`effects`]: what a model may lack. An effect is a named group of parameters with an *off* value, so that
//!   fitting a mass and adding friction are one operation on one search space. Effects act in the order in which they
//!   are registered.
//! - [`engine`]: the dynamics. The default engine works in minimal coordinates and is second-order accurate without
//!   contact; Rapier is the reference (feature `rapier`, on by default). The only things to touch are the ground z =
//!   0 and one ball.
//! - [`rollout`]: the simulation loop, for one robot or many side by side.
//! - [`model`]: a robot with free parameters, scenarios and a fitness, as a [`Simulator`](btr_core::world::Simulator).
//!
//! The same request gives the same bits: on any thread, in any batch.
//!
//! # Quick start
//!
//! A pendulum without a motor is released at 0.5 rad, and the log of its joint is read.
//!
//! ```
//! use btr_physics::drive::Hold;
//! use btr_physics::presets::pendulum::pendulum;
//! use btr_physics::robot::Actuator;
//! use btr_physics::rollout::{RolloutRequest, simulate};
//! use btr_physics::setup::Setup;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut robot = pendulum(1.0, 0.5, Actuator::Passive);
//! robot.links[1].joint.start = 0.5;
//! let setup = Setup { duration_s: 1.0, ground: None, ..Setup::default() };
//!
//! let drive = Hold::new(&robot);
//! let log = simulate(RolloutRequest::new(&robot, &drive).setup(&setup))?;
//!
//! let position_rad = log.values("q_hinge")?;
//! assert_eq!(position_rad.len(), log.clock_s().len());
//! assert_eq!(position_rad[0], 0.5);
//! assert!(position_rad.iter().any(|q| *q < 0.0));
//! # Ok(())
//! # }
//! ```

pub mod actuation;
pub mod drive;
pub mod effects;
pub mod engine;
pub mod inertials;
pub mod model;
pub mod presets;
pub mod robot;
pub mod rollout;
pub mod sensor;
pub mod setup;
