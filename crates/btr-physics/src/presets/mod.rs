//! Robots that come with btr.

pub mod ant;
pub mod nao;
pub mod pendulum;
