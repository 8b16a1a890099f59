//! Realities that differ from a robot's model: in their masses and gains, in their time step, and by what is hidden in
//! them.

use crate::excite::{Commands, TICK_S};
use crate::score::{Case, Planted};
use btr_core::log::{Log, Role};
use btr_core::random::{Rng, stream};
use btr_identify::residual_model::{EffectCandidate, FitParameter, Parametrisation, ResidualRequest, TimeStep};
use btr_lab::experiment::{Source, model, starts};
use btr_lab::identification::IdentificationProblem;
use btr_physics::drive::Replay;
use btr_physics::effects;
use btr_physics::effects::{FormulaTarget, PlacedEffect};
use btr_physics::model::{Model, Scenario};
use btr_physics::robot::{Base, JointKind, Robot};
use btr_physics::rollout::{RolloutRequest, simulate};
use rand::RngExt;
use std::path::Path;
use std::sync::Arc;

/// How many times finer the reality's time step is: finer than the finest that a diagnosis may take, and no multiple of
/// it.
const FINER: f64 = 6.0;
/// How long the robot rests before an episode is recorded, in s.
const SETTLE_S: f64 = 1.0;
/// How far the reality's masses and gains are off, at most.
const MASSES: f64 = 0.2;
const GAINS: f64 = 0.1;
/// Proportions of the amplitudes of hidden effects, in typical sizes, before they are scaled.
const SIZES: (f64, f64) = (0.7, 1.5);
/// Limits bind from about here on; see the scales of the robot.
const LIMITS: (f64, f64) = (0.3, 0.5);
/// ... and are loosened no further than to this.
const LOOSEST: f64 = 0.1;
/// What a hidden effect changes of the motion, in multiples of the noise: evenly over the orders of magnitude.
const SHOWS: (f64, f64) = (3.0, 40.0);
/// How often an effect is scaled towards that.
const SCALINGS: usize = 12;

/// A robot to try.
pub(crate) struct Subject {
    /// Its model, from this folder.
    pub file: &'static str,
    /// What is left of the robot.
    pub prepare: fn(&mut Robot),
    /// What it is told in training episodes, and in others to judge on.
    pub training: fn(usize, &mut Rng) -> Vec<Commands>,
    pub held_out: fn(usize, &mut Rng) -> Vec<Commands>,
    /// Beginnings of the names of the channels that its logs have.
    pub seen: &'static [&'static str],
    /// Effects that nothing of it could show.
    pub silent: &'static [&'static str],
    /// Effects at sites where they are, by mechanics, the same number as another that is drawn: such a thing has one
    /// name.
    pub one_number: &'static [(&'static str, &'static str)],
    /// The most logs that a diagnosis may simulate before another round begins.
    pub max_rollouts: usize,
    /// Laws that are in no library: `on` what, and the law.
    pub outside: &'static [(FormulaTarget, &'static str)],
}

/// A case that is still to be simulated.
pub(crate) type Plan = Box<dyn FnOnce() -> Case>;

/// All cases of a kind.
pub(crate) fn cases(
    subject: &'static Subject,
    kind: &str,
    effects: &[String],
    seeds: std::ops::Range<u64>,
    size: f64,
) -> Vec<Plan> {
    let mut names = effects.to_vec();
    if names.is_empty() && matches!(kind, "one" | "two") {
        let bare = Reality::new(subject, 0).problem(&[]);
        names = bare.candidates().iter().map(|c| c.effect.clone()).collect();
        names.dedup();
        names.retain(|name| !subject.silent.contains(&name.as_str()));
    }
    let mut cases: Vec<Plan> = Vec::new();
    for seed in seeds {
        match kind {
            "none" => cases.push(Box::new(move || Reality::new(subject, seed).case(&[], size))),
            "two" => {
                let mut rng = stream(seed, &[77]);
                let mut pick = || names[(rng.random::<f64>() * names.len() as f64) as usize].clone();
                let first = pick();
                let second = std::iter::repeat_with(pick).find(|name| *name != first);
                let both = [first, second.unwrap_or_default()];
                cases.push(Box::new(move || Reality::new(subject, seed).case(&both, size)));
            }
            "outside" => {
                for law in 0..subject.outside.len() {
                    cases.push(Box::new(move || Reality::new(subject, seed).outside(law)));
                }
            }
            _ => {
                for name in names.clone() {
                    cases.push(Box::new(move || Reality::new(subject, seed).case(&[name], size)));
                }
            }
        }
    }
    cases
}

/// One reality in the making.
struct Reality {
    subject: &'static Subject,
    seed: u64,
    rng: Rng,
    model: Model,
    told: Vec<Commands>,
    learn: usize,
}

impl Reality {
    fn new(subject: &'static Subject, seed: u64) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(subject.file);
        let mut model = Source::read(&path).and_then(|source| model(&source)).unwrap_or_else(|e| quit(&e));
        (subject.prepare)(&mut model.robot);
        let mut rng = stream(seed, &[1]);
        let joints = model.robot.movable().count();
        let training = (subject.training)(joints, &mut rng);
        let learn = training.len();
        let episodes: Vec<Commands> = training.into_iter().chain((subject.held_out)(joints, &mut rng)).collect();
        let mut model = Model { learn, ..model };
        model.scenarios = episodes.iter().enumerate().map(|(i, told)| scenario(&model, i, told)).collect();
        Reality { subject, seed, rng, model, told: episodes, learn }
    }

    /// The model beside what this reality does when `placed` is hidden in it.
    fn problem(&mut self, placed: &[PlacedEffect]) -> IdentificationProblem {
        let mut truth = self.model.simulations.nominal();
        for (value, dim) in truth.iter_mut().zip(self.model.simulations.dims()) {
            let off = if dim.name.starts_with("mass") { MASSES } else { GAINS };
            *value *= 1.0 + off * (2.0 * self.rng.random::<f64>() - 1.0);
            *value = value.clamp(dim.min, dim.max);
        }
        let logs: Vec<Log> = (0..self.model.scenarios.len()).map(|i| self.record(&truth, placed, i)).collect();
        let mut model = clone(&self.model, self.learn);
        for (scenario, log) in model.scenarios.iter_mut().zip(&logs) {
            scenario.start = starts(log, &self.model.robot).unwrap_or_else(|e| quit(&e));
        }
        IdentificationProblem::new(Arc::new(model), logs, &[]).unwrap_or_else(|e| quit(&e))
    }

    /// What the sensors say in an episode, once the robot has come to rest where the episode begins.
    fn record(&self, truth: &[f64], placed: &[PlacedEffect], episode: usize) -> Log {
        // A recording's clock starts with the recording: one that goes wrong must not have begun to while the robot
        // settled.
        let skewed = placed.iter().any(|placed| placed.effect.spec().name == "clock_skew");
        let free = self.model.robot.base == Base::Floating;
        let settle = if skewed || free { 0 } else { (SETTLE_S / TICK_S).round() as usize };
        let told: Commands =
            self.told[episode].iter().map(|row| [vec![row[0]; settle], row.clone()].concat()).collect();
        let settled = scenario(&self.model, episode, &told);
        let (mut robot, mut effects, mut setup) = self.model.at(truth, episode);
        for (link, row) in robot.links.iter_mut().filter(|link| link.joint.kind != JointKind::Fixed).zip(&told) {
            // Its servos hold it while it is put down: it is where its encoders read what it is told.
            let own = placed.iter().filter(|placed| free && placed.site == link.joint.name);
            link.joint.start = own.fold(row[0], |reading, placed| placed.effect.start(&placed.values, reading));
        }
        effects.extend_from_slice(placed);
        setup.dt_s /= FINER;
        setup.duration_s = settled.duration_s;
        setup.rest_s = if free { SETTLE_S } else { 0.0 };
        let Some(drive) = settled.replay else { quit(&"no replay") };
        let noise = self.seed.wrapping_mul(1009).wrapping_add(episode as u64);
        let log = simulate(RolloutRequest::new(&robot, &drive).setup(&setup).effects(&effects).noise_seed(noise))
            .unwrap_or_else(|e| quit(&e));
        let began_s = log.clock_s()[settle];
        let clock = log.clock_s()[settle..].iter().map(|t| t - began_s).collect();
        let mut cut = Log::new(clock).unwrap_or_else(|e| quit(&e));
        let seen = |name: &str| self.subject.seen.iter().any(|begin| name.starts_with(begin));
        for (name, channel) in log.channels().filter(|(name, _)| seen(name)) {
            let values = channel.values[settle..].to_vec();
            cut.insert(name, channel.unit.clone(), channel.role, values).unwrap_or_else(|e| quit(&e));
        }
        cut
    }

    /// Effects of the library, somewhere, each of a size that shows: so many sigma between the motions with and without
    /// it.
    fn case(mut self, names: &[String], size: f64) -> Case {
        let bare = self.problem(&[]);
        self.rng = stream(self.seed, &[2, names.len() as u64, fingerprint(&names.join(","))]);
        let planted: Vec<Planted> = names.iter().map(|name| self.plant(&bare, name, size)).collect();
        let placed: Vec<PlacedEffect> = planted.iter().flat_map(|p| p.placed(&bare)).collect();
        self.rng = stream(self.seed, &[3]);
        let model = self.problem(&placed);
        Case { name: names.join(" + "), seed: self.seed, planted, outside: false, model }
    }

    /// A law that the library does not have.
    fn outside(mut self, law: usize) -> Case {
        let joints: Vec<String> = self.model.robot.movable().map(|(_, link)| link.joint.name.clone()).collect();
        let joint = &joints[(self.rng.random::<f64>() * joints.len() as f64) as usize];
        let (on, text) = self.subject.outside[law];
        let effect = effects::formula(on, text, &[]).unwrap_or_else(|e| quit(&e));
        let placed = PlacedEffect { effect, site: joint.clone(), values: Vec::new() };
        let model = self.problem(&[placed]);
        Case { name: format!("{on:?} on {joint}: {text}"), seed: self.seed, planted: Vec::new(), outside: true, model }
    }

    /// An effect at a site drawn by lot, with amplitudes in typical proportions, scaled until it shows as wanted.
    fn plant(&mut self, bare: &IdentificationProblem, name: &str, size: f64) -> Planted {
        let drawn = |&i: &usize| {
            let EffectCandidate { effect, site, .. } = &bare.candidates()[i];
            effect == name && !self.subject.one_number.contains(&(name, site))
        };
        let sites: Vec<usize> = (0..bare.candidates().len()).filter(drawn).collect();
        let index = sites[(self.rng.random::<f64>() * sites.len() as f64) as usize];
        let candidate = &bare.candidates()[index];
        let mut coordinates = Vec::new();
        for &parameter in &candidate.amplitudes {
            coordinates.push((parameter, self.amplitude(&bare.parameters()[parameter])));
        }
        let start = &candidate.starts[(self.rng.random::<f64>() * candidate.starts.len() as f64) as usize];
        for (&parameter, &shape) in candidate.shapes.iter().zip(start) {
            coordinates.push((parameter, shape));
        }
        let wanted = size * SHOWS.0 * (SHOWS.1 / SHOWS.0).powf(self.rng.random());
        let mut planted =
            Planted { effect: name.to_owned(), site: candidate.site.clone(), coordinates, values: Vec::new() };
        let without = residuals(bare, &vec![0.0; bare.parameters().len()]);
        for _ in 0..SCALINGS {
            let shown = shows(bare, &without, &planted);
            if (shown / wanted - 1.0).abs() < 0.1 {
                break;
            }
            let factor = (wanted / shown.max(1e-3)).clamp(0.2, 5.0);
            for (parameter, u) in planted.coordinates.iter_mut().take(candidate.amplitudes.len()) {
                let parameter = &bare.parameters()[*parameter];
                // A limit that is hardly ever met is none, however much it is loosened.
                let least = if matches!(parameter.law, Parametrisation::Inverse | Parametrisation::Compliance) {
                    LOOSEST
                } else {
                    f64::NEG_INFINITY
                };
                *u = parameter.clamp(*u * factor).max(least);
            }
        }
        let value = |(k, u): &(usize, f64)| (bare.parameters()[*k].name.clone(), bare.parameters()[*k].value(*u));
        planted.values = planted.coordinates.iter().map(value).collect();
        planted
    }

    fn amplitude(&mut self, parameter: &FitParameter) -> f64 {
        let share: f64 = self.rng.random();
        let sign = if parameter.bounds.0 < 0.0 && self.rng.random::<f64>() < 0.5 { -1.0 } else { 1.0 };
        let sizes = if matches!(parameter.law, Parametrisation::Inverse | Parametrisation::Compliance) {
            LIMITS
        } else {
            SIZES
        };
        parameter.clamp(sign * (sizes.0 + share * (sizes.1 - sizes.0)))
    }
}

/// Residuals of the training episodes.
fn residuals(bare: &IdentificationProblem, u: &[f64]) -> Vec<f64> {
    let learn = bare.logs().iter().filter(|log| !log.held_out).count();
    (0..learn).flat_map(|log| bare.residual(ResidualRequest::of(u, log), TimeStep::USUAL).unwrap_or_default()).collect()
}

/// Root mean square of what an effect changes in the training episodes, in multiples of the noise.
fn shows(bare: &IdentificationProblem, without: &[f64], planted: &Planted) -> f64 {
    let mut u = vec![0.0; bare.parameters().len()];
    planted.coordinates.iter().for_each(|(parameter, x)| u[*parameter] = *x);
    let with = residuals(bare, &u);
    if with.len() != without.len() {
        return f64::INFINITY;
    }
    let changes = with.iter().zip(without).map(|(a, b)| (a - b).powi(2)).filter(|square| square.is_finite());
    let (squares, samples) = changes.fold((0.0, 0), |(sum, n), square| (sum + square, n + 1));
    (squares / f64::from(samples)).sqrt()
}

/// A replay of commands from rest at the first of them.
fn scenario(model: &Model, number: usize, told: &Commands) -> Scenario {
    let clock = (0..told[0].len()).map(|i| i as f64 * TICK_S).collect();
    let mut log = Log::new(clock).unwrap_or_else(|e| quit(&e));
    for ((_, link), row) in model.robot.movable().zip(told) {
        let name = format!("cmd_{}", link.joint.name);
        log.insert(name, "rad", Role::Command, row.clone()).unwrap_or_else(|e| quit(&e));
    }
    Scenario {
        name: format!("episode {number}"),
        replay: Some(Arc::new(Replay::new(&log, &model.robot))),
        duration_s: (told[0].len() - 1) as f64 * TICK_S,
        settings: Vec::new(),
        start: told.iter().map(|row| (row[0], 0.0)).collect(),
        ..Scenario::default()
    }
}

fn clone(model: &Model, learn: usize) -> Model {
    Model {
        robot: model.robot.clone(),
        effects: model.effects.clone(),
        setup: model.setup.clone(),
        targets: model.targets.clone(),
        simulations: model.simulations.clone(),
        prior_sds: model.prior_sds.clone(),
        drive: model.drive.clone(),
        scenarios: model.scenarios.clone(),
        learn,
        fitness: model.fitness.clone(),
        rollouts: 0.into(),
    }
}

fn fingerprint(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
}

/// A benchmark that cannot run has nothing to say.
pub(crate) fn quit(error: &dyn std::fmt::Display) -> ! {
    eprintln!("{error}");
    std::process::exit(2);
}
