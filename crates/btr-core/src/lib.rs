//! Back-to-Reality, generic over what is simulated.
//!
//! Controllers and simulations evolve against each other: controllers are found in a simulation, a few are tried in
//! reality, and what they really did is used to find a better simulation (Zagal, Delpiano and Ruiz-del-Solar,
//! "Self-modeling in humanoid soccer robots", Robotics and Autonomous Systems 57, 2009).
//!
//! This crate holds the ideas and does no I/O: it knows spaces of parameters ([`space`]), logs ([`log`]), what a
//! simulation and a reality are ([`world`]), how far two behaviours are apart ([`distance`]), how to search ([`search`])
//! and the loop that puts them together ([`coevolve`]).

pub mod coevolve;
pub mod distance;
pub mod log;
pub mod optimize;
pub mod parallel;
pub mod random;
pub mod search;
mod settings;
pub mod signal;
pub mod space;
pub mod world;
