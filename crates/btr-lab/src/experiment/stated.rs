//! Checks of what a file states: each number is finite, and has the sign and the range of what it says; its name can be
//! that of a folder.

use super::file::{File, NoiseSection, RealitySection};
use btr_core::limits::LONGEST_NAME;
use toml::Value;

/// A value that a file may not state, by its keys.
pub(super) struct Misstated {
    pub keys: Vec<String>,
    pub message: String,
    pub help: Option<String>,
}

/// What a number may be.
#[derive(Clone, Copy)]
enum Allowed {
    NotNegative,
    Positive,
    /// From 0 to 1.
    Share,
}

impl Allowed {
    fn holds(self, x: f64) -> bool {
        match self {
            Allowed::NotNegative => x >= 0.0,
            Allowed::Positive => x > 0.0,
            Allowed::Share => (0.0..=1.0).contains(&x),
        }
    }

    fn words(self) -> &'static str {
        match self {
            Allowed::NotNegative => "zero or more",
            Allowed::Positive => "positive",
            Allowed::Share => "between 0 and 1",
        }
    }
}

/// Checks the numbers of a file, and its name.
///
/// # Errors
/// The first invalid one.
pub(super) fn check(file: &File, text: &str) -> Result<(), Misstated> {
    check_finite(text)?;
    check_name(&file.name)?;
    check_noise(&["noise"], &file.noise)?;
    if let Some(RealitySection::Twin(twin)) = &file.reality {
        check_noise(&["reality", "noise"], &twin.noise)?;
        check_all(&["reality"], &[("spread", twin.spread, Allowed::Share)])?;
    }
    let simulation = &file.simulation;
    check_all(&["simulation"], &[("ground_friction", Some(simulation.ground_friction), Allowed::NotNegative)])?;
    let robot =
        [("mass_kg", file.robot.mass_kg, Allowed::Positive), ("length_m", file.robot.length_m, Allowed::Positive)];
    check_all(&["robot"], &robot)?;
    let Some(ball) = &simulation.ball else { return Ok(()) };
    let ball = [
        ("radius_m", Some(ball.radius_m), Allowed::Positive),
        ("mass_kg", Some(ball.mass_kg), Allowed::Positive),
        ("friction", Some(ball.friction), Allowed::NotNegative),
        ("restitution", Some(ball.restitution), Allowed::Share),
        ("rolling_damping_per_s", Some(ball.rolling_damping_per_s), Allowed::NotNegative),
    ];
    check_all(&["simulation", "ball"], &ball)
}

/// Refuses a name that cannot be that of a folder inside another one: a run's folder has the experiment's name.
fn check_name(name: &str) -> Result<(), Misstated> {
    let is_path = name.contains(['/', '\\']) || ["", ".", ".."].contains(&name.trim());
    if !is_path && !name.contains(char::is_control) && name.chars().count() <= LONGEST_NAME {
        return Ok(());
    }
    let message = format!("`{}` cannot be the name of a folder of runs", name.escape_debug());
    let help = format!("give a name of 1 to {LONGEST_NAME} characters, without / and \\");
    Err(Misstated { keys: vec!["name".to_owned()], message, help: Some(help) })
}

fn check_noise(table: &[&str], noise: &NoiseSection) -> Result<(), Misstated> {
    let sensors = [
        ("position_rad", noise.position_rad),
        ("position_quantum_rad", noise.position_quantum_rad),
        ("velocity_rad_s", noise.velocity_rad_s),
        ("torque_n_m", noise.torque_n_m),
        ("gyro_rad_s", noise.gyro_rad_s),
        ("acceleration_m_s2", noise.acceleration_m_s2),
        ("force_n", noise.force_n),
        ("model_rad", noise.model_rad),
        ("model_n_m", noise.model_n_m),
    ];
    check_all(table, &sensors.map(|(key, value)| (key, Some(value), Allowed::NotNegative)))?;
    let channels = noise.channels.iter().map(|(name, value)| (name.as_str(), Some(*value), Allowed::NotNegative));
    check_all(&[table, &["channels"]].concat(), &channels.collect::<Vec<_>>())
}

fn check_all(table: &[&str], numbers: &[(&str, Option<f64>, Allowed)]) -> Result<(), Misstated> {
    for (key, value, allowed) in numbers {
        if let Some(x) = value.filter(|x| !allowed.holds(*x)) {
            let keys = table.iter().chain([key]).map(|key| (*key).to_owned()).collect();
            let message = format!("{key} = {x} must be {}", allowed.words());
            let help = "correct the number, whose unit is in the key's name, or leave the key out for its default";
            return Err(Misstated { keys, message, help: Some(help.to_owned()) });
        }
    }
    Ok(())
}

/// Refuses what is no number, wherever it is, and what is infinite, but for a limit that is none.
///
/// # Errors
/// The first such number.
pub(super) fn check_finite(text: &str) -> Result<(), Misstated> {
    let Ok(table) = toml::from_str(text) else { return Ok(()) };
    let Some((keys, x)) = not_finite(&Value::Table(table), &[]) else { return Ok(()) };
    let message = format!("{} = {x} must be a finite number", keys.join("."));
    let help = "give a number, or leave the key out for its default".to_owned();
    Err(Misstated { keys, message, help: Some(help) })
}

/// The first number that is not finite and may not be so, with its keys.
fn not_finite(value: &Value, keys: &[String]) -> Option<(Vec<String>, f64)> {
    let below = |key: &str| [keys, &[key.to_owned()]].concat();
    match value {
        Value::Float(x) if x.is_finite() || (*x > 0.0 && may_be_infinite(keys)) => None,
        Value::Float(x) => Some((keys.to_vec(), *x)),
        Value::Table(table) => table.iter().find_map(|(key, value)| not_finite(value, &below(key))),
        Value::Array(values) => {
            values.iter().enumerate().find_map(|(k, value)| not_finite(value, &below(&k.to_string())))
        }
        _ => None,
    }
}

/// Whether infinity says that there is no limit: of a motor's torque, or as the off value of an effect.
fn may_be_infinite(keys: &[String]) -> bool {
    keys.last().is_some_and(|key| key == "max_torque") || keys.iter().any(|key| key == "effects")
}
