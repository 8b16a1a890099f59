//! Channels whose noise the model seems to state too low.

use super::diagnose_report::StatedLow;
use crate::identification::VerbInput;
use btr_core::signal::noise::NoiseEstimate;
use btr_core::signal::stats;
use btr_identify::diagnose::Diagnosis;

/// Factor within which the remaining error of a channel equals the noise of its readings.
const AS_LARGE: f64 = 1.15;
/// Largest autocorrelation time, in samples, of an error that counts as white.
const NEARLY_WHITE: f64 = 2.0;

/// Channels whose remaining error is white, exceeds the noise that the model states, and equals the noise of the
/// readings.
pub(super) fn stated_low(input: &VerbInput, diagnosis: &Diagnosis) -> Vec<StatedLow> {
    let model = input.problem.model();
    let (mut found, mut start) = (Vec::<StatedLow>::new(), 0);
    for (log, readings) in input.problem.logs().iter().zip(input.problem.recorded()).filter(|(log, _)| !log.held_out) {
        for channel in &log.channels {
            let rows = start + channel.samples.start..start + channel.samples.end;
            let left = diagnosis.fit.residual.get(rows).unwrap_or_default();
            let stated = model.setup.noise.stated(&channel.name);
            let shown =
                readings.channel(&channel.name).and_then(|c| NoiseEstimate::of(&c.values)).map(|noise| noise.sigma());
            let (Some(stated), Some(shown)) = (stated, shown) else { continue };
            // A floor that was raised above the sensor's noise contains errors that the model does not state.
            let is_the_floor = (channel.sigma / stated - 1.0).abs() < 0.01;
            let times = stats::std(left);
            let as_large = times > AS_LARGE && shown > AS_LARGE * stated && times * stated < AS_LARGE * shown;
            if is_the_floor && as_large && stats::autocorrelation_time(left) < NEARLY_WHITE {
                let (name, unit) = (channel.name.clone(), channel.unit.clone());
                match found.iter_mut().find(|known| known.channel == name) {
                    Some(known) => known.shown = known.shown.max(shown),
                    None => found.push(StatedLow { channel: name, unit, stated, shown }),
                }
            }
        }
        start += log.rows();
    }
    found
}
