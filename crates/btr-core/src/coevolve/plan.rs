//! The plan of a run: all settings of the loop (the paper's step 0).

use super::ledger::Memory;
use super::map::MapPhase;
use crate::distance::DistanceSpec;
use crate::search::SearchSpec;
use crate::settings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How simulation and reality work together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The paper's loop: controllers evolve in the best simulation, a few are tried, simulations evolve to match.
    #[default]
    BackToReality,
    /// Bongard and Lipson: the next real test is the one on which rival simulations disagree most; simulations evolve
    /// to explain all tests. Controllers are evolved for fitness in the last iteration only.
    EstimationExploration,
    /// Hemker and colleagues: the simulation stays as it is, a linear estimate of the fitness discrepancy corrects it.
    LinearCorrection,
    /// No simulation at all: the same controller search spends its evaluations in reality.
    RealityOnly,
    /// Cully, Clune, Tarapore and Mouret: a map of diverse controllers is made in the unchanged simulation; real tests,
    /// one per iteration, find those that do well in reality. For a robot that is damaged, or otherwise differs from
    /// its model.
    QualityDiversity,
}

/// The simulation the first iteration starts from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Initial {
    /// The nominal values of S.
    #[default]
    Nominal,
    /// A point of S drawn from the seed.
    Random,
}

/// One of the two searches and its length per iteration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SearchPhase {
    /// Generations per iteration.
    #[serde(deserialize_with = "settings::at_least_one")]
    pub generations: usize,
    /// The algorithm and its settings.
    pub search: SearchSpec,
    /// Whether the simulator search continues from its state at the end of the last iteration (with its whole
    /// distribution or population) instead of starting anew from s_{i−1}. The real tests that count may have changed
    /// since.
    #[serde(default)]
    pub carry_over: bool,
    /// Turns of least squares that follow the simulator search, from its best point and, once that is exhausted, from
    /// new starts near the best one. Each costs 2·dims + 5 simulations per real test. Only with a distance that is a
    /// sum of squares (`rmse`); ignored with others.
    #[serde(default)]
    #[serde(deserialize_with = "settings::count")]
    pub refine: usize,
}

/// Which controllers are tried in reality (step 2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// The m fittest of the last generation, topped up from earlier ones.
    #[default]
    Fittest,
    /// The fittest and m − 1 of its mutants, drawn with `mutation` per bit (the paper's p'_m).
    Neighbourhood,
    /// The fittest, and those on which rival simulations disagree most (Klaus, Glette and Tørresen).
    Disagreement,
    /// Needs `[coevolve.posterior]`. As long as some parameter is not identified to the `resolution`, or simulations do
    /// not explain the tests: the one of `candidates` controllers (the fittest of the search, and others drawn from C
    /// that are no worse than half of those) with the largest expected gain of information about S; unpredictable
    /// motion gains nothing. After that: the fittest.
    Informative,
}

/// How many controllers are tried, and by which rule.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Transfer {
    /// The rule.
    pub rule: Rule,
    /// m as a share of the controller population M; the paper takes 0.6 with phi_1.
    #[serde(deserialize_with = "settings::positive")]
    pub share: f64,
    /// m itself, instead of a share; the paper takes 1 or 2 with phi_2.
    #[serde(deserialize_with = "settings::maybe_count")]
    pub count: Option<usize>,
    /// p'_m of the neighbourhood rule, per bit.
    #[serde(deserialize_with = "settings::probability")]
    pub mutation: f64,
    /// Number of rival simulations of the disagreement rule.
    #[serde(deserialize_with = "settings::count")]
    pub rivals: usize,
    /// Number of controllers that the disagreement rule and the informative rule consider.
    #[serde(deserialize_with = "settings::count")]
    pub candidates: usize,
}

impl Default for Transfer {
    fn default() -> Self {
        Transfer { rule: Rule::Fittest, share: 0.6, count: None, mutation: 0.02, rivals: 6, candidates: 20 }
    }
}

/// Step 3 as estimation: a posterior over S instead of one best simulation; controllers are evaluated over the
/// posterior. The distance must be `whitened`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PosteriorPhase {
    /// Simulations per real test in each turn; at least twice the dimensions of S, and eight, are taken.
    #[serde(deserialize_with = "settings::at_least_one")]
    pub members: usize,
    /// Largest number of turns until the estimate settles.
    #[serde(deserialize_with = "settings::at_least_one")]
    pub turns: usize,
    /// Further starts while an estimate does not explain the tests.
    #[serde(deserialize_with = "settings::count")]
    pub restarts: usize,
    /// A parameter counts as identified when half its 95 % interval is at most this share of its bounds' width.
    #[serde(deserialize_with = "settings::positive")]
    pub resolution: f64,
    /// Simulations drawn from the posterior in which each controller of the search is evaluated.
    #[serde(deserialize_with = "settings::at_least_one")]
    pub samples: usize,
    /// The quantile of a controller's fitness over those simulations that the search maximises: 0 is the worst, 1 the
    /// best.
    #[serde(deserialize_with = "settings::probability")]
    pub quantile: f64,
    /// Least standard deviation of the simulations in which controllers are evaluated, as a share of the bounds' width:
    /// S never holds all that is uncertain.
    #[serde(deserialize_with = "settings::probability")]
    pub least_doubt: f64,
}

impl Default for PosteriorPhase {
    fn default() -> Self {
        PosteriorPhase {
            members: 48,
            turns: 12,
            restarts: 2,
            resolution: 0.05,
            samples: 6,
            quantile: 0.25,
            least_doubt: 0.005,
        }
    }
}

impl PosteriorPhase {
    /// Members of an ensemble in `dims` dimensions.
    pub(super) fn members(&self, dims: usize) -> usize {
        self.members.max(2 * dims).max(dims + 8)
    }
}

/// Rule by which the two populations count as disengaged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DisengagementRule {
    /// Iterations without progress before the verdict.
    #[serde(deserialize_with = "settings::at_least_one")]
    pub patience: usize,
    /// Progress is a fall of phi by at least this share.
    pub progress: f64,
    /// phi at or below this share of the starting simulation's phi counts as agreement.
    pub agreement: f64,
    /// Whether the run stops on disengagement or only reports it.
    pub stop: bool,
}

impl Default for DisengagementRule {
    fn default() -> Self {
        DisengagementRule { patience: 3, progress: 0.05, agreement: 0.1, stop: true }
    }
}

/// All settings of the loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// How simulation and reality work together.
    #[serde(default)]
    pub method: Method,
    /// Iterations of steps 1 to 3.
    #[serde(deserialize_with = "settings::count")]
    pub iterations: usize,
    /// Budget of real tests.
    #[serde(default, deserialize_with = "settings::maybe_count")]
    pub real_tests: Option<usize>,
    /// phi: what the simulator search minimises.
    pub distance: DistanceSpec,
    /// The simulation to start from.
    #[serde(default)]
    pub initial_simulation: Initial,
    /// Step 1. Needed where there are controllers to search.
    #[serde(default)]
    pub controllers: Option<SearchPhase>,
    /// Steps 1 and 2 of `quality_diversity`.
    #[serde(default)]
    pub map: Option<MapPhase>,
    /// Step 2.
    #[serde(default)]
    pub transfer: Transfer,
    /// Step 3. Needed where there are simulations to search.
    #[serde(default)]
    pub simulators: Option<SearchPhase>,
    /// Step 3 as estimation, in place of a search for simulators.
    #[serde(default)]
    pub posterior: Option<PosteriorPhase>,
    /// Which older transfers keep counting.
    #[serde(default)]
    pub memory: Memory,
    /// The simulator search pauses while phi is at or below this: there is nothing left to learn from the transfers.
    #[serde(default)]
    pub phi_goal: Option<f64>,
    /// The run is done once a real test reaches this fitness.
    #[serde(default)]
    pub fitness_goal: Option<f64>,
    /// When the space of simulations counts as exhausted.
    #[serde(default)]
    pub disengagement: DisengagementRule,
    /// Whether a run that stops disengaged adds the effect that its real tests show to S and continues.
    #[serde(default)]
    pub self_augment: bool,
}

impl Plan {
    /// m: how many controllers one iteration transfers, where C has `dims` dimensions.
    pub fn transfers(&self, dims: usize) -> usize {
        let population = self.controllers.as_ref().map_or(1, |phase| phase.search.population(dims));
        let m = self.transfer.count.unwrap_or_else(|| (self.transfer.share * population as f64).round() as usize);
        m.max(1)
    }

    /// Generations of the simulator search per iteration, with the turns of least squares that follow where the
    /// distance allows for them.
    pub fn simulator_generations(&self) -> usize {
        let refines = self.distance.build().as_squares().is_some();
        self.simulators.as_ref().map_or(0, |phase| phase.generations + if refines { phase.refine } else { 0 })
    }
}
