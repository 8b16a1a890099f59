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

/// Phase of an iteration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Phase {
    /// About to begin the iteration.
    Begin,
    /// Step 1 of the first iteration, where the method makes a map of controllers.
    Map { generation: usize },
    /// Step 1.
    Controllers { search: AnySearch, archive: Vec<ScoredController>, generation: usize },
    /// Step 2. `testing` is the controller search when reality itself is its environment.
    Transfer { queue: Vec<ScoredController>, next: usize, testing: Option<AnySearch> },
    /// Step 3. `tried` begins with s_{i−1}.
    Simulators { search: AnySearch, tests: Vec<usize>, tried: Vec<(UnitPoint, f64)>, generation: usize },
    /// Step 3, continued by least squares from the best that was tried.
    Refine { search: LeastSquares, tests: Vec<usize>, tried: Vec<(UnitPoint, f64)>, generation: usize },
    /// Step 3 as estimation.
    Estimate(Estimation),
    /// S has grown: step 3 on the existing tests, before any new one; or an estimate that explains them is known.
    Enlarged(Option<Estimated>),
    /// About to close the iteration.
    End,
    /// Over.
    Stopped(StopReason),
}

/// State of an estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Estimation {
    /// The tests that count, by their place in the ledger.
    pub(super) tests: Vec<usize>,
    pub(super) belief: Posterior,
    pub(super) turn: usize,
    /// Number of starts given up before this one.
    pub(super) start: usize,
    /// The best of those.
    pub(super) best: Option<Estimated>,
    /// Whether the belief explained several earlier tests, or predicted one, and failed to predict the latest.
    pub(super) surprised: bool,
}

/// State of a run: all that a checkpoint holds.
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
    /// s_0 on the unit cube: mean of the prior over S.
    pub(super) prior: UnitPoint,
    /// Estimate of S, for a plan with a posterior.
    pub(super) estimated: Option<Estimated>,
    /// Whether that explains several tests, or has predicted a later one.
    pub(super) confirmed: bool,
    /// Number of the first real test of the robot as it is now.
    pub(super) since: usize,
    /// Number of the first real test that no simulation explains together with those before it: an older test is
    /// repeated to decide whether the robot has changed or S lacks something.
    pub(super) suspicion: Option<usize>,
    pub(super) rivals: Vec<Vec<f64>>,
    /// The controllers of the method that makes a map of them.
    pub(super) map: Option<MapElites>,
    pub(super) correction: LinearCorrection,
    pub(super) ledger: Ledger,
    pub(super) history: History,
    pub(super) cost: Cost,
    /// phi of the starting simulation on the first transfers: the reference of disengagement.
    pub(super) phi_start: Option<f64>,
    /// phi of s_{i−1} on this iteration's transfers.
    pub(super) phi_predicted: Option<f64>,
    /// phi of s_i on the tests that count.
    pub(super) phi: Option<f64>,
}

impl RunState {
    /// Records of generations and iterations so far.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// Every real test so far, without behaviours.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// The simulation the run began with, in the units of S.
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// The iteration being worked on, from 1.
    pub fn iteration(&self) -> usize {
        self.iteration
    }

    /// Number of simulations so far.
    pub fn cost(&self) -> Cost {
        self.cost
    }

    /// What the next step does, in words.
    pub fn activity(&self) -> &'static str {
        match self.phase {
            Phase::Begin | Phase::Enlarged(_) => "beginning an iteration",
            Phase::Map { .. } => "filling the map of controllers",
            Phase::Controllers { .. } => "searching controllers in simulation",
            Phase::Transfer { .. } => "testing in reality",
            Phase::Simulators { .. } | Phase::Refine { .. } => "searching simulations",
            Phase::Estimate(_) => "estimating the simulation",
            Phase::End => "ending an iteration",
            Phase::Stopped(_) => "stopped",
        }
    }

    /// Why the run is over; `None` while it is not.
    pub fn stop_reason(&self) -> Option<&StopReason> {
        match &self.phase {
            Phase::Stopped(reason) => Some(reason),
            _ => None,
        }
    }
}
