//! The state of a run: all that a checkpoint holds.
//!
//! Checkpoints are written with postcard, which has no field names: the order of fields and variants must not change.

use crate::coevolve::correction::LinearCorrection;
use crate::coevolve::estimation::{Estimated, Posterior};
use crate::coevolve::evaluate::Cost;
use crate::coevolve::history::{History, StopReason};
use crate::coevolve::ledger::Ledger;
use crate::coevolve::transfer::ScoredController;
use crate::optimize::LeastSquares;
use crate::search::{AnySearch, MapElites, UnitPoint};
use serde::{Deserialize, Serialize};

/// Where in an iteration the run is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Phase {
    /// About to begin the iteration.
    Begin,
    /// Step 1 of the first iteration, where the method makes a map of controllers.
    Map { generation: usize },
    /// Step 1.
    Controllers { search: AnySearch, archive: Vec<ScoredController>, generation: usize },
    /// Step 2. `testing` is there when reality itself is the environment of the controller search.
    Transfer { queue: Vec<ScoredController>, next: usize, testing: Option<AnySearch> },
    /// Step 3. `tried` begins with s_{i−1}.
    Simulators { search: AnySearch, tests: Vec<usize>, tried: Vec<(UnitPoint, f64)>, generation: usize },
    /// Step 3, continued by least squares from the best that was tried.
    Refine { search: LeastSquares, tests: Vec<usize>, tried: Vec<(UnitPoint, f64)>, generation: usize },
    /// Step 3 as estimation.
    Estimate(Estimation),
    /// S has grown: step 3 on the tests there are, before any new one is asked for; or what explains them is known.
    Enlarged(Option<Estimated>),
    /// About to close the iteration.
    End,
    /// Over.
    Stopped(StopReason),
}

/// Where the estimation stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Estimation {
    /// The tests that count, by their place in the ledger.
    pub(super) tests: Vec<usize>,
    pub(super) belief: Posterior,
    pub(super) turn: usize,
    /// How many starts were given up before this one.
    pub(super) start: usize,
    /// The best of those.
    pub(super) best: Option<Estimated>,
    /// Whether what was believed explained several tests before these ones, or foretold one, and the latest came otherwise.
    pub(super) surprised: bool,
}

/// How far a run has come: all that has to be written down to go on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunState {
    pub(super) seed: u64,
    /// s_0.
    pub(super) start: Vec<f64>,
    pub(super) iteration: usize,
    pub(super) phase: Phase,
    /// s_{i−1}, then s_i.
    pub(super) simulation: Vec<f64>,
    /// c_{i−1}, then c_i, on the unit cube.
    pub(super) controller: Option<UnitPoint>,
    /// Where the next search for controllers begins.
    pub(super) ahead: Option<UnitPoint>,
    /// The simulator search as the last iteration left it.
    pub(super) carried: Option<AnySearch>,
    /// s_0 on the unit cube: about what S is believed before any test.
    pub(super) prior: UnitPoint,
    /// What the real tests say of S, where the plan asks for a posterior.
    pub(super) estimated: Option<Estimated>,
    /// Whether that explains several tests, or has foretold one that came after it.
    pub(super) confirmed: bool,
    /// Number of the first real test of the robot as it is now.
    pub(super) since: usize,
    /// Number of the first real test that nothing explains beside those before it: an older one is repeated, to tell whether the
    /// robot has changed or S lacks something.
    pub(super) suspicion: Option<usize>,
    pub(super) rivals: Vec<Vec<f64>>,
    /// The controllers of the method that makes a map of them.
    pub(super) map: Option<MapElites>,
    pub(super) correction: LinearCorrection,
    pub(super) ledger: Ledger,
    pub(super) history: History,
    pub(super) cost: Cost,
    /// phi of the starting simulation on the first transfers: the yardstick of disengagement.
    pub(super) phi_start: Option<f64>,
    /// phi of s_{i−1} on this iteration's transfers.
    pub(super) phi_predicted: Option<f64>,
    /// phi of s_i on the tests that count.
    pub(super) phi: Option<f64>,
}
