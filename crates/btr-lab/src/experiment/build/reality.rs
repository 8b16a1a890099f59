//! Builds the reality.

use super::builder::Builder;
use super::setup::noise;
use crate::execution::ExecutionContext;
use crate::experiment::file::{
    CommandSection, DriftSection, EffectSection, RealitySection, TwinParameters, TwinSection,
};
use crate::experiment::logs::scenarios::ScenarioSet;
use crate::experiment::source::FileError;
use crate::reality::{
    CommandReality, CommandSettings, ManualReality, RecordedReality, Revealing, Store, TwinReality, TwinStage,
};
use btr_core::log::Log;
use btr_core::random;
use btr_core::space::{Space, SpaceError};
use btr_physics::model::Model;
use rand::RngExt;
use std::path::Path;
use std::sync::Arc;

/// Label of the random stream that draws a hidden twin.
const TWIN_STREAM: u64 = 100;
/// A week.
const LONGEST_TEST_S: f64 = 604_800.0;

impl Builder<'_> {
    pub(crate) fn reality(
        &self,
        section: &RealitySection,
        model: &Arc<Model>,
        recorded: &[Log],
        seed: u64,
        folder: &Path,
        context: &Arc<ExecutionContext>,
    ) -> Result<Box<dyn Revealing>, FileError> {
        let (fitness, store) = (model.fitness.clone(), self.store(model, folder));
        Ok(match section {
            RealitySection::Twin(twin) => Box::new(self.twin(twin, model, seed, store)?),
            RealitySection::Logs(_) => Box::new(RecordedReality::new(recorded[..model.learn].to_vec(), fitness)),
            RealitySection::Command(command) => {
                Box::new(CommandReality::new(self.command(command)?, model.clone(), store, context.clone()))
            }
            RealitySection::Manual {} if model.drive.senses() => {
                let why = "a policy cannot be played by hand: its references depend on what the robot senses";
                let help = "kind = \"command\", with a program that runs the policy on the robot";
                return Err(self.error(&["reality", "kind"], why, Some(help.into())));
            }
            RealitySection::Manual {} => Box::new(ManualReality::new(model.clone(), store)),
        })
    }

    fn command(&self, command: &CommandSection) -> Result<CommandSettings, FileError> {
        let timely = |time_s: f64| time_s > 0.0 && time_s <= LONGEST_TEST_S;
        if command.run.is_empty() || !timely(command.timeout_s) {
            let message = "a command needs run = [program, ...] and a timeout_s above 0, a week at most";
            return Err(self.error(&["reality"], message, None));
        }
        for (key, time_s) in [("stop_s", command.stop_s), ("on_stop_timeout_s", command.on_stop_timeout_s)] {
            if !timely(time_s) {
                return Err(self.error(&["reality", key], format!("{key} must be above 0, a week at most"), None));
            }
        }
        if !["csv", "mcap"].contains(&command.log.as_str()) {
            return Err(self.unknown(&["reality", "log"], "kind of log", &command.log, ["csv", "mcap"]));
        }
        Ok(CommandSettings {
            run: command.run.clone(),
            log: command.log.clone(),
            timeout_s: command.timeout_s,
            retries: command.retries,
            stop_signal: command.stop_signal,
            stop_s: command.stop_s,
            on_stop: command.on_stop.clone(),
            on_stop_timeout_s: command.on_stop_timeout_s,
        })
    }

    /// The store of a run's real tests.
    pub(crate) fn store(&self, model: &Model, folder: &Path) -> Store {
        let controllers = model.drive.space().clone();
        let (fitness, mapping) = (model.fitness.clone(), self.file.channels.clone());
        let test_s = model.scenarios.iter().map(|scenario| scenario.duration_s).fold(0.0, f64::max);
        Store::new(folder.join("transfers"), controllers, fitness, mapping, test_s)
    }

    fn twin(&self, twin: &TwinSection, model: &Model, seed: u64, store: Store) -> Result<TwinReality, FileError> {
        let point = self.twin_point(twin, &model.simulations, seed)?;
        let first = self.stage(twin, &[], 0, point)?;
        let mut later = Vec::new();
        let mut before = &first;
        for (k, drift) in twin.drift.iter().enumerate() {
            let effects: Vec<EffectSection> = twin.drift[..=k].iter().flat_map(|drift| drift.effects.clone()).collect();
            let point = self.drifted(drift, &model.simulations, &before.parameters)?;
            later.push(self.stage(twin, &effects, drift.test, point)?);
            before = later.last().unwrap_or(&first);
        }
        Ok(TwinReality::new(first, later, random::derive(seed, &[TWIN_STREAM, 1]), store))
    }

    /// The parameters of a twin after a change.
    fn drifted(&self, drift: &DriftSection, space: &Space, before: &[f64]) -> Result<Vec<f64>, FileError> {
        let mut point = before.to_vec();
        for (name, times) in &drift.times {
            let keys = ["reality", "drift", "times", name];
            let Some(place) = space.index_of(name) else {
                let known = space.dims().iter().map(|d| d.name.as_str());
                return Err(self.unknown(&keys, "parameter of S", name, known));
            };
            point[place] *= times;
        }
        self.inside(space, &point, &["reality", "drift", "times"])?;
        Ok(point)
    }

    /// A stage of the twin: its initial effects and those added `later`.
    fn stage(
        &self,
        twin: &TwinSection,
        later: &[EffectSection],
        from_test: usize,
        parameters: Vec<f64>,
    ) -> Result<TwinStage, FileError> {
        let mut hidden = self.model(ScenarioSet::single(self.file.simulation.duration_s))?;
        hidden.effects.extend(self.effects(&twin.effects, "reality.effects", &hidden.robot)?);
        hidden.effects.extend(self.effects(later, "reality.drift.effects", &hidden.robot)?);
        hidden.setup.noise = noise(&twin.noise);
        if let Some(steps) = twin.steps_per_control {
            if steps == 0 {
                return Err(self.error(
                    &["reality", "steps_per_control"],
                    "steps_per_control must be at least 1",
                    None,
                ));
            }
            hidden.setup.dt_s = hidden.setup.control_s / f64::from(steps);
        }
        let effects = twin.effects.iter().chain(later);
        let names = effects.map(|e| format!("{}@{}", e.effect, e.site)).collect();
        Ok(TwinStage { from_test, model: hidden, parameters, hidden: names })
    }

    fn twin_point(&self, twin: &TwinSection, space: &Space, seed: u64) -> Result<Vec<f64>, FileError> {
        let keys = ["reality", "parameters"];
        let mut point = space.nominal();
        match &twin.parameters {
            TwinParameters::Word(word) if word == "nominal" => {}
            TwinParameters::Word(word) if word == "random" => {
                let spread = twin.spread.unwrap_or(1.0);
                let mut rng = random::stream(seed, &[TWIN_STREAM, 0]);
                let unit: Vec<f64> = (0..space.len()).map(|_| 0.5 + spread * (rng.random::<f64>() - 0.5)).collect();
                point = space.from_unit(&unit);
            }
            TwinParameters::Word(word) => return Err(self.unknown(&keys, "choice", word, ["nominal", "random"])),
            TwinParameters::Values(values) => {
                for (name, value) in values {
                    let Some(k) = space.index_of(name) else {
                        let known = space.dims().iter().map(|d| d.name.as_str());
                        return Err(self.unknown(&["reality", "parameters", name], "parameter of S", name, known));
                    };
                    point[k] = *value;
                }
            }
        }
        self.inside(space, &point, &keys)?;
        Ok(point)
    }

    /// Checks that a twin lies in S.
    fn inside(&self, space: &Space, point: &[f64], keys: &[&str]) -> Result<(), FileError> {
        space.check(point).map_err(|e| {
            let help = "a twin must lie in S: widen the bounds in [parameters] or move the twin".into();
            let keys = match &e {
                SpaceError::Outside { name, .. } => [keys, &[name.as_str()]].concat(),
                _ => keys.to_vec(),
            };
            self.error(&keys, format!("the hidden twin lies outside S: {e}"), Some(help))
        })
    }
}
