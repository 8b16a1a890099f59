//! Disengagement: one population no longer exerts selection pressure on the other (the paper's step 4).
//!
//! The verdict needs all of: phi has stopped falling, it has stopped well above agreement and above the goal that was
//! set for it, and the simulation keeps mispredicting fresh transfers. The ranks and the pressures are reported as
//! further evidence. With a posterior the verdict is direct: no simulation of S explains the tests to the noise, from
//! any start, even where everything that is unpredictable counts as noise.

use super::history::Iteration;
use super::plan::DisengagementRule;

/// Whether the last iterations amount to disengagement. Where phi was at its goal in one of them, there was nothing
/// left to learn, and a phi that no longer falls is no evidence.
pub(super) fn disengaged(iterations: &[Iteration], rule: &DisengagementRule, phi_goal: Option<f64>) -> bool {
    let lately = &iterations[iterations.len().saturating_sub(rule.patience)..];
    if iterations.last().is_some_and(|it| it.posterior.is_some()) {
        return lately.len() >= rule.patience && lately.iter().all(unexplained);
    }
    let at_goal = |it: &Iteration| it.phi.zip(phi_goal).is_some_and(|(phi, goal)| phi <= goal);
    if lately.iter().any(at_goal) {
        return false;
    }
    let shares: Vec<f64> = iterations.iter().filter_map(|it| it.evidence.phi_share).collect();
    if shares.len() <= rule.patience {
        return false;
    }
    let (before, recent) = shares.split_at(shares.len() - rule.patience);
    let best = |x: &[f64]| x.iter().copied().fold(f64::INFINITY, f64::min);
    let stalled = best(recent) > best(before) * (1.0 - rule.progress);
    let disagrees = best(recent) > rule.agreement;
    let mispredicts = lately.iter().all(|it| it.evidence.predicted_share.is_some_and(|share| share > rule.agreement));
    stalled && disagrees && mispredicts
}

/// Whether an estimate from several starts does not explain its tests, with all that is unpredictable counted as noise.
/// Tests are then chosen by expected information, so that each iteration has fresh ones.
fn unexplained(iteration: &Iteration) -> bool {
    iteration.posterior.as_ref().is_some_and(|estimate| !estimate.explained)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coevolve::history::Evidence;

    fn iteration(phi: f64) -> Iteration {
        let share = Some(phi / 0.036);
        let evidence = Evidence { phi_share: share, predicted_share: share, ..Evidence::default() };
        Iteration {
            i: 0,
            fitness_sim: None,
            fitness_ci95: None,
            fitness_real: None,
            best_real: None,
            phi_predicted: None,
            phi: Some(phi),
            parameters: indexmap::IndexMap::new(),
            posterior: None,
            controller: Vec::new(),
            real_tests: 0,
            simulated_evaluations: 0,
            evidence,
        }
    }

    #[test]
    fn a_run_at_its_goal_is_not_disengaged() {
        // In the end something new is tried.
        let stands: Vec<Iteration> = [0.0164, 0.0167, 0.0163, 0.0159, 0.0161, 0.0668].map(iteration).into();
        let rule = DisengagementRule::default();
        assert!(disengaged(&stands, &rule, None) && disengaged(&stands, &rule, Some(0.01)));
        assert!(!disengaged(&stands, &rule, Some(0.017)));
    }
}
