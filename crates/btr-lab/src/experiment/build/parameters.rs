//! The space S of free parameters, and the fitness.

use super::builder::Builder;
use crate::experiment::file::ParameterSection;
use crate::experiment::source::FileError;
use btr_core::space::{Dim, Space, SpaceError};
use btr_core::text::Text;
use btr_physics::effects::PlacedEffect;
use btr_physics::model::parameter::Target;
use btr_physics::model::task::{Fitness, FitnessTerm, TERMS};
use btr_physics::robot::{Base, Robot};
use btr_physics::setup::Setup;

impl Builder<'_> {
    pub(super) fn parameters(
        &self,
        robot: &Robot,
        effects: &[PlacedEffect],
        setup: &Setup,
    ) -> Result<(Vec<Target>, Space), FileError> {
        let (mut targets, mut dims) = (Vec::new(), Vec::new());
        for (name, section) in &self.file.parameters {
            let keys = ["parameters", name.as_str()];
            let target = Target::parse(name, robot).map_err(|e| self.error(&keys, e, None))?;
            target.check_formula(effects).map_err(|e| self.error(&keys, e, None))?;
            let model_value = target.nominal(robot, effects, setup);
            let dim = dim(section, &target, model_value).map_err(|message| self.error(&keys, message, None))?;
            check_sd(section).map_err(|message| self.error(&["parameters", name, "sd"], message, None))?;
            Space::new(vec![dim.clone()]).map_err(|e| self.error(&keys, &e, bounds_help(&e)))?;
            dims.push(dim);
            targets.push(target);
        }
        let space = Space::new(dims).map_err(|e| self.error(&["parameters"], e, None))?;
        Ok((targets, space))
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
