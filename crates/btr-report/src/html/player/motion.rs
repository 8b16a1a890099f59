//! The motion of logs and of a model's replays of them, for the player: the positions of the joints, frame by frame.

use super::drawing::{DrawnLink, Pose, drawn, pose, rounded};
use crate::table::number;
use btr_core::log::{Log, interpolate};
use btr_identify::compare::Comparison;
use btr_lab::motion::{base, has_base, positions, readings};
use btr_physics::model::Model;
use btr_physics::robot::{Base, Joint};
use serde::Serialize;

/// Least time between two frames.
const FRAME_S: f64 = 0.02;
/// Numbers in a page at most, or else fewer frames: about eight bytes each.
const MOST_NUMBERS: usize = 150_000;
/// Logs in a page at most, those with the largest errors.
const MOST_LOGS: usize = 8;

/// Logs and what models do with their commands.
pub(in crate::html) struct Replayed<'a> {
    /// The model, for its robot and its ground.
    pub(in crate::html) model: &'a Model,
    /// Names of the logs.
    pub(in crate::html) names: &'a [&'a str],
    /// The recordings.
    pub(in crate::html) logs: &'a [Log],
    /// States of the model; the first one is shown first.
    pub(in crate::html) states: Vec<ReplayedState<'a>>,
    /// What the states' errors are.
    pub(in crate::html) errors_are: Option<String>,
    /// Whether replays start anew from measured states.
    pub(in crate::html) in_windows: bool,
}

/// A state of the model.
pub(in crate::html) struct ReplayedState<'a> {
    /// Its name.
    pub(in crate::html) name: String,
    /// Its error in all logs.
    pub(in crate::html) error: Option<f64>,
    /// Its errors in each log.
    pub(in crate::html) comparison: &'a Comparison,
    /// Its simulation of each log.
    pub(in crate::html) simulated: &'a [Log],
}

/// What the player shows: a document of JSON.
#[derive(Debug, Serialize)]
pub(super) struct Motion {
    links: Vec<DrawnLink>,
    /// Names of the joints that move.
    joints: Vec<String>,
    /// Pose of a root that is bolted to the world.
    root: Pose,
    floats: bool,
    /// Whether there is a ground, at height 0.
    ground: bool,
    /// The model's states.
    states: Vec<PlayedState>,
    /// What their errors are.
    errors_are: Option<String>,
    logs: Vec<PlayedLog>,
    /// What a viewer has to know.
    notes: Vec<String>,
}

#[derive(Debug, Serialize)]
struct PlayedState {
    name: String,
    /// Its error, as it is shown.
    error: Option<String>,
}

#[derive(Debug, Serialize)]
struct PlayedLog {
    name: String,
    /// Its number in the plots of the page.
    log: usize,
    /// Time of each frame.
    time_s: Vec<f64>,
    /// Position of each joint in each frame, in rad or m; none where it was not measured.
    measured: Vec<Option<Vec<f64>>>,
    /// Pose of the base in each frame, if it was measured.
    base: Option<Vec<Pose>>,
    /// One for each state of the model.
    replays: Vec<PlayedReplay>,
}

#[derive(Debug, Serialize)]
struct PlayedReplay {
    /// Position of each joint in each frame.
    simulated: Vec<Vec<f64>>,
    /// Pose of a floating base in each frame.
    base: Option<Vec<Pose>>,
    /// Of each joint, the largest error of its channels from each frame to the next, in noise floors; none where it is
    /// not judged.
    errors: Vec<Option<Vec<f64>>>,
}

/// The samples of a log that are frames.
struct Frames<'a> {
    clock_s: &'a [f64],
    samples: Vec<usize>,
}

impl Replayed<'_> {
    /// What the player shows; none if there is nothing that moves.
    pub(super) fn motion(&self) -> Option<Motion> {
        let robot = &self.model.robot;
        let joints: Vec<&Joint> = robot.movable().map(|(_, link)| &link.joint).collect();
        let shown = self.shown();
        let floats = robot.base == Base::Floating;
        if shown.is_empty() || self.states.is_empty() || (joints.is_empty() && !floats) {
            return None;
        }
        let per_frame = 1 + (joints.len() + if floats { 7 } else { 0 }) * (1 + 2 * self.states.len());
        let most = MOST_NUMBERS / (per_frame * shown.len());
        let logs = shown.iter().map(|log| self.played(*log, &joints, most)).collect();
        Some(Motion {
            links: drawn(robot),
            joints: joints.iter().map(|joint| joint.name.clone()).collect(),
            root: pose(&robot.start),
            floats,
            ground: self.model.setup.ground.is_some(),
            states: self.states.iter().map(PlayedState::of).collect(),
            errors_are: self.errors_are.clone(),
            notes: self.notes(&joints, &shown),
            logs,
        })
    }

    /// The logs with the largest errors, in their order.
    fn shown(&self) -> Vec<usize> {
        let square = |log: usize| -> f64 {
            let tracks = self.states.iter().flat_map(|state| &state.comparison.tracks).filter(|t| t.log == log);
            let errors = tracks.flat_map(|track| track.error.iter().map(|e| (e / track.floor).powi(2)));
            errors.filter(|square| square.is_finite()).sum()
        };
        let moving = (0..self.logs.len()).filter(|log| self.logs[*log].clock_s().len() > 1);
        let mut logs: Vec<(usize, f64)> = moving.map(|log| (log, square(log))).collect();
        logs.sort_by(|(_, a), (_, b)| b.total_cmp(a));
        let mut logs: Vec<usize> = logs.into_iter().take(MOST_LOGS).map(|(log, _)| log).collect();
        logs.sort_unstable();
        logs
    }

    fn played(&self, log: usize, joints: &[&Joint], most: usize) -> PlayedLog {
        let real = &self.logs[log];
        let frames = Frames::of(real.clock_s(), most);
        let replay = |state: &ReplayedState| PlayedReplay {
            simulated: joints.iter().map(|joint| frames.simulated(&state.simulated[log], joint)).collect(),
            base: self.simulated_base(&frames, &state.simulated[log]),
            errors: joints.iter().map(|joint| frames.errors(state.comparison, log, joint)).collect(),
        };
        PlayedLog {
            name: self.names[log].to_owned(),
            log,
            time_s: frames.samples.iter().map(|k| rounded(frames.clock_s[*k], 1e-4)).collect(),
            measured: positions(&self.model.robot, real).into_iter().map(|q| Some(frames.of_readings(&q?))).collect(),
            base: self.measured_base(&frames, real),
            replays: self.states.iter().map(replay).collect(),
        }
    }

    fn measured_base(&self, frames: &Frames, real: &Log) -> Option<Vec<Pose>> {
        self.is_floating().then(|| base(|name| Some(frames.of_readings(&readings(real, name)?)))).flatten()
    }

    fn simulated_base(&self, frames: &Frames, simulated: &Log) -> Option<Vec<Pose>> {
        self.is_floating().then(|| base(|name| frames.of_simulation(simulated, name))).flatten()
    }

    fn is_floating(&self) -> bool {
        self.model.robot.base == Base::Floating
    }

    fn notes(&self, joints: &[&Joint], shown: &[usize]) -> Vec<String> {
        let mut notes = Vec::new();
        let measured: Vec<Vec<bool>> = shown
            .iter()
            .map(|log| positions(&self.model.robot, &self.logs[*log]).iter().map(Option::is_some).collect())
            .collect();
        let lacking = joints.iter().enumerate().filter(|(k, _)| measured.iter().any(|log| !log[*k]));
        let lacking: Vec<&str> = lacking.map(|(_, joint)| joint.name.as_str()).collect();
        if !lacking.is_empty() {
            notes.push(format!(
                "Not measured in every log, and drawn as the model moves there: {}.",
                lacking.join(", ")
            ));
        }
        if self.is_floating() && !shown.iter().all(|log| has_base(&self.logs[*log])) {
            notes.push("The pose of the base was not measured in every log: there it is the model's.".to_owned());
        }
        let given: Vec<&str> = self.model.robot.prescribed().map(|joint| joint.name.as_str()).collect();
        if !given.is_empty() {
            let joints = given.join(", ");
            notes.push(format!(
                "The motion of {joints} is given to the model: it differs in the torques, by which joints are coloured."
            ));
        }
        if self.in_windows {
            notes.push("The replay starts anew from the measured state in every window of a log.".to_owned());
        }
        if shown.len() < self.logs.len() {
            notes.push(format!("The {} logs with the largest errors are played, of {}.", shown.len(), self.logs.len()));
        }
        notes
    }
}

impl PlayedState {
    fn of(state: &ReplayedState) -> Self {
        PlayedState { name: state.name.clone(), error: state.error.map(number) }
    }
}

impl Frames<'_> {
    /// Samples that are at least 20 ms apart, and so far that there are at most so many; the last one included.
    fn of(clock_s: &[f64], most: usize) -> Frames<'_> {
        let (first, last) = (clock_s.first().copied().unwrap_or(0.0), clock_s.last().copied().unwrap_or(0.0));
        let apart_s = FRAME_S.max((last - first) / most.saturating_sub(2).max(1) as f64);
        let mut samples: Vec<usize> = Vec::new();
        for (k, t) in clock_s.iter().enumerate() {
            // Time stamps are rounded.
            let due = samples.last().is_none_or(|before| t - clock_s[*before] >= 0.999 * apart_s);
            if due || k + 1 == clock_s.len() {
                samples.push(k);
            }
        }
        Frames { clock_s, samples }
    }

    fn of_readings(&self, values: &[f64]) -> Vec<f64> {
        self.samples.iter().map(|k| rounded(values[*k], 1e-5)).collect()
    }

    fn of_simulation(&self, simulated: &Log, channel: &str) -> Option<Vec<f64>> {
        let values = &simulated.channel(channel)?.values;
        Some(self.of_readings(&interpolate(simulated.clock_s(), values, self.clock_s)))
    }

    fn simulated(&self, simulated: &Log, joint: &Joint) -> Vec<f64> {
        let found = self.of_simulation(simulated, &format!("q_{}", joint.name));
        found.unwrap_or_else(|| vec![rounded(joint.start, 1e-5); self.samples.len()])
    }

    fn errors(&self, comparison: &Comparison, log: usize, joint: &Joint) -> Option<Vec<f64>> {
        let channels = ["q", "dq", "tau"].map(|kind| format!("{kind}_{}", joint.name));
        let judged = comparison.residuals.iter().filter(|r| r.log == log && channels.contains(&r.channel));
        let judged: Vec<(&[f64], f64)> = judged.map(|r| (&r.error[..], r.floor)).collect();
        let worst = |(k, from): (usize, &usize)| {
            let to = self.samples.get(k + 1).copied().unwrap_or(self.clock_s.len());
            let errors = judged.iter().flat_map(|(error, floor)| error[*from..to].iter().map(move |e| e.abs() / floor));
            rounded(errors.fold(f64::NAN, f64::max), 0.1)
        };
        (!judged.is_empty()).then(|| self.samples.iter().enumerate().map(worst).collect())
    }
}
