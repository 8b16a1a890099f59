//! The legs of the Nao of `nao.toml`, on the ground: they walk, and shift their weight about. Arms and head keep still.

use crate::excite::{Commands, between, clock};
use crate::reality::{Subject, quit};
use btr_core::random::Rng;
use btr_physics::drive::{Drive, NaoWalk};
use btr_physics::effects::FormulaTarget;
use btr_physics::presets::nao;
use btr_physics::robot::{JointKind, Robot};
use rand::RngExt;
use std::f64::consts::TAU;

/// It has encoders and a gyroscope.
pub(crate) static NAO: Subject = Subject {
    file: "hidden_effects/nao.toml",
    prepare: legs_alone,
    training: episodes,
    held_out: episodes,
    seen: &["q_", "cmd_", "imu_gyro_"],
    silent: &[],
    one_number: &[],
    max_rollouts: 3000,
    outside: &[
        (FormulaTarget::Torque, "-20*max(0,q-0.1)^2"),
        (FormulaTarget::Torque, "0.8*sin(19*t)"),
        (FormulaTarget::Command, "cmd+0.08*sin(3*t)*cmd"),
    ],
};

/// Length of an episode, in s.
const DURATION_S: f64 = 1.4;
/// Where in a walk an episode begins, in s: the robot still stands.
const STANDING_S: f64 = 0.4;

/// Whatever is no leg is welded to the torso.
fn legs_alone(robot: &mut Robot) {
    for link in robot.links.iter_mut().filter(|link| !is_of_a_leg(&link.name)) {
        link.joint.kind = JointKind::Fixed;
    }
}

fn is_of_a_leg(name: &str) -> bool {
    ["Hip", "Knee", "Ankle"].iter().any(|part| name.contains(part))
}

fn episodes(_joints: usize, rng: &mut Rng) -> Vec<Commands> {
    vec![walk(rng), shifts(rng)]
}

/// A walk in small steps.
fn walk(rng: &mut Rng) -> Commands {
    let robot = nao::nao();
    let space = NaoWalk::space().unwrap_or_else(|e| quit(&e));
    let value = |dim: &btr_core::space::Dim| match dim.name.as_str() {
        "step_length" => between(rng, 0.01, 0.03),
        "step_period" => between(rng, 0.4, 0.55),
        "step_height" => between(rng, 0.015, 0.025),
        _ => dim.nominal.unwrap_or(0.0),
    };
    let values: Vec<f64> = space.dims().iter().map(value).collect();
    let walk = NaoWalk::new(&robot, &values, STANDING_S + DURATION_S).unwrap_or_else(|e| quit(&e));
    let told = |t: f64| {
        let mut command = vec![0.0; robot.movable().count()];
        walk.command(STANDING_S + t, &mut command);
        command
    };
    let told: Vec<Vec<f64>> = clock(DURATION_S).map(told).collect();
    let legs = robot.movable().enumerate().filter(|(_, (_, link))| is_of_a_leg(&link.name));
    legs.map(|(joint, _)| told.iter().map(|command| command[joint]).collect()).collect()
}

/// On both feet: it squats and sways, every joint a little as it likes.
fn shifts(rng: &mut Rng) -> Commands {
    let (squat, sway) = (Wave::new(rng, (0.12, 0.2), 0.7), Wave::new(rng, (0.05, 0.08), 0.7));
    let mut row = |name: &str| {
        let own = Wave::new(rng, (0.01, 0.03), 1.5);
        let (centre, squats, sways) = match &name[1..] {
            "HipPitch" | "AnklePitch" => (-0.45, -1.0, 0.0),
            "KneePitch" => (0.9, 2.0, 0.0),
            "HipRoll" => (0.0, 0.0, 1.0),
            "AnkleRoll" => (0.0, 0.0, -1.0),
            _ => (0.0, 0.0, 0.0),
        };
        clock(DURATION_S).map(|t| centre + squats * squat.at(t) + sways * sway.at(t) + own.at(t)).collect()
    };
    nao::nao().movable().filter(|(_, link)| is_of_a_leg(&link.name)).map(|(_, link)| row(&link.name)).collect()
}

/// Two sines that grow from nothing within 0.3 s: amplitude in rad, frequency in Hz and phase of each.
struct Wave([[f64; 3]; 2]);

impl Wave {
    fn new(rng: &mut Rng, (least, most): (f64, f64), hz: f64) -> Self {
        Wave([1.0, 2.3].map(|times| {
            [between(rng, least, most) / times, times * hz * between(rng, 0.8, 1.2), TAU * rng.random::<f64>()]
        }))
    }

    fn at(&self, t: f64) -> f64 {
        let ease = (t / 0.3).min(1.0);
        self.0.iter().map(|[a, f, p]| ease * a * ((TAU * f * t + p).sin() - p.sin())).sum()
    }
}
