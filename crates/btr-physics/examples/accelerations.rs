//! Forward dynamics of given states: `accelerations <ant|nao|file.urdf>` prints the names of the joints as a JSON list.
//! Then, for every state read from standard input as a line of JSON, it prints the accelerations: those of a floating
//! root (angular, linear, world's axes), then those of the joints.

use btr_physics::engine::forward_dynamics;
use btr_physics::engine::{BaseState, RobotState};
use btr_physics::presets::ant::ant;
use btr_physics::presets::nao::nao;
use btr_physics::robot::Base;
use btr_physics::robot::urdf::parse_urdf;
use btr_physics::setup::Setup;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;
use std::error::Error;
use std::io::BufRead;

/// Input state: SI units, the quaternion's real part first.
#[derive(Deserialize)]
struct InputState {
    base: [f64; 3],
    turn: [f64; 4],
    velocity: [f64; 3],
    angular: [f64; 3],
    q: Vec<f64>,
    dq: Vec<f64>,
    torques: Vec<f64>,
}

impl InputState {
    fn state(&self) -> RobotState {
        let [w, x, y, z] = self.turn;
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        RobotState {
            joints: self.q.iter().copied().zip(self.dq.iter().copied()).collect(),
            base: BaseState {
                pose: Isometry3::from_parts(Translation3::from(Vector3::from(self.base)), turn),
                velocity_m_s: Vector3::from(self.velocity),
                angular_rad_s: Vector3::from(self.angular),
            },
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let name = std::env::args().nth(1).ok_or("usage: accelerations <ant|nao|file.urdf>")?;
    let robot = match name.as_str() {
        "ant" => ant(),
        "nao" => nao(),
        file => parse_urdf(&std::fs::read_to_string(file)?, Base::Fixed)?.0,
    };
    let joints: Vec<&str> = robot.movable().map(|(_, link)| link.joint.name.as_str()).collect();
    println!("{}", serde_json::json!(joints));
    for line in std::io::stdin().lock().lines() {
        let input: InputState = serde_json::from_str(&line?)?;
        let accelerations = forward_dynamics(&robot, Setup::default().gravity_m_s2, &input.state(), &input.torques);
        println!("{}", serde_json::json!(accelerations));
    }
    Ok(())
}
