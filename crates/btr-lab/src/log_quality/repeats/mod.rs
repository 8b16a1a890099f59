//! Runs of the same command, and how far they differ.
//!
//! Runs are compared beside the model: each run's error, from its own start, departs from the mean error of its runs by
//! what the robot did not do twice. What the model lacks is in every run and cancels.

mod report;
mod same_command;

pub use report::{Drift, RepeatReport, RepeatedChannel, RepeatedRegime, RunOutlier};

use btr_core::log::{Log, interpolate};
use btr_core::signal::repeats::{RunSpread, departures, without_offsets};
use btr_core::world::Simulator;
use btr_physics::model::{Model, Scenario};
use btr_physics::robot::{Base, Joint};
use btr_physics::sensor::RunNoise;
use indexmap::IndexMap;
use rayon::prelude::*;
use same_command::{commands, on_clock_of, shift_s};

/// A spread below this many noise floors is that of the sensors.
const NOTICEABLE: f64 = 1.15;

/// Offsets of whole runs count by themselves if they are this share of the variance.
const OFFSETS: f64 = 0.3;

/// The runs of one command: the scenario of each, and by how much later than the first it does the same, in s.
pub(crate) type Runs = Vec<(usize, f64)>;

/// Runs of the same commands among the scenarios of a model.
#[derive(Clone, Debug, Default)]
pub(crate) struct Repeats {
    /// The runs of each command that was given more than once.
    runs: Vec<Runs>,
    /// The spread of each compared channel.
    channels: IndexMap<String, ChannelSpread>,
}

/// How far the readings of a channel differ from run to run.
#[derive(Clone, Debug)]
struct ChannelSpread {
    unit: String,
    spread: RunSpread,
    /// The same without the offset of each run.
    rest: RunSpread,
    /// Mean square of the offsets, weighted by the number of runs of each command.
    offsets: f64,
    weight: f64,
    /// The noise floor of its sensor.
    sensor: f64,
    /// The departures of each scenario that has runs, on its own clock, NaN where there are none; as large as those of
    /// one run from what the robot does on average.
    departures: IndexMap<usize, Vec<f64>>,
}

impl ChannelSpread {
    /// The spread of one run; `None` where it is not more than the sensor's noise.
    fn beyond_the_sensor(&self) -> Option<RunNoise> {
        let whole = self.spread.std().filter(|sigma| *sigma > NOTICEABLE * self.sensor)?;
        let offset = Some(self.offset()).filter(|offset| offset * offset > OFFSETS * whole * whole);
        let spread = if offset.is_some() { &self.rest } else { &self.spread };
        let sigma = spread.std()?.max(self.sensor);
        Some(RunNoise { sigma, offset, freedom: spread.freedom(), memory: spread.memory(), shared: Vec::new() })
    }

    /// Standard deviation of the offset of a run.
    fn offset(&self) -> f64 {
        (self.offsets / self.weight.max(1.0)).sqrt()
    }

    /// The squared correlation with the departures of another channel.
    fn shared(&self, other: &ChannelSpread) -> f64 {
        let pairs = self.departures.iter().filter_map(|(scenario, own)| Some((own, other.departures.get(scenario)?)));
        let samples = pairs.flat_map(|(a, b)| a.iter().zip(b)).filter(|(a, b)| a.is_finite() && b.is_finite());
        let (aa, bb, ab) = samples.fold((0.0, 0.0, 0.0), |(aa, bb, ab), (a, b)| (aa + a * a, bb + b * b, ab + a * b));
        if aa > 0.0 && bb > 0.0 { ab * ab / (aa * bb) } else { 0.0 }
    }
}

impl Repeats {
    /// The runs among the logs of the model's scenarios. Scenarios with the same name in `declared` are runs of one
    /// command; others are where their commands and their settings are the same. None for floating robots, whose
    /// contacts come at other times in every run.
    pub(crate) fn of(model: &Model, logs: &[Log], declared: &[Option<String>]) -> Self {
        if model.robot.base == Base::Floating {
            return Repeats::default();
        }
        let runs = runs(model, logs, declared);
        if runs.is_empty() {
            return Repeats::default();
        }
        let errors = Errors::of(model, logs, &runs);
        let joints = model.robot.movable().map(|(_, link)| link.joint.compared());
        let spread = |name: String| Some((name.clone(), spread(&errors, logs, &runs, &name)?));
        let mut channels: IndexMap<String, ChannelSpread> = joints.filter_map(spread).collect();
        for (name, channel) in &mut channels {
            channel.sensor = sensor_floor(model, logs, &errors, name);
        }
        Repeats { runs, channels }
    }

    /// What no model can predict of a run, by channel, where that is more than the sensor's noise.
    pub(crate) fn noise(&self) -> IndexMap<String, RunNoise> {
        let beyond = |(_, channel): &(&String, &ChannelSpread)| channel.beyond_the_sensor().is_some();
        let noisy: Vec<(&String, &ChannelSpread)> = self.channels.iter().filter(beyond).collect();
        let noise = |(name, channel): &(&String, &ChannelSpread)| {
            let shared = noisy.iter().map(|(_, other)| channel.shared(other)).collect();
            Some(((*name).clone(), RunNoise { shared, ..channel.beyond_the_sensor()? }))
        };
        noisy.iter().filter_map(noise).collect()
    }
}

/// The noise floor of a channel's sensor: its mean square over the logs that have runs.
fn sensor_floor(model: &Model, logs: &[Log], errors: &Errors, name: &str) -> f64 {
    let of_log = |scenario: &usize| {
        let (log, noise) = (&logs[*scenario], &model.setup.noise);
        let readings = &log.channel(name)?.values;
        match errors.predicted(log, *scenario, name) {
            Some(predicted) => noise.floor_beside(name, readings, &predicted),
            None => noise.floor(name, readings),
        }
    };
    let floors: Vec<f64> = errors.scenarios.iter().filter_map(of_log).collect();
    (floors.iter().map(|floor| floor * floor).sum::<f64>() / floors.len().max(1) as f64).sqrt()
}

/// Groups scenarios by their commands; only groups of at least two.
fn runs(model: &Model, logs: &[Log], declared: &[Option<String>]) -> Vec<Runs> {
    let prescribed: Vec<String> = model.robot.prescribed().map(|joint: &Joint| joint.name.clone()).collect();
    let mut groups: Vec<Runs> = Vec::new();
    for (scenario, log) in logs.iter().enumerate() {
        let commands = commands(log, &prescribed);
        let shift = |first: usize| {
            let same_settings = have_same_settings(&model.scenarios[first], &model.scenarios[scenario]);
            let told = declared[first].is_some() || declared[scenario].is_some();
            match told {
                true if declared[first] == declared[scenario] => shift_s(log, &logs[first], &commands, true),
                false if same_settings => shift_s(log, &logs[first], &commands, false),
                _ => None,
            }
        };
        let group = groups.iter_mut().find_map(|runs| Some((shift(runs.first()?.0)?, runs)));
        match group {
            Some((shift_s, runs)) => runs.push((scenario, shift_s)),
            None => groups.push(vec![(scenario, 0.0)]),
        }
    }
    groups.retain(|runs| runs.len() > 1);
    groups
}

fn have_same_settings(a: &Scenario, b: &Scenario) -> bool {
    let settings = |scenario: &Scenario| -> Vec<(String, u64)> {
        scenario.settings.iter().map(|(target, value)| (target.name().to_owned(), value.to_bits())).collect()
    };
    settings(a) == settings(b)
}

/// The errors of the model at its current values on the scenarios that have runs.
struct Errors {
    scenarios: Vec<usize>,
    simulated: IndexMap<usize, Log>,
}

impl Errors {
    fn of(model: &Model, logs: &[Log], runs: &[Runs]) -> Self {
        let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
        let scenarios: Vec<usize> = runs.iter().flatten().map(|(scenario, _)| *scenario).collect();
        // Where a simulation diverges, readings are compared with readings.
        let simulate = |k: usize| model.simulate(model.request(&s, k).controller(&c)).ok().map(|log| (k, log));
        let simulated: Vec<Option<(usize, Log)>> = scenarios.par_iter().copied().map(simulate).collect();
        let is_whole = |(k, simulated): &(usize, Log)| {
            simulated.duration_s() + logs[*k].usual_step_s().unwrap_or(0.0) >= logs[*k].duration_s()
        };
        Errors { scenarios, simulated: simulated.into_iter().flatten().filter(is_whole).collect() }
    }

    /// What the model predicts of a scenario's channel, on the log's clock; `None` where it diverges.
    fn predicted(&self, log: &Log, scenario: usize, name: &str) -> Option<Vec<f64>> {
        let model = self.simulated.get(&scenario)?;
        Some(interpolate(model.clock_s(), model.values(name).ok()?, log.clock_s()))
    }

    /// The error of a scenario's channel on its own clock.
    fn channel(&self, log: &Log, scenario: usize, name: &str) -> Option<Vec<f64>> {
        let readings = &log.channel(name)?.values;
        let Some(predicted) = self.predicted(log, scenario, name) else { return Some(readings.clone()) };
        Some(readings.iter().zip(predicted).map(|(reading, predicted)| reading - predicted).collect())
    }
}

/// The spread of a channel over all commands.
fn spread(errors: &Errors, logs: &[Log], runs: &[Runs], name: &str) -> Option<ChannelSpread> {
    let mut all = ChannelSpread {
        unit: logs.iter().find_map(|log| log.channel(name))?.unit.clone(),
        spread: RunSpread::default(),
        rest: RunSpread::default(),
        offsets: 0.0,
        weight: 0.0,
        sensor: 0.0,
        departures: IndexMap::new(),
    };
    for runs in runs {
        let first = &logs[runs.first()?.0];
        let error = |(scenario, shift_s): &(usize, f64)| {
            let error = errors.channel(&logs[*scenario], *scenario, name)?;
            Some(on_clock_of(first, &logs[*scenario], &error, *shift_s))
        };
        let Some(errors): Option<Vec<Vec<f64>>> = runs.iter().map(error).collect() else { continue };
        let departures = departures(&errors);
        all.spread = std::mem::take(&mut all.spread).and(RunSpread::of(&departures));
        let (rest, offset) = without_offsets(&departures);
        all.rest = std::mem::take(&mut all.rest).and(RunSpread::of(&rest));
        let weight = (runs.len() - 1) as f64;
        all.offsets += weight * offset * offset;
        all.weight += weight;
        // The mean of a few runs follows each of them a little.
        let whole = (runs.len() as f64 / (runs.len() - 1) as f64).sqrt();
        for ((scenario, shift_s), departure) in runs.iter().zip(departures) {
            let own = on_clock_of(&logs[*scenario], first, &departure, -shift_s);
            all.departures.insert(*scenario, own.into_iter().map(|d| whole * d).collect());
        }
    }
    all.spread.std().is_some().then_some(all)
}
