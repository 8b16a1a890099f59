//! `check`: the quality of logs, and the identifiability of the free parameters from them, before any fit.

mod responses;

pub use responses::DeadTimeReport;

use crate::experiment::{CheckedLog, LeftOutLog, Replays};
use crate::identification::IdentificationProblem;
use crate::log_quality::in_common::{CommonFinding, in_common};
use crate::log_quality::repeats::RepeatReport;
use btr_core::signal::dead_time::DeadTime;
use btr_identify::fit::{NullDirection, Objective, Sensitivity, identifiable};
use btr_identify::quality::{CommandResponse, Finding};
use indexmap::IndexSet;
use serde::Serialize;
use serde_json::{Value, json};
use std::sync::Arc;

/// The result of `check`.
#[derive(Clone, Debug)]
pub struct CheckReport {
    /// The quality of each log.
    pub logs: Vec<CheckedLog>,
    /// Findings that several joints have in common.
    pub in_common: Vec<CommonFinding>,
    /// What all logs together say of the dead times.
    pub dead_times: DeadTimeReport,
    /// Warnings about usable logs.
    pub warnings: Vec<String>,
    /// How far runs of the same command differ.
    pub repeatability: RepeatReport,
    /// Logs that could not be used.
    pub left_out: Vec<LeftOutLog>,
    /// Identifiability of the free parameters from all logs together.
    pub identifiability: IdentifiabilityReport,
}

impl CheckReport {
    /// The result with the keys of `--json`.
    pub fn document(&self) -> Value {
        let joint = |j: &CommandResponse| {
            let lag = j.lag.map(|lag| json!({ "lag_s": lag.seconds, "sd_s": lag.sd_s, "likeness": lag.correlation }));
            let (dead_time, ci95, onsets) = match j.dead_time {
                Some(DeadTime::Known { seconds, ci95_s, onsets }) => (Some(seconds), Some(ci95_s), onsets),
                Some(DeadTime::Scattered { onsets, .. } | DeadTime::TooFew { onsets }) => (None, None, onsets),
                None => (None, None, 0),
            };
            json!({
                "joint": j.joint,
                "command_lag": lag,
                "dead_time_s": dead_time,
                "dead_time_ci95_s": ci95,
                "dead_time_onsets": onsets,
            })
        };
        let log = |CheckedLog { log: name, quality }: &CheckedLog| {
            json!({
                "log": name,
                "verdict": quality.worst(),
                "clock": quality.clock,
                "channels": quality.sensors,
                "glitches": quality.glitches,
                "joints": quality.joints.iter().map(joint).collect::<Vec<_>>(),
                "findings": quality.findings,
            })
        };
        let logs: Vec<Value> = self.logs.iter().map(log).collect();
        let mut document = json!({
            "ok": true,
            "logs": logs,
            "in_common": self.in_common,
            "dead_times": self.dead_times,
            "warnings": self.warnings,
            "repeatability": self.repeatability,
        });
        if let (Some(document), Value::Object(fields)) = (document.as_object_mut(), json!(self.identifiability)) {
            document.extend(fields);
        }
        if !self.left_out.is_empty() {
            document["left_out"] = json!(self.left_out);
        }
        document
    }
}

/// Identifiability of the free parameters, with the keys of `--json`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct IdentifiabilityReport {
    /// Sensitivity to each free parameter.
    pub parameters: Vec<Sensitivity>,
    /// Number of independent identifiable combinations.
    pub rank: usize,
    /// Condition number of the Jacobian in noise floors per standard deviation of the priors; `None` if a combination
    /// has no effect at all.
    pub condition_number: Option<f64>,
    /// Combinations that are not identifiable, each with a sentence.
    pub null_directions: Vec<NullDirection>,
    /// Parameters without any effect.
    pub dead: Vec<String>,
    /// Why identifiability is unknown, if it is.
    pub not_judged: Option<String>,
    /// Number of simulated logs.
    pub rollouts: usize,
}

/// Checks the logs, and differentiates the model at its current values by all free parameters.
pub fn check(replays: Replays) -> CheckReport {
    let mut logs = replays.checked.clone();
    for CheckedLog { quality, .. } in &mut logs {
        quality.add(responses::findings(&replays.model, &quality.joints));
    }
    let measured: IndexSet<&String> = logs.iter().flat_map(|log| &log.quality.joints).map(|of| &of.joint).collect();
    let findings: Vec<&Finding> = logs.iter().flat_map(|log| &log.quality.findings).collect();
    let in_common = in_common(&findings, measured.len());
    CheckReport {
        dead_times: DeadTimeReport::of(&replays.model, &logs),
        in_common,
        logs,
        warnings: replays.warnings.clone(),
        repeatability: replays.repeats.report(&replays.model, &replays.logs),
        left_out: replays.left_out.clone(),
        identifiability: identifiability(replays),
    }
}

fn identifiability(replays: Replays) -> IdentifiabilityReport {
    let not_judged =
        |why: &str| IdentifiabilityReport { not_judged: Some(why.to_owned()), ..IdentifiabilityReport::default() };
    // Logs that cannot be compared with the model still have a quality.
    let problem = match IdentificationProblem::to_learn(Arc::new(replays.model), replays.logs) {
        Ok(problem) => problem,
        Err(why) => return not_judged(&why.to_string()),
    };
    if problem.free().is_empty() {
        return not_judged("the model has no free parameters ([parameters])");
    }
    let objective = Objective::new(&problem);
    let Ok(Some(found)) = identifiable(&objective) else {
        return not_judged("the model diverges on these logs at its current values");
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
