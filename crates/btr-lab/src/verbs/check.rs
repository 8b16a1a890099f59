//! `check`: what logs are worth before anything is fitted to them: their quality, and what they tell about the numbers
//! in doubt.

use crate::experiment::{CheckedLog, Replays};
use crate::identification::IdentificationProblem;
use btr_identify::fit::{NullDirection, Objective, Sensitivity, identifiable};
use btr_identify::quality::CommandResponse;
use serde::Serialize;
use serde_json::{Value, json};
use std::sync::Arc;

/// The answer.
#[derive(Clone, Debug)]
pub struct CheckReport {
    /// One per log.
    pub logs: Vec<CheckedLog>,
    /// What is odd about them, though they can be used.
    pub warnings: Vec<String>,
    /// What all of them together tell.
    pub told: IdentifiabilityReport,
}

impl CheckReport {
    /// The answer with the keys of `--json`.
    pub fn document(&self) -> Value {
        let joint = |j: &CommandResponse| {
            let lag = j.lag.map(|lag| json!({ "lag_s": lag.seconds, "sd_s": lag.sd_s, "likeness": lag.correlation }));
            json!({ "joint": j.joint, "command_lag": lag })
        };
        let log = |CheckedLog { log: name, quality }: &CheckedLog| {
            json!({
                "log": name,
                "verdict": quality.worst(),
                "clock": quality.clock,
                "channels": quality.sensors,
                "joints": quality.joints.iter().map(joint).collect::<Vec<_>>(),
                "findings": quality.findings,
            })
        };
        let logs: Vec<Value> = self.logs.iter().map(log).collect();
        let mut document = json!({ "ok": true, "logs": logs, "warnings": self.warnings });
        if let (Some(document), Value::Object(told)) = (document.as_object_mut(), json!(self.told)) {
            document.extend(told);
        }
        document
    }
}

/// What logs tell about the numbers in doubt, with the keys of `--json`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct IdentifiabilityReport {
    /// Each number in doubt.
    pub parameters: Vec<Sensitivity>,
    /// How many independent combinations of them can be told.
    pub rank: usize,
    /// Of the Jacobian, in noise floors per standard deviation of the priors; none where a combination is not told at
    /// all.
    pub condition_number: Option<f64>,
    /// Combinations that cannot be told, each with a sentence.
    pub null_directions: Vec<NullDirection>,
    /// Numbers without any effect.
    pub dead: Vec<String>,
    /// Why nothing of this is known, where it is not.
    pub not_judged: Option<String>,
    /// Simulated logs.
    pub rollouts: usize,
}

/// Looks at the logs, and differentiates the model as it stands by everything in doubt.
pub fn check(replays: Replays) -> CheckReport {
    CheckReport { logs: replays.checked.clone(), warnings: replays.warnings.clone(), told: told(replays) }
}

fn told(replays: Replays) -> IdentifiabilityReport {
    let not_judged =
        |why: &str| IdentifiabilityReport { not_judged: Some(why.to_owned()), ..IdentifiabilityReport::default() };
    // Logs that cannot be compared with the model have a quality all the same.
    let problem = match IdentificationProblem::to_learn(Arc::new(replays.model), replays.logs) {
        Ok(problem) => problem,
        Err(why) => return not_judged(&why.to_string()),
    };
    if problem.free().is_empty() {
        return not_judged("no number of the model is in doubt ([parameters])");
    }
    let objective = Objective::new(&problem);
    let Ok(Some(found)) = identifiable(&objective) else {
        return not_judged("the model blows up on these logs as it stands");
    };
    let dead = found.parameters.iter().filter(|parameter| parameter.dead).map(|parameter| parameter.name.clone());
    IdentifiabilityReport {
        dead: dead.collect(),
        rank: found.rank,
        condition_number: found.condition_number,
        null_directions: found.null_directions,
        parameters: found.parameters,
        not_judged: None,
        rollouts: objective.rollouts(),
    }
}
