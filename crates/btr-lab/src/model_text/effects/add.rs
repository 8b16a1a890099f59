//! `add`: writes effects, and values of the model, into its file as free parameters.

use crate::experiment::Source;
use crate::model_text::patterns::stands_for;
use crate::scales::RobotScales;
use crate::suggest::suggestion;
use btr_core::text::{Text, Verb};
use btr_physics::effects;
use btr_physics::effects::{EFFECTS, Effect, Param, PlacedEffect, SiteKind};
use btr_physics::model::parameter::{ParameterError, Target};
use btr_physics::robot::Robot;
use toml_edit::{DocumentMut, InlineTable, Item, Table, Value, value};

/// What to add.
#[derive(Clone, Debug)]
pub struct Addition(Kind);

#[derive(Clone, Debug)]
enum Kind {
    /// An effect at a site.
    Effect(&'static dyn Effect, String),
    /// An effect at each of these sites that the model does not have it at.
    Separately(&'static dyn Effect, Vec<String>),
    /// A value that the model states, with its bounds.
    Value(Target, ValueBounds),
}

/// By how much bounds of a value are widened.
const WIDER: f64 = 0.05;

/// Bounds of a value: two values, or two factors on the model's.
#[derive(Clone, Copy, Debug)]
enum ValueBounds {
    Absolute([f64; 2]),
    Relative([f64; 2]),
}

impl ValueBounds {
    /// Wide bounds for a quantity by its name.
    fn usual(name: &str) -> Self {
        match name.split('@').next().unwrap_or(name) {
            "length" => ValueBounds::Relative([0.7, 1.5]),
            "origin_x" | "origin_y" | "origin_z" => ValueBounds::Absolute([-0.1, 0.1]),
            "tilt_x" | "tilt_y" | "tilt_z" => ValueBounds::Absolute([-0.5, 0.5]),
            "direction" => ValueBounds::Absolute([-1.0, 1.0]),
            _ => ValueBounds::Relative([0.125, 8.0]),
        }
    }
}

/// Why an effect or a law cannot be added.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AddError {
    /// No effect of that name.
    #[error("there is no effect `{name}`")]
    Unknown {
        /// The requested name.
        name: String,
        /// Similar names, as a question.
        near: Option<String>,
    },
    /// The effect cannot act on that site.
    #[error("`{effect}` cannot act on `{site}`")]
    Site {
        /// The effect.
        effect: String,
        /// The requested name.
        site: String,
        /// The possible sites.
        known: Vec<String>,
    },
    /// A value that the robot does not have.
    #[error(transparent)]
    Value(#[from] ParameterError),
    /// The model already has the effect.
    #[error("the model has `{name}` already")]
    Twice {
        /// `effect@site`.
        name: String,
    },
    /// A name that a law's parameter cannot have.
    #[error("a law's parameter cannot be called `{name}`: {why}")]
    Name {
        /// The parameter.
        name: String,
        /// The reason.
        why: String,
    },
    /// The file is not valid TOML; it was parsed before, so this does not happen.
    #[error(transparent)]
    Toml(#[from] toml_edit::TomlError),
}

impl AddError {
    /// The remedy.
    pub fn help(&self) -> Option<Text> {
        Some(match self {
            AddError::Unknown { near: Some(near), .. } => near.as_str().into(),
            AddError::Unknown { near: None, .. } => Text::from(Verb::Effects) + " lists them",
            AddError::Site { known, .. } if known.is_empty() => {
                "it is for joints with kind = \"prescribed\"; couplings, for those with a neighbour".into()
            }
            AddError::Site { known, .. } => format!("it can act on: {}", known.join(", ")).into(),
            AddError::Twice { .. } => Text::from("fit it as it is: ") + Verb::Fit,
            AddError::Name { .. } => "call it something else".into(),
            AddError::Value(_) | AddError::Toml(_) => return None,
        })
    }
}

impl Addition {
    /// Parses `EFFECT[@SITE]`, or the name of a parameter such as `mass@LINK` or `armature.inertia@JOINT`: a value that
    /// the model states. An effect of joints or links without a site is added at each possible one that lacks it, with
    /// values of its own; a pattern (`@*`) shares one value.
    ///
    /// # Errors
    /// An unknown effect or site; a value that the site does not have.
    pub fn parse(text: &str, robot: &Robot) -> Result<Self, AddError> {
        let (name, site) = text.split_once('@').unwrap_or((text, "*"));
        let separate = |effect| Some(Addition(Kind::Separately(effect, separate_sites(effect, robot)?)));
        if let Some(separately) = effects::find(text).and_then(separate) {
            return Ok(separately);
        }
        if effects::find(name).is_none() {
            match Target::parse(text, robot) {
                Ok(target) => return Ok(Addition(Kind::Value(target, ValueBounds::usual(text)))),
                // It is no parameter's name either: the message below speaks of effects.
                Err(ParameterError::Unknown { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
        let effect = effects::find(name).ok_or_else(|| AddError::Unknown {
            name: name.to_owned(),
            near: suggestion(name, EFFECTS.iter().map(|e| e.spec().name)),
        })?;
        let placed = PlacedEffect::off(effect, site);
        if placed.check_site(robot).is_err() {
            let joints = robot.movable().filter(|(link, _)| effect.acts_on(robot, *link));
            let known = match effect.spec().site {
                SiteKind::Joint => joints.map(|(_, link)| link.joint.name.clone()).collect(),
                SiteKind::Link => robot.links.iter().map(|link| link.name.clone()).collect(),
                SiteKind::Base => vec!["base".to_owned()],
                SiteKind::Ground | SiteKind::Robot => vec!["*".to_owned()],
            };
            return Err(AddError::Site { effect: name.to_owned(), site: site.to_owned(), known });
        }
        Ok(Addition(Kind::Effect(effect, site.to_owned())))
    }

    /// A value of the model between these bounds, which are widened by a little: rounded, they contain the value even
    /// where it stands at one of them. Signs are kept.
    ///
    /// # Errors
    /// A name that is no parameter of the robot.
    pub(crate) fn value(name: &str, [least, most]: [f64; 2], robot: &Robot) -> Result<Self, AddError> {
        let bounds = [least - WIDER * least.abs(), most + WIDER * most.abs()];
        Ok(Addition(Kind::Value(Target::parse(name, robot)?, ValueBounds::Absolute(bounds))))
    }
}

/// The sites of an effect that acts on joints or links.
fn separate_sites(effect: &'static dyn Effect, robot: &Robot) -> Option<Vec<String>> {
    let named: Vec<&String> = match effect.spec().site {
        SiteKind::Joint => robot.movable().map(|(_, link)| &link.joint.name).collect(),
        SiteKind::Link => robot.links.iter().map(|link| &link.name).collect(),
        SiteKind::Base | SiteKind::Ground | SiteKind::Robot => return None,
    };
    let possible = |site: &&&String| PlacedEffect::off(effect, site.as_str()).check_site(robot).is_ok();
    Some(named.iter().filter(possible).map(|site| (*site).clone()).collect())
}

/// The model's text with the effects added: each parameter is free, at its off value if it has one. Bounds are scaled
/// to the robot by its weight.
///
/// # Errors
/// An effect that the model already has.
pub fn add(source: &Source, robot: &Robot, additions: &[Addition]) -> Result<String, AddError> {
    add_scaled(source, &RobotScales::guess(robot), additions)
}

/// The same with bounds for the given scales.
pub(crate) fn add_scaled(source: &Source, scales: &RobotScales, additions: &[Addition]) -> Result<String, AddError> {
    let mut document = source.text.parse::<DocumentMut>()?;
    for Addition(kind) in additions {
        match kind {
            Kind::Effect(effect, site) => write_effect(&mut document, scales, *effect, site)?,
            Kind::Separately(effect, sites) => write_separately(&mut document, scales, *effect, sites)?,
            Kind::Value(target, bounds) => write_value(&mut document, target, *bounds)?,
        }
    }
    Ok(document.to_string())
}

fn write_value(document: &mut DocumentMut, target: &Target, bounds: ValueBounds) -> Result<(), AddError> {
    let parameters = document.entry("parameters").or_insert_with(|| Item::Table(Table::new()));
    let Some(parameters) = parameters.as_table_like_mut() else { return Ok(()) };
    if parameters.iter().any(|(key, entry)| key == target.name() || stands_for(key, entry, target.name())) {
        return Err(AddError::Twice { name: target.name().to_owned() });
    }
    let mut entry = InlineTable::new();
    let (key, bounds) = match bounds {
        ValueBounds::Absolute(bounds) => ("bounds", bounds.map(rounded)),
        ValueBounds::Relative(factors) => ("relative", factors),
    };
    entry.insert(key, Value::Array(bounds.into_iter().collect()));
    parameters.insert(target.name(), value(entry));
    if let Some(mut key) = parameters.key_mut(target.name()) {
        key.leaf_decor_mut().set_prefix(format!("\n# In {}; without a value here, the model's own.\n", target.unit()));
    }
    Ok(())
}

/// Adds an effect at all sites that lack it; one of them must.
fn write_separately(
    document: &mut DocumentMut,
    scales: &RobotScales,
    effect: &'static dyn Effect,
    sites: &[String],
) -> Result<(), AddError> {
    let written: Vec<Result<(), AddError>> =
        sites.iter().map(|site| write_effect(document, scales, effect, site)).collect();
    let is_new = written.iter().any(Result::is_ok);
    written.into_iter().find(|result| !matches!(result, Err(AddError::Twice { .. }) if is_new)).unwrap_or(Ok(()))
}

fn write_effect(
    document: &mut DocumentMut,
    scales: &RobotScales,
    effect: &'static dyn Effect,
    site: &str,
) -> Result<(), AddError> {
    let spec = effect.spec();
    let parameters = document.entry("parameters").or_insert_with(|| Item::Table(Table::new()));
    let Some(parameters) = parameters.as_table_like_mut() else { return Ok(()) };
    for (k, param) in spec.params.iter().enumerate() {
        let name = format!("{}.{}@{site}", spec.name, param.name);
        if parameters.contains_key(&name) {
            return Err(AddError::Twice { name: format!("{}@{site}", spec.name) });
        }
        let scale = (scales.of_unit(param.unit, site), scales.of_bounds(param.unit, site));
        parameters.insert(&name, value(entry(param, scale)));
        if let Some(mut key) = parameters.key_mut(&name) {
            let comment = if k == 0 {
                format!("\n# {}: {}. Source: {}.\n# In {}", spec.name, spec.law, spec.cite, param.unit)
            } else {
                format!("# In {}", param.unit)
            };
            key.leaf_decor_mut().set_prefix(format!("{comment}; off at {}.\n", off(param)));
        }
    }
    Ok(())
}

fn off(param: &Param) -> String {
    match param {
        p if p.shape => "no value: it only shapes the effect".to_owned(),
        p if p.off.is_nan() => "the model's own value".to_owned(),
        p if p.off.is_infinite() => "infinity".to_owned(),
        p => p.off.to_string(),
    }
}

/// Rounds a bound to two digits.
pub(in crate::model_text) fn rounded(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

/// Bounds and initial value of a parameter: its off value if that is finite, else its typical value.
fn entry(param: &Param, (scale, of_bounds): (f64, f64)) -> InlineTable {
    let start = if param.off.is_finite() { param.off } else { param.hint * scale };
    let mut table = InlineTable::new();
    let bounds =
        [of_bounds.min(1.0) * param.bounds.0.min(start), of_bounds.max(1.0) * param.bounds.1.max(start)].map(rounded);
    table.insert("bounds", Value::Array(bounds.into_iter().collect()));
    table.insert("value", start.into());
    table
}
