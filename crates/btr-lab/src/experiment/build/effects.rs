//! Builds the effects of a model.

use super::builder::Builder;
use crate::experiment::file::EffectSection;
use crate::experiment::source::FileError;
use btr_core::text::{Mention, Text};
use btr_physics::effects;
use btr_physics::effects::{Effect, FormulaError, MissingNeighbour, PlacedEffect, SiteKind};
use btr_physics::robot::Robot;

impl Builder<'_> {
    pub(super) fn effects(
        &self,
        sections: &[EffectSection],
        table: &str,
        robot: &Robot,
    ) -> Result<Vec<PlacedEffect>, FileError> {
        sections.iter().enumerate().map(|(k, section)| self.effect(section, (table, k), robot)).collect()
    }

    fn effect(&self, section: &EffectSection, at: (&str, usize), robot: &Robot) -> Result<PlacedEffect, FileError> {
        let index = at.1.to_string();
        let keys: Vec<&str> = at.0.split('.').chain([index.as_str()]).collect();
        if section.effect == effects::FORMULA.name {
            return self.formula(section, &keys, robot);
        }
        let Some(effect) = effects::find(&section.effect) else {
            let known = effects::EFFECTS.iter().map(|e| e.spec().name).chain([effects::FORMULA.name]);
            return Err(self.unknown(&[&keys[..], &["effect"]].concat(), "effect", &section.effect, known));
        };
        let params = effect.spec().params;
        if let Some(wrong) = section.values.keys().find(|name| params.iter().all(|p| p.name != name.as_str())) {
            let what = format!("parameter of {}", section.effect);
            return Err(self.unknown(
                &[&keys[..], &[wrong.as_str()]].concat(),
                &what,
                wrong,
                params.iter().map(|p| p.name),
            ));
        }
        let values = params.iter().map(|p| section.values.get(p.name).copied().unwrap_or(p.off)).collect();
        let law = [("law", section.law.is_some()), ("on", section.on.is_some())];
        if let Some((key, _)) = law.iter().find(|(_, given)| *given) {
            let message = format!("{} has its own law; only a formula takes `{key}`", section.effect);
            return Err(self.error(&[&keys[..], &[key]].concat(), message, None));
        }
        self.placed(effect, section, values, &keys, robot)
    }

    /// A user-defined law.
    fn formula(&self, section: &EffectSection, keys: &[&str], robot: &Robot) -> Result<PlacedEffect, FileError> {
        let (Some(on), Some(law)) = (section.on, &section.law) else {
            let help = "on = \"torque\" (or \"command\", \"reading\") and law = \"-a*sin(3*q)\" with a = 0.1".into();
            return Err(self.error(keys, "a formula needs `on` and `law`", Some(help)));
        };
        let names: Vec<&str> = section.values.keys().map(String::as_str).collect();
        let effect = effects::formula_or_function(on, law, &names, &self.source.laws).map_err(|e| {
            let key = match &e {
                FormulaError::Unused(name) | FormulaError::Taken(name) => name,
                _ => "law",
            };
            let help = match &e {
                FormulaError::NotInReading(_) => {
                    "the law can act on the joint's command or torque: on = \"command\" or on = \"torque\"".into()
                }
                FormulaError::Absent(_) => {
                    "a function lives in the program that made the model: give it along with the file \
                     (in Python load_model(..., laws={...})), or write the law as an expression"
                        .into()
                }
                _ => Text::from(Mention::Effect("formula".to_owned())) + " documents laws",
            };
            self.error(&[keys, &[key]].concat(), &e, Some(help))
        })?;
        if let Some((name, value)) = section.values.iter().find(|(_, value)| !value.is_finite()) {
            return Err(self.error(
                &[keys, &[name.as_str()]].concat(),
                format!("{name} = {value} is not a number"),
                None,
            ));
        }
        self.placed(effect, section, section.values.values().copied().collect(), keys, robot)
    }

    fn placed(
        &self,
        effect: &'static dyn Effect,
        section: &EffectSection,
        values: Vec<f64>,
        keys: &[&str],
        robot: &Robot,
    ) -> Result<PlacedEffect, FileError> {
        let placed = PlacedEffect { effect, site: section.site.clone(), values };
        if placed.check_site(robot).is_err() {
            let (what, known) = sites(effect.spec().site, robot);
            return Err(self.unknown(&[keys, &["site"]].concat(), what, &placed.site, known));
        }
        placed.check().map_err(|e| {
            let help = Text::from(Mention::Effect(section.effect.clone())) + " lists the valid values";
            self.error(keys, e, Some(help))
        })?;
        placed.check_neighbours(robot).map_err(|missing| {
            let help = neighbour_help(&missing, robot);
            self.error(&[keys, &["law"]].concat(), missing, Some(help.into()))
        })?;
        Ok(placed)
    }
}

/// The joints that have the neighbour that another one lacks, as places for its law.
fn neighbour_help(missing: &MissingNeighbour, robot: &Robot) -> String {
    let (name, side) = (missing.quantity.name(), missing.quantity.side());
    let joints = robot.movable().zip(robot.neighbours()).filter(|(_, neighbours)| neighbours.on(side).is_some());
    let joints: Vec<&str> = joints.map(|((_, link), _)| link.joint.name.as_str()).collect();
    if joints.is_empty() {
        return format!("write the law without `{name}`: no joint of this robot has such a neighbour");
    }
    format!("place it at joints that have one (site = \"{}\") or write it without `{name}`", joints.join(","))
}

/// The name of a kind of site, and the sites of that kind on a robot.
fn sites(kind: SiteKind, robot: &Robot) -> (&'static str, Vec<&str>) {
    match kind {
        SiteKind::Joint => ("joint", robot.movable().map(|(_, link)| link.joint.name.as_str()).collect()),
        SiteKind::Robot => ("place", vec!["*"]),
        SiteKind::Base | SiteKind::Ground => ("place", vec!["base", "*"]),
        SiteKind::Link => ("link", robot.links.iter().map(|link| link.name.as_str()).collect()),
    }
}
