//! The loop on known truths: what it finds, and when it reports disengagement.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use btr_core::coevolve::{Coevolution, Side, StopReason, phi};
use btr_core::distance::Distance;
use btr_core::world::Simulator;
use btr_tests::{Hidden, Oscillator, finish, plan};

const TRUTH: [f64; 2] = [2.2, 0.5];

/// A run to its end against the truth.
fn run(changes: &str, reality: &mut Hidden) -> (Coevolution, StopReason) {
    let world = Oscillator::new().unwrap();
    let mut run = Coevolution::new(plan(changes).unwrap(), 1, &world).unwrap();
    let reason = finish(&mut run, &world, reality);
    (run, reason)
}

fn honest() -> Hidden {
    Hidden::new(Oscillator::new().unwrap(), TRUTH)
}

/// Largest error of a simulation, as a share of the truth.
fn error(s: &[f64]) -> f64 {
    s.iter().zip(TRUTH).map(|(found, truth)| (found / truth - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn fitness_alone_finds_the_hidden_parameters() {
    let (run, reason) = run("", &mut honest());
    assert_eq!(reason, StopReason::IterationsDone);
    assert!(error(run.start()) > 0.3, "the start must not know the truth");
    assert!(error(run.simulation()) < 1e-3, "{:?}", run.simulation());
    let iterations = &run.history().iterations;
    let gaps: Vec<f64> =
        iterations.iter().map(|it| (it.fitness_sim.unwrap() - it.fitness_real.unwrap()).abs()).collect();
    assert!(gaps[0] > 0.05 && gaps[1..].iter().all(|gap| *gap < 0.01 * gaps[0]), "promised against real: {gaps:?}");
    // With the true simulation the best controller is known: phase −omega, amplitude exp(−damping)/0.4.
    let ideal = (-TRUTH[1]).exp().powi(2) / 0.8;
    let best = run.best_tested().and_then(|e| e.fitness()).unwrap();
    assert!(best > 0.97 * ideal && best <= ideal, "{best} of {ideal}");
}

#[test]
fn least_squares_finish_what_a_short_search_began() {
    let short = |refine: usize, distance: &str| {
        let search = "search = { algorithm = 'cma_es', population = 4 }";
        let changes = format!(
            "iterations = 1\ndistance = '{distance}'\ntransfer = {{ count = 1 }}\n\
            simulators = {{ generations = 2, refine = {refine}, {search} }}"
        );
        run(&changes, &mut honest()).0
    };
    let (rough, fine) = (short(0, "rmse"), short(8, "rmse"));
    assert!(error(rough.simulation()) > 0.02, "{:?}", rough.simulation());
    assert!(error(fine.simulation()) < 1e-6, "{:?}", fine.simulation());
    let phis = |run: &Coevolution| run.history().iterations[0].phi.unwrap();
    assert!(phis(&fine) < 1e-6 * phis(&rough));
    // Other distances ignore `refine`.
    assert_eq!(short(8, "spectrum").history().generations.len(), short(0, "spectrum").history().generations.len());
}

#[test]
fn disagreement_finds_them_from_one_time_series_each() {
    let changes = "distance = 'rmse'\ntransfer = { rule = 'disagreement', count = 1, rivals = 4, candidates = 6 }";
    let (run, _) = run(changes, &mut honest());
    assert_eq!(run.ledger().spent(), 4);
    assert!(error(run.simulation()) < 1e-3, "{:?}", run.simulation());
}

#[test]
fn estimation_exploration_finds_them_and_exploits_last() {
    let changes = "method = 'estimation_exploration'\ndistance = 'rmse'\ntransfer = { count = 1, rivals = 4 }";
    let (run, reason) = run(changes, &mut honest());
    assert_eq!(reason, StopReason::IterationsDone);
    assert!(error(run.simulation()) < 1e-3, "{:?}", run.simulation());
    let fitness: Vec<f64> = run.ledger().entries().iter().filter_map(|e| e.fitness()).collect();
    assert!(
        fitness[3] > fitness[..3].iter().copied().fold(f64::MIN, f64::max),
        "only the last seeks fitness: {fitness:?}"
    );
}

#[test]
fn a_planted_linear_discrepancy_is_recovered_without_touching_the_simulation() {
    // The nominal simulation is the truth but for 0.5 − 0.3·(amplitude − 1) in fitness: on the unit cube, −0.6 per
    // unit.
    let mut reality = Hidden::new(Oscillator::new().unwrap(), [1.5, 0.2]).with_bonus(|c| 0.5 - 0.3 * (c[0] - 1.0));
    let (run, _) = run("method = 'linear_correction'\niterations = 5", &mut reality);
    assert_eq!(run.simulation(), run.start());
    assert!(run.history().generations.iter().all(|g| g.side == Side::Controllers));
    let tested = |e: &btr_core::coevolve::Entry| {
        let unit = Oscillator::new().unwrap().controllers().to_unit(&e.trial.controller);
        let planted = 0.5 - 0.6 * (unit[0] - 0.5);
        (run.correction().at(&unit) - planted).abs()
    };
    let worst = run.ledger().entries().iter().map(tested).fold(0.0, f64::max);
    assert!(worst < 0.02, "{worst} where controllers were tried");
}

#[test]
fn reality_only_spends_its_budget_and_no_simulation() {
    for budget in [1, 7, 40, 59] {
        let mut reality = honest();
        let (run, reason) = run(&format!("method = 'reality_only'\nreal_tests = {budget}"), &mut reality);
        assert_eq!((run.ledger().spent(), reality.trials.len()), (budget, budget));
        assert_eq!((run.cost().evaluations, reason), (0, StopReason::RealTestsSpent), "budget {budget}");
    }
}

#[test]
fn a_reality_inside_s_does_not_disengage() {
    for distance in ["fitness", "rmse"] {
        let (run, reason) = run(&format!("distance = '{distance}'\niterations = 8"), &mut honest());
        assert_eq!(reason, StopReason::IterationsDone, "{distance}");
        assert!(!run.disengaged());
    }
}

#[test]
fn a_reality_outside_s_disengages_with_evidence() {
    let world = Oscillator::new().unwrap().moved_by(0.5);
    let (run, reason) = run("distance = 'rmse'\niterations = 30", &mut Hidden::new(world, [4.5, 0.5]));
    assert_eq!(reason, StopReason::Disengaged);
    let last = run.history().iterations.last().unwrap();
    assert!(last.i < 15, "it took {} iterations", last.i);
    assert!(last.evidence.phi_share.unwrap() > 0.1 && last.evidence.predicted_share.unwrap() > 0.1);
    assert!(last.evidence.pressure_on_simulations.is_some() && last.evidence.rank_agreement.is_some());

    let watched = "distance = 'rmse'\niterations = 12\ndisengagement = { stop = false }";
    let world = Oscillator::new().unwrap().moved_by(0.5);
    let (run, reason) = self::run(watched, &mut Hidden::new(world, [4.5, 0.5]));
    assert_eq!((reason, run.disengaged()), (StopReason::IterationsDone, true), "reported without stopping");
}

#[test]
fn a_truth_beyond_a_bound_is_reported_at_the_bound() {
    let (run, _) = run("distance = 'rmse'", &mut Hidden::new(Oscillator::new().unwrap(), [3.4, 0.5]));
    assert_eq!(run.history().iterations.last().unwrap().evidence.at_bound, ["omega"], "{:?}", run.simulation());
}

#[test]
fn goals_end_the_run_and_the_search() {
    let (run, reason) = run("fitness_goal = 0.2\niterations = 10", &mut honest());
    assert_eq!(reason, StopReason::GoalReached);
    assert!(run.history().iterations.len() < 10 && run.best_tested().unwrap().fitness().unwrap() >= 0.2);

    // Without memory, phi of the iteration's own transfers alone decides whether the search pauses.
    let (run, _) = self::run("phi_goal = 0.02\nmemory = 'none'", &mut honest());
    let of =
        |i: usize| run.history().generations.iter().filter(|g| g.iteration == i && g.side == Side::Simulators).count();
    let searched: Vec<usize> = run.history().iterations.iter().map(|it| of(it.i)).collect();
    assert!((1..25).contains(&searched[0]) && searched.contains(&0), "{searched:?}");
    for (it, generations) in run.history().iterations.iter().zip(&searched) {
        assert!(it.phi.unwrap() <= 0.02);
        assert_eq!(*generations == 0, it.phi_predicted.unwrap() <= 0.02, "iteration {}: {searched:?}", it.i);
    }
}

/// phi of a simulation on some tests, computed directly.
fn phi_of(s: &[f64], tests: &[&btr_core::coevolve::Entry], distance: &dyn Distance) -> f64 {
    let world = Oscillator::new().unwrap();
    let of = |e: &&btr_core::coevolve::Entry| {
        distance.distance(e.behaviour().unwrap(), &world.run(s, &e.trial.controller, e.trial.scenario).unwrap())
    };
    phi(&tests.iter().map(of).collect::<Vec<_>>())
}

#[test]
fn memory_chooses_the_tests_that_count_and_phi_never_rises_on_them() {
    for memory in ["'all'", "'none'", "{ worst = 3 }"] {
        // A reality outside S, so that phi never vanishes and every test matters.
        let mut reality = Hidden::new(Oscillator::new().unwrap().moved_by(0.3), TRUTH);
        let changes = format!("memory = {memory}\ntransfer = {{ count = 4 }}\ndisengagement = {{ stop = false }}");
        let (run, _) = run(&changes, &mut reality);
        let distance = run.plan().distance.build();
        let mut before = run.start().to_vec();
        for it in &run.history().iterations {
            let after: Vec<f64> = it.parameters.values().copied().collect();
            let (mut old, new): (Vec<_>, Vec<_>) = (run.ledger().entries().iter())
                .filter(|e| e.trial.iteration <= it.i)
                .partition(|e| e.trial.iteration < it.i);
            let badness = |e: &&btr_core::coevolve::Entry| phi_of(&before, &[*e], distance.as_ref());
            old.sort_by(|a, b| badness(b).total_cmp(&badness(a)));
            old.truncate(match memory {
                "'all'" => usize::MAX,
                "'none'" => 0,
                _ => 3,
            });
            let counting: Vec<_> = old.into_iter().chain(new).collect();
            let now = phi_of(&after, &counting, distance.as_ref());
            assert!((it.phi.unwrap() - now).abs() < 1e-12, "{memory}, iteration {}: {:?} is not {now}", it.i, it.phi);
            assert!(
                now <= phi_of(&before, &counting, distance.as_ref()) + 1e-12,
                "{memory}: s_i is worse than s_(i-1)"
            );
            before = after;
        }
    }
}
