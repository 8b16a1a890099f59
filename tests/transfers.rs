//! Step 2 and the ledger: which controllers are tried in reality, and how often.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use btr_core::coevolve::{Coevolution, Method, Side, StopReason, TestVerdict};
use btr_core::world::{Simulator, Trial};
use btr_tests::{Hidden, Oscillator, finish, plan};
use proptest::prelude::*;

const TRUTH: [f64; 2] = [2.2, 0.5];

fn run(changes: &str, seed: u64, world: &Oscillator, reality: &mut Hidden) -> (Coevolution, StopReason) {
    let mut run = Coevolution::new(plan(changes).unwrap(), seed, world).unwrap();
    let reason = finish(&mut run, world, reality);
    (run, reason)
}

fn honest() -> Hidden {
    Hidden::new(Oscillator::new().unwrap(), TRUTH)
}

/// The predicted fitness of the first iteration's transfers, and the same computed from its generations: the last
/// generation first, in descending fitness, none twice.
fn promised_and_expected(run: &Coevolution, m: usize) -> (Vec<f64>, Vec<f64>) {
    let mine = run.ledger().entries().iter().filter(|e| e.trial.iteration == 1);
    let promised = mine.map(|e| e.promised.unwrap()).collect();
    let mut expected: Vec<f64> = Vec::new();
    let generations = run.history().generations.iter().filter(|g| g.iteration == 1 && g.side == Side::Controllers);
    for generation in generations.collect::<Vec<_>>().into_iter().rev() {
        let mut scores: Vec<f64> = generation.scores.iter().copied().flatten().collect();
        scores.sort_by(|a, b| b.total_cmp(a));
        for score in scores {
            if !expected.contains(&score) {
                expected.push(score);
            }
        }
    }
    expected.truncate(m);
    (promised, expected)
}

#[test]
fn the_fittest_share_of_the_last_generation_is_tried_fittest_first() {
    let world = Oscillator::new().unwrap();
    let (run, _) = run("iterations = 1", 1, &world, &mut honest());
    let (promised, expected) = promised_and_expected(&run, 12);
    assert_eq!(promised, expected, "60 % of 20");
    let last = run.history().generations.iter().rfind(|g| g.side == Side::Controllers).unwrap();
    assert!(promised.iter().all(|f| last.scores.contains(&Some(*f))), "no need for earlier generations");
}

#[test]
fn earlier_generations_fill_up_where_too_few_can_be_transferred() {
    // Three in four controllers diverge, pseudo-randomly.
    let world = Oscillator::new().unwrap().refusing(|c| (c[0] * 1e7).fract() > 0.25);
    // CMA-ES proposes new points every time, so it cannot carry over the few that work.
    let search =
        "iterations = 1\ncontrollers = { generations = 6, search = { algorithm = 'cma_es', population = 20 } }";
    let (run, _) = run(search, 1, &world, &mut honest());
    let (promised, expected) = promised_and_expected(&run, 12);
    assert_eq!((promised.len(), &promised), (12, &expected));
    let last = run.history().generations.iter().rfind(|g| g.side == Side::Controllers).unwrap();
    assert!(last.failed > 8, "only {} of the last generation failed", last.failed);
    assert!(promised.windows(2).any(|pair| pair[0] < pair[1]), "a generation follows another");
}

#[test]
fn every_rule_begins_with_the_fittest_and_tries_no_controller_twice() {
    for rule in ["fittest", "neighbourhood", "disagreement"] {
        let world = Oscillator::new().unwrap();
        let changes = format!("transfer = {{ rule = '{rule}', count = 6, rivals = 3 }}\ndistance = 'rmse'");
        let (run, _) = run(&changes, 3, &world, &mut honest());
        let tried: Vec<&Trial> = run.ledger().entries().iter().map(|e| &e.trial).collect();
        assert_eq!(tried.len(), 24, "{rule}");
        let twice = tried.iter().enumerate().find(|(k, a)| tried[..*k].iter().any(|b| a.controller == b.controller));
        assert_eq!(twice, None, "{rule}");
        let mut generations = run.history().generations.iter();
        let best = generations.rfind(|g| g.side == Side::Controllers && g.iteration == 1).unwrap().best;
        assert_eq!(run.ledger().entries()[0].promised, Some(best), "{rule}");
    }
}

#[test]
fn neighbours_are_near_the_fittest() {
    let world = Oscillator::new().unwrap();
    let changes = "iterations = 1\ntransfer = { rule = 'neighbourhood', count = 8, mutation = 0.03 }";
    let (run, _) = run(changes, 5, &world, &mut honest());
    let units: Vec<Vec<f64>> =
        run.ledger().entries().iter().map(|e| world.controllers().to_unit(&e.trial.controller)).collect();
    assert_eq!(units.len(), 8);
    // One bit per 30: half of all mutants keep one of their two parameters, to the grid of 16 bits.
    let kept = |unit: &&Vec<f64>| unit.iter().zip(&units[0]).any(|(a, b)| (a - b).abs() < 2.0 / 65535.0);
    assert!(units[1..].iter().filter(kept).count() >= 3, "{units:?}");
}

#[test]
fn failed_real_tests_are_spent_and_do_not_stop_the_loop() {
    let mut reality = honest().failing(|trial| trial.number % 3 == 0);
    let world = Oscillator::new().unwrap();
    let (run, reason) = run("iterations = 5\nreal_tests = 40", 1, &world, &mut reality);
    assert_eq!(reason, StopReason::RealTestsSpent);
    assert_eq!((run.ledger().spent(), reality.trials.len()), (40, 40));
    let failed = run.ledger().entries().iter().filter(|e| matches!(e.verdict, TestVerdict::Failed { .. }));
    assert_eq!(failed.count(), 14);
    let error = run.simulation().iter().zip(TRUTH).map(|(s, t)| (s / t - 1.0).abs()).fold(0.0, f64::max);
    assert!(error < 1e-3, "{:?}", run.simulation());
}

#[test]
fn a_reality_that_always_fails_ends_the_run_after_three_tests() {
    let mut reality = honest().failing(|_| true);
    let world = Oscillator::new().unwrap();
    let (run, reason) = run("", 1, &world, &mut reality);
    assert_eq!((reason, run.ledger().spent()), (StopReason::NoRealData, 3));
}

#[test]
fn a_simulator_that_always_fails_ends_without_a_real_test() {
    let world = Oscillator::new().unwrap().refusing(|_| true);
    let (run, reason) = run("", 1, &world, &mut honest());
    assert_eq!((reason, run.ledger().spent()), (StopReason::NoRealData, 0));
    assert_eq!(run.cost().failures, run.cost().evaluations);
}

fn plans() -> impl Strategy<Value = String> {
    let method =
        prop::sample::select(vec!["back_to_reality", "estimation_exploration", "linear_correction", "reality_only"]);
    let rule = prop::sample::select(vec!["fittest", "neighbourhood", "disagreement"]);
    let search = prop::sample::select(vec!["ga", "real_ga", "cma_es"]);
    let memory = prop::sample::select(vec!["'all'", "'none'", "{ worst = 2 }"]);
    let numbers = (1usize..4, 0usize..25, 0.01f64..1.5, 1usize..3, 2usize..8);
    (method, rule, search, memory, numbers).prop_map(|(method, rule, search, memory, numbers)| {
        let (iterations, budget, share, generations, population) = numbers;
        format!(
            "method = '{method}'\niterations = {iterations}\nreal_tests = {budget}\nmemory = {memory}\n\
             transfer = {{ rule = '{rule}', share = {share:?}, rivals = 2, candidates = 4 }}\n\
             controllers = {{ generations = {generations}, search = {{ algorithm = '{search}', population = {population} }} }}\n\
             simulators = {{ generations = 2, search = {{ algorithm = '{search}', population = 4 }} }}"
        )
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn no_plan_spends_more_than_its_budget_or_tries_a_controller_twice(
        changes in plans(), seed in 0u64..1000, scenarios in 1usize..4, fragile in any::<bool>(), clumsy in any::<bool>(),
    ) {
        let world = Oscillator::new().unwrap().scenarios(scenarios);
        let world = if fragile { world.refusing(|c| (c[0] * 1e4).fract() > 0.5) } else { world };
        let reality = honest();
        let mut reality = if clumsy { reality.failing(|trial| trial.number % 2 == 0) } else { reality };
        let (run, _) = run(&changes, seed, &world, &mut reality);
        let (budget, spent) = (run.plan().real_tests.unwrap(), run.ledger().spent());
        prop_assert!(spent <= budget && reality.trials.len() == spent, "{} trials, {spent} spent of {budget}", reality.trials.len());
        prop_assert!(run.ledger().entries().iter().enumerate().all(|(k, e)| e.trial.number == k));
        // Where the search runs in reality, its elite is tested again like any other individual.
        if run.plan().method != Method::RealityOnly {
            let tried: Vec<_> = run.ledger().entries().iter().map(|e| (&e.trial.controller, e.trial.scenario)).collect();
            let twice = tried.iter().enumerate().find(|(k, a)| tried[..*k].contains(a));
            prop_assert_eq!(twice, None);
        }
    }
}
