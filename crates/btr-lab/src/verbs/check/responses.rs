//! How the joints follow their commands, over all logs: what one log after the other says again.

use crate::experiment::CheckedLog;
use btr_core::signal::dead_time::DeadTime;
use btr_identify::quality::{CommandResponse, Finding, Severity, Topic};
use btr_physics::model::Model;
use btr_physics::robot::site::matches;
use indexmap::IndexMap;
use serde::Serialize;

/// A lag that exceeds the median of the other joints' by this factor, ...
const LATER: f64 = 3.0;
/// ... and this time in s, is told.
const LATE_S: f64 = 0.03;
/// Fewest other joints whose lags tell what is usual.
const FEWEST: usize = 2;
/// Dead times are alike within this time, in s.
const ALIKE_S: f64 = 0.005;

/// What all logs together say of the dead times, with the keys of `--json`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct DeadTimeReport {
    /// Joints whose dead time no log tells.
    pub not_known: Vec<String>,
    /// Joints with a dead time that the model lacks, and its median over the logs in s.
    pub not_in_model: IndexMap<String, f64>,
    /// What people are told of that.
    pub sentences: Vec<String>,
}

impl DeadTimeReport {
    /// The report on the joints of these logs.
    pub(super) fn of(model: &Model, logs: &[CheckedLog]) -> Self {
        let mut joints: IndexMap<&str, Vec<&CommandResponse>> = IndexMap::new();
        for response in logs.iter().flat_map(|log| &log.quality.joints).filter(|response| response.lag.is_some()) {
            joints.entry(&response.joint).or_default().push(response);
        }
        let mut report = DeadTimeReport::default();
        for (joint, responses) in joints {
            if responses.iter().all(|of| matches!(of.dead_time, Some(DeadTime::TooFew { .. }))) {
                report.not_known.push(joint.to_owned());
            }
            let lacking = responses.iter().filter_map(|of| undelayed(model, of));
            if let Some(median) = median(lacking.collect()) {
                report.not_in_model.insert(joint.to_owned(), median);
            }
        }
        report.sentences = report.told();
        report
    }

    fn told(&self) -> Vec<String> {
        let not_known = (!self.not_known.is_empty()).then(|| {
            format!(
                "the dead time of {} is not known: record at least three steps of the command, of 0.2 rad or more, each from \
                 rest and held until the joint stands, at least 0.5 s",
                self.not_known.join(", ")
            )
        });
        self.lacking().into_iter().chain(not_known).collect()
    }

    fn lacking(&self) -> Vec<String> {
        let times = || self.not_in_model.values().copied();
        let (least, most) = times().fold((f64::INFINITY, 0.0), |(low, high), s| (f64::min(low, s), f64::max(high, s)));
        let ms = |seconds: f64| format!("{:.1}", 1e3 * seconds);
        if self.not_in_model.len() > 1 && most - least < ALIKE_S {
            let joints = self.not_in_model.keys().cloned().collect::<Vec<_>>().join(", ");
            let middle = 0.5 * (least + most);
            return vec![format!(
                "the model has no dead time, and {joints} begin to move {} to {} ms after their commands: its effect is \
                 command_delay with delay = {middle:.4}",
                ms(least),
                ms(most)
            )];
        }
        let lacking = |(joint, seconds): (&String, &f64)| sentence(joint, *seconds);
        self.not_in_model.iter().map(lacking).collect()
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn sentence(joint: &str, seconds: f64) -> String {
    format!("the model has no dead time at {joint}: its effect is command_delay@{joint} with delay = {seconds:.4}")
}

/// The dead time of a joint that the log shows, and the model does not have.
fn undelayed(model: &Model, of: &CommandResponse) -> Option<f64> {
    let delays = |name: &str| ["command_delay", "encoder_delay"].contains(&name);
    let is_delayed =
        model.effects.iter().any(|placed| delays(placed.effect.spec().name) && matches(&placed.site, &of.joint));
    match of.dead_time {
        Some(DeadTime::Known { seconds, ci95_s: [low, _], .. }) if low > 0.0 && of.lag.is_some() && !is_delayed => {
            Some(seconds)
        }
        _ => None,
    }
}

/// Findings about the joints of a log: dead times that the model lacks, and a joint that lags far more than the others.
pub(super) fn findings(model: &Model, joints: &[CommandResponse]) -> Vec<Finding> {
    let lacking = joints.iter().filter_map(|of| {
        let sentence = sentence(&of.joint, undelayed(model, of)?);
        Some(Finding::new(Topic::DeadTime, Severity::Fine, &of.joint, sentence))
    });
    lacking.chain(joints.iter().filter_map(|of| later(of, joints))).collect()
}

/// A joint that lags far more than the others.
fn later(of: &CommandResponse, joints: &[CommandResponse]) -> Option<Finding> {
    let lag_s = |of: &CommandResponse| of.lag.filter(|lag| lag.correlation >= 0.5).map(|lag| lag.seconds);
    let own = lag_s(of)?;
    let others: Vec<f64> = joints.iter().filter(|other| other.joint != of.joint).filter_map(lag_s).collect();
    let count = others.len();
    let usual = median(others).filter(|usual| count >= FEWEST && own > LATER * usual && own > LATE_S)?;
    let sentence = format!(
        "{} follows its command after {:.0} ms, the other joints after {:.0} ms: a soft gain, friction or a delay of its own?",
        of.joint,
        1e3 * own,
        1e3 * usual
    );
    Some(Finding::new(Topic::CommandLag, Severity::Doubtful, &of.joint, sentence))
}

#[cfg(test)]
mod tests {
    use super::*;
    use btr_core::signal::lag::Lag;

    fn responses(lags_ms: [f64; 4]) -> Vec<CommandResponse> {
        let lag = |ms: f64| Lag { seconds: 1e-3 * ms, correlation: 0.9, sd_s: 0.001 };
        let response = |(k, ms): (usize, f64)| CommandResponse {
            joint: format!("j{k}"),
            lag: Some(lag(ms)),
            dead_time: Some(DeadTime::TooFew { onsets: 0 }),
        };
        lags_ms.into_iter().enumerate().map(response).collect()
    }

    #[test]
    fn a_joint_that_lags_far_more_than_the_others_is_doubted() {
        let doubted = |lags_ms: [f64; 4]| {
            let joints = responses(lags_ms);
            joints.iter().filter_map(|of| later(of, &joints)).map(|found| found.channel).collect::<Vec<_>>()
        };
        assert_eq!(doubted([20.0, 25.0, 90.0, 18.0]), ["j2"]);
        assert!(doubted([20.0, 25.0, 55.0, 18.0]).is_empty() && doubted([2.0, 2.0, 25.0, 2.0]).is_empty());
    }

    #[test]
    fn dead_times_that_are_alike_are_told_together() {
        let report = |times: [f64; 2]| DeadTimeReport {
            sentences: Vec::new(),
            not_known: vec!["hip".to_owned()],
            not_in_model: [("a".to_owned(), times[0]), ("b".to_owned(), times[1])].into_iter().collect(),
        };
        let told = report([0.040, 0.042]).told();
        assert!(told.len() == 2 && told[0].contains("a, b begin to move 40.0 to 42.0 ms"), "{told:?}");
        assert_eq!(report([0.040, 0.060]).told().len(), 3);
    }
}
