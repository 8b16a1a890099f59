//! Multiple shooting: logs cut into short windows. Contact makes motion chaotic: a whole rollout leaves its log at the
//! first foot that touches down a sample too late. A robot on a fixed base may run off as well, where a motor
//! saturates. So the state is reset at the beginning of every window to that of the log. Joints are smoothed by local
//! parabolas. The unmeasured velocity and height of the base come from a simulation that is corrected towards the
//! measurements (an observer after D. G. Luenberger, "Observing the state of a linear system", IEEE Transactions on
//! Military Electronics 8, 1964, with constant gains).

use btr_core::log::{Log, interpolate};
use btr_core::signal::smooth::{Motion, smooth};
use btr_core::world::WorldError;
use btr_physics::effects::PlacedEffect;
use btr_physics::engine::{Dynamics, RobotState};
use btr_physics::model::{Model, ModelRequest, Scenario};
use btr_physics::robot::Base;
use btr_physics::rollout::restart::Restart;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use std::ops::Range;

/// Length of a window in s; all windows of a log are about equally long. On a fixed base also the fewest samples of
/// one: two numbers per joint are free at its beginning.
const WINDOW_S: f64 = 0.4;
const SAMPLES: f64 = 20.0;
/// Time in which the observer converges at the log's beginning, in s.
const SETTLE_S: f64 = 0.2;
/// Time after a window's start that is not compared, in s.
const BURN_IN_S: f64 = 0.05;
/// Time between two corrections of the observer in s, and their gains: for joints, for the gyroscope.
const PULL_S: f64 = 0.01;
const PULL: (f64, f64) = (0.5, 0.5);

/// Standard deviations of the observed base: velocity in m/s, height in m, roll and pitch in rad, angular velocity in
/// rad/s.
const BASE: [f64; 9] = [0.05, 0.05, 0.05, 0.003, 0.01, 0.01, 0.03, 0.03, 0.03];
/// The standard deviation of a joint's velocity is one noise floor per this time, in s.
const REACH_S: f64 = 0.03;

/// The windows of a log.
pub(crate) struct Windows {
    pub restarts: Vec<Restart>,
    /// The compared samples of each.
    pub samples: Vec<Range<usize>>,
}

/// Cuts a log into windows, with initial states observed by the model with values `s` and these effects. A log that is
/// too short for a window has none.
pub(crate) fn cut(
    model: &Model,
    s: &[f64],
    effects: &[PlacedEffect],
    situation: &Scenario,
    log: &Log,
) -> Result<Windows, WorldError> {
    let clock = log.clock_s();
    let tick_s = log.duration_s() / (clock.len() - 1).max(1) as f64;
    let least_s = if model.robot.base == Base::Fixed { SAMPLES * tick_s } else { 0.0 };
    let count = ((log.duration_s() - SETTLE_S) / WINDOW_S.max(least_s)).round().max(0.0) as usize;
    let length_s = (log.duration_s() - SETTLE_S) / count.max(1) as f64;
    let starts_s: Vec<f64> = (0..count).map(|k| SETTLE_S + length_s * k as f64).collect();
    let restarts = observe(model, s, effects, situation, log, &starts_s)?;
    let sample = |time_s: f64| clock.partition_point(|t| t - clock[0] <= time_s + 1e-6);
    let samples = (0..restarts.len()).map(|k| {
        let end = restarts.get(k + 1).map_or(clock.len(), |next| sample(next.time_s));
        sample(restarts[k].time_s + BURN_IN_S).min(end)..end
    });
    Ok(Windows { samples: samples.collect(), restarts })
}

/// The measured part of a robot's state, smoothed.
struct MeasuredState<'a> {
    clock_s: &'a [f64],
    joints: Vec<Option<Vec<Motion>>>,
    gyro: Option<[Vec<f64>; 3]>,
}

impl<'a> MeasuredState<'a> {
    fn of(model: &Model, log: &'a Log) -> Self {
        let smoothed = |name: &str| log.channel(name).map(|channel| smooth(log.clock_s(), &channel.values));
        let joints = model.robot.movable().map(|(_, link)| smoothed(&format!("q_{}", link.joint.name))).collect();
        let axis =
            |axis: &str| Some(smoothed(&format!("imu_gyro_{axis}"))?.iter().map(|motion| motion.value).collect());
        let gyro = || Some([axis("x")?, axis("y")?, axis("z")?]);
        MeasuredState { clock_s: log.clock_s(), joints, gyro: gyro() }
    }

    /// Position and velocity of a joint.
    fn joint(&self, joint: usize, time_s: f64) -> Option<(f64, f64)> {
        let motions = self.joints.get(joint)?.as_ref()?;
        let at = self.clock_s[0] + time_s;
        let next = self.clock_s.partition_point(|t| *t < at).min(self.clock_s.len() - 1);
        let [before, after] = [next.saturating_sub(1), next].map(|i| (self.clock_s[i], motions[i]));
        let along = |(t, motion): (f64, Motion)| {
            let ahead = at - t;
            let q = motion.value + ahead * (motion.velocity + 0.5 * ahead * motion.acceleration);
            (q, motion.velocity + ahead * motion.acceleration)
        };
        let share = if after.0 > before.0 { ((at - before.0) / (after.0 - before.0)).clamp(0.0, 1.0) } else { 1.0 };
        // The nearer of the two if they are the same sample, or if one is missing.
        let (a, b) = (along(before), along(after));
        let mixed = |a: f64, b: f64| match (a.is_finite(), b.is_finite()) {
            (true, false) => a,
            (false, _) => b,
            _ => a + share * (b - a),
        };
        let state = (mixed(a.0, b.0), mixed(a.1, b.1));
        (state.0.is_finite() && state.1.is_finite()).then_some(state)
    }

    /// The angular velocity in the root's axes.
    fn turning(&self, time_s: f64) -> Option<Vector3<f64>> {
        let at = [self.clock_s[0] + time_s];
        let [x, y, z] = self.gyro.as_ref()?;
        let turning = Vector3::from([x, y, z].map(|axis| interpolate(self.clock_s, axis, &at)[0]));
        turning.iter().all(|w| w.is_finite()).then_some(turning)
    }

    /// Corrects a state by shares of its errors.
    fn pull(&self, state: &mut RobotState, time_s: f64, (joints, gyro): (f64, f64)) {
        for (i, (q, dq)) in state.joints.iter_mut().enumerate() {
            if let Some((measured, velocity)) = self.joint(i, time_s) {
                *q += joints * (measured - *q);
                *dq += joints * (velocity - *dq);
            }
        }
        if let Some(turning) = self.turning(time_s) {
            let in_world = state.base.pose.rotation * turning;
            state.base.angular_rad_s += gyro * (in_world - state.base.angular_rad_s);
        }
    }
}

/// The states at the given times: joints as measured, the base as observed.
fn observe(
    model: &Model,
    s: &[f64],
    effects: &[PlacedEffect],
    situation: &Scenario,
    log: &Log,
    starts_s: &[f64],
) -> Result<Vec<Restart>, WorldError> {
    let measured = MeasuredState::of(model, log);
    let half_s = 0.5 * model.setup.dt_s;
    let (mut pulls, mut restarts) = (1, Vec::new());
    let mut lead = |time_s: f64, engine: &mut dyn Dynamics| {
        if time_s + half_s >= PULL_S * f64::from(pulls) {
            pulls += 1;
            let mut state = RobotState::of(engine);
            measured.pull(&mut state, time_s, PULL);
            engine.place(&state);
        }
        if starts_s.get(restarts.len()).is_some_and(|start_s| time_s + half_s >= *start_s) {
            let mut state = RobotState::of(engine);
            measured.pull(&mut state, time_s, (1.0, 1.0));
            restarts.push(Restart { time_s, state });
        }
    };
    model.simulate(ModelRequest::new(s, situation).effects(effects).hook(Box::new(&mut lead)))?;
    Ok(restarts)
}

/// Number of uncertain coordinates of the initial state of a robot with this many joints.
pub(crate) fn nudges(joints: usize) -> usize {
    2 * joints + BASE.len()
}

/// The joint of one of those coordinates.
pub(crate) fn nudged_joint(number: usize, joints: usize) -> Option<usize> {
    (number / 2 < joints).then_some(number / 2)
}

/// Moves one coordinate of the initial states of all windows by a number of standard deviations; `sigmas` are the
/// joints' noise floors.
pub(crate) fn nudge(restarts: &mut [Restart], number: usize, by: f64, sigmas: &[f64]) {
    for Restart { state: RobotState { joints, base }, .. } in restarts {
        if let Some((sigma, joint)) = sigmas.get(number / 2).zip(joints.get_mut(number / 2)) {
            match number % 2 {
                0 => joint.0 += by * sigma,
                _ => joint.1 += by * sigma / REACH_S,
            }
            continue;
        }
        let number = number - 2 * sigmas.len();
        let along = |axis: usize| by * BASE[number] * Vector3::ith(axis, 1.0);
        match number {
            0..3 => base.velocity_m_s += along(number),
            3 => base.pose.translation.vector += along(2),
            4 | 5 => {
                // About the root itself, so that its position stays unchanged.
                let turn = UnitQuaternion::from_scaled_axis(along(number - 4));
                base.pose = Isometry3::from_parts(base.pose.translation, turn * base.pose.rotation);
            }
            _ => base.angular_rad_s += along(number - 6),
        }
    }
}
