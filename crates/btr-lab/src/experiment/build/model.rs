//! Robot, actuators, set-up, effects, parameters and fitness of a model.

use super::Builder;
use crate::experiment::file::{ActuatorSection, EffectSection, NoiseSection, ParameterSection};
use crate::experiment::logs::scenarios::rarer;
use crate::experiment::parse::FileError;
use btr_core::log::Log;
use btr_core::space::{Dim, Space, SpaceError};
use btr_physics::effects;
use btr_physics::effects::{Effect, FormulaError, PlacedEffect, SiteKind};
use btr_physics::model::parameter;
use btr_physics::model::parameter::Target;
use btr_physics::model::task::{Fitness, FitnessTerm, TERMS};
use btr_physics::presets::{ant, nao, pendulum};
use btr_physics::robot::site;
use btr_physics::robot::urdf;
use btr_physics::robot::urdf::UrdfError;
use btr_physics::robot::{Actuator, Base, DutyLoop, Joint, Robot, Sampling};
use btr_physics::sensor::SensorNoise;
use btr_physics::setup::{Ball, Ground, Sensors, Setup};
use nalgebra::{Point3, Vector3};
use std::path::Path;

/// The paper's time between two references.
const PAPERS_CONTROL_S: f64 = 0.055;

impl Builder<'_> {
    pub(crate) fn robot(&self) -> Result<Robot, FileError> {
        let section = &self.file.robot;
        let mut robot = match (&section.builtin, &section.urdf) {
            (Some(name), None) => self.builtin(name)?,
            (None, Some(path)) => {
                let base = section.base.unwrap_or(Base::Fixed);
                let path = self.source.folder().join(path);
                urdf::load_urdf(&path, base).map_err(|e| self.no_robot(&path, &e))?.0
            }
            _ => {
                let help = "builtin = \"ant\", \"nao\" or \"pendulum\"; or urdf = \"robot.urdf\"";
                return Err(self.error(&["robot"], "give either builtin or urdf", Some(help.to_owned())));
            }
        };
        if let Some(height) = section.height_m {
            robot.start.translation.z = height;
        }
        self.actuators(&mut robot)?;
        Ok(robot)
    }

    /// A URDF that is not there is the model file's mistake, one that makes no sense its own.
    fn no_robot(&self, path: &Path, error: &UrdfError) -> FileError {
        if let UrdfError::File { .. } = error {
            return self.error(&["robot", "urdf"], error, None);
        }
        let message = error.to_string();
        let line = std::fs::read_to_string(path).ok().and_then(|text| line_of(&text, &message)).unwrap_or(0);
        FileError { path: path.to_owned(), line, column: 0, message, help: None }
    }

    fn builtin(&self, name: &str) -> Result<Robot, FileError> {
        let section = &self.file.robot;
        match name {
            "ant" => Ok(ant::ant()),
            "nao" => Ok(nao::nao()),
            "pendulum" => {
                let (mass_kg, length_m) = (section.mass_kg.unwrap_or(1.0), section.length_m.unwrap_or(1.0));
                Ok(pendulum::pendulum(mass_kg, length_m, Actuator::Passive))
            }
            _ => Err(self.unknown(&["robot", "builtin"], "built-in robot", name, ["ant", "nao", "pendulum"])),
        }
    }

    fn actuators(&self, robot: &mut Robot) -> Result<(), FileError> {
        let names: Vec<String> = robot.movable().map(|(_, link)| link.joint.name.clone()).collect();
        for (pattern, section) in &self.file.actuators {
            if !names.iter().any(|name| site::matches(pattern, name)) {
                return Err(self.unknown(&["actuators", pattern], "joint", pattern, names.iter().map(String::as_str)));
            }
            let actuator = actuator(section);
            if let Some((value, number)) = parameter::motor_values(&actuator).find(|(_, x)| *x < 0.0 || x.is_nan()) {
                let message = format!("{value} = {number} must be zero or more");
                return Err(self.error(&["actuators", pattern, value], message, None));
            }
            let sampling =
                sampling(section).map_err(|(key, message)| self.error(&["actuators", pattern, key], message, None))?;
            // Who follows another joint is driven by it, unless it is called by its name.
            let meant = |joint: &Joint| {
                site::matches(pattern, &joint.name) && (joint.mimic.is_none() || *pattern == joint.name)
            };
            if !robot.movable().any(|(_, link)| meant(&link.joint)) {
                let message = format!("every joint that `{pattern}` matches follows another one, which drives it");
                let help = "call a joint by its whole name to give it an actuator of its own".to_owned();
                return Err(self.error(&["actuators", pattern], message, Some(help)));
            }
            for link in robot.links.iter_mut().skip(1).filter(|link| meant(&link.joint)) {
                (link.joint.actuator, link.joint.sampling) = (actuator.clone(), sampling);
            }
        }
        Ok(())
    }

    pub(super) fn setup(&self, robot: &Robot, recorded: &[Log]) -> Result<Setup, FileError> {
        let s = &self.file.simulation;
        let control_s = s.control_s.or_else(|| tick_of(recorded)).unwrap_or(PAPERS_CONTROL_S);
        let positive = [("control_s", control_s), ("duration_s", s.duration_s)];
        if let Some((key, value)) = positive.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            return Err(self.error(&["simulation", key], format!("{key} = {value} must be positive"), None));
        }
        let counts = [("steps_per_control", s.steps_per_control), ("sample_every", s.sample_every)];
        if let Some((key, _)) = counts.iter().find(|(_, count)| *count == 0) {
            return Err(self.error(&["simulation", key], format!("{key} must be at least 1"), None));
        }
        let dt_s = control_s / f64::from(s.steps_per_control);
        let control_s = as_often(recorded, control_s, dt_s);
        let floating = robot.base == Base::Floating;
        Ok(Setup {
            dt_s,
            substeps: 1,
            duration_s: s.duration_s,
            begins_s: 0.0,
            rest_s: 0.0,
            control_s,
            interpolate: s.interpolate,
            sample_s: Some(dt_s * f64::from(s.sample_every)),
            sensors: Sensors { velocities: true, torques: true, imu: floating, feet: floating },
            ground: floating.then(|| Ground::hard(s.ground_friction)),
            ball: s.ball.as_ref().map(|b| Ball {
                radius_m: b.radius_m,
                mass_kg: b.mass_kg,
                start_m: Point3::new(b.position_m[0], b.position_m[1], b.radius_m),
                friction: b.friction,
                restitution: b.restitution,
                rolling_damping_per_s: b.rolling_damping_per_s,
            }),
            noise: noise(&self.file.noise),
            gravity_m_s2: Vector3::new(0.0, 0.0, s.gravity),
            engine: s.engine,
            start_velocities: Vec::new(),
        })
    }

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
            let message = format!("{} has a law of its own; only a formula takes `{key}`", section.effect);
            return Err(self.error(&[&keys[..], &[key]].concat(), message, None));
        }
        self.placed(effect, section, values, &keys, robot)
    }

    /// A user's own law.
    fn formula(&self, section: &EffectSection, keys: &[&str], robot: &Robot) -> Result<PlacedEffect, FileError> {
        let (Some(on), Some(law)) = (section.on, &section.law) else {
            let help =
                "on = \"torque\" (or \"command\", \"reading\") and law = \"-a*sin(3*q)\" with a = 0.1".to_owned();
            return Err(self.error(keys, "a formula needs `on` and `law`", Some(help)));
        };
        let names: Vec<&str> = section.values.keys().map(String::as_str).collect();
        let effect = effects::formula_or_function(on, law, &names, &self.source.laws).map_err(|e| {
            let key = match &e {
                FormulaError::Unused(name) | FormulaError::Taken(name) => name,
                _ => "law",
            };
            let help = match &e {
                FormulaError::Absent(_) => {
                    "a function lives in the program that made the model: give it along with the file \
                                            (in Python load_model(..., laws={...})), or write the law as an expression"
                }
                _ => "`btr effects formula` tells what a law can say",
            };
            self.error(&[keys, &[key]].concat(), &e, Some(help.to_owned()))
        })?;
        if let Some((name, value)) = section.values.iter().find(|(_, value)| !value.is_finite()) {
            return Err(self.error(&[keys, &[name.as_str()]].concat(), format!("{name} = {value} is no number"), None));
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
            let help = format!("`btr effects {}` tells which values make sense", section.effect);
            self.error(keys, e, Some(help))
        })?;
        Ok(placed)
    }

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
            let own = target.nominal(robot, effects, setup);
            let dim = dim(section, &target, own).map_err(|message| self.error(&keys, message, None))?;
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

    /// Whether this model has the channels that a term needs, which stands at these keys.
    pub(crate) fn check_channels_of(&self, term: &FitnessTerm, robot: &Robot, keys: &[&str]) -> Result<(), FileError> {
        let lacks = |channel: &&&str| match channel.split_once('_') {
            Some(("base", _)) => robot.base == Base::Fixed,
            Some(("ball", _)) => self.file.simulation.ball.is_none(),
            _ => false,
        };
        let Some(channel) = term.needs.iter().find(lacks) else { return Ok(()) };
        let message = format!("`{}` needs the channel {channel}, which this model does not have", term.name);
        let help = "a free base gives base_*, a [simulation.ball] gives ball_*".to_owned();
        Err(self.error(keys, message, Some(help)))
    }
}

fn bounds_help(error: &SpaceError) -> Option<String> {
    match error {
        SpaceError::Outside { .. } => Some("widen the bounds, or give value = a number between them".to_owned()),
        SpaceError::LogBounds { .. } => Some("start above zero, or leave out scale = \"log\"".to_owned()),
        _ => None,
    }
}

fn actuator(section: &ActuatorSection) -> Actuator {
    match *section {
        ActuatorSection::Passive => Actuator::Passive,
        ActuatorSection::Position { kp, ki, kd, max_torque, .. } => Actuator::Position { kp, ki, kd, max_torque },
        ActuatorSection::Torque { max_torque } => Actuator::Torque { max_torque },
        ActuatorSection::Voltage { kt, resistance, gain, max_duty, supply, .. } => {
            Actuator::Voltage { kt, resistance, servo: gain.map(|gain| DutyLoop { gain, max_duty, supply }) }
        }
        ActuatorSection::Prescribed { .. } => Actuator::Prescribed,
    }
}

/// How a servo is clocked; the key that makes no sense, and why, otherwise.
fn sampling(section: &ActuatorSection) -> Result<Option<Sampling>, (&'static str, String)> {
    let (period_s, velocity_over) = match *section {
        ActuatorSection::Position { sample_s: Some(period_s), velocity_over, .. } => (period_s, velocity_over),
        ActuatorSection::Voltage { sample_s: Some(_), gain: None, .. } => {
            return Err(("sample_s", "sample_s needs a position loop; give gain".to_owned()));
        }
        ActuatorSection::Voltage { sample_s: Some(period_s), .. }
        | ActuatorSection::Prescribed { sample_s: Some(period_s) } => (period_s, 1),
        _ => return Ok(None),
    };
    if !(period_s > 0.0 && period_s.is_finite()) {
        return Err(("sample_s", format!("sample_s = {period_s} must be positive")));
    }
    if velocity_over == 0 {
        return Err(("velocity_over", "velocity_over must be at least 1".to_owned()));
    }
    Ok(Some(Sampling { period_s, velocity_over }))
}

/// The time between two samples of the fastest log, freed of jitter.
fn tick_of(recorded: &[Log]) -> Option<f64> {
    const GRAIN: f64 = 1e5;
    let fastest = recorded.iter().filter_map(Log::usual_step_s).min_by(f64::total_cmp)?;
    Some((fastest * GRAIN).round() / GRAIN).filter(|tick| *tick > 0.0)
}

/// How often the model takes a command. Where those of logs change from sample to sample, more often than the file says, what
/// led a joint from one reference to the next is in them already: they are taken as often as they come, at most once a step.
fn as_often(recorded: &[Log], control_s: f64, dt_s: f64) -> f64 {
    match tick_of(recorded) {
        Some(tick_s) if rarer(control_s, tick_s) && recorded.iter().all(changes_with_every_sample) => {
            dt_s * (tick_s / dt_s).round().max(1.0)
        }
        _ => control_s,
    }
}

/// Whether some command changes between most of a log's samples.
fn changes_with_every_sample(log: &Log) -> bool {
    let told: Vec<&[f64]> =
        log.channels().filter(|(name, _)| name.starts_with("cmd_")).map(|(_, channel)| &channel.values[..]).collect();
    let samples = log.clock_s().len();
    let changes = (1..samples).filter(|&k| told.iter().any(|values| (values[k] - values[k - 1]).abs() > 0.0)).count();
    2 * changes > samples
}

/// Where an effect of this kind can sit on a robot, and what such a place is called.
fn sites(kind: SiteKind, robot: &Robot) -> (&'static str, Vec<&str>) {
    match kind {
        SiteKind::Joint => ("joint", robot.movable().map(|(_, link)| link.joint.name.as_str()).collect()),
        SiteKind::Robot => ("place", vec!["*"]),
        SiteKind::Base | SiteKind::Ground => ("place", vec!["base", "*"]),
        SiteKind::Link => ("link", robot.links.iter().map(|link| link.name.as_str()).collect()),
    }
}

/// A dimension of S; `own` is the robot's own value, if its sites share one.
fn dim(section: &ParameterSection, target: &Target, own: Option<f64>) -> Result<Dim, String> {
    let name = target.name();
    let known = own.filter(|x| x.is_finite());
    let [min, max] = match (section.bounds, section.relative, known) {
        (Some(bounds), None, _) => bounds,
        (None, Some(_), Some(0.0)) => return Err(nothing_to_be_relative_to(name)),
        (None, Some([a, b]), Some(own)) => [a * own, b * own],
        (None, Some(_), None) => {
            return Err(format!("parameter `{name}`: the robot has no single value to be relative to; give bounds"));
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
        Some(("mass", link)) => format!("`{link}` has no mass, as a URDF's link without <inertial>"),
        _ => "the model's own value is 0".to_owned(),
    };
    format!("parameter `{name}`: {why}, and nothing is relative to that; give bounds = [min, max]")
}

/// The line of a URDF that a message is about: where the first name that it quotes stands in quotes. The parser tells none.
fn line_of(text: &str, message: &str) -> Option<usize> {
    let quoted = format!("\"{}\"", message.split('`').nth(1)?);
    let before = &text[..text.find(&quoted)?];
    Some(before.matches('\n').count() + 1)
}

pub(super) fn noise(section: &NoiseSection) -> SensorNoise {
    SensorNoise {
        position: section.position_rad,
        velocity: section.velocity_rad_s,
        torque: section.torque_n_m,
        gyro_rad_s: section.gyro_rad_s,
        accelerometer_m_s2: section.acceleration_m_s2,
        foot_n: section.force_n,
        position_quantum: section.position_quantum_rad,
    }
}
