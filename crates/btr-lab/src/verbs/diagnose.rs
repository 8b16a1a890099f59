//! `diagnose`: which physical effect is missing.

use super::adds_to::adds_to;
use super::diagnose_report::{DiagnoseReport, LawReport, grouped, wrong_values};
use super::stated_low::stated_low;
use crate::experiment::Source;
use crate::identification::VerbInput;
use crate::model_text::{AddError, Addition, FittedValue, adapted, add_scaled, in_finer_steps};
use crate::output::written_by_btr;
use btr_core::world::WorldError;
use btr_identify::LadderStep;
use btr_identify::diagnose::{DiagnoseOptions, Diagnosis, MissingEffect, Verdict};
use btr_identify::fit::{FitPoint, Objective, StopSignal};
use btr_identify::residual_model::{CandidateKind, ResidualModel, TimeStep};
use btr_physics::robot::Base;
use std::path::Path;
use std::time::Instant;

/// The model at the end of a diagnosis.
pub struct Diagnosed {
    /// The values of all parameters.
    pub fit: FitPoint,
    /// The effects and the values that were added to it.
    found: Vec<MissingEffect>,
    /// The time step of the diagnosis.
    pub step: TimeStep,
    /// Whether what remains is noise.
    is_explained: bool,
}

/// Usual number of simulated logs per joint and per effect that may be named, and fewest joints that count. Of 103
/// generated robots with 2 to 7 joints, diagnosed without a limit, no right answer took more than five sixths of this.
const USUAL_ROLLOUTS: usize = 850;
const FEWEST_JOINTS: usize = 4;
/// That number is for at most so many training logs: every point of a search simulates all of them.
const USUAL_LOGS: usize = 4;
/// Usual number of effects that a diagnosis may name; and for each joint of a prescribed motion, which is a question of
/// its own: two frictions, a rotor, and one more.
const USUAL_EFFECTS: usize = 3;
const USUAL_EFFECTS_OF_JOINT: usize = 4;

impl VerbInput {
    /// The options of a diagnosis that names at most so many effects; usually three, or four per joint where the motion
    /// is prescribed. Without a number of rollouts, the usual one, or twice as many while
    /// what is found halves the error: most points of a prescribed motion take none. A
    /// floating robot, whose contacts take many tries, has no limit.
    pub fn options(&self, max_effects: Option<usize>, max_rollouts: Option<usize>) -> DiagnoseOptions {
        let robot = &self.problem.model().robot;
        let of_joints = robot.is_prescribed().then(|| USUAL_EFFECTS_OF_JOINT * robot.movable().count());
        let max_effects = max_effects.unwrap_or(of_joints.unwrap_or(USUAL_EFFECTS));
        let joints = robot.movable().count().max(FEWEST_JOINTS);
        let usual = if robot.base == Base::Fixed {
            let effects = if robot.is_prescribed() { max_effects.min(USUAL_EFFECTS) } else { max_effects };
            let logs = self.recordings.learn.len().max(USUAL_LOGS);
            USUAL_ROLLOUTS.saturating_mul(joints * effects.max(1)).saturating_mul(logs) / USUAL_LOGS
        } else {
            usize::MAX
        };
        let (most, while_falling) = match max_rollouts {
            Some(most) => (most, most),
            None => (usual, usual.saturating_mul(2)),
        };
        DiagnoseOptions { max_effects, max_rollouts: most, max_rollouts_while_falling: while_falling }
    }

    /// The text of the diagnosed model for a file in the folder `into`: the effects that were found are in it as free
    /// parameters, and all parameters have their fitted values. The time step is that of the diagnosis. Standard
    /// deviations stay those of earlier logs, as these logs are fitted next; where something is unexplained, there are
    /// none.
    ///
    /// # Errors
    /// An effect that the model's text has already, which a diagnosis does not name.
    pub fn diagnosed_text(&self, diagnosed: &Diagnosed, into: &Path) -> Result<String, AddError> {
        let Diagnosed { fit, found, step, is_explained } = diagnosed;
        let (problem, parameters) = (&self.problem, self.problem.parameters());
        let additions: Result<Vec<Vec<Addition>>, AddError> = found.iter().map(|one| self.addition(one)).collect();
        let text = add_scaled(&self.source, self.problem.scales(), &additions?.concat())?;
        let source = Source { text, ..self.source.clone() };
        let added = found.iter().flat_map(|found| problem.candidates()[found.candidate].parameters());
        let added = added.map(|k| (parameters[k].name.as_str(), parameters[k].value(fit.u[k])));
        let sd = |name: &str| self.earlier_sd(name).filter(|_| *is_explained);
        let free = self.values(fit).map(|(name, value)| FittedValue { name, value, sd: sd(name) });
        let text = adapted(&source, problem.model(), free.chain(added.map(FittedValue::from)), into)?;
        let text = written_by_btr(&text);
        let setup = &problem.model().setup;
        Ok(if *step == TimeStep::USUAL { text } else { in_finer_steps(&text, setup, step.divides_by())? })
    }

    /// What adds a finding to the model's text.
    fn addition(&self, found: &MissingEffect) -> Result<Vec<Addition>, AddError> {
        let robot = &self.problem.model().robot;
        let value = |k: usize| {
            let parameter = &self.problem.parameters()[k];
            let [a, b] = [parameter.bounds.0, parameter.bounds.1].map(|u| parameter.value(u));
            Addition::value(&parameter.name, [a.min(b), a.max(b)], robot)
        };
        match found.kind {
            CandidateKind::Effect => Ok(vec![Addition::parse(&format!("{}@{}", found.effect, found.site), robot)?]),
            CandidateKind::Value => self.problem.candidates()[found.candidate].parameters().map(value).collect(),
        }
    }
}

/// Diagnoses the missing effects; `on_step` is called with every step of the error ladder. `residual_model` is the
/// input's problem, evaluated locally or by workers. Once `stop_signal` says so, the search ends with the best so far.
///
/// # Errors
/// The reason why the model cannot be simulated at its current values.
pub fn diagnose(
    input: &VerbInput,
    residual_model: &dyn ResidualModel,
    options: DiagnoseOptions,
    stop_signal: StopSignal,
    on_step: &dyn Fn(&LadderStep),
) -> Result<(DiagnoseReport, Diagnosed), WorldError> {
    let began = Instant::now();
    let mut objective = Objective::new(residual_model).stopping_when(stop_signal);
    let diagnosis = btr_identify::diagnose::diagnose(&mut objective, options, on_step)?;
    let glitches = input.in_files(&diagnosis.glitches);
    let is_at_bound = |name: &str| diagnosis.at_bound.iter().any(|other| other == name);
    let residual_law = residual_law(input, &diagnosis);
    let report = DiagnoseReport {
        ok: true,
        verdict: diagnosis.verdict,
        degree: diagnosis.degree,
        remaining: diagnosis.left.clone(),
        effects: grouped(input, &diagnosis.effects),
        wrong_values: wrong_values(input, &diagnosis.effects),
        ranking: diagnosis.rounds.clone(),
        error_ladder: diagnosis.ladder.clone(),
        noise_floor: input.floors_in(&diagnosis.logs),
        unexplained_share: diagnosis.unexplained_share,
        left_over: diagnosis.left_over.clone(),
        stand_ins: diagnosis.stand_ins.clone(),
        noise_stated_low: match diagnosis.verdict {
            // What follows a law is no noise.
            Verdict::Unexplained | Verdict::PartlyExplained if residual_law.is_none() => stated_low(input, &diagnosis),
            _ => Vec::new(),
        },
        residual_law,
        next_experiment: input.next_experiment(&diagnosis.rivals),
        integrator_error: diagnosis.integrator_error,
        time_step_s: input.time_step_s(objective.step()),
        doubts: input.doubts_with(&glitches, &diagnosis.left),
        glitches,
        not_judged: input.not_judged.clone(),
        left_out: input.left_out.clone(),
        frozen: input.frozen.clone(),
        with_prior: input.with_prior(),
        at_bound: diagnosis.at_bound.clone(),
        at_limit: input.at_limits(input.values(&diagnosis.fit), is_at_bound),
        adds_to: adds_to(input, &diagnosis.effects),
        without_effect: input.idle_effects(input.values(&diagnosis.fit), is_at_bound),
        cut_short: diagnosis.cut_short,
        rollouts: diagnosis.rollouts,
        seconds: began.elapsed().as_secs_f64(),
    };
    let (step, found) = (objective.step(), diagnosis.effects);
    let is_explained = !matches!(report.verdict, Verdict::Unexplained | Verdict::PartlyExplained);
    Ok((report, Diagnosed { fit: diagnosis.fit, found, step, is_explained }))
}

fn residual_law(input: &VerbInput, diagnosis: &Diagnosis) -> Option<LawReport> {
    let found = diagnosis.residual_law.as_ref()?;
    let (site, on, law) = input.problem.law(found)?;
    let word = format!("{on:?}").to_lowercase();
    let toml = format!("[[effects]]\neffect = \"formula\"\nsite = \"{site}\"\non = \"{word}\"\nlaw = \"{law}\"\n");
    let effects = diagnosis.effects.iter().filter(|_| found.beside_effects);
    let beside = effects.map(|found| format!("{}@{}", found.effect, found.site)).collect();
    Some(LawReport { law, site, on, explains: found.explains, beside, toml })
}
