//! Where a fit begins: at the values of another model of the same robot, and, with effects that were added, where a
//! diagnosis would begin them.

use super::VerbInput;
use crate::experiment;
use crate::experiment::{FileError, Replays, Source};
use crate::identification::problem_error::ProblemError;
use crate::model_text::with_parameters_of;
use btr_identify::diagnose::with_effects;
use btr_identify::fit::{Objective, StartValues};
use btr_identify::residual_model::{EffectCandidate, ResidualModel};
use btr_physics::effects::PlacedEffect;
use btr_physics::model::Model;
use btr_physics::model::parameter::Target;
use btr_physics::robot::Robot;
use btr_physics::robot::site::matches;

/// A model from whose values a fit of another one begins.
pub struct StartModel {
    source: Source,
    model: Model,
}

/// What is changed about a model before it is fitted.
#[derive(Clone, Copy)]
pub struct FitOptions<'a> {
    /// Effects to add, and values to free.
    pub add: &'a [String],
    /// Patterns of parameters that keep the model's values.
    pub freeze: &'a [String],
    /// A model to begin at; it has [completed](StartModel::completing) the source.
    pub start: Option<&'a StartModel>,
}

impl StartModel {
    /// The model of a file.
    ///
    /// # Errors
    /// An invalid file, at its line.
    pub fn new(source: Source) -> Result<Self, FileError> {
        let model = experiment::model(&source)?;
        Ok(StartModel { source, model })
    }

    /// A model's text with the free parameters that only this model has: those of effects that were found, and values.
    ///
    /// # Errors
    /// An invalid file; a model of another robot.
    pub fn completing(&self, source: Source) -> Result<Source, FileError> {
        let robot = experiment::model(&source)?.robot;
        if let Some(part) = difference(&robot, &self.model.robot) {
            let message =
                format!("a model of another robot than {}: {part} is in one of them alone", source.path.display());
            let help = "begin with a model of the same robot, such as a diagnosis or a fit of this one writes".into();
            return Err(self.source.error(&["robot"], &message, Some(help)));
        }
        let text = with_parameters_of(&source.text, &self.source.text)
            .map_err(|error| source.error(&["parameters"], error.message(), None))?;
        Ok(Source { text, ..source })
    }

    /// The value of a parameter; `None` where the model does not state a single one.
    fn value(&self, name: &str) -> Option<f64> {
        let Model { robot, effects, setup, simulations, .. } = &self.model;
        if let Some(value) = simulations.dims().iter().find(|dim| dim.name == name).and_then(|dim| dim.nominal) {
            return Some(value);
        }
        let target = Target::parse(name, robot).ok()?;
        let site = name.split_once('@').map_or("*", |(_, site)| site);
        let has = |effect: &str| effects.iter().any(|placed| is_at(placed, effect, site));
        let is_stated = target.of_effect().is_none_or(|(effect, _)| has(effect.spec().name));
        is_stated.then(|| target.nominal(robot, effects, setup)).flatten()
    }

    /// The first effect with values of its own that another model lacks.
    fn lacking<'a>(&'a self, in_model: &Model) -> Option<&'a PlacedEffect> {
        let has = |placed: &&PlacedEffect| {
            let (name, site) = (placed.effect.spec().name, placed.site.as_str());
            let prefix = format!("{name}.");
            let is_free = |dim: &str| dim.starts_with(&prefix) && dim.ends_with(&format!("@{site}"));
            in_model.effects.iter().any(|other| is_at(other, name, site))
                || in_model.simulations.dims().iter().any(|dim| is_free(&dim.name))
        };
        self.model.effects.iter().filter(|placed| !placed.is_off()).find(|placed| !has(placed))
    }
}

/// Whether a model places an effect of this name at a site.
fn is_at(placed: &PlacedEffect, effect: &str, site: &str) -> bool {
    placed.effect.spec().name == effect && matches(&placed.site, site)
}

/// A link or a joint that only one of two robots has.
fn difference(one: &Robot, other: &Robot) -> Option<String> {
    let names = |robot: &Robot| -> Vec<String> {
        let links = robot.links.iter().map(|link| format!("link `{}`", link.name));
        links.chain(robot.movable().map(|(_, link)| format!("joint `{}`", link.joint.name))).collect()
    };
    let (one, other) = (names(one), names(other));
    let only = |of: &[String], without: &[String]| of.iter().find(|name| !without.contains(name)).cloned();
    only(&one, &other).or_else(|| only(&other, &one))
}

impl VerbInput {
    /// The input of a fit; `replays` is the model without what is added.
    ///
    /// # Errors
    /// See [`with`](Self::with) and [`freezing`](Self::freezing); a start model with an effect that the model
    /// lacks, or that states no parameter that is fitted.
    pub fn to_fit(source: Source, replays: Replays, options: FitOptions) -> Result<Self, ProblemError> {
        let input = VerbInput::with(source, replays, options.add)?.freezing(options.freeze)?;
        match options.start {
            Some(start) => input.beginning_at(start),
            None => Ok(input),
        }
    }

    /// The same, of which a fit begins at the values of a start model. Parameters that it does not state begin at the
    /// model's values.
    ///
    /// # Errors
    /// An effect of the start model that the model lacks; a start model that states no parameter that is fitted.
    fn beginning_at(mut self, start: &StartModel) -> Result<Self, ProblemError> {
        let name = start.source.path.display().to_string();
        if let Some(placed) = start.lacking(self.problem.model()) {
            let effect = format!("{}@{}", placed.effect.spec().name, placed.site);
            return Err(ProblemError::StartHas { start: name, effect });
        }
        let values = self.own_values(|parameter| start.value(parameter));
        if self.problem.free().iter().all(|&k| values[k].is_none()) {
            return Err(ProblemError::StartSaysNothing(name));
        }
        if let Some(before) = &mut self.before {
            before.start = Some(before.own_values(|parameter| start.value(parameter)));
        }
        self.start = Some(values);
        Ok(self)
    }

    /// Names of the parameters that are fitted and that the start model does not state.
    pub fn unstated(&self) -> Vec<&str> {
        let Some(start) = &self.start else { return Vec::new() };
        let unstated = self.problem.free().iter().filter(|&&k| start[k].is_none());
        unstated.map(|&k| self.problem.parameters()[k].name.as_str()).collect()
    }

    /// The coordinates of the model's own parameters at these values, by name; those that are frozen stay.
    fn own_values(&self, value: impl Fn(&str) -> Option<f64>) -> StartValues {
        let of = |k: usize| {
            let parameter = &self.problem.parameters()[k];
            let is_free = self.problem.free().contains(&k);
            is_free.then(|| value(&parameter.name)).flatten().map(|value| parameter.coordinate(value))
        };
        self.problem.own().map(of).collect()
    }

    /// Where a fit of the effects that were added begins if each begins where a diagnosis would begin it, and how many
    /// logs that took; `before` is the residual model without them. `None` where no such effect can be screened, or the
    /// work is cancelled.
    pub(crate) fn screened(&self, before: &dyn ResidualModel) -> Option<(StartValues, usize)> {
        let mut objective = Objective::new(before);
        let all = objective.parameters().to_vec();
        let is_added = |candidate: &EffectCandidate| candidate.parameters().all(|k| self.added.contains(&all[k].name));
        let candidates = objective.candidates().iter();
        let effects: Vec<usize> = candidates.enumerate().filter(|(_, c)| is_added(c)).map(|(index, _)| index).collect();
        if effects.is_empty() {
            return None;
        }
        let mut start = vec![0.0; all.len()];
        let begun = self.before.as_ref().and_then(|before| before.start.as_ref());
        for (k, value) in begun.into_iter().flatten().enumerate() {
            start[k] = value.map_or(0.0, |value| all[k].clamp(value));
        }
        let fit = with_effects(&mut objective, &effects, &start).ok()?;
        let value =
            |name: &str| all.iter().position(|parameter| parameter.name == name).map(|k| all[k].value(fit.u[k]));
        Some((self.own_values(value), objective.rollouts()))
    }
}
