//! The model before and after a fit or a diagnosis, and on the way: sections of its channels and joints, and a player
//! in which each stage can be chosen.

use super::joints::ComparedLogs;
use super::page::{Block, Section};
use super::player::{AS_IT_STANDS, Player, Replayed, ReplayedState};
use crate::Subject;
use crate::table::number;
use btr_core::world::WorldError;
use btr_identify::LadderStep;
use btr_identify::compare::{ChannelError, Comparison};
use btr_identify::residual_model::TimeStep;
use btr_lab::identification::NoiseFloor;
use btr_lab::verbs::{HeldOutLogs, JudgedLogs};
use btr_physics::sensor::SensorNoise;

/// Stages that can be chosen at most: the first two and the latest.
const MOST_STAGES: usize = 8;

/// How a fit or a diagnosis changed the model.
pub(super) struct Stages {
    /// What the model is at last, in a sentence.
    pub(super) after: String,
    /// The model as it stands, and what became of it.
    stages: Vec<Stage>,
    /// The time step of the simulations.
    step: TimeStep,
    /// The noise floors that errors are multiples of.
    floors: Vec<NoiseFloor>,
}

/// The model at a step of the error ladder.
struct Stage {
    name: String,
    /// Its error on held-out logs; without such, on training logs.
    error: f64,
    /// The coordinates of the parameters.
    u: Vec<f64>,
}

impl Stages {
    /// Every step of an error ladder; at last, the model is at the point `u`.
    pub(super) fn all(ladder: &[LadderStep], (u, step): (&[f64], TimeStep), after: String) -> Self {
        let mut stages: Vec<Stage> = ladder.iter().map(Stage::of).collect();
        if let Some(first) = stages.first_mut() {
            first.name = AS_IT_STANDS.to_owned();
        }
        if let Some(last) = stages.last_mut() {
            last.u = u.to_vec();
        }
        stages.dedup_by(|stage, before| stage.u == before.u);
        if stages.len() > MOST_STAGES {
            stages.drain(2..stages.len() - (MOST_STAGES - 2));
        }
        Stages { after, stages, step, floors: Vec::new() }
    }

    /// The same with these noise floors.
    pub(super) fn in_floors(self, floors: &[NoiseFloor]) -> Self {
        Stages { floors: floors.to_vec(), ..self }
    }

    /// The first and the last step of an error ladder; at last, the model is at the point `u` and has this name.
    pub(super) fn ends(ladder: &[LadderStep], reached: (&[f64], TimeStep), after: String, name: String) -> Self {
        let ends: Vec<LadderStep> = match ladder {
            [first, .., last] => vec![first.clone(), LadderStep { step: name, ..last.clone() }],
            one => one.to_vec(),
        };
        Stages::all(&ends, reached, after)
    }

    /// The errors of all stages on these logs. A stage on the way that cannot be simulated is left out.
    fn judged(&self, subject: &Subject, logs: &HeldOutLogs) -> Result<Vec<(&Stage, JudgedLogs)>, WorldError> {
        let mut judged = Vec::with_capacity(self.stages.len());
        for (k, stage) in self.stages.iter().enumerate() {
            match subject.input.judge(logs, &stage.u, self.step, &self.floors) {
                Ok(errors) => judged.push((stage, errors)),
                Err(error) if k == 0 || k + 1 == self.stages.len() => return Err(error),
                Err(_) => {}
            }
        }
        Ok(judged)
    }
}

impl Stage {
    fn of(step: &LadderStep) -> Self {
        Stage { name: step.step.clone(), error: step.held_out.unwrap_or(step.train), u: step.u.clone() }
    }

    fn state<'a>(&self, JudgedLogs { comparison, simulated }: &'a JudgedLogs) -> ReplayedState<'a> {
        ReplayedState { name: self.name.clone(), error: Some(self.error), comparison, simulated }
    }
}

impl Subject<'_> {
    /// The judged channels and the joints, with the original model and with what became of it, and a player of all
    /// stages. Where these logs cannot be simulated, the section says so.
    pub(super) fn before_and_after(&self, stages: &Stages) -> (Vec<Section>, Option<Player>) {
        self.simulated(stages).unwrap_or_else(|error| {
            let text = format!("These logs could not be simulated as a whole: {error}.");
            (vec![Section { title: "Before and after".to_owned(), blocks: vec![Block::Text(text)] }], None)
        })
    }

    fn simulated(&self, stages: &Stages) -> Result<(Vec<Section>, Option<Player>), WorldError> {
        let logs = self.input.judged();
        let judged = stages.judged(self, &logs)?;
        let player = self.player(&logs, &judged);
        let Some(((_, after), earlier)) = judged.split_last() else { return Ok((Vec::new(), None)) };
        let before = earlier.first().map(|(_, before)| &before.comparison);
        let mut blocks = vec![
            Block::Text(format!(
                "The model against {}: {}after: {}. These errors are of whole simulated logs, in noise floors; the errors \
                 above exclude what uncertain initial states and the time step explain.",
                logs.names.join(", "),
                if before.is_some() { "before: the original model; " } else { "" },
                stages.after
            )),
            channels(before, &after.comparison),
        ];
        blocks.extend(estimated_floors(&self.input.problem.model().setup.noise, &after.comparison).map(Block::Text));
        let between = earlier.iter().skip(1).map(|(stage, judged)| (&*stage.name, &judged.comparison)).collect();
        let problem = ComparedLogs { names: logs.names, logs: logs.logs, before, between, after: &after.comparison };
        let first = Section { title: "Before and after".to_owned(), blocks };
        Ok((std::iter::once(first).chain(problem.sections()).collect(), player))
    }

    fn player(&self, logs: &HeldOutLogs, judged: &[(&Stage, JudgedLogs)]) -> Option<Player> {
        Player::of(&Replayed {
            model: self.input.problem.model(),
            names: &logs.names,
            logs: logs.logs,
            states: judged.iter().map(|(stage, judged)| stage.state(judged)).collect(),
            errors_are: Some(format!("error on {}, in {}", self.judged_on(), self.input.error_unit().times())),
            in_windows: self.input.problem.is_chaotic(),
        })
    }

    fn judged_on(&self) -> &'static str {
        if self.held_out.is_empty() { "what was held out" } else { "the held-out logs" }
    }
}

/// Why figures of `btr compare` differ: noise floors that the model does not state are estimated from the logs of a
/// command.
fn estimated_floors(noise: &SensorNoise, comparison: &Comparison) -> Option<String> {
    let names = comparison.channels.iter().map(|channel| channel.name.as_str());
    let names: Vec<&str> = names.filter(|name| !noise.states_white(name)).collect();
    (!names.is_empty()).then(|| {
        format!(
            "[noise] of the model does not state the noise of {}: its floor is estimated, here from all logs of this \
             report, and in btr compare from the logs that it is given. The figures differ by as much as these floors.",
            names.join(", ")
        )
    })
}

/// The errors of all channels before and after.
fn channels(before: Option<&Comparison>, after: &Comparison) -> Block {
    let chi = |name: &str| before.and_then(|b| b.channels.iter().find(|c| c.name == name)).map(|c| c.chi);
    let row = |c: &ChannelError| {
        let before = chi(&c.name).map_or_else(|| "-".to_owned(), number);
        vec![c.name.clone(), c.unit.clone(), number(c.noise_floor), before, number(c.chi)]
    };
    Block::Table {
        header: ["channel", "unit", "noise floor", "before", "after"].map(str::to_owned).to_vec(),
        rows: after.channels.iter().map(row).collect(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use btr_lab::experiment::Source;
    use btr_lab::verbs::VerbInput;
    use std::path::Path;

    fn step(name: &str, u: &[f64]) -> LadderStep {
        LadderStep { step: name.to_owned(), train: 2.0, held_out: None, u: u.to_vec() }
    }

    /// The names and the points of the stages of a ladder with steps at these points.
    fn stages(points: &[f64], last: f64) -> Vec<(String, f64)> {
        let ladder: Vec<LadderStep> = points.iter().map(|u| step(&format!("to {u}"), &[*u])).collect();
        let stages = Stages::all(&ladder, (&[last], TimeStep::USUAL), String::new()).stages;
        stages.into_iter().map(|stage| (stage.name, stage.u[0])).collect()
    }

    fn named(stages: &[(&str, f64)]) -> Vec<(String, f64)> {
        stages.iter().map(|(name, u)| ((*name).to_owned(), *u)).collect()
    }

    #[test]
    fn the_last_stage_is_where_the_model_is_and_a_step_that_changes_nothing_is_none() {
        assert_eq!(stages(&[0.0, 0.0, 1.0, 2.0], 2.5), named(&[(AS_IT_STANDS, 0.0), ("to 1", 1.0), ("to 2", 2.5)]));
        assert_eq!(stages(&[0.0, 0.0], 0.0), named(&[(AS_IT_STANDS, 0.0)]));
        let many: Vec<f64> = (0..12).map(f64::from).collect();
        let kept: Vec<f64> = stages(&many, 11.0).into_iter().map(|(_, u)| u).collect();
        assert_eq!(kept, [0.0, 1.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0]);
    }

    #[test]
    fn floors_that_are_estimated_are_told() {
        let robots = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
        let text = std::fs::read_to_string(robots.join("arm.toml")).unwrap().replace("position_rad = ", "#");
        let logs = [robots.join("arm/learn_1.csv")];
        let input = VerbInput::new(Source::new(robots.join("arm.toml"), text), &logs, &[]).unwrap();
        let subject = Subject { input: &input, logs: &logs, held_out: &[] };
        let ladder = [step("model as it stands", &vec![0.0; input.problem.parameters().len()])];
        let stages = Stages::all(&ladder, (&ladder[0].u, TimeStep::USUAL), String::new());
        let stages = stages.in_floors(&input.floors());
        let (sections, _) = subject.before_and_after(&stages);
        let mut html = String::new();
        sections[0].blocks.iter().for_each(|block| block.write(&mut html));
        let told = "does not state the noise of q_yaw, q_shoulder, q_elbow: its floor is estimated";
        assert!(html.contains(told), "{html}");
    }

    #[test]
    fn logs_that_cannot_be_simulated_are_reported_and_the_rest_stays() {
        let robots = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
        let logs = [robots.join("arm/learn_1.csv")];
        let input = VerbInput::new(Source::read(&robots.join("arm.toml")).unwrap(), &logs, &[]).unwrap();
        let subject = Subject { input: &input, logs: &logs, held_out: &[] };
        let parameters = input.problem.parameters().len();
        let shown = |ladder: &[f64]| {
            let point = |u: &f64| vec![*u; parameters];
            let ladder: Vec<LadderStep> = ladder.iter().map(|u| step(&format!("to {u}"), &point(u))).collect();
            let last = ladder.last().unwrap().u.clone();
            let stages = Stages::all(&ladder, (&last, TimeStep::USUAL), String::new()).in_floors(&input.floors());
            let (sections, player) = subject.before_and_after(&stages);
            assert_eq!(player.is_some(), last[0].is_finite());
            let mut html = String::new();
            sections.iter().flat_map(|section| &section.blocks).for_each(|block| block.write(&mut html));
            html
        };
        let whole = shown(&[0.0]);
        assert!(!whole.contains("does not state the noise"), "this model does");
        assert!(whole.contains("Residual in") && !whole.contains("could not be simulated"));
        let said = shown(&[0.0, f64::NAN]);
        assert!(said.contains("could not be simulated as a whole: ") && !said.contains("Residual in"), "{said}");
        // Of the steps between, only those that can be simulated are there to be chosen.
        let between = shown(&[0.0, f64::NAN, 0.01, 0.02]);
        assert!(between.contains(">to 0.01</text>") && !between.contains("NaN"));
        assert!(between.contains("data-state=\"1\" class=\"hidden\"") && between.contains("data-state=\"2\">"));
    }
}
