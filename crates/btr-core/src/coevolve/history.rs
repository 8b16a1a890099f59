//! Records of generations and iterations, and the reason why a run stopped.

use super::drift::Drift;
use super::estimation::{Belief, OpenDirection};
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

/// Which of the two populations a generation belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Step 1; scores are fitness, larger is better.
    Controllers,
    /// Step 3; scores are phi, smaller is better.
    Simulators,
}

/// One generation of one population.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Generation {
    /// Iteration, from 1.
    pub iteration: usize,
    /// Generation within the iteration's search, from 1.
    pub generation: usize,
    /// Whose.
    pub side: Side,
    /// The best score.
    pub best: f64,
    /// The mean over individuals that did not fail.
    pub mean: f64,
    /// How many individuals failed.
    pub failed: usize,
    /// Every individual's score, `None` where it failed.
    pub scores: Vec<Option<f64>>,
    /// Simulators: every individual, in the units of S. Controllers: the best one, in the units of C.
    pub points: Vec<Vec<f64>>,
}

/// Place of a generation in a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct GenerationLabel {
    pub iteration: usize,
    pub generation: usize,
    pub side: Side,
}

impl Generation {
    pub(super) fn new(label: GenerationLabel, points: Vec<Vec<f64>>, scores: &[f64]) -> Self {
        let GenerationLabel { iteration, generation, side } = label;
        let finite: Vec<f64> = scores.iter().copied().filter(|x| x.is_finite()).collect();
        let best = match side {
            Side::Controllers => finite.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            Side::Simulators => finite.iter().copied().fold(f64::INFINITY, f64::min),
        };
        let mean = finite.iter().sum::<f64>() / finite.len() as f64;
        let failed = scores.len() - finite.len();
        let scores = scores.iter().map(|&x| x.is_finite().then_some(x)).collect();
        Generation { iteration, generation, side, best, mean, failed, scores, points }
    }
}

/// Estimate of S from the real tests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EstimateRecord {
    /// Whether simulations explain the tests to the noise. Otherwise S lacks something, or the estimate has not
    /// converged.
    pub explained: bool,
    /// The part of the readings that simulations of the posterior cannot predict, in multiples of the noise: mostly
    /// chaos.
    pub unpredictable: f64,
    /// Each parameter by name.
    pub parameters: IndexMap<String, Belief>,
    /// Parameters that the tests do not identify to the plan's resolution.
    pub not_told: Vec<String>,
    /// Combinations of parameters that the tests hardly identify.
    pub open_directions: Vec<OpenDirection>,
}

/// Evidence of one iteration on the engagement of the two populations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// phi of s_i as a share of the starting simulation's phi on the first transfers: 1 is no better, 0 is agreement.
    pub phi_share: Option<f64>,
    /// The same for s_{i−1} on this iteration's fresh transfers.
    pub predicted_share: Option<f64>,
    /// Kendall's tau-b between promised and real fitness of this iteration's transfers.
    pub rank_agreement: Option<f64>,
    /// Pressure of the controllers on the simulations: spread of phi, (mean − best)/mean, over the first generation of
    /// step 3. Near 0 no simulation is better than another.
    pub pressure_on_simulations: Option<f64>,
    /// Pressure of the simulations on the controllers: 1 − Kendall's tau-b between the transfers' fitness in s_{i−1}
    /// and in s_i, halved. At 0 the new simulation ranks controllers like the old one.
    pub pressure_on_controllers: Option<f64>,
    /// Parameters of s_i that lie on a bound of S.
    pub at_bound: Vec<String>,
}

/// One turn of steps 1 to 3.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Iteration {
    /// From 1.
    pub i: usize,
    /// The fitness of the controller c_i that the simulation predicted before its test.
    pub fitness_sim: Option<f64>,
    /// 95 % prediction interval of that over the posterior or the map; `None` without either.
    pub fitness_ci95: Option<[f64; 2]>,
    /// Real fitness of c_i.
    pub fitness_real: Option<f64>,
    /// The best real fitness so far, of any controller.
    pub best_real: Option<f64>,
    /// phi of the previous simulation on this iteration's new transfers: how well it predicted them.
    pub phi_predicted: Option<f64>,
    /// phi of s_i on the transfers that count.
    pub phi: Option<f64>,
    /// s_i by name, in the units of S.
    pub parameters: IndexMap<String, f64>,
    /// Estimate of S; `None` for a plan without a posterior.
    pub posterior: Option<EstimateRecord>,
    /// c_i in the units of C.
    pub controller: Vec<f64>,
    /// Real tests spent so far.
    pub real_tests: usize,
    /// Simulated behaviours so far.
    pub simulated_evaluations: u64,
    /// Evidence for or against disengagement.
    pub evidence: Evidence,
}

/// Why a run ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
// Exhaustive: the command line has words for each reason.
pub enum StopReason {
    /// A real test reached the fitness goal.
    GoalReached,
    /// No controller of the map is predicted to be much better than the best one tried.
    NothingBetter,
    /// All iterations were done.
    IterationsDone,
    /// The budget of real tests is spent.
    RealTestsSpent,
    /// The populations disengaged: S probably lacks something of reality.
    Disengaged,
    /// No real test returned usable data.
    NoRealData,
}

/// S has grown: the paper's re-parametrisation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Augmentation {
    /// The last iteration that was closed before.
    pub after_iteration: usize,
    /// Real tests there were.
    pub real_tests: usize,
    /// The dimensions that S gained.
    pub parameters: Vec<String>,
}

/// The whole run so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct History {
    /// Every generation of both populations.
    pub generations: Vec<Generation>,
    /// Every iteration.
    pub iterations: Vec<Iteration>,
    /// How S has grown.
    pub augmentations: Vec<Augmentation>,
    /// How the robot has changed.
    pub drifts: Vec<Drift>,
}
