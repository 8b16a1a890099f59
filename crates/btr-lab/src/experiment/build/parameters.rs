//! The space S of free parameters, and the fitness.

use super::builder::Builder;
use crate::experiment::file::ParameterSection;
use crate::experiment::source::FileError;
use btr_core::space::{Dim, Space, SpaceError};
use btr_core::text::Text;
use btr_physics::effects::PlacedEffect;
use btr_physics::model::parameter::{ParameterError, Target};
use btr_physics::model::task::{Fitness, FitnessTerm, TERMS};
use btr_physics::robot::{Base, Robot};
use btr_physics::setup::Setup;

/// The free parameters of a model, in their order.
#[derive(Default)]
pub(super) struct FreeParameters {
    pub(super) targets: Vec<Target>,
    pub(super) dims: Vec<Dim>,
    pub(super) prior_sds: Vec<Option<f64>>,
}

impl Builder<'_> {
    pub(super) fn parameters(
        &self,
        robot: &Robot,
        effects: &[PlacedEffect],
        setup: &Setup,
    ) -> Result<(FreeParameters, Space), FileError> {
        let mut free = FreeParameters::default();
        for (name, section) in &self.file.parameters {
            let keys = ["parameters", name.as_str()];
            check_sd(section).map_err(|message| self.error(&["parameters", name, "sd"], message, None))?;
            for target in self.targets(name, section, robot, effects, setup)? {
                let model_value = target.nominal(robot, effects, setup);
                let dim = dim(section, &target, model_value).map_err(|message| self.error(&keys, message, None))?;
                Space::new(vec![dim.clone()]).map_err(|e| self.error(&keys, &e, bounds_help(&e)))?;
                free.dims.push(dim);
                free.targets.push(target);
                free.prior_sds.push(section.sd);
            }
        }
        let space = Space::new(free.dims.clone()).map_err(|e| self.error(&["parameters"], e, None))?;
        Ok((free, space))
    }

    /// What an entry stands for: one target, or one for each site that its pattern matches and that has no entry of its
    /// own.
    fn targets(
        &self,
        name: &str,
        section: &ParameterSection,
        robot: &Robot,
        effects: &[PlacedEffect],
        setup: &Setup,
    ) -> Result<Vec<Target>, FileError> {
        let invalid = |e: ParameterError| self.error(&["parameters", name], e, None);
        let each = Target::each(name, robot).map_err(invalid)?;
        if section.shared || each.iter().any(|target| is_value_of_one_effect(target, name, section, effects)) {
            let one = Target::parse(name, robot).map_err(invalid)?;
            one.check_formula(effects).map_err(invalid)?;
            return Ok(vec![one]);
        }
        let is_left = |target: &Target| target.name() == name || !self.file.parameters.contains_key(target.name());
        let left: Vec<Target> = each.into_iter().filter(is_left).collect();
        let is_bounded = |target: &&Target| {
            let reference = target.nominal(robot, effects, setup);
            section.relative.is_none() || reference.is_some_and(|value| value.is_finite() && value != 0.0)
        };
        let bounded: Vec<Target> = left.iter().filter(is_bounded).cloned().collect();
        // Where nothing has a reference, the message is about the first one.
        Ok(if bounded.is_empty() { left } else { bounded })
    }

    pub(super) fn fitness(&self, robot: &Robot) -> Result<Fitness, FileError> {
        let fitness = Fitness::new(&self.file.fitness)
            .map_err(|e| self.unknown(&["fitness", &e.name], "fitness term", &e.name, TERMS.iter().map(|t| t.name)))?;
        for term in TERMS.iter().filter(|t| self.file.fitness.contains_key(t.name)) {
            self.check_channels_of(term, robot, &["fitness", term.name])?;
        }
        Ok(fitness)
    }

    /// Checks that the model has the channels that the term at these keys needs.
    pub(crate) fn check_channels_of(&self, term: &FitnessTerm, robot: &Robot, keys: &[&str]) -> Result<(), FileError> {
        let lacks = |channel: &&&str| match channel.split_once('_') {
            Some(("base", _)) => robot.base == Base::Fixed,
            Some(("ball", _)) => self.file.simulation.ball.is_none(),
            _ => false,
        };
        let Some(channel) = term.needs.iter().find(lacks) else { return Ok(()) };
        let message = format!("`{}` needs the channel {channel}, which this model does not have", term.name);
        let help = "a free base gives base_*, a [simulation.ball] gives ball_*".into();
        Err(self.error(keys, message, Some(help)))
    }
}

fn bounds_help(error: &SpaceError) -> Option<Text> {
    match error {
        SpaceError::Outside { .. } => Some("widen the bounds, or give value = a number between them".into()),
        SpaceError::LogBounds { .. } => Some("start above zero, or leave out scale = \"log\"".into()),
        _ => None,
    }
}

/// Whether all that a name stands for is one value of an effect: it is placed there as a whole, or will be.
fn is_value_of_one_effect(target: &Target, name: &str, section: &ParameterSection, placed: &[PlacedEffect]) -> bool {
    let Some((effect, _)) = target.of_effect() else { return target.is_of_formula() };
    let site = name.split_once('@').map_or("*", |(_, site)| site);
    let is_placed = placed.iter().any(|p| p.effect.spec().name == effect.spec().name && p.site == site);
    section.relative.is_none() || is_placed
}

/// Rejects a standard deviation that is none, or that belongs to no value.
fn check_sd(section: &ParameterSection) -> Result<(), String> {
    match section.sd {
        Some(sd) if !(sd > 0.0 && sd.is_finite()) => Err(format!("sd = {sd} must be a positive number")),
        Some(_) if section.value.is_none() => Err("sd belongs to a value: give value = ... beside it".to_owned()),
        _ => Ok(()),
    }
}

/// A dimension of S; `model_value` is the model's value, if all sites share one.
fn dim(section: &ParameterSection, target: &Target, model_value: Option<f64>) -> Result<Dim, String> {
    let name = target.name();
    let known = model_value.filter(|x| x.is_finite());
    let [min, max] = match (section.bounds, section.relative, known) {
        (Some(bounds), None, _) => bounds,
        (None, Some(_), Some(0.0)) => return Err(nothing_to_be_relative_to(name)),
        (None, Some([a, b]), Some(model_value)) => [a * model_value, b * model_value],
        (None, Some(_), None) => {
            return Err(format!(
                "parameter `{name}`: the model has no single finite value, so relative bounds have no reference; give bounds"
            ));
        }
        _ => return Err(format!("parameter `{name}`: give either bounds = [min, max] or relative = [factor, factor]")),
    };
    let dim = Dim::new(name, target.unit(), min, max).scale(section.scale.into());
    Ok(match section.value.or(known) {
        Some(value) => dim.nominal(value),
        None => dim,
    })
}

fn nothing_to_be_relative_to(name: &str) -> String {
    let why = match name.split_once('@') {
        Some(("mass", link)) => format!("`{link}` has no mass (its URDF link has no <inertial>)"),
        _ => "the model's own value is 0".to_owned(),
    };
    format!("parameter `{name}`: {why}, so relative bounds are empty; give bounds = [min, max]")
}
