//! Noise that the model states far below what the logs show.

use btr_core::log::{Log, interpolate};
use btr_core::signal::noise;
use btr_physics::model::Model;

/// How many times less than the readings show is worth a warning.
const FAR_LOWER: f64 = 2.0;

/// A warning if the model states the noise of a joint's position far too low; `logs` and `simulated` are those of the
/// model's scenarios. Without a simulation, fast motion cannot be told from noise.
pub(crate) fn warning(model: &Model, logs: &[Log], simulated: &[Option<Log>]) -> Option<String> {
    let pairs = logs.iter().zip(simulated).filter_map(|(log, simulated)| Some((log, simulated.as_ref()?)));
    let all = pairs.flat_map(|(log, simulated)| of_log(model, log, simulated));
    let far = all.filter(|noise| noise.times() > FAR_LOWER);
    far.max_by(|a, b| a.times().total_cmp(&b.times())).map(|worst| worst.warning())
}

/// The noise of a position.
struct Noise<'a> {
    channel: &'a str,
    unit: &'a str,
    stated: f64,
    shown: f64,
}

impl Noise<'_> {
    /// How many times as much the log shows.
    fn times(&self) -> f64 {
        self.shown / self.stated
    }

    fn warning(&self) -> String {
        let Noise { channel, unit, stated, shown } = self;
        format!(
            "[noise] states {stated:.1e} {unit} for {channel}, but the log shows {shown:.1e} {unit}, {:.1} times as much: \
             errors look that much larger, and verdicts may turn to `unexplained`; set position_rad = {shown:.1e}, or \
             leave it out to have it estimated",
            self.times()
        )
    }
}

/// The noise of the compared positions whose white noise the model states. Fast motion looks like noise, but not beside
/// the model.
fn of_log<'a>(model: &'a Model, log: &'a Log, simulated: &'a Log) -> impl Iterator<Item = Noise<'a>> {
    let compared: Vec<String> = model.robot.movable().map(|(_, link)| link.joint.compared()).collect();
    let is_position = move |name: &str| name.starts_with("q_") && compared.iter().any(|known| known == name);
    log.channels().filter(move |(name, _)| is_position(name)).filter_map(|(name, channel)| {
        let noise = &model.setup.noise;
        let floor = noise.floor(name, &channel.values).filter(|_| noise.states_white(name))?;
        let of_model = interpolate(simulated.clock_s(), simulated.values(name).ok()?, log.clock_s());
        let shown = noise::floor_beside(&channel.values, &of_model)?;
        let stated = noise.unpredictable.beside(name, floor);
        Some(Noise { channel: name, unit: &channel.unit, stated, shown })
    })
}
